"""The pieces of a listening study, cut from a corpus: music, and for each piece the dances that may be shown to it.

The music of a piece stays, and the dance is exchanged: its own ("true"), its own half a beat late ("lagged"), another
clip's of the same kind ("swapped"), or another model's. So the sound is the same whatever the answer, and neither its
beginning nor its end nor its loudness gives the answer away.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from harmolab.beats.audio import music_beats
from harmolab.body.kinematics import resample_motion, upsample_motion
from harmolab.clips import corpus_recordings
from harmolab.data.recordings import Problem, ProblemReport, load_any_motion, recorded_offset
from harmolab.files import PathLike, Progress, silent
from harmolab.lab.listening.trials import Item, KeyEntry
from harmolab.params import HarmonyParams
from harmolab.score import check_whole
from harmolab.types import Audio, BeatTrack, Clip, FloatArray, Motion
from harmolab.verdict.judge import other_measures, score_clip

FPS = 60.0  # of every motion shown, so that its rate does not tell where it comes from
FADE = 0.05  # seconds, at both ends of the sound
LOUDNESS = 0.1  # root mean square of every sound, where no peak forbids it; full scale is 1
ONSET = 0.25  # seconds at the beginning that must not be silent
QUIET = 0.2  # of the sound's root mean square: below, it counts as silent
STEP = 6  # frames between the moments where a piece may begin
RECORDED = 0.9  # of the frames shown must be recorded movement
SHORTEST, LONGEST = 2.0, 60.0  # seconds of a piece
COUNTERPARTS = ("{}/motion.npz", "{}/skeletons.json", "{}.npz", "{}.bvh")  # files of a dance by its name
Dances = Mapping[str, tuple[Motion, int]]  # by version: a motion, and the frames by which it comes late


@dataclass(frozen=True, eq=False)
class StudyPiece:
    """A piece of music and the dances that may be shown to it; all begin and end together.

    Parameters
    ----------
    name : str
    audio : Audio, faded at both ends
    beats : BeatTrack of the music, on the time line of `audio`
    motions : mapping from version ("true", "lagged", the name of a model) to Motion
    dance : str, empty when unknown
    """

    name: str
    audio: Audio
    beats: BeatTrack
    motions: Mapping[str, Motion]
    dance: str = ""

    @property
    def item(self) -> Item:
        """The piece for `make_trials`; the source of a version is "name / version"."""
        return Item(self.name, {version: f"{self.name} / {version}" for version in self.motions})

    def clip(self, version: str) -> Clip:
        """The music with one of its dances, for a score."""
        return Clip(f"{self.name} / {version}", self.audio, self.motions[version], beats=self.beats, dance=self.dance)


@dataclass(frozen=True, eq=False)
class Pieces:
    """The pieces of a study, and for each clip that gave none its name and the reason."""

    pieces: tuple[StudyPiece, ...]
    left_out: tuple[str, ...] = ()

    @property
    def items(self) -> tuple[Item, ...]:
        """The pieces for `make_trials`."""
        return tuple(piece.item for piece in self.pieces)

    def named(self, name: str) -> StudyPiece:
        """The piece of that name, which a key calls item."""
        return next(piece for piece in self.pieces if piece.name == name)

    def presented(self, entry: KeyEntry) -> tuple[Audio, list[Motion]]:
        """The music of a trial and its dance, or its two dances (left, right): the arguments of `blind_page`."""
        piece = self.named(entry.item)
        return piece.audio, [piece.motions[version] for version in entry.versions]

    def scores(self, entries: Iterable[KeyEntry]) -> dict[str, dict[str, float]]:
        """`clip_scores` of every dance that is shown: {score: {source: value}}."""
        rows = {
            source: clip_scores(self.named(entry.item).clip(version))
            for entry in entries
            for version, source in zip(entry.versions, entry.sources, strict=True)
        }
        names = next(iter(rows.values()), {})
        return {name: {source: row[name] for source, row in rows.items()} for name in names}


def lagged_pieces(clips: Iterable[Clip], *, seconds: float, seed: int) -> Pieces:
    """Pieces for a study of true and wrong music: of each clip one, with its dance "true", and "lagged" by half a beat.

    Parameters
    ----------
    clips : iterable of Clip with a motion
        Each with a name of its own; taken one at a time.
    seconds : float
        Length of every piece, 2 to 60.
    seed : int
        Decides the beginning of each piece: any moment from which both dances last and the music sounds.

    Returns
    -------
    Pieces
        `pieces` have the audio and the motions; `items` are those for `make_trials`; `left_out` names clips that gave
        no piece, with the reason.

    Raises
    ------
    ValueError
        If `seconds` is out of range, or the seed negative.

    Examples
    --------
    >>> from harmolab import synthetic_clip
    >>> study = lagged_pieces([synthetic_clip("waltz", seconds=8.0)], seconds=5.0, seed=1)
    >>> study.pieces[0].audio.duration, sorted(study.pieces[0].motions)
    (5.0, ['lagged', 'true'])
    """
    return _pieces(((clip, _true_and_lagged) for clip in clips), seconds, seed)


def swapped_pieces(clips: Iterable[Clip], *, seconds: float, seed: int) -> Pieces:
    """A piece of every second clip, with its dance "true" and "swapped": that of another clip of the same kind.

    The clip that lends its dance gives no piece of its own, so that no rater hears a music or sees a dance twice and
    learns from it. By accident a lent dance may fit for a while.

    Parameters and errors are those of `lagged_pieces`; the seed also decides which clip lends to which.
    """
    true = _pieces(((clip, lambda motion, _: {"true": (motion, 0)}) for clip in clips), seconds, seed)
    kinds = defaultdict(list)
    for piece in true.pieces:
        kinds[piece.dance].append(piece)
    swapped, left_out = [], list(true.left_out)
    for dance, pieces in kinds.items():
        order = [pieces[place] for place in _rng(seed, dance).permutation(len(pieces))]
        for own, lent in zip(order[::2], order[1::2], strict=False):
            swapped.append(replace(own, motions={**own.motions, "swapped": lent.motions["true"]}))
        if len(order) % 2:
            left_out.append(f"{order[-1].name}: no other clip is left to swap its dance ({dance or 'unknown'}) with")
    return Pieces(tuple(swapped), tuple(left_out))


def paired_pieces(
    pairs: Iterable[tuple[Clip, Motion, float]], versions: tuple[str, str], *, seconds: float, seed: int
) -> Pieces:
    """A piece of each clip with two dances to its one music, for "choice": its own, and another.

    Parameters
    ----------
    pairs : iterable of (Clip with a motion, the other Motion, audio time of its frame 0 in seconds)
    versions : names of the two, such as ("HarmoGAN", "LSTM")
    seconds, seed
        As in `lagged_pieces`.

    Raises
    ------
    ValueError
        If the two names are equal, or `seconds` is not between 2 and 60.
    """
    if versions[0] == versions[1]:
        raise ValueError(f"two versions need two names, got {versions[0]!r} twice")
    lates = ((clip, other, round((offset - clip.offset) * FPS)) for clip, other, offset in pairs)
    return _pieces(((clip, partial(_pair, other, late, versions)) for clip, other, late in lates), seconds, seed)


def study_pieces(
    corpus: PathLike,
    against: PathLike | None = None,
    *,
    wrong: str = "lagged",
    seconds: float,
    seed: int,
    progress: Progress = silent,
    report: ProblemReport = lambda problem: None,
) -> Pieces:
    """The pieces of a folder of recordings: "lagged" or "swapped", or paired with the dances of another folder.

    Parameters
    ----------
    corpus : folder of recordings
    against : folder with another dance for each recording, under the same name (a recording's folder, npz or bvh)
        It begins at the audio time that its files say; where they say none, with the recording's motion.
    wrong : "lagged" or "swapped", the wrong dances without `against`
    report : function(Problem), called for each recording that cannot be read, has no other dance or gives no piece

    Raises
    ------
    FileNotFoundError, ValueError
        If a folder does not exist or holds no recording, no recording gives a piece; and as `lagged_pieces`.
    """
    recordings = corpus_recordings(corpus, progress=progress, report=report)
    clips = (replace(each.clip, name=each.folder.relative_to(corpus).as_posix()) for each in recordings)
    if against is not None:
        versions = (Path(corpus).resolve().name, Path(against).resolve().name)
        pieces = paired_pieces(_counterparts(clips, Path(against), report), versions, seconds=seconds, seed=seed)
    else:
        pieces = (lagged_pieces if wrong == "lagged" else swapped_pieces)(clips, seconds=seconds, seed=seed)
    for text in pieces.left_out:
        report(Problem(Path(corpus), text))
    if not pieces.pieces:
        raise ValueError(f"{corpus}: no recording gives a trial of {seconds:g} s; try fewer --seconds")
    return pieces


def _counterparts(clips: Iterable[Clip], against: Path, report: ProblemReport) -> Iterator[tuple[Clip, Motion, float]]:
    """Each clip with the motion of the same name in another folder, and the audio time at which that begins."""
    if not against.is_dir():
        raise ValueError(f"{against}: no such folder")
    for clip in clips:
        paths = [against / name.format(clip.name) for name in COUNTERPARTS]
        path = next((path for path in paths if path.is_file()), None)
        if path is None:
            report(Problem(against, f"{against} holds no dance called {clip.name}"))
        else:
            offset = recorded_offset(path)
            yield clip, load_any_motion(path), clip.offset if offset is None else offset


def clip_scores(clip: Clip) -> dict[str, float]:
    """The scores of one clip: ours above chance in three settings, the paper's h (Eq. 20), and those of others.

    The recommended score says of every dance how it rests on the beat, also of one that is not on it. It is NaN where
    it does not judge: most pieces are shorter than its 16 beats.
    """
    # So that a dance has a number, too, that does not follow unsure beats.
    clip = replace(clip, beats=replace(music_beats(clip), fit=None, windows=None))
    names = ("paper", "valleys", "recommended")
    scores = {name: score_clip(clip, getattr(HarmonyParams, name)(), n_rotations=0) for name in names}
    above = {f"{name}_above_chance": score.place_harmony for name, score in scores.items()}
    return {**above, "paper_h": scores["paper"].harmony, **other_measures(clip)}


def _true_and_lagged(motion: Motion, beats: BeatTrack) -> Dances:
    late = round(0.5 * float(np.median(np.diff(beats.times))) * FPS)
    return {"true": (motion, 0), "lagged": (motion, late)}


def _pair(other: Motion, late: int, versions: tuple[str, str], motion: Motion, _: BeatTrack) -> Dances:
    return {versions[0]: (motion, 0), versions[1]: (_at_rate(other), late)}


def _pieces(clips: Iterable[tuple[Clip, Callable[[Motion, BeatTrack], Dances]]], seconds: float, seed: int) -> Pieces:
    """The pieces of all clips, equally loud, and the reasons why some clips gave none.

    Beside each clip stands the function from its motion and beats to its dances.
    """
    if not SHORTEST <= seconds <= LONGEST:
        raise ValueError(f"seconds must be between {SHORTEST:g} and {LONGEST:g}, got {seconds:g}")
    check_whole(seed=seed)
    pieces, left_out = [], []
    for clip, dances in clips:
        try:
            beats = music_beats(clip)
            if len(beats) < 2:
                raise ValueError(f"its music has {len(beats)} beats; two are needed")
            if clip.motion is None:
                raise ValueError("has no motion to show")
            pieces.append(_piece(clip, beats, dances(_at_rate(clip.motion), beats), seconds, seed))
        except ValueError as error:
            left_out.append(f"{clip.name}: {error}")
    return Pieces(_equally_loud(pieces), tuple(left_out))


def _at_rate(motion: Motion) -> Motion:
    return resample_motion(upsample_motion(motion, FPS), FPS)


def _piece(clip: Clip, beats: BeatTrack, dances: Dances, seconds: float, seed: int) -> StudyPiece:
    """The piece that begins at a random moment among those where all dances are recorded and the music sounds."""
    count = round(seconds * FPS)
    first = max(math.ceil(-clip.offset * FPS), *(late for _, late in dances.values()), 0)
    ends = [motion.n_frames + late for motion, late in dances.values()]
    last = min(*ends, math.floor((clip.audio.duration - clip.offset) * FPS)) - count
    if last < first:
        raise ValueError(f"has no {seconds:g} s of dance and music together")
    for start in _rng(seed, clip.name).permutation(np.arange(first, last + 1, STEP)):
        audio = _faded(clip.audio.span(max(clip.offset + start / FPS, 0.0), count / FPS))
        motions = {name: motion.span((start - late) / FPS, count / FPS) for name, (motion, late) in dances.items()}
        music = beats.span(max(clip.offset + start / FPS, 0.0), audio.duration)
        recorded = min(motion.valid.mean() for motion in motions.values())
        if _sounds(audio) and recorded >= RECORDED and len(music) > 1:
            return StudyPiece(clip.name, audio, music, motions, clip.dance)
    raise ValueError(f"has no {seconds:g} s that begin with sound, hold beats and are recorded throughout")


def _faded(audio: Audio) -> Audio:
    """The sound with a straight fade at both ends, so that no click tells where it was cut."""
    seconds = np.arange(audio.samples.size) / audio.sample_rate
    ramp = np.minimum(np.minimum(seconds, seconds[::-1]) / FADE, 1.0)
    return Audio(audio.samples * ramp, audio.sample_rate)


def _sounds(audio: Audio) -> bool:
    """True if the beginning is not silent."""
    return bool(_loudness(audio.samples[: round(ONSET * audio.sample_rate)]) > QUIET * _loudness(audio.samples) > 0)


def _equally_loud(pieces: list[StudyPiece]) -> tuple[StudyPiece, ...]:
    """All sounds at one root mean square: `LOUDNESS`, or the most that the sharpest reaches without clipping."""
    loudness = [_loudness(piece.audio.samples) for piece in pieces]
    peaks = [float(np.abs(piece.audio.samples).max()) for piece in pieces]
    level = min([LOUDNESS, *(0.99 * loud / peak for loud, peak in zip(loudness, peaks, strict=True))])
    return tuple(
        replace(piece, audio=Audio(piece.audio.samples * (level / loud), piece.audio.sample_rate))
        for piece, loud in zip(pieces, loudness, strict=True)
    )


def _loudness(samples: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(samples))))


def _rng(seed: int, name: str) -> np.random.Generator:
    """Random numbers of one clip, whatever other clips there are."""
    return np.random.default_rng([seed, *name.encode()])
