"""Does a score tell right music from wrong in a folder of recordings? (`harmolab evaluate compare`; cf. Fig. 8)

True music is compared with the same music 0.3-0.7 beat late, or with other songs. A window scores the mean of its
clips.

The chance band of an AUC holds 95 % of the AUCs of *null corpora*. In these the music of each unit of choreography, or
of each recording, begins at a random place in the beat, and all that is fitted is fitted anew in every draw.
"""

import math
import os
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from harmolab.data import recordings as folders
from harmolab.files import Progress, plain, silent
from harmolab.lab.compare import scores as scoring
from harmolab.lab.compare.rows import THIS_PROCESS, Processes, RecordingOptions, corpus_scores
from harmolab.lab.compare.scores import DISCRIMINANT, NEAR, Clips, Scores, ScoreTable
from harmolab.lab.compare.windows import CLIP_SECONDS, OURS, TENTHS, BeatClip, Corpus, learn_patterns, usable_clips
from harmolab.params import DANCES, BarPattern
from harmolab.score import check_whole
from harmolab.significance import auc
from harmolab.systems.training.features import check_choice
from harmolab.types import FloatArray, IntArray

Names = NDArray[np.str_]


@dataclass(frozen=True, eq=False)
class CorpusResult:
    """The result of `compare`: all numbers, and for each score the values behind its AUC.

    Parameters
    ----------
    summary : dict
        Numbers by name, as `harmolab evaluate compare --json` prints them.
    true, wrong : dicts
        Name of a score -> (W,) scores of the windows with their own music, and (W, K) with wrong music, K times each.
    dances : (W,) list of str
    sequences : (W,) list of str
        Folder of the recording of each window.
    patterns : dict
        Dance -> the bar patterns that were learnt for its clips.
    """

    summary: dict[str, Any]
    true: dict[str, FloatArray]
    wrong: dict[str, FloatArray]
    dances: list[str]
    sequences: list[str]
    patterns: dict[str, list[BarPattern]] = field(default_factory=dict)


def compare(
    recordings: Corpus,
    *,
    corpus: str = "",
    dances: Sequence[str] = (),
    window: float | None = CLIP_SECONDS,
    null: Literal["lagged", "other"] = "lagged",
    beats: Literal["annotated", "tracked"] | None = None,
    fit_on: Corpus | None = None,
    n_rotations: int = 400,
    seed: int = 0,
    processes: Processes = THIS_PROCESS,
    progress: Progress = silent,
    report: folders.ProblemReport = lambda problem: None,
) -> CorpusResult:
    """The AUC of every score on recordings, true against wrong music, and the verdict on each recording.

    It tells which scores are to be trusted on your recordings: the AUC is the probability that a dance scores more with
    its own music than one with wrong music (`auc`).

    Parameters
    ----------
    recordings : str or path of a folder, or iterable of Recording
        Read one at a time; only scores and curves are kept.
    corpus : str
        Name of the corpus in the summary; the path when left out.
    dances : sequence of str
        Only recordings of these dances count; all when empty.
    window : float or None, seconds
        Length of the windows that are judged. None judges whole recordings.
    null : "lagged" or "other"
        Wrong music is the same music .3 to .7 beat late, or that of other recordings.
    beats : "annotated" or "tracked"
        Whose beats are taken. When left out: annotated ones, unless a folder holds a recording without beats.json.
    fit_on : as `recordings`, or None
        Corpus on which patterns and lags are learnt. None: inside `recordings`, on other figures than the judged one.
    n_rotations : int
        Null corpora behind each chance band, and resamplings of the recordings behind each interval; with 0 there is
        neither. Of few recordings the interval is too narrow: of two it holds the AUC in .5 of simulated corpora, of
        five in .8, of ten in .87.
    seed : int
        Of all that is drawn.
    processes : Processes
        That read and score the recordings of a folder; the result is the same to the last bit.
    progress : function(iterable, label) -> iterable
        Reports on recordings and null corpora.
    report : function(Problem)
        Called for each recording that cannot be read, or not be scored, as one without the annotated beats.

    Returns
    -------
    CorpusResult
        `summary`, a dict of all numbers; the scores behind them; the patterns that were learnt.

    Raises
    ------
    FileNotFoundError, ValueError
        If no recording can be scored, for a window that is not positive, another word for `null` or `beats`, and as
        `harmolab.lab.run_rows`.

    Examples
    --------
    >>> result = compare("my_corpus", window=None)  # doctest: +SKIP
    """
    beats = beats or _common_beats(recordings, fit_on)
    check_whole(n_rotations=n_rotations, seed=seed)
    check_choice("null", null, ("lagged", "other"))
    check_choice("beats", beats, ("annotated", "tracked"))
    if window is not None and not 0 < window < float("inf"):
        raise ValueError(f"window must be a positive number of seconds, or None for whole sequences; got {window}")
    options = RecordingOptions(beats, window, tuple(dances), null == "other")
    recorded = list(corpus_scores(recordings, options, processes, progress=progress, report=report))
    clips = [clip for scores in recorded for clip in scores.clips]
    if not clips:
        raise ValueError("no recording to compare; `harmolab data check` says what the files lack")
    fit_clips = None
    if fit_on is not None:
        options = replace(options, other_music=False, judged=False)
        others = corpus_scores(fit_on, options, processes.below("fit_on"), progress=progress, report=report)
        fit_clips = [clip for scores in others for clip in scores.clips]
        if not fit_clips:
            raise ValueError("no recording to fit on; `harmolab data check` says what the files lack")
    usable = usable_clips(clips, fit_clips)
    learnt = learn_patterns(clips, fit_clips)
    music = scoring.other_music(clips, seed) if null == "other" else None
    table = scoring.score_table(clips, learnt, usable, fit_clips, music)
    table = replace(table, fitted=table.fitted | {DISCRIMINANT: scoring.discriminant_score(clips, fit_clips, music)})
    result = _summarise(clips, table, n_rotations, seed, progress)
    verdicts = [scores.verdict for scores in recorded if scores.verdict is not None]
    summary = {
        "corpus": corpus or (str(recordings) if isinstance(recordings, str | os.PathLike) else ""),
        "window": window if window is not None else "whole", "null": null, "beats": beats,
        "n": len(result.dances), "n_sequences": len(set(result.sequences)), "fitted_on": _fit_note(clips, fit_clips),
        "n_parts": len(clips), "unfitted_parts": sum(pattern == BarPattern.stop_on_the_beat() for pattern in learnt),
        "seed": seed, **result.summary, "discriminant": _beside(result, table, clips, seed, n_rotations),
        **scoring.verdict_summary(verdicts, fit_clips or clips, fit_clips is None, seed),
    }  # fmt: skip
    fitted: dict[str, list[BarPattern]] = {}
    for clip, pattern in zip(clips, learnt, strict=True):
        fitted.setdefault(clip.dance, []).append(pattern)
    return replace(result, summary=plain(summary), patterns=fitted)


def _common_beats(*corpora: Corpus | None) -> Literal["annotated", "tracked"]:
    """ "annotated" when every recording of the folders has a beats.json, else "tracked"."""
    roots = [corpus for corpus in corpora if isinstance(corpus, str | os.PathLike)]
    recordings = [folder for root in roots for folder in folders.find_recordings(root).folders]
    return "annotated" if all((folder / "beats.json").is_file() for folder in recordings) else "tracked"


def _fit_note(clips: Clips, fit_clips: Clips | None) -> str:
    """A sentence about what the fitted scores were fitted on."""
    if fit_clips is not None:
        return f"{len({clip.sequence for clip in fit_clips})} sequences of another corpus, without shared figures"
    if all(clip.figures for clip in clips):
        return "other sequences, without the figures of the judged clip"
    return "other sequences (figures are not named here, so the same movement may recur)"


@dataclass(frozen=True, eq=False)
class _Windows:
    """Which window each clip belongs to, (clips,) indices, and each window's dance and recording."""

    of_clip: IntArray
    dances: list[str]
    sequences: list[str]

    @classmethod
    def of(cls, clips: Clips) -> "_Windows":
        first: dict[tuple[str, int], BeatClip] = {}
        for clip in clips:
            first.setdefault((clip.sequence, clip.window), clip)
        number = {key: index for index, key in enumerate(first)}
        of_clip = np.array([number[clip.sequence, clip.window] for clip in clips])
        return cls(of_clip, [clip.dance for clip in first.values()], [clip.sequence for clip in first.values()])

    def means(self, values: FloatArray) -> FloatArray:
        """Mean over the clips of each window: (clips, ...) to (windows, ...)."""
        sums = np.zeros((len(self.dances), *values.shape[1:]))
        np.add.at(sums, self.of_clip, values)
        return sums / np.bincount(self.of_clip).reshape(-1, *[1] * (values.ndim - 1))

    def means_of(self, scores: Scores) -> Scores:
        """Window means with true, (W,), and with wrong music, (W, K)."""
        return self.means(scores[0]), self.means(scores[1])

    def aucs(self, table: dict[str, Scores]) -> dict[str, float]:
        """AUC of true against wrong music of every score."""
        return {name: auc(*self.means_of(scores)) for name, scores in table.items()}


def _summarise(clips: Clips, table: ScoreTable, n_rotations: int, seed: int, progress: Progress) -> CorpusResult:
    """AUC, interval, chance band and per-dance values of every score."""
    windows = _Windows.of(clips)
    means = {name: windows.means_of(row) for name, row in table.at(np.zeros(len(clips), np.int64)).items()}
    true, wrong = ({name: row[side] for name, row in means.items()} for side in (0, 1))
    bands = _chance_bands(clips, table, windows, n_rotations, seed, progress)
    row, dances = partial(_row, seed=seed, count=n_rotations), np.array(windows.dances)
    members = {dance_key(dance): np.flatnonzero(dances == dance) for dance in sorted(set(windows.dances))}
    sequences, scores = np.array(windows.sequences), {}
    for name, (right, other) in means.items():
        scores[name] = row(right, other, sequences) | {"chance_band": bands.get(name, [None, None])}
        scores[name]["by_dance"] = {key: row(right[own], other[own], sequences[own]) for key, own in members.items()}
    return CorpusResult({"scores": scores}, true, wrong, windows.dances, windows.sequences)


def _chance_bands(
    clips: Clips, table: ScoreTable, windows: _Windows, count: int, seed: int, progress: Progress
) -> dict[str, list[float | None]]:
    """The middle 95 % of the AUCs of each score over null corpora.

    Units of choreography may have been laid on the music one by one, or a dancer keeps one phase through a recording:
    both are turned, and the wider band counts.
    """
    bands: dict[str, list[float | None]] = {}
    units, recordings = [clip.unit for clip in clips], [clip.sequence for clip in clips]
    groups = {"unit": units, "recording": recordings} if units != recordings else {"recording": recordings}
    for name, group in groups.items():
        draws = _origins(clips, group, count, seed)
        rows = [windows.aucs(table.at(origins)) for origins in progress(draws, f"chance band, by {name}")]
        for score in rows[0] if rows else ():
            band = _quantiles([row[score] for row in rows])
            bands[score] = max(band, bands.get(score, band), key=lambda ends: np.ptp(np.array(ends, np.float64)))
    return bands


def _origins(clips: Clips, groups: Sequence[str], count: int, seed: int) -> IntArray:
    """(count, clips) random shifts in tenths of a beat; clips of the same group turn together."""
    rng = np.random.default_rng(seed)
    _, group = np.unique(groups, return_inverse=True)
    steps = math.lcm(*(TENTHS * clip.cycle for clip in clips))
    return rng.integers(0, steps, (count, group.max() + 1))[:, group]


def _quantiles(values: Sequence[float]) -> list[float | None]:
    """The middle 95 % of some values; None without them."""
    return [float(edge) for edge in np.quantile(values, [0.025, 0.975])] if len(values) else [None, None]


def _row(true: FloatArray, wrong: FloatArray, sequences: Names, *, seed: int, count: int) -> dict[str, Any]:
    """AUC, its bootstrap interval over recordings, and the mean scores."""
    return {
        "auc": auc(true, wrong),
        "interval": _quantiles([auc(true[rows], wrong[rows]) for rows in _resampled(sequences, seed, count)]),
        "n": len(true),
        "mean_true": float(true.mean()),
        "mean_wrong": float(wrong.mean()),
    }


def _resampled(sequences: Names, seed: int, count: int) -> list[IntArray]:
    """Numbers of the windows of as many recordings, drawn with replacement, so many times; none for one recording."""
    members = [np.flatnonzero(sequences == name) for name in dict.fromkeys(sequences)]
    draws = np.random.default_rng(seed).integers(0, len(members), (count if len(members) > 1 else 0, len(members)))
    return [np.concatenate([members[i] for i in row]) for row in draws]


def _beside(result: CorpusResult, table: ScoreTable, clips: Clips, seed: int, count: int) -> dict[str, Any]:
    """The discriminant beside the learnt curve: difference in AUC, and number of recordings whose lag each finds."""
    true, wrong = result.true, result.wrong

    def gain(rows: IntArray) -> float:
        return auc(true[DISCRIMINANT][rows], wrong[DISCRIMINANT][rows]) - auc(true[OURS][rows], wrong[OURS][rows])

    lags = {name: scoring.recording_lags(table.fitted[name], clips) for name in (OURS, DISCRIMINANT)}
    return {
        "auc_difference": gain(np.arange(len(result.sequences))),
        "interval": _quantiles([gain(rows) for rows in _resampled(np.array(result.sequences), seed, count)]),
        "lags_found": {name: int(np.sum(np.abs(row) <= NEAR)) for name, row in lags.items()},
    }


def dance_key(dance: str) -> str:
    """The initial of one of the seven `DANCES` (C, J, Q, R, S, T, W), the name of another, "?" without a name."""
    return dance[0].upper() if dance in DANCES else dance or "?"
