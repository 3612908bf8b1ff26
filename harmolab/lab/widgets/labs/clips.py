"""Many clips, read once, and their scores whenever a setting moves: what the corpus lab shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from harmolab.beats.visual import visual_beats
from harmolab.lab.compare.batch import BatchScores, BeatBatch, PatternBatch, rescore, rescore_patterns
from harmolab.lab.widgets.labs.lab import MODES
from harmolab.lab.widgets.labs.stage import Stage
from harmolab.params import HarmonyParams
from harmolab.types import Clip, FloatArray


@dataclass(frozen=True, eq=False)
class Corpus:
    """Beats of C clips, ready to be scored again and again.

    Parameters
    ----------
    names : C names
    batches : mode -> what of C clips it scores: a PatternBatch for "recommended", else a BeatBatch
    periods : (C,) array, seconds between music beats
    source : str, what the data are
    """

    names: tuple[str, ...]
    batches: Mapping[str, BeatBatch | PatternBatch]
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
            if isinstance(batch, PatternBatch) != (MODES[mode].measure == "pattern"):
                raise ValueError(f"the {mode} mode cannot score a {type(batch).__name__}")

    @classmethod
    def of(cls, clips: Sequence[Clip]) -> Corpus:
        """What each mode needs of clips with motion, read once.

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

    def late(self, mode: str, beats: float) -> BeatBatch | PatternBatch:
        """The batch with each clip's music moved by `beats` beats, round its end."""
        return self.batches[mode].moved(beats * self.periods)


def _batch(stages: Sequence[Stage], params: HarmonyParams) -> BeatBatch | PatternBatch:
    """What `params` scores of the stages."""
    if params.measure == "pattern":
        return PatternBatch.of([(one.music, one.motion) for one in stages], params)
    return BeatBatch.of([(one.music, visual_beats(one.motion, params=params)) for one in stages])


@lru_cache(maxsize=2)  # the wrong music stays where it is while other sliders move
def _late(corpus: Corpus, mode: str, beats: float) -> BeatBatch | PatternBatch:
    return corpus.late(mode, beats)


@lru_cache(maxsize=4)  # the true music's scores stay while another clip is chosen, or the wrong music moves
def corpus_scores(corpus: Corpus, mode: str, params: HarmonyParams, late: float | None = None) -> BatchScores:
    """Scores of all clips with true music, or with music that is `late` beats late."""
    batch = corpus.batches[mode] if late is None else _late(corpus, mode, late)
    return rescore_patterns(batch, params) if isinstance(batch, PatternBatch) else rescore(batch, params)
