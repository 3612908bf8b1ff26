"""The recordings that a choreographer takes beats from, and where they come from: folders, files, clips, motions."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from harmolab.corpora.folders import Recording, find_recordings, load_any_motion, recorded_offset, recording_files
from harmolab.corpora.synthetic.clip import PlantedClip
from harmolab.io.beats import BeatAnnotation, load_annotation
from harmolab.io.files import PathLike, Progress, silent
from harmolab.params import DANCES
from harmolab.skeletons import Skeleton, tree_order
from harmolab.types import BeatTrack, Clip, FloatArray, IntArray, Motion

MILLIMETRE = 0.001  # metres: to this the places of joints are kept
FARTHEST = 32.0  # metres from the middle of a recording
SUFFIXES = (".npz", ".bvh", ".npy", ".pkl", ".json")
_NO_TIMES, _NO_PLACES = np.zeros(0), np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class Take:
    """One recording: its motion, and the beats of its music where they are known.

    Parameters
    ----------
    name : str
    motion : Motion, three-dimensional; the middle of its way is at x = z = 0, its floor at 0
    dance : str, "" when unknown
    beats : (B,) array, seconds from the motion's first frame; two or more, or none when unknown
    places : (B,) array, place of each beat in its bar; empty when unknown
    meter : int, beats in a bar; 0 when unknown
    """

    name: str
    motion: Motion
    dance: str = ""
    beats: FloatArray = field(default_factory=lambda: _NO_TIMES)
    places: IntArray = field(default_factory=lambda: _NO_PLACES)
    meter: int = 0

    @property
    def seconds(self) -> float:
        """Time of the last frame."""
        return (self.motion.n_frames - 1) / self.motion.fps

    @property
    def track(self) -> BeatTrack:
        """The beats as a track on the motion's time line."""
        places = self.places if self.places.size else None
        return BeatTrack(self.beats, np.ones(self.beats.size), 100.0, self.motion.duration, places)


Item = Recording | PlantedClip | Clip | Motion | Take


def take_of(item: Item, number: int = 1) -> Take:
    """A recording, clip or motion as a `Take`; ValueError where it has no motion in three dimensions."""
    if isinstance(item, Take):
        return item
    if isinstance(item, Recording | PlantedClip):
        clip, annotation = item.clip, item.annotation
        beats = clip.beats if annotation is None else annotation.track(clip.audio.duration)
        return _take_of_clip(replace(clip, beats=beats), None if annotation is None else annotation.meter)
    return _take_of_clip(item) if isinstance(item, Clip) else _take(f"motion {number}", item)


def _take_of_clip(clip: Clip, meter: int | None = None) -> Take:
    if clip.motion is None:
        raise ValueError(f"{clip.name}: there is no motion to take beats from")
    return _take(clip.name, clip.motion, clip.dance, clip.beats, clip.offset, meter)


def _take(
    name: str, motion: Motion, dance: str = "", track: BeatTrack | None = None, offset: float = 0.0,
    meter: int | None = None,
) -> Take:  # fmt: skip
    """A take of a motion whose first frame is at `offset` seconds of the music that `track` belongs to."""
    take = Take(name, _kept(name, motion), dance)
    inside = np.zeros(0, bool)
    if track is not None:
        inside = (track.times >= offset) & (track.times <= offset + take.seconds)
    if track is None or inside.sum() < 2:
        return take
    places = _NO_PLACES if track.bar_places is None else track.bar_places[inside]
    bar = 0 if track.bar_places is None else meter or meter_of(track, dance)
    return replace(take, beats=track.times[inside] - offset, places=places, meter=bar)


def meter_of(track: BeatTrack, dance: str = "") -> int:
    """Beats in a bar of a track: as many places as occur, or those of the dance where no bar is whole; 0: unknown."""
    places = track.bar_places
    counted = 0 if places is None or places.size == 0 else int(places.max()) + 1
    usual = DANCES[dance].meter if dance in DANCES else 0
    is_short = places is not None and places.size < usual  # less than a bar does not show all of its places
    return usual if is_short and counted else counted


def _kept(name: str, motion: Motion) -> Motion:
    """A motion in the middle of the room and on the floor, to the millimetre, as it is saved."""
    if motion.positions.shape[2] != 3:
        raise ValueError(f"{name}: is two-dimensional; a choreographer needs motion in three dimensions, metres, y up")
    tree_order(motion.skeleton.parents)
    middle = motion.positions.mean(axis=(0, 1))
    middle[1] = np.median(motion.positions[..., 1].min(axis=1))
    steps = np.round((motion.positions - middle) / MILLIMETRE)
    if np.abs(steps).max() * MILLIMETRE > FARTHEST:
        raise ValueError(f"{name}: reaches over {FARTHEST:g} m from its middle; are these metres?")
    return replace(motion, positions=steps * MILLIMETRE)


def same_skeleton(takes: Sequence[Take]) -> Skeleton:
    """The skeleton of all takes; ValueError where there is none, or more than one, with what to do."""
    if not takes:
        raise ValueError("a choreographer needs a recording at least, got none")
    first = takes[0]
    for take in takes:
        if take.motion.skeleton != first.motion.skeleton:
            sizes = [len(one.motion.skeleton.joints) for one in (first, take)]
            raise ValueError(
                f"{first.name} and {take.name} have different skeletons ({sizes[0]} and {sizes[1]} joints); a dance is "
                "made from one: name a folder that holds one of them"
            )
    return first.motion.skeleton


@dataclass(frozen=True)
class ReadTakes:
    """The takes of a corpus, and a line about each file or folder that could not be used."""

    takes: tuple[Take, ...]
    notes: tuple[str, ...]


def read_takes(roots: Iterable[PathLike], *, scale: float | None = None, progress: Progress = silent) -> ReadTakes:
    """The takes in corpora: folders of recordings, or folders of bare motion files, or such files.

    The music of recordings is not read: without annotated beats a recording is a bare motion, and is cut at its rests.
    `scale` is metres in one unit of the motion files; None as in `harmolab.io.motion.load_motion`.

    Raises
    ------
    FileNotFoundError, ValueError
        A root is not there, or holds nothing that can be read; names it.
    """
    takes: list[Take] = []
    notes: list[str] = []
    for root in map(Path, roots):
        before = len(takes)
        for path in progress(_paths(root), f"reading {root.name}"):
            try:
                takes.append(_read(path, root, scale))
            except (ValueError, FileNotFoundError) as error:
                notes.append(str(error))
        if len(takes) == before:
            reason = f": {notes[-1]}" if notes else "; recordings, .npz, .bvh or other motion files are read"
            raise ValueError(f"{root}: holds no motion that can be danced from{reason}")
    return ReadTakes(tuple(takes), tuple(notes))


def _paths(root: Path) -> list[Path]:
    """The recordings' folders at or below `root`; without any the motion files there."""
    if root.is_file():
        return [root]
    recordings = find_recordings(root)
    if recordings.folders:
        return list(recordings.folders)
    return sorted(path for path in root.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())


def _read(path: Path, root: Path, scale: float | None) -> Take:
    """The take in a recording's folder or in a motion file."""
    motion = load_any_motion(path, scale=scale)
    if path.is_file():
        name = path.stem if path == root else path.relative_to(root).with_suffix("").as_posix()
        return _take(name, motion)
    files = recording_files(path)
    annotation = None if files.beats is None else load_annotation(files.beats)
    return _take(
        path.name, motion, files.dance, _track(annotation), recorded_offset(path) or 0.0,
        None if annotation is None else annotation.meter,
    )  # fmt: skip


def _track(annotation: BeatAnnotation | None) -> BeatTrack | None:
    return None if annotation is None or annotation.times.size < 2 else annotation.track()
