"""Scores of a generated dance, for a table beside it: harmony, beats, jerk, skating."""

from __future__ import annotations

from collections.abc import Callable

from harmolab.harmony import score_motion
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, HarmonyScore, Motion


def dance_scores(motion: Motion, music: BeatTrack, score: HarmonyScore | None = None) -> dict[str, float | int | None]:
    """Name -> number of every score of a dance; None where it is too short for that, or has no feet to judge.

    Parameters
    ----------
    motion : Motion
    music : BeatTrack on the motion's time line
    score : HarmonyScore of the two by the recommended settings, computed without a dance's pattern when left out
    """
    score = score or score_motion(music, motion)
    paper = score_motion(music, motion, params=HarmonyParams.paper(), n_rotations=0)
    return _judged(score) | {
        "paper: harmony": paper.harmony,
        "paper: hit rate": paper.hit_rate,
        "paper: chance": paper.chance,
        "paper: visual beats M": paper.n_visual,
        "jerk, m/s³": _or_none(jerk, motion),
        "foot skating, m/s": _or_none(foot_skating, motion),
    }


def _judged(score: HarmonyScore) -> dict[str, float | int | None]:
    """The numbers of the recommended score, beginning with the one to read."""
    verdict = score.judgement.to_dict() if score.judgement else {}
    return {
        "harmony above chance": score.above_chance,
        "level, 0 to 4": verdict.get("level"),
        "p value": score.p_value,
        "pulse, 1/s": verdict.get("pulse"),
        "share inside the body": verdict.get("share"),
        "music beats N": score.n_audio,
    }


def _or_none(measure: Callable[[Motion], float], motion: Motion) -> float | None:
    """A measure, or None where it does not apply."""
    try:
        return measure(motion)
    except ValueError:
        return None
