"""The corpus lab: the scores of many clips with their own and with wrong music, and the AUC, while sliders move."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import lru_cache, partial
from typing import Any

import numpy as np

from harmolab.beats.visual import visual_beats
from harmolab.lab.compare.batch import PlaceBatch, rescore_places
from harmolab.lab.labs import live
from harmolab.lab.player_data import LAB_SENTENCES, Dancer, Player, percent
from harmolab.params import HarmonyParams
from harmolab.score import score_harmony
from harmolab.significance import auc
from harmolab.types import BeatTrack, Clip, FloatArray
from harmolab.verdict.judge import score_motion

SCORES = {"harmony": "harmony h", "harmony_above_chance": "harmony above chance", "hit_rate": "share of beats met"}


@dataclass(frozen=True, eq=False)
class Corpus:
    """Beats of C clips, ready to be scored again and again.

    Parameters
    ----------
    names : C names
    music : C tracks of music beats
    dances : mode -> C tracks of visual beats, for modes that count hits
    places : PlaceBatch of the C clips, for the recommended mode
    source : str, origin of the data
    """

    names: tuple[str, ...]
    music: tuple[BeatTrack, ...]
    dances: Mapping[str, tuple[BeatTrack, ...]]
    places: PlaceBatch
    source: str

    @property
    def periods(self) -> FloatArray:
        """Seconds between music beats, (C,) array; 0 with fewer than two."""
        return np.array([np.median(np.diff(track.times)) if len(track) > 1 else 0.0 for track in self.music])

    @classmethod
    def of(cls, clips: Sequence[Clip]) -> "Corpus":
        """Beats and movement of clips with motion, read once for every mode.

        Raises
        ------
        ValueError
            Without clips, or if one has no motion.
        """
        if not clips:
            raise ValueError("a corpus needs at least one clip")
        stages = [live.Stage.of(clip) for clip in clips]
        dances = {
            mode: tuple(visual_beats(one.motion, params=params) for one in stages)
            for mode, params in live.MODES.items()
            if params.measure == "hits"
        }
        places = PlaceBatch.of([(one.music, one.motion) for one in stages], live.MODES["recommended"])
        source = " + ".join(sorted({one.source for one in stages if one.source}))
        return cls(tuple(clip.name for clip in clips), tuple(one.music for one in stages), dances, places, source)


@lru_cache(maxsize=4)  # true and wrong music, and those of the setting before
def corpus_scores(
    corpus: Corpus, mode: str, params: HarmonyParams, score: str = "harmony", late: float | None = None
) -> FloatArray:
    """Scores of all clips, (C,) array, with true music, or with music that is `late` beats late."""
    seconds = (late or 0.0) * corpus.periods
    if params.measure == "shape":
        return np.asarray(getattr(rescore_places(corpus.places.moved(seconds), params), score))
    pairs = zip(map(_late, corpus.music, seconds), corpus.dances[mode], strict=True)
    return np.array([getattr(score_harmony(*pair, params=params, n_rotations=0), score) for pair in pairs])


def _late(track: BeatTrack, seconds: float) -> BeatTrack:
    """Music beats so much later, round the track's end."""
    if seconds == 0:
        return track
    times, order = np.unique(np.mod(track.times + seconds, track.duration), return_index=True)
    return replace(track, times=times, strengths=track.strengths[order], bar_places=None)


def corpus_lab(clips: Sequence[Clip], **values: Any) -> live.LiveLab:
    """A lab in the browser: sliders for a score's settings, and the scores of many clips with true and wrong music.

    The picture has the AUC, which is how well the score tells true from wrong music at these settings.

    Parameters
    ----------
    clips : sequence of Clip with motion
        In JupyterLab a button opens the chosen clip in a player under the picture.
    **values
        Values at which controls start, such as ``delay=0.1``, in place of those of the first mode.

    Returns
    -------
    LiveLab
        It shows itself in JupyterLab and in the report. `numbers`, `sentence` and `params` say what it shows, `set`
        moves controls, and `save` writes it as a page.

    Raises
    ------
    ValueError
        Without clips, if one has no motion, for an unknown control, or for a value that it cannot have.

    Examples
    --------
    >>> lab = corpus_lab(clips, delay=0.1)  # doctest: +SKIP
    >>> lab.numbers["auc"]  # doctest: +SKIP
    """
    corpus = Corpus.of(clips)
    controls = {
        **live.lab_controls("corpus"),
        "clip": live.Slider("dance", "number", 0, len(clips) - 1, 1),
        "mode": live.CONTROLS["mode"],
        "score": live.Menu("score shown", "score", SCORES),
    }
    content = live.LabContent(
        kind="corpus",
        evidence=_evidence(corpus),
        controls=controls,
        extra={"score": "harmony", "late": 0.5, "clip": 0},
        numbers=partial(corpus_numbers, corpus),
        play=partial(_player_element, clips),
    )
    return live.LiveLab(content, values)


def _evidence(corpus: Corpus) -> dict[str, Any]:
    return {
        "source": corpus.source,
        "names": corpus.names,
        "periods": corpus.periods,
        "music": [{**live.track_evidence(track), "duration": track.duration} for track in corpus.music],
        "dances": {mode: [live.track_evidence(track) for track in tracks] for mode, tracks in corpus.dances.items()},
        "places": asdict(corpus.places),
    }


def _player_element(clips: Sequence[Clip], *, clip: float, score: str, late: float, **values: Any) -> str:
    """The player of one clip, with its true music, as an element of a page."""
    one = clips[int(clip)]
    stage = live.Stage.of(one)
    harmony = score_motion(stage.music, stage.motion, params=live.lab_params(**values), n_rotations=0)
    dancer = Dancer(one.dance or "dancer", stage.motion, harmony)
    return Player(one.shared().audio, [dancer], music=stage.music, title=one.name)._repr_html_()


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
    params = live.lab_params(mode, **values)
    # Rounded, so that scores that differ by the order of a sum are tied, here and in the browser.
    true, wrong = (corpus_scores(corpus, mode, params, score, beats).round(12) for beats in (None, late))
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
