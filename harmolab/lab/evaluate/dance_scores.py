"""Scores of a generated dance, for a table beside it: harmony, beats, jerk, skating."""

from __future__ import annotations

from collections.abc import Callable

from harmolab.harmony import score_motion
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, HarmonyScore, Motion


def dance_scores(
    motion: Motion, music: BeatTrack, valleys: HarmonyScore | None = None
) -> dict[str, float | int | None]:
    """Name -> number of every score of a dance; None where it is too short for that, or has no feet to judge.

    Parameters
    ----------
    motion : Motion
    music : BeatTrack on the motion's time line
    valleys : HarmonyScore of the two by speed valleys, computed when left out
    """
    valleys = valleys or score_motion(music, motion, params=HarmonyParams.valleys())
    paper = score_motion(music, motion, params=HarmonyParams.paper(), n_rotations=0)
    return {
        "harmony above chance": valleys.harmony_above_chance,
        "p value": valleys.p_value,
        "visual beats M": valleys.n_visual,
        "music beats N": valleys.n_audio,
        "paper: harmony": paper.harmony,
        "paper: hit rate": paper.hit_rate,
        "paper: chance": paper.chance,
        "paper: visual beats M": paper.n_visual,
        "jerk, m/s³": _or_none(jerk, motion),
        "foot skating, m/s": _or_none(foot_skating, motion),
    }


def _or_none(measure: Callable[[Motion], float], motion: Motion) -> float | None:
    """A measure, or None where it does not apply."""
    try:
        return measure(motion)
    except ValueError:
        return None
