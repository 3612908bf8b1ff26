"""A score and its evidence: the record that scoring returns, and that pictures, pages and sentences read."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from harmolab.params import HarmonyParams
from harmolab.types import BeatTrack, BoolArray, FloatArray, IntArray
from harmolab.verdict.judge import Judgement

MOST_CHANCE = 0.9  # share of the beats reached by chance, above which a score above chance says nothing


@dataclass(frozen=True, eq=False)
class HarmonyScore:
    """A score and its evidence: all that pictures, pages and sentences about it need. Times are seconds.

    Parameters
    ----------
    params : HarmonyParams, the settings it was computed with
    music, visual : BeatTrack, the attentional beats of both sides on the motion's time line, the lag not taken off
    pairs : (N,) array of int
        Index of the visual beat within the delay of each attentional music beat, -1 for a miss (Eq. 18). The score by
        a bar pattern does not rest on them, but pictures of who meets whom do.
    shares : (N,) array
        Share of each attentional music beat in the score: 1 for a hit and 0 for a miss, or with a bar pattern its
        percentile rank among all moments.
    mean_share : float, their mean, weighted by the strengths of the beats: what `chance` is taken off
    null : (R,) array, that mean after each rotation in time, or at each lag; empty when not computed
    harmony, audio_harmony, visual_harmony : float
        h of Eq. 20-21, h_a = h_s / N and h_v = h_s / M.
    hitting_score : float, h_s of Eq. 19
    hit_rate : float
        Share of all music beats with an attentional visual beat within the delay.
    chance : float, the share that a random shift in time would reach
    harmony_above_chance : float
        0 is what chance reaches, 1 is every beat hit. The recommended score's is H of its `judgement`: in [-1, 1], and
        NaN where no place in the beat can be judged.
    intervals : (N,) array, from each attentional music beat to its nearest visual beat, less the lag (Eq. 17)
    p_value : float
        Share of random rotations in time that score as high; NaN when not computed. The recommended score's is that of
        its `judgement`.
    interval : (float, float), spread of harmony_above_chance from beat to beat or from bar to bar, 95 %; NaN without
    judgement : Judgement of `harmolab.verdict.judge`, None unless the measure is "shape"
    """

    params: HarmonyParams
    music: BeatTrack
    visual: BeatTrack
    pairs: IntArray
    shares: FloatArray
    mean_share: float
    harmony: float
    audio_harmony: float
    visual_harmony: float
    hitting_score: float
    hit_rate: float
    chance: float
    harmony_above_chance: float
    intervals: FloatArray
    null: FloatArray = field(default_factory=lambda: np.zeros(0))
    p_value: float = float("nan")
    interval: tuple[float, float] = (float("nan"), float("nan"))
    judgement: Judgement | None = None

    @property
    def above_chance(self) -> float:
        """`harmony_above_chance` where it means something: NaN where chance alone reaches more than .9 of the beats."""
        return self.harmony_above_chance if self.chance <= MOST_CHANCE else float("nan")

    @property
    def place_harmony(self) -> float:
        """`harmony_above_chance` also where no place can be judged, for means over many dances."""
        return self.judgement.place_harmony if self.judgement else self.harmony_above_chance

    @property
    def hits(self) -> BoolArray:
        """(N,) True for each attentional music beat that counts as hit (Eq. 18), or, with a bar pattern, that fits."""
        return self.shares > 0.5

    @property
    def n_audio(self) -> int:
        """N, the number of attentional music beats."""
        return len(self.music)

    @property
    def n_visual(self) -> int:
        """M, the number of attentional visual beats."""
        return len(self.visual)

    def to_dict(self) -> dict[str, Any]:
        """Plain numbers and lists, ready for JSON, without settings and null; a number that does not exist is None."""
        beats = {"music_times": self.music.times, "visual_times": self.visual.times, "pairs": self.pairs}
        inner = ("params", "music", "visual", "null", "judgement")
        numbers = {name: value for name, value in vars(self).items() if name not in inner}
        counts = {"hits": self.hits, "n_audio": self.n_audio, "n_visual": self.n_visual}
        verdict = self.judgement.to_dict() if self.judgement else {}
        return {name: _plain(value) for name, value in (numbers | counts | beats | verdict).items()}


def _plain(value: Any) -> Any:
    """Lists and finite numbers in place of arrays, tuples and what is not finite."""
    if isinstance(value, np.ndarray | tuple):
        return [_plain(item) for item in np.asarray(value).tolist()]
    return None if isinstance(value, float) and not np.isfinite(value) else value
