"""Takes, the recordings that a choreographer takes beats from: read from folders, files, clips, motions; on disk.

A corpus of takes on disk has names, tempi and sizes in ``model.json``, movement and beats in ``model.npz`` beside it.

==============  =======================================================================================
name            shape and type, and meaning
==============  =======================================================================================
``positions``   (F, J, 3) 16-bit integers: millimetres, of all takes one after the other. The first two
                frames of a take are places; of the others the second differences are kept, which zip
                well: the place of every joint comes back to the millimetre.
``valid``       (F,) bool, False for filler frames
``beats``       (B,) numbers, seconds from the first frame of their take
``places``      (B,) integers, place in the bar; -1 where unknown
==============  =======================================================================================

The JSON says how many frames and beats each take has. Nothing is unpickled, and nothing is unpacked whose size was not
compared before.
"""

import hashlib
import io
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_opening

from harmolab.body.kinematics import joint_speed, smooth
from harmolab.body.skeletons import Skeleton, named_joints, sides_and_parts, tree_order
from harmolab.data.oddities import faults_of
from harmolab.data.recordings import Recording, find_recordings, load_any_motion, recorded_offset, recording_files
from harmolab.data.synthetic.clips import PlantedClip
from harmolab.files import PathLike, Progress, named_faults, reading, silent
from harmolab.metrics.likeness import LikenessLimits
from harmolab.params import DANCES
from harmolab.readers.arrays import checked_fps, read_npz
from harmolab.readers.beats import load_annotation
from harmolab.readers.motion_file import same_dance
from harmolab.systems.training.about import DEFAULT_STEM, read_about, stored_skeleton, weights_stem, whole, write_about
from harmolab.types import BeatTrack, Clip, FloatArray, IntArray, Motion, check_kind, usual_meter

MILLIMETRE = 0.001  # metres: to this the places of joints are kept
FARTHEST = 32.0  # metres from the middle of a recording
STANDING = 0.5  # of a take's median speed: what is slower at its ends is standing
SMOOTHING = 0.3  # seconds, standard deviation, of that speed
KEPT_UP = 1.0  # seconds for which a dance goes on at least; a shorter movement is a change of stance
JUMP, FASTEST = 0.5, 10.0  # metres, and metres a second, that no joint moves from a first frame to the next
LITTLE = 0.02  # octaves by which a song may be outside of the usual tempo of its dance
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
        return (len(self.motion.positions) - 1) / self.motion.fps

    def places_of(self, count: int) -> IntArray:
        """(count,) array, place in its bar of each beat; -1 where they are unknown."""
        return self.places if self.places.size else np.full(count, -1)

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
    if not isinstance(item, Recording | PlantedClip | Clip):
        check_kind(item, Motion, name := f"motion {number}")
        return _take(name, item)
    clip, annotation = (item, None) if isinstance(item, Clip) else (item.clip, item.annotation)
    if clip.motion is None:
        raise ValueError(f"{clip.name}: there is no motion to take beats from")
    track, meter = clip.beats, None
    if annotation is not None:
        track, meter = annotation.track(clip.audio.duration), annotation.meter
    return _take(clip.name, clip.motion, clip.dance, track, clip.offset, meter)


def _take(
    name: str, motion: Motion, dance: str = "", track: BeatTrack | None = None, offset: float = 0.0,
    meter: int | None = None,
) -> Take:  # fmt: skip
    """A take of a motion whose first frame is at `offset` seconds of the music that `track` belongs to."""
    take = Take(name, _kept(name, motion), dance)
    if track is None:
        return take
    inside = (track.times >= offset) & (track.times <= offset + take.seconds)
    if inside.sum() > 1:
        take = replace(take, beats=track.times[inside] - offset)
        if track.bar_places is not None:
            meter = meter or meter_of(track, dance)
            take = replace(take, places=track.bar_places[inside] % meter, meter=meter)
    return take


def mirrored(take: Take) -> Take:
    """The take as a mirror shows it: left and right change places, and so do joints that have a side in their name."""
    joints, other = named_joints(take.motion.skeleton), {"left": "right", "right": "left", "": ""}
    keys = sides_and_parts(take.motion.skeleton)
    twins = [joints.get((other[side], part), joint) for joint, (side, part) in enumerate(keys)]
    positions = take.motion.positions[:, twins] * np.array([-1.0, 1.0, 1.0])
    return replace(take, name=f"{take.name}, mirrored", motion=replace(take.motion, positions=positions))


def meter_of(track: BeatTrack, dance: str = "") -> int:
    """Beats in a bar of a track: those of most bars, or those of the dance where no bar is whole; 0: unknown."""
    places = track.bar_places
    if places is None or places.size == 0:
        return 0
    usual = DANCES[dance].meter if dance in DANCES else 0
    return usual if places.size < usual else usual_meter(places)  # less than a bar does not show all of its places


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


def nearest_dance(takes: Sequence[Take], tempo: float, meter: int) -> str:
    """The dance of takes that is nearest to music: of its `meter`, usual at its tempo, and then recorded nearest to it.

    A tempo, its half and its double count as one, since trackers take one for the other. Of takes without beats the
    usual tempo of the dance (`DANCES`) counts; "" where no dance has a tempo.
    """
    near: dict[str, tuple[bool, bool, float]] = {}
    for take in takes:
        usual = DANCES.get(take.dance)
        bar, tempi, is_strange = take.meter, None, False
        if usual is not None:
            bar, tempi = take.meter or usual.meter, usual.tempo
            is_strange = _octaves_off(tempo, usual.tempo) > LITTLE
        if take.beats.size:
            own = 60 / float(np.median(np.diff(take.beats)))
            tempi = own, own
        if take.dance and tempi:
            cost = (bar != meter, is_strange, _octaves_off(tempo, tempi))
            near[take.dance] = min(cost, near.get(take.dance, cost))
    return min(near, key=lambda dance: near[dance], default="")


def _octaves_off(tempo: float, bounds: Sequence[float]) -> float:
    """Distance of a tempo, its half or its double from a range, in octaves: the least of the three."""
    tempi = tempo * np.array([0.5, 1.0, 2.0])
    return float(np.abs(np.log2(np.clip(tempi, bounds[0], bounds[1]) / tempi)).min())


def same_skeleton(takes: Sequence[Take]) -> Skeleton:
    """The skeleton of all takes; ValueError where there is none, or more than one, with what to do."""
    if not takes:
        raise ValueError("a choreographer needs a recording at least, got none")
    first = takes[0]
    for take in takes:
        if take.motion.skeleton != first.motion.skeleton:
            sizes = [len(one.motion.skeleton.joints) for one in (first, take)]
            fault = f"{first.name} and {take.name} have different skeletons ({sizes[0]} and {sizes[1]} joints)"
            raise ValueError(f"{fault}; a dance is made from one: name a folder that holds one of them")
    return first.motion.skeleton


class Kept(NamedTuple):
    """The takes of a corpus, lines about what could not be read, limits of likeness of the takes."""

    takes: tuple[Take, ...]
    notes: tuple[str, ...] = ()
    limits: LikenessLimits | None = None


def read_takes(roots: Iterable[PathLike], *, scale: float | None = None, progress: Progress = silent) -> Kept:
    """The takes in corpora: folders of recordings, or folders of bare motion files, or such files.

    The music of recordings is not read: without annotated beats a recording is a bare motion, and is cut at its rests.
    `scale` is metres in one unit of the motion files; None as in `harmolab.readers.motion.load_motion`. Beside others,
    a take with a fault, as another unit of length (`harmolab.data.oddities`), is left out; `Kept.notes` says so.

    Raises
    ------
    FileNotFoundError, ValueError
        A root is not there, or holds nothing that can be read; names it.
    """
    takes: list[Take] = []
    notes: list[str] = []
    for root in map(Path, roots):
        before, paths = len(takes), _paths(root)
        notes += _loose(root, paths)
        for path in progress(paths, f"reading {root.name}"):
            try:
                takes.append(_read(path, root, scale))
            except (ValueError, FileNotFoundError) as error:
                notes.append(str(error))
        if len(takes) == before:
            reason = f": {notes[-1]}" if notes else "; recordings, .npz, .bvh or other motion files are read"
            raise ValueError(f"{root}: holds no motion that can be danced from{reason}")
    faults = {take: faults_of(take.motion) for take in takes}
    if whole := tuple(take for take in takes if not faults[take]):
        notes += [f"{take.name}: {faults[take][0]}" for take in takes if faults[take]]
    return Kept(whole or tuple(takes), tuple(notes))


def _paths(root: Path) -> list[Path]:
    """The recordings' folders at or below `root`; without any the motion files there."""
    if root.is_file():
        return [root]
    files = (path for path in root.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file())
    return list(find_recordings(root).folders) or sorted(files)


def _loose(root: Path, paths: list[Path]) -> list[str]:
    """A sentence on files of movement beside the folders of recordings, if there are any."""
    files = sorted(root.rglob("*")) if paths and paths[0].is_dir() else []
    moves = [path for path in files if path.suffix.lower() in (*SUFFIXES[:-1], ".c3d")]
    loose = [path for path in moves if not any(folder in path.parents for folder in paths)]
    more = f" (and {len(loose) - 1} more)" if loose[1:] else ""
    return [f"{path}{more}: lies beside whole recordings, which alone are danced" for path in loose[:1]]


def dancing_span(motion: Motion) -> tuple[float, float]:
    """Seconds at which the dance of a take begins and ends: it moves at least half as fast there as it mostly does."""
    speed = smooth(joint_speed(motion.positions, motion.fps), SMOOTHING, motion.fps)
    is_moving = binary_opening(speed >= STANDING * np.median(speed), np.ones(max(1, round(KEPT_UP * motion.fps)), bool))
    moving = np.flatnonzero(is_moving) if is_moving.any() else np.arange(motion.n_frames)
    return float(moving[0]) / motion.fps, float(moving[-1] + 1) / motion.fps


def _trimmed(motion: Motion) -> tuple[Motion, float]:
    """A motion without standing at its ends, and without a pose before them that it jumps from; and where it begins.

    Files often open with the pose in which a skeleton was defined. What hardly moves at all is left whole.
    """
    step = np.linalg.norm(motion.positions[1] - motion.positions[0], axis=-1).max()
    jumps = motion.n_frames > 3 and step >= max(JUMP, FASTEST / motion.fps)
    first = 1 / motion.fps if jumps else 0.0
    rest = motion.span(first, motion.duration)
    start, end = dancing_span(rest)
    if end - start < KEPT_UP:
        return rest, first
    return rest.span(start, end - start), first + start


def _read(path: Path, root: Path, scale: float | None) -> Take:
    """The take in a recording's folder or in a motion file; ValueError also where another file has its dance."""
    if path != root and (twin := same_dance(path, SUFFIXES)):
        raise ValueError(f"{path}: has the name of {twin.name}, which alone is danced")
    motion, start = _trimmed(load_any_motion(path, scale=scale))
    if path.is_file():
        name = path.stem if path == root else path.relative_to(root).with_suffix("").as_posix()
        return _take(name, motion)
    files, track, meter = recording_files(path), None, None
    if files.beats is not None:
        annotation = load_annotation(files.beats)
        if annotation.times.size > 1:
            track, meter = annotation.track(), annotation.meter
    return _take(path.name, motion, files.dance, track, (recorded_offset(path) or 0.0) + start, meter)


# Takes on disk

CLASS = "Choreographer"
MOST_TAKES, MOST_BEATS, MOST_METER = 10_000, 1_000_000, 32
MOST_VALUES = 50_000_000  # 400 MB when they are read; six hours of 23 joints at 30 frames a second
_ARRAYS = {"positions": "i", "valid": "b", "beats": "f", "places": "i"}
_WHAT = "recorded movement of a choreographer"
Arrays = dict[str, NDArray[Any]]


def save_takes(folder: PathLike, kept: Kept) -> None:
    """Write takes of one skeleton to a folder, made if need be; both files appear whole or not at all.

    Raises
    ------
    ValueError
        A joint jumps by more than 16 bits of millimetres hold, or they are more than `load_takes` reads.
    """
    stem, takes, entries = Path(folder) / DEFAULT_STEM, kept.takes, [_entry(take) for take in kept.takes]
    with named_faults(folder):
        _shapes(entries, len(takes[0].motion.skeleton.joints))
    arrays = {
        # The frames of one coordinate follow each other: up to an eighth smaller once compressed.
        "positions": np.asfortranarray(np.concatenate([_packed(take) for take in takes])),
        "valid": np.concatenate([take.motion.valid for take in takes]),
        "beats": np.concatenate([take.beats for take in takes]),
        "places": np.concatenate([take.places_of(take.beats.size) for take in takes]).astype(np.int16),
    }
    packed = io.BytesIO()
    np.savez_compressed(packed, allow_pickle=False, **arrays)
    data = packed.getvalue()
    about = {
        "system": "choreographer",
        "class": CLASS,
        "build": {"skeleton": asdict(takes[0].motion.skeleton), "takes": entries},
        "sha256": hashlib.sha256(data).hexdigest(),
        "notes": list(kept.notes),
        "limits": None if kept.limits is None else kept.limits.to_dict(),
    }
    write_about(stem, about, _array_file(stem), data)


def load_takes(path: PathLike) -> Kept:
    """The corpus that was saved in a folder.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file: it is not there, damaged, foreign, of another size than its description says, or holds
        what no recording holds.
    """
    stem = weights_stem(path)
    about = read_about(stem)
    file = _array_file(stem)
    with reading(file, _WHAT):
        if about.get("class") != CLASS:
            raise ValueError(f"holds a {about.get('class')}, not a {CLASS}")
        if hashlib.sha256(file.read_bytes()).hexdigest() != about.get("sha256"):
            raise ValueError(f"is not the file that {stem.name}.json describes (SHA-256 differs)")
        skeleton, entries = stored_skeleton(about["build"]), about["build"]["takes"]
        tree_order(skeleton.parents)
        shapes = _shapes(entries, len(skeleton.joints))
        arrays = _checked(read_npz(file, _ARRAYS), shapes)
        limits = None if about.get("limits") is None else LikenessLimits.from_dict(about["limits"])
        notes = tuple(str(line) for line in about.get("notes") or ())
        return Kept(_takes(arrays, entries, skeleton), notes, limits)


def _array_file(stem: Path) -> Path:
    return stem.with_name(f"{stem.name}.npz")


def _packed(take: Take) -> NDArray[np.int16]:
    """Positions (T, J, 3) of a take, as they are kept."""
    places = np.round(take.motion.positions / MILLIMETRE).astype(np.int64)
    places[2:] = np.diff(places, n=2, axis=0)
    if np.abs(places).max() > np.iinfo(np.int16).max:
        raise ValueError(f"{take.name}: a joint jumps by more than {FARTHEST:g} m from one frame to the next")
    return places.astype(np.int16)


def _unpacked(kept: NDArray[np.int16]) -> FloatArray:
    """Positions (T, J, 3) in metres, of `_packed`."""
    steps = kept[1:].astype(np.int64)
    steps[0] -= kept[0]
    places = np.concatenate([kept[:1].astype(np.int64), np.cumsum(steps, axis=0)])
    return np.cumsum(places, axis=0) * MILLIMETRE


def _entry(take: Take) -> dict[str, Any]:
    """The entry of a take in the JSON."""
    motion = take.motion
    counts = {"frames": motion.n_frames, "beats": take.beats.size}
    return {"name": take.name, "dance": take.dance, "fps": motion.fps, "meter": take.meter, **counts}


def _shapes(entries: Any, joints: int) -> dict[str, tuple[int, ...]]:
    """The shapes of the arrays that entries promise; ValueError for those that no corpus has."""
    if not isinstance(entries, list) or not 1 <= len(entries) <= MOST_TAKES:
        raise ValueError(f"describes no list of 1 to {MOST_TAKES} recordings")
    frames = sum(_count(entry, "frames", 2, 2**31) for entry in entries)
    beats = sum(_count(entry, "beats", 0, MOST_BEATS) for entry in entries)
    if frames * joints * 3 > MOST_VALUES:
        fault = f"describes {frames} frames of {joints} joints, more than {MOST_VALUES} numbers"
        raise ValueError(f"{fault}; take fewer recordings, or a lower frame rate")
    return {"positions": (frames, joints, 3), "valid": (frames,), "beats": (beats,), "places": (beats,)}


def _checked(arrays: Arrays, shapes: dict[str, tuple[int, ...]]) -> Arrays:
    """The arrays; ValueError unless they are of these shapes and hold what a corpus may hold."""
    for name, shape in shapes.items():
        if name not in arrays:
            raise ValueError(f"has no array {name!r}")
        if arrays[name].shape != shape:
            raise ValueError(f"{name} has shape {arrays[name].shape}; its description calls for {shape}")
    if arrays["positions"].dtype != np.int16:
        raise ValueError(f"positions must be 16-bit integers, got {arrays['positions'].dtype}")
    if not -1 <= arrays["places"].min(initial=0) <= arrays["places"].max(initial=0) < MOST_METER:
        raise ValueError(f"places in the bar must lie between -1 and {MOST_METER - 1}")
    return arrays


def _count(entry: Any, name: str, least: int, most: int) -> int:
    """A whole number of an entry."""
    return whole(name, entry.get(name) if isinstance(entry, dict) else None, least, most)


def _takes(arrays: Arrays, entries: list[dict[str, Any]], skeleton: Skeleton) -> tuple[Take, ...]:
    """The takes that the entries describe, out of checked arrays."""
    takes, frame, beat = [], 0, 0
    for entry in entries:
        frames, beats = slice(frame, frame + entry["frames"]), slice(beat, beat + entry["beats"])
        positions, fps = _unpacked(arrays["positions"][frames]), checked_fps(entry["fps"])
        if np.abs(positions).max() > FARTHEST + 1:
            raise ValueError(f"{str(entry.get('name'))[:40]}: joints are over {FARTHEST:g} m away: damaged")
        motion = Motion(positions, fps, skeleton, arrays["valid"][frames])
        takes.append(_stored_take(entry, motion, arrays["beats"][beats].astype(np.float64), arrays["places"][beats]))
        frame, beat = frames.stop, beats.stop
    return tuple(takes)


def _stored_take(entry: dict[str, Any], motion: Motion, times: FloatArray, places: NDArray[Any]) -> Take:
    """One take; ValueError where its beats are no beats of it."""
    meter = _count(entry, "meter", 0, MOST_METER)
    last = (motion.n_frames - 1) / motion.fps
    is_rising = np.isfinite(times).all() and (np.diff(times) > 0).all()
    if not is_rising or times.size == 1 or (times < 0).any() or (times > last + 1e-6).any():
        raise ValueError(f"{str(entry.get('name'))[:40]}: beats must be two or more, rising from 0 to {last:g} s")
    is_placed = (places >= 0).any()
    if is_placed and not ((places >= 0) & (places < meter)).all():
        raise ValueError(f"{str(entry.get('name'))[:40]}: places in the bar do not fit its {meter} beats")
    bar_places = places.astype(np.int64) if is_placed else _NO_PLACES
    return Take(str(entry["name"]), motion, str(entry["dance"]), times, bar_places, meter)
