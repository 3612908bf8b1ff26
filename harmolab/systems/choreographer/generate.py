"""The choreographer: dances that are made of beats of recorded movement, and an account of what each is made of."""

import hashlib
import shutil
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from importlib.metadata import version
from itertools import islice
from pathlib import Path
from typing import Any, Self

import numpy as np

from harmolab.body.skeletons import Skeleton, side_pairs
from harmolab.files import PathLike, Progress, cache_folder, silent
from harmolab.metrics.likeness import SHORTEST, LikenessLimits
from harmolab.shape_speed import ShapeSignal, shape_signal, shape_speed
from harmolab.systems.choreographer import lay
from harmolab.systems.choreographer.form import Form, pace
from harmolab.systems.choreographer.moves import ChoreographerParams, Course, Moves, moves_of, pattern_shares, pulse
from harmolab.systems.choreographer.takes import (
    Item,
    Kept,
    Take,
    load_takes,
    meter_of,
    mirrored,
    read_takes,
    same_skeleton,
    save_takes,
    take_of,
)
from harmolab.systems.training.about import corpora, json_file, read_about, weights_stem
from harmolab.systems.training.requests import DanceRequest, DanceSystem, check_initial
from harmolab.types import Audio, BeatTrack, BoolArray, IntArray, Motion

# A dance, and what it is made of: recordings, seams, how much of it is new, warnings

VISIBLE_SEAM = 18.0  # centimetres above which a faded seam can be seen
LEAST_MINUTES, ENOUGH_MINUTES = 1.0, 2.0
OTHER_TEMPO = 0.2  # share by which a tempo may be another before the dance suffers
TOO_LITTLE = "too little motion for this song"


@dataclass(frozen=True)
class Piece:
    """Beats of one recording that are danced in a row: a part of a `Choreography`.

    Parameters
    ----------
    recording : str
        Name of the recording.
    first_beat, last_beat : int
        It is danced from the one beat of the recording to the other; the first beat is 0.
    source_start, source_end : float, seconds
        Their times in the recording's motion.
    seam_cm : float, centimetres
        Size of the seam with which it begins, a distance of the joints; 0 for the first piece.
    start : float, seconds
        When it begins in the dance; negative where its first beat lies before the dance.
    """

    recording: str
    first_beat: int
    last_beat: int
    source_start: float
    source_end: float
    seam_cm: float
    start: float


@dataclass(frozen=True, eq=False)
class Choreography:
    """A dance of the choreographer, and what it is made of.

    A *seam* is where the dance goes over from one recording to another. Its size is the distance of the joints there,
    after the best turn and shift, in centimetres.

    Parameters
    ----------
    motion : Motion
        Its first frame stands at second `start` of the music.
    start : float, seconds
    pieces : tuple of Piece
        The beats of recordings that it is made of, in order.
    mean_seam_cm, worst_seam_cm : float, centimetres
        Mean and largest seam. Seams below 1.5 cm, to the same figure in another recording, are left out of the mean. 0
        without seams.
    distinct_minutes : float, minutes
        Movement of the recordings, without beats that look like earlier ones.
    longest_stretch : int
        Most beats in a row that one recording also has.
    seen_before : float from 0 to 1
        Share of the beats that look like an earlier beat of this dance. The mirror image of an earlier beat does not
        count: it is another movement.
    shares : dict
        Name of a recording -> share of the beats that it gave, largest first.
    stretch : float
        How much the tempo of the recordings was changed: mean |log| of the change; .03 is 3 %.
    warnings : tuple of str
        Sentences to be read by whoever makes the dance.
    form : str
        The quiet, loud and silent parts of the music, in words; "" where it has none.
    held : (T,) bool array
        Frames in which the pose is held, since the music is silent or the dance at its end.
    """

    motion: Motion
    start: float
    pieces: tuple[Piece, ...]
    mean_seam_cm: float
    worst_seam_cm: float
    distinct_minutes: float
    longest_stretch: int
    seen_before: float
    shares: Mapping[str, float]
    stretch: float
    warnings: tuple[str, ...]
    form: str
    held: BoolArray


def pieces_of(moves: Moves, runs: list[lay.Run], music: lay.MusicBeats, start: float) -> tuple[Piece, ...]:
    """The runs of a dance, by name and time."""
    pieces = []
    for run in runs:
        course, last = moves.courses[run.course], run.beat + run.last - run.first
        begins, ends = course.beats[[run.beat, last]].tolist()
        begin = float(music.times[run.first]) - start
        pieces.append(Piece(course.take.name, run.beat, last, begins, ends, run.seam, begin))
    return tuple(pieces)


def seam_sizes(runs: list[lay.Run], params: ChoreographerParams) -> tuple[float, float]:
    """Mean and worst seam, centimetres; those below a twin's are left out of the mean."""
    seams = np.array([run.seam for run in runs[1:]])
    real = seams[seams >= params.twin]
    return float(real.mean()) if real.size else 0.0, float(seams.max(initial=0.0))


def distinct_minutes(moves: Moves, params: ChoreographerParams) -> float:
    """Minutes of the beats that no earlier beat looks like."""
    is_new = np.ones(len(moves), bool)
    for first in range(0, len(moves), 500):
        rows = np.arange(first, min(first + 500, len(moves)))
        is_new[rows] = ~(_twins(moves, rows, params) & (np.arange(len(moves)) < rows[:, None])).any(axis=1)
    return float(moves.lengths[is_new & ~moves.gaps].sum()) / 60


def _twins(moves: Moves, nodes: IntArray, params: ChoreographerParams) -> BoolArray:
    """Which nodes look like each of `nodes`, (P, N); each like itself."""
    twins = moves.alike.rows(nodes) < params.twin
    twins[np.arange(nodes.size), nodes] = True
    return twins


def repetition(moves: Moves, path: IntArray, params: ChoreographerParams) -> tuple[int, float]:
    """The longest stretch of beats that one recording also has, and the share of beats that look like earlier ones."""
    twins = _twins(moves, path, params)
    is_repeated = np.triu(twins[:, path].T, k=1).any(axis=0)
    before = np.full(len(moves), -1)
    before[moves.following[moves.following >= 0]] = np.flatnonzero(moves.following >= 0)
    stretch, longest = np.zeros(len(moves), np.int64), 0
    for row in twins:
        stretch = np.where(row, np.where(before >= 0, stretch[before], 0) + 1, 0)
        longest = max(longest, int(stretch.max()))
    return longest, float(is_repeated.mean())


def recording_shares(moves: Moves, path: IntArray) -> dict[str, float]:
    """Share of the beats by recording, largest first."""
    counts = np.bincount(moves.course[path], minlength=len(moves.courses)) / path.size
    order = np.argsort(-counts, kind="stable")
    return {moves.courses[number].take.name: float(counts[number]) for number in order.tolist() if counts[number]}


def warnings_of(
    moves: Moves, music: lay.MusicBeats, *, worst: float, minutes: float, is_own_pulse: bool, has_beats: bool
) -> tuple[str, ...]:
    """Sentences about what this corpus cannot do for this song."""
    lines = []
    if not has_beats:
        lines.append("no beats are heard in this music: the dance keeps a tempo of its own")
    if worst > VISIBLE_SEAM or minutes < LEAST_MINUTES:
        reason = f"{minutes:.1f} distinct minutes" if minutes < LEAST_MINUTES else f"a seam of {worst:.0f} cm shows"
        rule = f": {ENOUGH_MINUTES:g} distinct minutes of a dance are enough, {LEAST_MINUTES:g} is the least"
        lines.append(f"{TOO_LITTLE} ({reason}){rule if minutes < ENOUGH_MINUTES else ''}")
    ratio = float(np.median(moves.lengths)) / music.period
    if not is_own_pulse and has_beats and abs(ratio - 1) > OTHER_TEMPO:
        pace = "faster" if ratio > 1 else "slower"
        lines.append(
            f"the music ({60 / music.period:.0f} bpm) is {100 * abs(ratio - 1):.0f} % {pace} than the recorded dancing "
            f"({60 / float(np.median(moves.lengths)):.0f} bpm)"
        )
    return (*lines, *_bar_warning(moves, music, is_own_pulse))


def _bar_warning(moves: Moves, music: lay.MusicBeats, is_own_pulse: bool) -> tuple[str, ...]:
    """A sentence where the bar is not danced, and why."""
    if is_own_pulse or moves.meter == 0:
        return ("the bar is not danced: where it begins in these recordings is not known",)
    if music.meter == 0:
        return ('"one" of this music is not known, so the bar is not danced; say where a bar begins (--one SECONDS)',)
    if not (moves.meters == music.meter).any():
        return (f"the bar is not danced: the music has {music.meter} beats in a bar, these recordings {moves.meter}",)
    return ()


# The choreographer

# Mirrored takes double the time that a choice takes. Of five minutes they make no seam smaller; of two they do.
FEW_SECONDS, ENOUGH_SHARE = 180.0, 1.5  # of recordings, and of the length of a dance
LEAST_FPS, MOST_FPS = 25.0, 120.0
STILL = 1e-9  # beats from one frame to the next
DEFAULT_PERIOD = 0.5  # seconds between beats where neither the music nor the recordings have any; usual for the latter


def _is_choreographer(folder: PathLike) -> bool:
    """True for the folder of a choreographer that was saved."""
    with suppress(ValueError, OSError):
        return bool(read_about(folder).get("system") == "choreographer")
    return False


class Choreographer(DanceSystem):
    """A system that dances to any music with recorded movement: it lays recorded beats on the beats of the music.

    Make one with `Choreographer.of` (recordings, clips or motions), `Choreographer.read` (folders or files),
    `Choreographer.load`, or take the movement that comes with harmolab (`shipped_bank`). `generate` is that of all
    systems (`System`), with two more keywords: ``dance``, the one to take from recordings of several, and
    ``plant_feet``, whether feet that carry are kept from sliding. `choreograph` also says what a dance is made of.

    Parameters
    ----------
    takes : sequence of Take
        Recordings of one skeleton.
    params : ChoreographerParams, optional
        What a seam, another tempo or a repetition costs.
    notes : iterable of str
        Lines about recordings that could not be read.
    limits : LikenessLimits
        Of the recordings; computed when they are needed and were not passed.

    Raises
    ------
    ValueError
        If there is no recording, or two have other joints.

    Examples
    --------
    >>> dancer = Choreographer.read(["my_recordings"])  # doctest: +SKIP
    >>> motion = dancer.generate(audio, seconds=20.0, seed=3)  # doctest: +SKIP
    """

    def __init__(
        self,
        takes: Sequence[Take],
        *,
        params: ChoreographerParams | None = None,
        notes: Iterable[str] = (),
        limits: LikenessLimits | None = None,
    ) -> None:
        self.takes, self.params, self.notes = tuple(takes), params or ChoreographerParams(), tuple(notes)
        self.skeleton: Skeleton = same_skeleton(self.takes)
        self._limits = limits
        self._moves: dict[tuple[Take, ...], Moves] = {}
        self._signals: dict[Take, ShapeSignal] = {}
        self._mirrored: dict[Take, Take] = {}

    @classmethod
    def of(cls, items: Iterable[Item], *, params: ChoreographerParams | None = None) -> Self:
        """A choreographer with recordings, clips or motions in memory, all of one skeleton.

        Where all beats of a recording are known (`Recording`, `Clip.beats`) it is cut at them; a motion is cut at its
        own rests. Positions are rounded to the millimetre.

        Parameters
        ----------
        items : iterable of Recording, Clip or Motion, three-dimensional
        params : ChoreographerParams, optional

        Raises
        ------
        ValueError
            If one has no motion in three dimensions, there are none, or two have other joints.
        """
        return cls([take_of(item, number) for number, item in enumerate(items, 1)], params=params)

    @classmethod
    def load(cls, folder: PathLike, *, params: ChoreographerParams | None = None) -> Self:
        """The choreographer that was saved in a folder; else one with the recordings or motion files there.

        Raises
        ------
        FileNotFoundError, ValueError
            Both name the file or folder.
        """
        if json_file(weights_stem(folder)).is_file():
            kept = load_takes(folder)
            return cls(kept.takes, params=params, notes=kept.notes, limits=kept.limits)
        return cls.read([folder], params=params)

    @classmethod
    def read(
        cls,
        data: Iterable[PathLike],
        *,
        params: ChoreographerParams | None = None,
        scale: float | None = None,
        progress: Progress = silent,
    ) -> Self:
        """A choreographer with the movement of files: folders of recordings, folders of motion files, or such files.

        The music of recordings is not read: one without annotated beats is cut at its own rests.

        Parameters
        ----------
        data : iterable of str or path
        params : ChoreographerParams, optional
        scale : float
            Metres in one unit of the files, where they do not say it (`harmolab.load_motion`).
        progress : function(iterable, label) -> iterable
            Reports on the files, such as a progress bar.

        Raises
        ------
        FileNotFoundError, ValueError
            Both name the file or folder.
        """
        corpus = read_takes(corpora(data), scale=scale, progress=progress)
        return cls(corpus.takes, params=params, notes=corpus.notes)

    def save(self, folder: PathLike) -> None:
        """Write the recorded movement, not the music, and its `limits` to a folder, which is made if there is none."""
        save_takes(folder, Kept(self.takes, self.notes, self.limits))

    @classmethod
    def train(
        cls,
        data: Sequence[PathLike],
        out: PathLike,
        *,
        seed: int = 1,
        resume: bool = False,
        progress: Progress = silent,
        **more: Any,
    ) -> Self:
        """A choreographer with the movement of corpora, saved in a folder, as all systems are trained.

        There is nothing to train, so that `seed` and `resume` do nothing.

        Parameters
        ----------
        data : sequence of str or path
            Folders of recordings.
        out : str or path
            New or empty, or of an earlier choreographer.

        Raises
        ------
        ValueError
            If a corpus cannot be used, `out` holds something else, or for an unknown keyword.
        """
        if unknown := sorted(more.keys() - {"report", "notice"}):
            raise ValueError(f"a choreographer has no setting {unknown[0]!r}: it learns nothing but bar patterns")
        if Path(out).is_file() or (Path(out).is_dir() and any(Path(out).iterdir()) and not _is_choreographer(out)):
            raise ValueError(f"{out}: holds something else; name a new or empty folder")
        choreographer = cls.read(data, progress=progress)
        choreographer.save(out)
        return choreographer

    @property
    def fps(self) -> float:
        """Frame rate of the dances: that of the recordings, within 25 to 120."""
        return float(np.clip(np.median([take.motion.fps for take in self.takes]), LEAST_FPS, MOST_FPS))

    @property
    def limits(self) -> LikenessLimits | None:
        """Range of each measure of likeness in these recordings; None where none is long enough to be measured."""
        if self._limits is None and any(take.motion.duration >= SHORTEST for take in self.takes):
            self._limits = LikenessLimits.of([take.motion for take in self.takes], [take.dance for take in self.takes])
        return self._limits

    @property
    def dances(self) -> tuple[str, ...]:
        """Names of the dances that were recorded."""
        return tuple(sorted({take.dance for take in self.takes} - {""}))

    def respond(self, request: DanceRequest) -> Motion:
        """The motion of `choreograph`, for a request (`harmolab.systems.training.requests.DanceRequest`)."""
        return self.composed(request).motion

    def choreograph(self, audio: Audio, beats: BeatTrack | None = None, **options: Any) -> Choreography:
        """Dance to music, and say what the dance is made of.

        Parameters
        ----------
        audio : Audio
            The whole recording.
        beats : BeatTrack
            Beats on the audio's time line. When left out a program finds them, among the tempi of `dance` where it is
            told. Where bars are known (`BeatTrack.bar_places`), recorded bars are laid on them.
        **options
            ``start``, ``seconds``, ``seed`` and ``initial`` as in `System.generate`. Another seed gives another dance
            that is about as good. ``dance`` is the one to take from recordings of several; ``plant_feet=False`` leaves
            feet that carry as they are; ``progress`` reports on the beats.

        Returns
        -------
        Choreography

        Raises
        ------
        ValueError
            If `start` or `seconds` lies outside the music, `dance` is unknown to both the corpus and the tempo table,
            or `initial` is of other joints or two-dimensional.
        """
        return self.composed(DanceRequest(audio, beats, **options))

    def composed(self, request: DanceRequest) -> Choreography:
        """`choreograph` for a request (`harmolab.systems.training.requests.DanceRequest`)."""
        start, initial, dance = request.start, request.initial, request.dance or ""
        frames = request.n_frames(self.fps)
        if initial is not None:
            check_initial(initial, self.skeleton, "the recordings")
        request.check_dance(self.dances)
        takes, notes = self._of_dance(dance)
        track = request.track()
        is_own_pulse, period = not takes[0].beats.size, DEFAULT_PERIOD
        if not is_own_pulse:
            period = float(np.median(np.concatenate([np.diff(take.beats) for take in takes])))
        end = start + (frames - 1) / self.fps
        beats_from = partial(lay.beats_between, track, end=end, meter=meter_of(track, dance), period=period)
        form, music = Form.of(request.audio), beats_from(start)
        music = form.danced_beats(beats_from(form.before_silence(music, start)), end, period)
        moves = self._moves_of(takes, music.period, frames / self.fps)
        lead = float(lay.beat_numbers(music, np.array([start]))[0])
        beat = float(music.times[1] - music.times[0])
        ending = None if initial is None else lay.Ending(initial, lead, beat, moves, self.params)
        costs = None if ending is None else ending.costs()
        path = lay.choose(moves, music, self.params, seed=request.seed, first=costs, progress=request.progress)
        turn, shift = (1.0, 0.0) if ending is None else ending.fit(int(path[0]))
        runs = lay.runs_of(moves, path, self.params, turn=turn, shift=shift)
        numbers = lay.beat_numbers(music, start + np.arange(frames) / self.fps)
        positions = lay.danced(moves, runs, numbers, self.fps, plant_feet=request.plant_feet, initial=initial)
        mean, worst = seam_sizes(runs, self.params)
        minutes, (stretch, repeated) = distinct_minutes(moves, self.params), repetition(moves, path, self.params)
        about = warnings_of(
            moves, music, worst=worst, minutes=minutes, is_own_pulse=is_own_pulse, has_beats=len(track) > 1
        )
        return Choreography(
            motion=Motion(positions, self.fps, self.skeleton),
            start=start,
            pieces=pieces_of(moves, runs, music, start),
            mean_seam_cm=mean,
            worst_seam_cm=worst,
            distinct_minutes=minutes,
            longest_stretch=stretch,
            seen_before=repeated,
            shares=recording_shares(moves, path),
            stretch=float(np.abs(np.log(music.lengths / moves.lengths[path])).mean()),
            warnings=(*notes, *about),
            form=form.in_words(start, end, music.period),
            held=np.diff(numbers, prepend=-1.0) < STILL,
        )

    def _of_dance(self, dance: str) -> tuple[tuple[Take, ...], list[str]]:
        """The takes to dance from: of the asked dance if there are any, with beats or all without; and what to say."""
        notes, takes = [], tuple(take for take in self.takes if take.dance == dance) if dance else self.takes
        if not takes:
            takes = self.takes
            names = ", ".join(self.dances) or "what is there"
            notes.append(f"there is no {dance} among these recordings, so {names} is danced")
        if len(mixed := sorted({take.dance for take in takes} - {""})) > 1:
            notes.append(f"recordings of {', '.join(mixed)} are mixed; name one of them (--dance) to keep to it")
        timed = tuple(take for take in takes if take.beats.size)
        bare = tuple(take for take in takes if not take.beats.size)
        used = timed if sum(take.seconds for take in timed) >= sum(take.seconds for take in bare) else bare
        if timed and bare:
            left = len(takes) - len(used)
            notes.append(f"{left} of {len(takes)} recordings are left out: those with and without beats do not mix")
        return used, notes

    def _moves_of(self, takes: tuple[Take, ...], period: float, seconds: float = 0.0) -> Moves:
        """The nodes of takes: cut at their beats, or at their own rests with the song's period.

        Of the latter, which know no bar that begins with one foot, the mirrored takes may join: where the recordings
        are few, or short beside the `seconds` of the dance.
        """
        if takes[0].beats.size:
            if takes not in self._moves:
                courses = [Course(take, take.beats) for take in takes]
                self._moves[takes] = moves_of(courses, self.params, pattern_shares(takes))
            return self._moves[takes]
        courses = []
        for take in takes:
            if take not in self._signals:
                self._signals[take] = shape_signal(shape_speed(take.motion))
            beats = pulse(self._signals[take], pace(period, DEFAULT_PERIOD))
            if beats.size > 1:
                courses.append(Course(take, beats))
        if sum(take.seconds for take in takes) < max(FEW_SECONDS, ENOUGH_SHARE * seconds) and side_pairs(self.skeleton):
            courses += [Course(self._mirror(course.take), course.beats) for course in courses]
        if not courses:
            raise ValueError(f"no recording is long enough for two beats of {period:.2f} s")
        return moves_of(courses, self.params)

    def _mirror(self, take: Take) -> Take:
        """The take with its sides exchanged, once for all songs."""
        if take not in self._mirrored:
            self._mirrored[take] = mirrored(take)
        return self._mirrored[take]


# Corpora that were read before are kept, not read and measured again

SIGNATURE = 5  # raise it when the same files give another choreographer than before, within a version
MOST_FILES = 50_000  # below a folder that holds more nothing is kept


def load_corpus(corpus: PathLike, *, scale: float | None = None, progress: Progress = silent) -> Choreographer:
    """The choreographer of a corpus, a saved model or a motion file, with its limits of likeness.

    What was read once is kept in the user's cache (`harmolab.files.cache_folder`), as long as no file below the
    folder changes in name, size or time, and for this version of harmolab. `scale` is as in `Choreographer.read`.

    Raises
    ------
    FileNotFoundError, ValueError
        As `Choreographer.read`; both name the file or folder.
    """
    if (Path(corpus) / "model.json").is_file():
        return Choreographer.load(corpus)
    place = _place(Path(corpus), scale)
    if place is not None:
        with suppress(OSError, ValueError):
            return Choreographer.load(place)
    choreographer = Choreographer.read([corpus], scale=scale, progress=progress)
    return choreographer if place is None else _keep(choreographer, place)


def _place(corpus: Path, scale: float | None) -> Path | None:
    """The folder in the cache for a corpus as it is now; None where nothing is kept."""
    if (folder := cache_folder()) is None:
        return None
    paths = [corpus] if corpus.is_file() else corpus.rglob("*")
    files = list(islice((path for path in paths if path.is_file()), MOST_FILES + 1))
    if not 0 < len(files) <= MOST_FILES:
        return None
    lines = [f"{path.relative_to(corpus)} {path.stat().st_size} {path.stat().st_mtime_ns}" for path in files]
    read = f"{version('harmolab')} {SIGNATURE} {scale} {sorted(lines)}"
    return folder / "corpora" / f"{_digest(str(corpus.resolve()))}_{_digest(read)}"


def _digest(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogateescape")).hexdigest()[:24]


def _keep(choreographer: Choreographer, place: Path) -> Choreographer:
    """Keep a choreographer in place of what was kept of the same folder; it comes back as it will be read.

    A cache that cannot be written is no error, nor is a corpus of more than is kept.
    """
    with suppress(OSError, ValueError):
        choreographer.save(place)
        for older in place.parent.glob(f"{place.name.partition('_')[0]}_*"):
            if older != place:
                shutil.rmtree(older, ignore_errors=True)
        return Choreographer.load(place)
    return choreographer
