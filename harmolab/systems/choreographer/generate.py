"""Dances made of recorded beats: the contract of `harmolab.systems`, and all that there is to say about a dance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from harmolab.beats.audio import music_beats
from harmolab.io.files import PathLike, Progress, silent
from harmolab.metrics.body_measures import SHORTEST
from harmolab.metrics.likeness import LikenessLimits
from harmolab.params import DANCES
from harmolab.shape_speed import ShapeSignal, shape_signal, shape_speed
from harmolab.skeletons import Skeleton
from harmolab.systems.choreographer import choreography as report
from harmolab.systems.choreographer.choose import beats_between, choose
from harmolab.systems.choreographer.choreography import Choreography
from harmolab.systems.choreographer.lay import Ending, beat_numbers, danced, runs_of
from harmolab.systems.choreographer.moves import Course, Moves, moves_of, pattern_shares
from harmolab.systems.choreographer.params import ChoreographerParams
from harmolab.systems.choreographer.pulse import pulse
from harmolab.systems.choreographer.store import Kept, load_takes, save_takes
from harmolab.systems.choreographer.takes import Item, Take, meter_of, read_takes, same_skeleton, take_of
from harmolab.systems.common.about import json_file, weights_stem
from harmolab.systems.common.length import n_frames
from harmolab.types import Audio, BeatTrack, Clip, Motion

LEAST_FPS, MOST_FPS = 25.0, 120.0
DEFAULT_PERIOD = 0.5  # seconds between beats where neither the music nor the recordings have any


class Choreographer:
    """Dances to any music, of recorded beats.

    Parameters
    ----------
    takes : recordings of one skeleton
    params : ChoreographerParams, optional
    notes : lines about recordings that could not be read
    limits : LikenessLimits of the recordings; computed when they are asked for and were not given

    Raises
    ------
    ValueError
        There is no recording, or there are two skeletons.
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

    @classmethod
    def of(cls, items: Iterable[Item], *, params: ChoreographerParams | None = None) -> Self:
        """A choreographer of recordings, clips or motions, of one skeleton.

        Where all beats of a recording are known (`Recording`, `Clip.beats`) it is cut at them; a motion is cut at its
        own rests. Motions are kept to the millimetre.

        Raises
        ------
        ValueError
            One has no motion in three dimensions, or there are none, or two skeletons.
        """
        return cls([take_of(item, number) for number, item in enumerate(items, 1)], params=params)

    @classmethod
    def load(cls, folder: PathLike, *, params: ChoreographerParams | None = None) -> Self:
        """The choreographer that was saved in a folder; or one of the recordings or motion files there.

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
        """A choreographer of corpora: folders of recordings, or of bare motion files, or such files; errors name them.

        The music of recordings is not listened to: one without annotated beats is cut at its own rests. `scale` is
        metres in one unit of the files, if they do not say (`harmolab.io.motion.load_motion`).
        """
        corpus = read_takes(data, scale=scale, progress=progress)
        return cls(corpus.takes, params=params, notes=corpus.notes)

    def save(self, folder: PathLike) -> None:
        """Write the recordings, not the music, and their `limits` to a folder; it is made unless it exists."""
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
        """The choreographer of corpora, saved in `out`: there is nothing to train, so `seed` and `resume` do nothing.

        Of the further keywords of other systems none has a meaning here.

        Raises
        ------
        ValueError
            A corpus cannot be used, `out` holds something else, or for an unknown keyword.
        """
        if unknown := sorted(more.keys() - {"report", "notice"}):
            raise ValueError(f"a choreographer has no setting {unknown[0]!r}: it learns nothing but bar patterns")
        if Path(out).is_dir() and any(Path(out).iterdir()) and not json_file(weights_stem(out)).is_file():
            raise ValueError(f"{out}: holds something else; name a new or empty folder")
        choreographer = cls.read(data, progress=progress)
        choreographer.save(out)
        return choreographer

    @property
    def fps(self) -> float:
        """Frame rate of the dances: that of the recordings, within 25 to 120."""
        usual = float(np.median([take.motion.fps for take in self.takes]))
        return min(max(usual, LEAST_FPS), MOST_FPS)

    @property
    def limits(self) -> LikenessLimits | None:
        """Range of each measure of likeness in these recordings; None where none is long enough to be measured."""
        if self._limits is None and any(take.motion.duration >= SHORTEST for take in self.takes):
            motions, dances = [take.motion for take in self.takes], [take.dance for take in self.takes]
            self._limits = LikenessLimits.of(motions, dances)
        return self._limits

    @property
    def dances(self) -> tuple[str, ...]:
        """Names of the dances that were recorded."""
        return tuple(sorted({take.dance for take in self.takes} - {""}))

    def generate(
        self,
        audio: Audio,
        beats: BeatTrack | None = None,
        *,
        start: float = 0.0,
        seconds: float | None = None,
        seed: int = 0,
        initial: Motion | None = None,
        dance: str = "",
        plant_feet: bool = True,
        progress: Progress = silent,
    ) -> Motion:
        """The motion of `choreograph` (`harmolab.systems.System`)."""
        return self.choreograph(
            audio, beats, start=start, seconds=seconds, seed=seed, initial=initial, dance=dance, plant_feet=plant_feet,
            progress=progress,
        ).motion  # fmt: skip

    def choreograph(
        self,
        audio: Audio,
        beats: BeatTrack | None = None,
        *,
        start: float = 0.0,
        seconds: float | None = None,
        seed: int = 0,
        initial: Motion | None = None,
        dance: str = "",
        plant_feet: bool = True,
        progress: Progress = silent,
    ) -> Choreography:
        """A dance to music, and what it is made of; its frame 0 belongs to the audio time `start`.

        Parameters
        ----------
        audio : Audio, the whole recording
        beats : BeatTrack on the audio time line; tracked when left out, with the tempo of `dance` as prior
            Where it knows "one" (`bar_places`), recorded bars are laid on its bars.
        start, seconds : float, seconds; to the end of the music when `seconds` is left out or longer
        seed : int; with the beats it draws what else would be as good: another seed, or song, another dance
        initial : Motion of the same joints that the dance goes on from, in place and pose
        dance : name of the dance to take from a corpus of several
        plant_feet : bool
            Keep feet that carry from sliding (`harmolab.systems.common.grounding`).
        progress : function(iterable, label) -> iterable

        Raises
        ------
        ValueError
            If `start` or `seconds` lies outside the music, `dance` is unknown to both the corpus and the tempo table,
            or `initial` is of other joints or two-dimensional.
        """
        frames = n_frames(audio, start, seconds, self.fps)
        self._check_initial(initial)
        takes, notes = self._of_dance(dance)
        track = music_beats(Clip("", audio, beats=beats, dance=dance))
        is_own_pulse = not takes[0].beats.size
        period = DEFAULT_PERIOD if is_own_pulse else float(np.median(np.concatenate([np.diff(t.beats) for t in takes])))
        end = start + (frames - 1) / self.fps
        music = beats_between(track, start, end, meter=meter_of(track, dance), period=period)
        moves = self._moves_of(takes, music.period)
        lead = float(beat_numbers(music, np.array([start]))[0])
        ending = None
        if initial is not None:
            ending = Ending(initial, lead, float(music.times[1] - music.times[0]), moves, self.params)
        costs = None if ending is None else ending.costs()
        path = choose(moves, music, self.params, seed=seed, first=costs, progress=progress)
        turn, shift = (1.0, 0.0) if ending is None else ending.fit(int(path[0]))
        runs = runs_of(moves, path, self.params, turn=turn, shift=shift)
        numbers = beat_numbers(music, start + np.arange(frames) / self.fps)
        positions = danced(moves, runs, numbers, self.fps, plant_feet=plant_feet, initial=initial)
        mean, worst = report.seam_sizes(runs, self.params)
        minutes = report.distinct_minutes(moves, self.params)
        stretch, repeated = report.repetition(moves, path, self.params)
        about = report.warnings_of(
            moves, music, worst=worst, minutes=minutes, is_own_pulse=is_own_pulse, has_beats=len(track) > 1
        )
        return Choreography(
            motion=Motion(positions, self.fps, self.skeleton),
            start=start,
            pieces=report.pieces_of(moves, runs, music, start),
            mean_seam_cm=mean,
            worst_seam_cm=worst,
            distinct_minutes=minutes,
            longest_stretch=stretch,
            seen_before=repeated,
            shares=report.recording_shares(moves, path),
            stretch=float(np.abs(report.stretches(moves, path, music)).mean()),
            warnings=(*notes, *about),
        )

    def _check_initial(self, initial: Motion | None) -> None:
        if initial is not None and initial.skeleton.joints != self.skeleton.joints:
            joints = f"({len(initial.skeleton.joints)}) than the recordings ({len(self.skeleton.joints)})"
            raise ValueError(f"initial has other joints {joints}; retarget it first")
        if initial is not None and initial.positions.shape[2] != 3:
            raise ValueError("initial is two-dimensional; the recordings are in three dimensions")

    def _of_dance(self, dance: str) -> tuple[tuple[Take, ...], list[str]]:
        """The takes to dance from: of the asked dance if there are any, with beats or all without; and what to say."""
        if dance and dance not in {*DANCES, *self.dances}:
            raise ValueError(f"unknown dance {dance!r}; known: {', '.join(sorted({*DANCES, *self.dances}))}")
        notes, takes = [], tuple(take for take in self.takes if take.dance == dance) if dance else self.takes
        if not takes:
            takes = self.takes
            names = ", ".join(self.dances) or "what is there"
            notes.append(f"there is no {dance} among these recordings: danced is {names}")
        if len(mixed := sorted({take.dance for take in takes} - {""})) > 1:
            notes.append(f"recordings of {', '.join(mixed)} are mixed; name one of them (--dance) to keep to it")
        timed = tuple(take for take in takes if take.beats.size)
        bare = tuple(take for take in takes if not take.beats.size)
        if not timed or not bare:
            return takes, notes
        used, unused = (timed, bare) if _seconds(timed) >= _seconds(bare) else (bare, timed)
        notes.append(f"{len(unused)} of {len(takes)} recordings are left out: beats are known of some only")
        return used, notes

    def _moves_of(self, takes: tuple[Take, ...], period: float) -> Moves:
        """The nodes of takes: cut at their beats, or at their own rests with the song's period."""
        if takes[0].beats.size:
            if takes not in self._moves:
                courses = [Course(take, take.beats) for take in takes]
                self._moves[takes] = moves_of(courses, self.params, pattern_shares(takes))
            return self._moves[takes]
        courses = []
        for take in takes:
            if take not in self._signals:
                self._signals[take] = shape_signal(shape_speed(take.motion))
            beats = pulse(self._signals[take], period)
            if beats.size > 1:
                courses.append(Course(take, beats))
        if not courses:
            raise ValueError(f"no recording is long enough for two beats of {period:.2f} s")
        return moves_of(courses, self.params)


def _seconds(takes: Iterable[Take]) -> float:
    return sum(take.seconds for take in takes)
