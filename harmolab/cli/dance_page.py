"""A dance as one page that plays anywhere: sound, movement and player in a single file, no network."""

from __future__ import annotations

import base64
import io
from collections.abc import Mapping
from pathlib import Path

import jinja2
import numpy as np
import soundfile

from harmolab.features.poses import side_pairs
from harmolab.kinematics import smooth, upsample_motion
from harmolab.types import Audio, BeatTrack, FloatArray, Motion

__all__ = ["dance_page"]

TEMPLATES = Path(__file__).resolve().parents[1] / "templates"
FPS = 30.0
FOLLOW = 0.8  # seconds over which the camera's way is smoothed


def dance_page(motion: Motion, audio: Audio, *, beats: BeatTrack, title: str, facts: Mapping[str, str]) -> str:
    """The page, as HTML.

    Parameters
    ----------
    motion : Motion, (T, J, 3) metres
    audio : Audio that starts with the motion's first frame
    beats : BeatTrack on the motion's time line
    title : str
    facts : name -> text, shown as a table

    Raises
    ------
    ValueError
        For a motion in image coordinates.
    """
    if motion.positions.shape[2] != 3:
        raise ValueError("the player shows movement in space; this motion is in image coordinates")
    danced = upsample_motion(motion, FPS)
    environment = jinja2.Environment(loader=jinja2.FileSystemLoader(TEMPLATES), autoescape=True)
    return environment.get_template("dance.html.j2").render(
        title=title, facts=facts, audio=_flac(audio), data=_data(danced, beats)
    )


def _data(motion: Motion, beats: BeatTrack) -> dict[str, object]:
    """What the player reads: numbers as base64 of little-endian 32-bit floats."""
    skeleton, positions = motion.skeleton, motion.positions
    skull = [joint for joint, name in enumerate(skeleton.joints) if "head" in name.lower()]
    across = side_pairs(skeleton) if skeleton.bones else ()
    return {
        "fps": motion.fps,
        "joints": len(skeleton.joints),
        "frames": motion.n_frames,
        "duration": motion.duration,
        "bones": [[a, b] for a, b in (*skeleton.bones, *across) if not (a in skull and b in skull)],
        "skull": skull,
        "height": max(float(np.percentile(np.ptp(positions[..., 1], axis=1), 90)), 0.1),
        "beats": [round(float(time), 4) for time in beats.times],
        "positions": _base64(positions),
        "way": _base64(smooth(positions.mean(axis=1)[:, [0, 2]], FOLLOW, motion.fps)),
    }


def _base64(values: FloatArray) -> str:
    return base64.b64encode(np.ascontiguousarray(values, dtype="<f4").tobytes()).decode()


def _flac(audio: Audio) -> str:
    """The sound, 16 bits, lossless: a coder with loss would put a delay before the first sample."""
    stream = io.BytesIO()
    samples = np.clip(np.asarray(audio.samples, dtype=np.float64), -1.0, 1.0)
    soundfile.write(stream, samples, round(audio.sample_rate), format="FLAC", subtype="PCM_16")
    return base64.b64encode(stream.getvalue()).decode()
