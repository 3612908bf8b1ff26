"""Scores of a generated dance, for a table beside it: harmony, beats, jerk, skating, likeness to recorded dancers."""

from __future__ import annotations

from collections.abc import Callable

from harmolab.harmony import score_motion
from harmolab.metrics.likeness import MEASURES, Likeness
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.score import HarmonyScore

Entry = float | int | str | None
ABOVE_CHANCE = "harmony above chance"
# What speaks of harmony: of a dance that fails by likeness none is told.
OF_HARMONY = (ABOVE_CHANCE, "level, 0 to 4", "p in time", "paper: harmony", "paper: hit rate", "paper: chance")
MEANINGLESS = "not meaningful"


def dance_scores(
    motion: Motion, music: BeatTrack, score: HarmonyScore | None = None, *, likeness: Likeness | None = None
) -> dict[str, Entry]:
    """Name -> number of every score of a dance; None where it is too short for that, or has no feet to judge.

    With a likeness "looks like dancing" says how many measures pass, and every measure stands there with the range that
    recorded dancers had; of a dance that fails all that speaks of harmony (`OF_HARMONY`) is "not meaningful".

    Parameters
    ----------
    motion : Motion
    music : BeatTrack on the motion's time line
    score : HarmonyScore of the two by the recommended settings, computed without a dance's pattern when left out
    likeness : Likeness of the motion (`harmolab.likeness`)
    """
    score = score or score_motion(music, motion)
    paper = score_motion(music, motion, params=HarmonyParams.paper(), n_rotations=0)
    scores: dict[str, Entry] = _judged(score) | {
        "paper: harmony": paper.harmony,
        "paper: hit rate": paper.hit_rate,
        "paper: chance": paper.chance,
        "paper: visual beats M": paper.n_visual,
        "jerk, m/s³": _or_none(jerk, motion),
        "foot skating, m/s": _or_none(foot_skating, motion),
    }
    return scores if likeness is None else _guarded(scores, likeness)


def _guarded(scores: dict[str, Entry], likeness: Likeness) -> dict[str, Entry]:
    """The scores with those of likeness after harmony, which says nothing where they fail."""
    if likeness.passed is False:
        scores |= dict.fromkeys(OF_HARMONY, MEANINGLESS)
    first = {ABOVE_CHANCE: scores[ABOVE_CHANCE], "looks like dancing": likeness.cannot or likeness.count}
    return first | scores | {f"like dancing: {MEASURES[name]}": _measured(likeness, name) for name in MEASURES}


def _measured(likeness: Likeness, name: str) -> str | None:
    """A measure, the range that recorded dancers had, and "fails" where it is too far from it."""
    if name not in likeness.values:
        return None
    low, _, high = likeness.recorded[name]
    fails = " fails" if name in likeness.fails else ""
    return f"{likeness.values[name]:.3g} ({low:.3g} to {high:.3g}){fails}"


def _judged(score: HarmonyScore) -> dict[str, Entry]:
    """The numbers of the recommended score, beginning with the one to read."""
    verdict = score.judgement.to_dict() if score.judgement else {}
    return {
        ABOVE_CHANCE: score.above_chance,
        "level, 0 to 4": verdict.get("level"),
        "p in time": verdict.get("p_time"),
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
