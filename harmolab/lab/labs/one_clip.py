"""The labs of one clip: scoring, salience of beats (Eq. 10-13), detectors of visual beats; of one's own files, too.

The scoring lab has the choices of the score, beats that can be dragged, and the sound. The saliency lab shows the beats
that a listener or viewer would notice; the detector lab the moments that are visual beats, and the curve from which
they are read.
"""

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import Any, cast

import ipywidgets
import numpy as np
from numpy.typing import ArrayLike

from harmolab.beats.salience import audio_mask, normalise_strengths, visual_mask
from harmolab.beats.visual import visual_beats
from harmolab.lab.labs import live
from harmolab.lab.player_data import LAB_SENTENCES, LUCK, percent
from harmolab.params import BarPattern
from harmolab.readers.video import is_video
from harmolab.score import HarmonyScore, nearest_intervals, score_harmony
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.significance import rotations
from harmolab.types import BeatTrack, Clip, FloatArray
from harmolab.verdict.bar_pattern import first_place
from harmolab.verdict.evidence import MOMENTS
from harmolab.verdict.judge import Judgement, music_and_motion, score_motion, without_start

# The reader's own song and dance, picked in a notebook

SONGS = "audio/*"
DANCES = ".npz,.npy,.pkl,.csv,.json,.bvh,.c3d,.zip,video/*"
NONE = "none yet; over 10 MB only by its path"


class OwnFiles(ipywidgets.VBox):
    """Pick a song and a dance of your own in JupyterLab: for each a button to upload a file, and a line for its path.

    Of button and line the one that was used last counts, and words beside them name its file. A file of more than 10 MB
    needs the line: JupyterLab drops it without a word, unless it was set up by `make setup`. An uploaded file is
    written into a temporary folder; of its own name only the ending is kept.

    Raises
    ------
    ValueError
        On asking for either where one of the two was picked alone, unless it is a video as the dance.

    Examples
    --------
    >>> files = OwnFiles()
    >>> files.song is None
    True
    """

    def __init__(self) -> None:
        self._folder = TemporaryDirectory()
        self._rows = {kind: _row(kind, accept) for kind, accept in {"song": SONGS, "dance": DANCES}.items()}
        super().__init__([ipywidgets.HBox(row) for row in self._rows.values()])

    @property
    def song(self) -> Path | None:
        """The song's file, else the video in which it plays; None when neither was picked."""
        return self._files()[0]

    @property
    def dance(self) -> Path | None:
        """The file of the motion or video, or a folder of key points; None when nothing was picked."""
        return self._files()[1]

    def _files(self) -> tuple[Path | None, Path | None]:
        song, dance = self._file("song"), self._file("dance")
        song = song or (dance if dance and is_video(dance) else None)
        if (song is None) != (dance is None):
            picked, missing = ("dance", "song") if song is None else ("song", "dance")
            raise ValueError(f"a {picked} arrived, and no {missing}: pick one, too; over 10 MB it comes by its path")
        return song, dance

    def _file(self, kind: str) -> Path | None:
        upload, line, _ = self._rows[kind]
        if path := line.value.strip().strip("\"'"):  # quotes, as Windows puts them around a path that is copied
            return Path(path).expanduser()
        if not upload.value:
            return None
        picked = upload.value[0]
        ending = Path(picked["name"]).suffix
        if not re.fullmatch(r"\.\w{1,8}", ending, flags=re.ASCII):
            raise ValueError(f"the {kind} needs a name that ends in its format, such as .wav or .bvh")
        path = Path(self._folder.name) / f"{kind}{ending.lower()}"
        path.write_bytes(picked["content"])
        return path

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return {**(super()._repr_mimebundle_(**kwargs) or {}), "text/plain": "pick your files in JupyterLab"}


def _row(kind: str, accept: str) -> tuple[ipywidgets.FileUpload, ipywidgets.Text, ipywidgets.Label]:
    """A button and a line for one file, and words on what arrived."""
    upload = ipywidgets.FileUpload(accept=accept, description=kind)
    line = ipywidgets.Text(placeholder=f"or the path of the {kind}", layout={"width": "28rem"})
    words = ipywidgets.Label(NONE)

    def tell(change: Any) -> None:
        if change["owner"] is upload and upload.value:
            line.value = ""
        name = line.value.strip() or (upload.value[0]["name"] if upload.value else "")
        words.value = f"{name} is taken" if name else NONE

    upload.observe(tell, "value")
    line.observe(tell, "value")
    return upload, line, words


# The scoring lab

N_ROTATIONS = 200  # as fine as the eye can tell


def scoring_lab(clip: Clip, *, pattern: BarPattern | None = None, name: str = "", **values: Any) -> live.LiveLab:
    """A lab in the browser: the score of one dance while its settings change, λ1, λ2, T_delay, β, lag and others.

    Menus choose mode (paper, recommended, valleys), detector and matching. A mode sets all other controls to its own
    values; each can be moved away from there.

    Parameters
    ----------
    clip : Clip with a motion
        A few seconds are best.
    pattern : BarPattern, optional
        The movement that the recommended mode expects. When left out: a waltz where the movement recurs every three
        beats, else a rest on each beat.
    name : str
        Of the dance and its song, for the title of the page.
    **values
        Values at which controls start, such as ``delay=0.1``, in place of those of the paper mode.

    Returns
    -------
    LiveLab, as of `corpus_lab`

    Raises
    ------
    ValueError
        If the clip has no motion, for an unknown control, or for a value that it cannot have.

    Examples
    --------
    >>> lab = scoring_lab(synthetic_clip("cha-cha"), delay=0.1)  # doctest: +SKIP
    >>> lab.sentence  # doctest: +SKIP
    """
    return live.LiveLab(replace(scoring_content(live.Stage.of(clip, pattern)), name=name), values)


def scoring_content(stage: live.Stage) -> live.LabContent:
    """The scoring lab of a stage."""
    controls = live.lab_controls("scoring")
    controls |= {"lambda1": live.last_lambda(stage.music.strengths, live.LAMBDA1)}
    controls |= {"lambda2": live.last_lambda(_largest_steps(stage), live.LAMBDA2)}
    late = min(0.4, round(15 / stage.music.tempo / 0.01) * 0.02) if len(stage.music) > 1 else 0.24
    return live.LabContent(
        kind="scoring",
        evidence={
            "source": stage.source,
            "duration": stage.music.duration,
            "music": live.track_evidence(stage.music),
            **live.curve_evidence(stage.motion, controls),
            "shifts": rotations(stage.music.duration, N_ROTATIONS),
            "verdicts": [verdict_numbers(stage, lag) for lag in lags()],
            "shape": _shape(stage),
        },
        controls=controls,
        numbers=partial(scoring_numbers, stage),
        computed={"late": round(late, 2), "loud": live.middle_lambda(stage.music)},
        pattern=stage.pattern,
    )


# The scoring lab: evidence


def lags() -> list[float]:
    """Values of the lag's slider, seconds."""
    count = round((live.LAG.high - live.LAG.low) / live.LAG.step)
    return [round(live.LAG.low + step * live.LAG.step, 6) for step in range(count + 1)]


def _largest_steps(stage: live.Stage) -> FloatArray:
    """The steps of strength (Eq. 12) of the detector whose largest stands out most."""
    params = [live.lab_params("paper", detector=name) for name in live.DETECTORS]
    tracks = [visual_beats(stage.motion, params=each) for each in params]
    steps = [np.abs(np.diff(track.strengths)) for track in tracks if len(track) > 1]
    return max(steps, key=lambda step: step.max() / max(step.std(), 1e-12), default=np.zeros(0))


def _shape(stage: live.Stage) -> dict[str, Any]:
    """The shape speed of the recommended mode, and the pattern that is laid on it where its place is known."""
    signal = shape_signal(shape_speed(stage.motion))
    pattern, places = stage.pattern, stage.music.bar_places
    times = signal.times
    step = float(times[1] - times[0]) if times.size > 1 else 1.0
    return {
        "curve": {"start": times[0], "step": step, "values": signal.values.round(4), "unit": "speed of the shape (SD)"},
        "pattern": None if pattern is None else _waves(pattern),
        "place": None if places is None or not places.size else first_place(places),
    }


# The scoring lab: numbers


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
    chance = f"{'' if score.params.matching == 'many' else 'at most '}{percent(score.chance)}"
    counts = {"hits": score.hits.sum(), "beats": score.n_audio, "chance": chance}
    luck = "" if np.isnan(score.p_value) else LAB_SENTENCES["more" if score.p_value <= LUCK else "luck"]
    return LAB_SENTENCES["hits"].format(**counts) + luck.format(p=f"{score.p_value:.3f}")


def verdict_numbers(stage: live.Stage, lag: float) -> dict[str, Any]:
    """Numbers of the recommended mode at a lag, and the verdict as their sentence."""
    params = live.lab_params("recommended", pattern=stage.pattern, lag=lag)
    score = score_motion(stage.music, stage.motion, params=params)
    judgement = cast(Judgement, (score if stage.has_start else without_start(score)).judgement)
    place = judgement.place
    return {
        "level": judgement.level,
        "above": judgement.harmony_above_chance,
        "p_time": judgement.p_time,
        "p_place": judgement.p_place,
        "late": 1000 * judgement.lag_s if judgement.level >= 3 and stage.has_start else np.nan,
        "times": score.music.times,
        "shares": [] if place is None else score.shares,
        "chance": None if place is None else place.chance,
        "curve": [] if place is None else place.curve,
        "step": 60 / judgement.tempo / MOMENTS,
        "pattern": _waves(place.pattern if place else BarPattern.stop_on_the_beat()),
        "sentence": judgement.verdict,
    }


def _waves(pattern: BarPattern) -> dict[str, Any]:
    """A pattern as the script lays it on the movement."""
    return {"beats": pattern.beats, "waves": (pattern.cosines, pattern.sines)}


# The saliency lab

LAMBDAS = np.linspace(0.0, 15.0, 151)


def saliency_lab(clip: Clip, **values: Any) -> live.LiveLab:
    """A lab in the browser: the beats that are kept and dropped as λ1, λ2 and the readings of Eq. 10-13 change.

    Parameters
    ----------
    clip : Clip with a motion
        A few seconds are best.
    **values
        Values at which controls start, such as ``lambda2=2.0``, in place of those of the paper mode.

    Returns
    -------
    LiveLab, as of `corpus_lab`

    Raises
    ------
    ValueError
        If the clip has no motion, for an unknown control, or for a value that it cannot have.

    Examples
    --------
    >>> lab = saliency_lab(synthetic_clip("cha-cha"), lambda1=3.0)  # doctest: +SKIP
    """
    stage = live.Stage.of(clip)
    visual = visual_beats(stage.motion, params=live.MODES["paper"])
    content = live.LabContent(
        kind="saliency",
        evidence={
            "source": stage.source,
            "duration": stage.motion.duration,
            "music": live.track_evidence(stage.music),
            "dance": live.track_evidence(visual),
            "lambdas": LAMBDAS,
            "units": live.STRENGTHS,
        },
        controls=live.lab_controls("saliency"),
        numbers=partial(saliency_numbers, stage, visual),
        computed={"loud": live.middle_lambda(stage.music)},
    )
    return live.LiveLab(content, values)


def saliency_numbers(stage: live.Stage, visual: BeatTrack, **values: Any) -> dict[str, Any]:
    """The numbers of the lab: masks of both tracks, the shares kept at every λ, and the sentence.

    Parameters
    ----------
    stage : Stage
    visual : BeatTrack, the visual beats of the stage's motion
    **values
        The controls, by name; the paper's when left out.
    """
    params = live.lab_params(**values)
    strengths = normalise_strengths(stage.music.strengths, params.normalisation)
    reading = params.saliency
    music = partial(audio_mask, strengths, reading=reading)
    dance = partial(
        visual_mask, visual.strengths, reading=reading, quantity=params.visual_saliency, first_beat=params.first_beat
    )
    masks = music(threshold=params.audio_threshold), dance(threshold=params.visual_threshold)
    counts = {"music": masks[0].sum(), "beats": len(stage.music), "dance": masks[1].sum(), "movements": len(visual)}
    return {
        **{name: int(count) for name, count in counts.items()},
        "music_mask": masks[0],
        "dance_mask": masks[1],
        "music_shares": [music(threshold=value).mean() for value in LAMBDAS] if len(stage.music) else [],
        "dance_shares": [dance(threshold=value or None).mean() for value in LAMBDAS] if len(visual) else [],
        "sentence": LAB_SENTENCES["kept"].format(**counts),
    }


# The detector lab

NEAR = 0.05  # seconds: a planted beat with a detected one this close is a detected beat


def detector_lab(clip: Clip, *, planted: ArrayLike | None = None, **values: Any) -> live.LiveLab:
    """A lab in the browser: the speed curve and its visual beats as detector, frame rate, plateau and smoothing change.

    Parameters
    ----------
    clip : Clip with a motion
        A few seconds are best.
    planted : (P,) array, seconds on the audio's time line, optional
        The true ends of movements, as of `PlantedClip`: circles mark those that were detected, crosses the others.
    **values
        Values at which controls start, such as ``detector="valleys"``, in place of those of the paper mode.

    Returns
    -------
    LiveLab, as of `corpus_lab`

    Raises
    ------
    ValueError
        If the clip has no motion, for an unknown control, or for a value that it cannot have.

    Examples
    --------
    >>> lab = detector_lab(synthetic_clip("cha-cha"))  # doctest: +SKIP
    >>> lab.set(smoothing=0.05)  # doctest: +SKIP
    >>> lab.sentence  # doctest: +SKIP
    """
    stage, controls = live.Stage.of(clip), live.lab_controls("detector")
    times = None if planted is None else _on_stage(clip, planted)
    evidence = {
        "source": stage.source,
        "duration": stage.motion.duration,
        "music": stage.music.times,
        "planted": times,
        "near": NEAR,
        **live.curve_evidence(stage.motion, controls),
    }
    numbers = partial(detector_numbers, stage, times)
    return live.LiveLab(live.LabContent("detector", evidence, controls, numbers), values)


def _on_stage(clip: Clip, planted: ArrayLike) -> FloatArray:
    """Planted times on the time line of the stage."""
    times = np.sort(np.asarray(planted, np.float64))
    track = BeatTrack(times, np.ones(times.size), fps=100.0, duration=clip.audio.duration)
    return music_and_motion(replace(clip, beats=track))[0].times


def detector_numbers(stage: live.Stage, planted: FloatArray | None, **values: Any) -> dict[str, Any]:
    """The numbers of the lab: visual beats, which planted ones are near one of them, and the sentence.

    Parameters
    ----------
    stage : Stage
    planted : (P,) array, seconds on the stage's time line, or None
    **values
        The controls, by name; the paper's when left out.
    """
    visual = visual_beats(stage.motion, params=live.lab_params(**values))
    near = None if planted is None else nearest_intervals(planted, visual.times) <= NEAR
    counts = {
        "beats": len(visual),
        "music": len(stage.music),
        "planted": 0 if planted is None else planted.size,
        "found": 0 if near is None else int(near.sum()),
        "near": round(1000 * NEAR),
    }
    distances = nearest_intervals(visual.times, stage.music.times)
    return {
        **counts,
        "times": visual.times,
        "heights": visual.strengths,
        "mask": near,
        "rate": len(visual) / stage.motion.duration,
        "distance": float(np.median(distances)) if len(visual) and len(stage.music) else np.nan,
        "sentence": LAB_SENTENCES["detected" if planted is None else "planted"].format(**counts),
    }
