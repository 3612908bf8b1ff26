"""The scoring lab: every choice of the harmony score at work on one clip, beats that can be dragged, and the sound."""

from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from types import MappingProxyType
from typing import Any

import numpy as np

from harmolab.beats.visual import visual_beats
from harmolab.lab.labs import live
from harmolab.lab.player import LAB_SENTENCES, LUCK, percent
from harmolab.params import BarPattern
from harmolab.score import HarmonyScore, score_harmony
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.significance import rotations
from harmolab.types import BeatTrack, Clip
from harmolab.verdict.evidence import MOMENTS
from harmolab.verdict.judge import Judgement, score_motion

N_ROTATIONS = 200  # as fine as the eye can tell


def scoring_lab(clip: Clip, *, pattern: BarPattern | None = None, **values: Any) -> live.LiveLab:
    """Sliders for λ1, λ2, T_delay, β and lag, menus for mode, detector and matching, below a picture of the score.

    Choosing a mode sets the other controls to its own values; each can be moved away from there.

    Parameters
    ----------
    clip : Clip with a motion; a few seconds are best
    pattern : BarPattern, optional
        Movement that the recommended mode expects; when left out, a waltz where the movement recurs every three beats,
        else a rest on each.
    **values
        Where controls start instead of at the paper mode: ``delay=0.1``; a mode brings its own settings.

    Raises
    ------
    ValueError
        If the clip has no motion, for an unknown control, or for a value that it cannot have.

    Examples
    --------
    >>> lab = scoring_lab(synthetic_clip("cha-cha"), delay=0.1)  # doctest: +SKIP
    >>> lab.sentence  # doctest: +SKIP
    """
    return live.LiveLab(scoring_content(live.Stage.of(clip, pattern)), values)


def scoring_content(stage: live.Stage) -> live.LabContent:
    """The scoring lab of a stage."""
    controls = live.lab_controls("scoring")
    late = min(0.4, round(15 / stage.music.tempo / 0.01) * 0.02) if len(stage.music) > 1 else 0.24
    about, presets = live.lab_texts("scoring", late=round(late, 2), loud=live.middle_lambda(stage.music))
    return live.LabContent(
        kind="scoring",
        about=about,
        evidence=scoring_evidence(stage, controls),
        controls=controls,
        presets=presets,
        numbers=partial(scoring_numbers, stage),
        pattern=stage.pattern,
    )


# Evidence


def scoring_evidence(stage: live.Stage, controls: Mapping[str, live.Slider | live.Menu]) -> dict[str, Any]:
    """The numbers that the lab computes with, of a stage: beats and curves, and the verdict at each step of the lag."""
    return {
        "source": stage.source,
        "duration": stage.music.duration,
        "music": live.track_evidence(stage.music),
        **live.curve_evidence(stage.motion, controls),
        "shifts": rotations(stage.music.duration, N_ROTATIONS),
        "verdicts": [verdict_numbers(stage, lag) for lag in lags()],
        "shape": _shape(stage),
    }


def lags() -> list[float]:
    """Values of the lag's slider, seconds."""
    count = round((live.LAG.high - live.LAG.low) / live.LAG.step)
    return [round(live.LAG.low + step * live.LAG.step, 6) for step in range(count + 1)]


def _shape(stage: live.Stage) -> dict[str, Any]:
    """The shape speed of the recommended mode, and the pattern that is laid on it where its place is known."""
    signal = shape_signal(shape_speed(stage.motion))
    pattern, places = stage.pattern, stage.music.bar_places
    times = signal.times
    step = float(times[1] - times[0]) if times.size > 1 else 1.0
    return {
        "curve": {"start": times[0], "step": step, "values": signal.values.round(4), "unit": "speed of the shape (SD)"},
        "pattern": None if pattern is None else {"beats": pattern.beats, "waves": (pattern.cosines, pattern.sines)},
        "place": None if places is None or not places.size else places[0],
    }


# Numbers


def scoring_numbers(
    stage: live.Stage, *, mode: str, moves: Mapping[str, Mapping[str, float]] = MappingProxyType({}), **values: Any
) -> dict[str, Any]:
    """The numbers of the lab: those of `score_motion`, and the sentence under the picture.

    Parameters
    ----------
    stage : Stage
    mode : "paper", "recommended" or "valleys"
    moves : "music" and "dance" -> number of a beat -> the time in seconds to which it was dragged
    **values
        The other controls, by name; those of the mode when left out.
    """
    params = live.lab_params(mode, pattern=stage.pattern, **values)
    if params.measure == "shape":
        return verdict_numbers(stage, params.lag)
    music = _moved(stage.music, moves.get("music", {}))
    visual = _moved(visual_beats(stage.motion, params=params), moves.get("dance", {}))
    return hit_numbers(score_harmony(music, visual, params=params, n_rotations=N_ROTATIONS))


def _moved(track: BeatTrack, moves: Mapping[str, float]) -> BeatTrack:
    """The track with the beats of these numbers at other times."""
    times = track.times.copy()
    for number, time in moves.items():
        times[int(number)] = time
    return replace(track, times=times)


def hit_numbers(score: HarmonyScore) -> dict[str, Any]:
    """Numbers of a score by hits, and their sentence."""
    return {
        "harmony": score.harmony,
        "audio_harmony": score.audio_harmony,
        "visual_harmony": score.visual_harmony,
        "hits": int(score.hits.sum()),
        "beats": score.n_audio,
        "movements": score.n_visual,
        "share": score.mean_share,
        "chance": score.chance,
        "above": score.harmony_above_chance,
        "p": score.p_value,
        "rate": score.hit_rate,
        "pairs": score.pairs,
        "null": score.null,
        "sentence": hit_sentence(score),
    }


def hit_sentence(score: HarmonyScore) -> str:
    """The sentence of a score by hits."""
    if score.n_audio == 0 or score.n_visual == 0:
        return LAB_SENTENCES["unheard" if score.n_audio == 0 else "unseen"]
    counts = {"hits": score.hits.sum(), "beats": score.n_audio, "chance": percent(score.chance)}
    luck = "" if np.isnan(score.p_value) else LAB_SENTENCES["more" if score.p_value <= LUCK else "luck"]
    return LAB_SENTENCES["hits"].format(**counts) + luck.format(p=f"{score.p_value:.3f}")


def verdict_numbers(stage: live.Stage, lag: float) -> dict[str, Any]:
    """Numbers of the recommended mode at a lag, and the verdict as their sentence."""
    params = live.lab_params("recommended", pattern=stage.pattern, lag=lag)
    score = score_motion(stage.music, stage.motion, params=params)
    judgement = score.judgement
    if judgement is None:
        raise ValueError(f"the measure {params.measure!r} gives no verdict")
    place = judgement.place
    return {
        "level": judgement.level,
        "above": judgement.harmony_above_chance,
        "p_time": judgement.p_time,
        "p_place": judgement.p_place,
        "late": 1000 * judgement.lag_s if judgement.level >= 3 else np.nan,
        "times": score.music.times,
        "shares": [] if place is None else score.shares,
        "chance": None if place is None else place.chance,
        "curve": [] if place is None else place.curve,
        "step": 60 / judgement.tempo / MOMENTS,
        "pattern": _reading(judgement),
        "sentence": judgement.verdict,
    }


def _reading(judgement: Judgement) -> dict[str, Any]:
    """The reading that fits best, as a pattern; rests on the beat where there is none."""
    pattern = judgement.place.pattern if judgement.place else BarPattern.stop_on_the_beat()
    return {"beats": pattern.beats, "waves": (pattern.cosines, pattern.sines)}
