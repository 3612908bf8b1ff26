"""Music and dance whose beats were planted: the embedded default, and the instrument that tells what a score can see.

Seven ballroom dances, a band that plays them, and a dancer of 21 joints whose movement units end on the beats. The
truth comes with every clip: beats and downbeats of the music, ends of the movements, figures.
"""

from harmolab.data.synthetic.beats import ClipSettings
from harmolab.data.synthetic.clips import PlantedClip, planted_clip, synthetic_clip, write_corpus
from harmolab.data.synthetic.dancer import DANCER, figure_names, synthetic_motion
from harmolab.data.synthetic.music import PlantedMusic, synthetic_music

__all__ = [
    "DANCER", "ClipSettings", "PlantedClip", "PlantedMusic", "figure_names", "planted_clip", "synthetic_clip",
    "synthetic_motion", "synthetic_music", "write_corpus",
]  # fmt: skip
