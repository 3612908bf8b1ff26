"""Reading what people have: sound, movement, beats. Errors start with the file's name."""

from harmolab.io.audio import AudioInfo, audio_info, load_audio
from harmolab.io.beats import BeatAnnotation, Unit, load_annotation, load_beats
from harmolab.io.bvh import load_bvh
from harmolab.io.bvh_writer import save_bvh
from harmolab.io.keypoints import load_keypoints
from harmolab.io.layouts import COCO_17, OPENPOSE_18, OPENPOSE_25
from harmolab.io.motion import load_motion, save_motion
from harmolab.io.pickles import load_aist

__all__ = [
    "COCO_17",
    "OPENPOSE_18",
    "OPENPOSE_25",
    "AudioInfo",
    "BeatAnnotation",
    "Unit",
    "audio_info",
    "load_aist",
    "load_annotation",
    "load_audio",
    "load_beats",
    "load_bvh",
    "load_keypoints",
    "load_motion",
    "save_bvh",
    "save_motion",
]
