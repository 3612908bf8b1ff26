"""The corpus lab: the scores of many clips with their own and with wrong music, and the AUC, while sliders move."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields
from functools import lru_cache, partial
from typing import Any

import numpy as np

from harmolab.beats.visual import visual_beats
from harmolab.harmony import score_motion
from harmolab.lab.compare.batch import BatchScores, BeatBatch, PlaceBatch, rescore, rescore_places
from harmolab.lab.widgets.labs.controls import MODE, named_controls
from harmolab.lab.widgets.labs.lab import MODES, with_settings
from harmolab.lab.widgets.labs.live import LabContent, LiveLab, Menu, Preset, Slider
from harmolab.lab.widgets.labs.stage import Stage
from harmolab.lab.widgets.player import Dancer, Player
from harmolab.lab.widgets.words import LAB_SENTENCES, percent
from harmolab.params import HarmonyParams
from harmolab.significance import auc
from harmolab.types import Clip, FloatArray

IDLE = {"recommended": ("lambda1", "lambda2", "delay")}  # all beats count, and no hits
SCORES = {"harmony": "harmony h", "harmony_above_chance": "harmony above chance", "hit_rate": "share of beats met"}
SETTINGS = ("delay", "lambda1", "lambda2", "beta", "lag")
ABOUT = (
    "Left: scores of all dances with their true music (blue) and with the same music late (outline). Right: a mark for "
    "each dance, a green circle where the true music wins. Click a mark to choose its dance, and hear it."
)
PAPER: Mapping[str, Any] = {"mode": "paper", "late": 0.5, "score": "harmony"}
STOPS: Mapping[str, Any] = {**PAPER, "mode": "valleys"}
RECOMMENDED: Mapping[str, Any] = {"mode": "recommended", "late": 0.5, "score": "harmony_above_chance"}
PRESETS = (
    Preset("the paper's", PAPER, "Half a beat late, the music meets the peaks of the speed instead of the stops."),
    Preset("0.1 s", {**PAPER, "delay": 0.1}, "Fewer hits, but no more right answers: peaks are met as well as stops."),
    Preset(
        "stops only",
        STOPS,
        "The cloud leaves the diagonal and right answers rise: the peaks, which lie between the beats, are out.",
    ),
    Preset(
        "a whole beat late",
        {**STOPS, "late": 1.0},
        "The cloud goes back to the diagonal: music that is a whole beat late fits nearly as well.",
    ),
    Preset(
        "large movements only",
        {**STOPS, "lambda2": 2.0},
        "Small movements are ignored, and with them goes some of what tells the two apart.",
    ),
    Preset("missed beats cost more", {**STOPS, "beta": 4.0}, "The scores move a little, and the right answers hardly."),
    Preset(
        "expect a late dance",
        {**STOPS, "lag": 0.26},
        "The dance is expected about half a beat later than it is, and the wrong music wins.",
    ),
    Preset(
        "recommended",
        RECOMMENDED,
        "It is not told the dance, and a rest half a beat late is a hit on the beat: so late it cannot know.",
    ),
    Preset(
        "recommended, a quarter late",
        {**RECOMMENDED, "late": 0.25},
        "A quarter of a beat late lies between rest and hit, and the true music wins again.",
    ),
)


@dataclass(frozen=True, eq=False)
class Corpus:
    """Beats of C clips, ready to be scored again and again.

    Parameters
    ----------
    names : C names
    batches : mode -> beats and movement of C clips: a PlaceBatch for "recommended", else a BeatBatch
    periods : (C,) array, seconds between music beats
    source : str, origin of the data
    """

    names: tuple[str, ...]
    batches: Mapping[str, BeatBatch | PlaceBatch]
    periods: FloatArray
    source: str = ""

    def __post_init__(self) -> None:
        counts = {len(self.names), len(self.periods), *(batch.durations.size for batch in self.batches.values())}
        if not self.batches or set(self.batches) - set(MODES) or len(counts) != 1:
            raise ValueError(
                f"a corpus needs a batch for some of {', '.join(MODES)}, with as many clips as names and periods; "
                f"got {', '.join(self.batches) or 'none'} with {', '.join(map(str, sorted(counts)))} clips"
            )
        for mode, batch in self.batches.items():
            if isinstance(batch, PlaceBatch) != (MODES[mode].measure == "shape"):
                raise ValueError(f"the {mode} mode cannot score a {type(batch).__name__}")

    @classmethod
    def of(cls, clips: Sequence[Clip]) -> Corpus:
        """Beats and movement of clips with motion, read once for every mode.

        Raises
        ------
        ValueError
            Without clips, or if one has no motion.
        """
        stages = [Stage.of(clip) for clip in clips]
        batches = {mode: _batch(stages, params) for mode, params in MODES.items()}
        periods = [float(np.median(np.diff(one.music.times))) if len(one.music) > 1 else 0.0 for one in stages]
        sources = sorted({one.source for one in stages if one.source})
        return cls(tuple(clip.name for clip in clips), batches, np.array(periods), " + ".join(sources))


def _batch(stages: Sequence[Stage], params: HarmonyParams) -> BeatBatch | PlaceBatch:
    """The stages as the measure of `params` scores them."""
    if params.measure == "shape":
        return PlaceBatch.of([(one.music, one.motion) for one in stages], params)
    return BeatBatch.of([(one.music, visual_beats(one.motion, params=params)) for one in stages])


@lru_cache(maxsize=4)  # true and wrong music, and those of the setting before
def corpus_scores(corpus: Corpus, mode: str, params: HarmonyParams, late: float | None = None) -> BatchScores:
    """Scores of all clips with true music, or with music that is `late` beats late."""
    batch = corpus.batches[mode]
    if late is not None:
        batch = batch.moved(late * corpus.periods)
    return rescore_places(batch, params) if isinstance(batch, PlaceBatch) else rescore(batch, params)


def corpus_lab(clips: Corpus | Sequence[Clip], **values: Any) -> LiveLab:
    """Sliders for the score's settings above the scores of a whole corpus, with the AUC of true against wrong music.

    Parameters
    ----------
    clips : clips with motion, or a Corpus of their beats
        In JupyterLab a button opens the chosen clip in a player under the picture; that of a Corpus cannot be played.
    **values
        Where controls start instead of at the first mode's settings: ``delay=0.1``; a mode brings its own.

    Raises
    ------
    ValueError
        Without clips, if one has no motion, for an unknown control, or for a value that it cannot have.

    Examples
    --------
    >>> lab = corpus_lab(clips, delay=0.1)  # doctest: +SKIP
    >>> lab.numbers["auc"]  # doctest: +SKIP
    """
    if isinstance(clips, Corpus):
        return LiveLab(corpus_content(clips), values)
    return LiveLab(corpus_content(Corpus.of(clips), play=partial(_player_element, clips)), values)


def corpus_content(corpus: Corpus, *, play: Callable[..., str] | None = None) -> LabContent:
    """The corpus lab of a corpus."""
    modes = tuple(corpus.batches)
    controls = {
        "late": Slider("wrong music comes later by", "late", 0.0, 1.0, 0.05, "beats"),
        **named_controls(*SETTINGS),
        "clip": Slider("dance", "number", 0, len(corpus.names) - 1, 1),
        "mode": Menu("way to score", "mode", {mode: MODE[mode] for mode in modes}),
        "score": Menu("score shown", "score", SCORES),
    }
    return LabContent(
        kind="corpus",
        title="The corpus lab",
        about=ABOUT,
        evidence=_evidence(corpus),
        controls=controls,
        presets=tuple(preset for preset in PRESETS if preset.values["mode"] in modes),
        extra={"score": "harmony", "late": 0.5, "clip": 0},
        params=corpus_params,
        numbers=partial(corpus_numbers, corpus),
        words=LAB_SENTENCES,
        idle=IDLE,
        play=play,
    )


def _evidence(corpus: Corpus) -> dict[str, Any]:
    return {
        "source": corpus.source,
        "names": corpus.names,
        "periods": corpus.periods,
        "batches": {
            mode: {field.name: getattr(batch, field.name) for field in fields(batch)}
            for mode, batch in corpus.batches.items()
        },
    }


def _player_element(clips: Sequence[Clip], *, clip: float, **values: Any) -> str:
    """The player of one clip, with its true music, as an element of a page."""
    one = clips[int(clip)]
    stage = Stage.of(one)
    score = score_motion(stage.music, stage.motion, params=corpus_params(**values), n_rotations=0)
    dancer = Dancer(one.dance or "dancer", stage.motion, score)
    return Player(one.shared().audio, [dancer], music=stage.music, title=one.name)._repr_html_()


def corpus_params(*, mode: str, score: str = "", late: float = 0.0, clip: float = 0, **values: Any) -> HarmonyParams:
    """A mode's settings but for those of the lab's controls; score, clip and delay of the music are no settings."""
    return with_settings(MODES[mode], **values)


def corpus_numbers(
    corpus: Corpus, *, mode: str, score: str = "harmony", late: float = 0.5, clip: float = 0, **values: Any
) -> dict[str, Any]:
    """The numbers of the lab: scores of every clip with true and with wrong music, the AUC, and the sentence.

    Parameters
    ----------
    corpus : Corpus
    mode : "paper", "recommended" or "valleys"
    score : "harmony", "harmony_above_chance" or "hit_rate"
    late : float, beats by which the wrong music is moved
    clip : number of the chosen clip; no number depends on it
    **values
        The other controls, by name; those of the mode when left out.
    """
    params = corpus_params(mode=mode, **values)
    true, wrong = (getattr(corpus_scores(corpus, mode, params, beats), score) for beats in (None, late))
    tied = np.isclose(true, wrong)
    area = auc(true, wrong)
    counts = {"wins": int(((true > wrong) & ~tied).sum()), "ties": int(tied.sum()), "clips": true.size}
    return {
        **counts,
        "auc": area,
        "mean_true": float(true.mean()),
        "mean_wrong": float(wrong.mean()),
        "true": true,
        "wrong": wrong,
        "sentence": LAB_SENTENCES["corpus"].format(**counts, auc=percent(area)),
    }
