"""Dances and the songs that they are danced to, paired by the names of their files or by a list.

A motion goes with the song of the same name; else with the song whose name stands in the motion's as a word
("demo_mBR0_seed3.npz" and "mBR0.wav"); else with the only song that has the motion's music id of AIST++. A recording's
own folder holds its song. What goes with nothing is listed with the reason, and no motion is ever given a song by luck.
Of files of one name in a folder that whose ending stands first in `MOTIONS` counts, and the others are listed.

The published codes name their dances so, and the rules above pair them:

* EDGE, ``test.py``: ``test_mBR0.pkl``, which begins at a random slice of the song; which one is not written.
* EDGE, in training: ``2000_3_gBR_sBM_cAll_d04_mBR0_ch01_slice7.pkl``; slice 7 begins 7 strides into the song.
* FACT: ``gBR_sBM_cAll_d04_mBR0_ch01_mJB4.npy``, the recording of its seed and then the song, which alone counts.
* FineDance, ``generate_all.py``: ``test_3_063z@005.pkl``; piece 5 of song 063, counted in strides as slices are.
* Bailando: ``gBR_sBM_cAll_d04_mBR0_ch01.json.npy``, or a folder ``gBR_sBM_cAll_d04_mBR0_ch01.json`` of frames.
"""

import filecmp
import hashlib
import math
import os
import re
import unicodedata
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

from harmolab.data.recordings import find_audio, natural, read_any_motion, recording_files
from harmolab.files import SOUNDS, MissingFrameRate, PathLike, column_lines, read_json, reading
from harmolab.readers.keypoints import FRAME_ENDS
from harmolab.readers.motion_file import same_dance

MOTIONS = (".npz", ".npy", ".bvh", ".pkl", ".pickle", ".json", ".jsonl", ".c3d")
GENERATED, RECORDED = "generated", "recorded"
FROZEN, OTHER_SONG = "frozen pose", "recorded, other song"
_MUSIC_ID = re.compile(r"(?:^|_)(m[A-Z]{2}\d)(?=_|$)")  # of AIST++, as in gBR_sBM_cAll_d04_mBR0_ch01
_SEED_AND_SONG = re.compile(r"_ch\d\d_(m[A-Z]{2}\d)$")  # of FACT: the end of a recording's name, then the song
_SLICE = re.compile(r"(?:(?:^|_)slice|z@)(\d{1,6})$")  # of EDGE, and of FineDance
COLUMNS = ("motion", "music", "system", "seed", "offset")  # of a list of pairs; the first two must be there
NO_MOTION = "is no motion file"
CLOSED = "cannot be opened: permission denied"
TOO_DEEP = "holds dances a folder deeper than a seed's; name the folder that holds it as the system's"
LISTED, SLICED = "listed", "slice"  # where the start of a dance is from: a list, the number of its slice
MOST_SECONDS = 36_000.0  # ten hours: no dance begins later in its song


class Song(NamedTuple):
    """A song: its name, that of its file or of the folder of its recording, and the file."""

    name: str
    path: Path


@dataclass(frozen=True)
class Pair:
    """A dance and its song.

    Parameters
    ----------
    system : str, name of the row of the table that the dance counts for
    seed : str, name of the subfolder it lies in, "" without one
    song : str, name of the song: intervals are drawn over songs
    motion, music : Path
    kind : str, "generated", or the name of a control (`harmolab.lab.evaluate.rows`)
    offset : float or None, seconds into the song at which the file's first frame is danced; None where neither a list
        nor a slice says it
    begins : str, where the offset is from, `LISTED` or `SLICED`; "" without one
    seed_frames : int, frames at the start of the file that the system was given, and that are left out
    fps : float or None, hertz, where the file holds no rate; None for that of all files
    """

    system: str
    seed: str
    song: str
    motion: Path
    music: Path
    kind: str = GENERATED
    offset: float | None = None
    begins: str = ""
    seed_frames: int = 0
    fps: float | None = None

    @property
    def key(self) -> str:
        """The dance's name among all of an evaluation; the same in every run."""
        return " | ".join((self.system, self.seed, str(self.motion), self.song))

    @property
    def stamp(self) -> str:
        """A text that changes with the files of dance and song, and with frames, rate and start of the dance."""
        return f"{input_stamp(self.motion, self.music)} {self.offset} {self.seed_frames} {self.fps}"


class Unpaired(NamedTuple):
    """A file that has no part in the table, the reason, and the system of which it is a missing dance, "" for none."""

    file: Path
    reason: str
    system: str = ""


class Pairing(NamedTuple):
    """The pairs of some folders, and the files that are left over; the systems of a list, with pairs kept or not."""

    pairs: tuple[Pair, ...]
    unpaired: tuple[Unpaired, ...]
    systems: tuple[str, ...] = ()


def songs_in(folder: PathLike) -> tuple[Song, ...]:
    """The songs of a folder: its sound files, and the sound of each recording's folder in it.

    Raises
    ------
    FileNotFoundError, ValueError
        There is no such folder, or there is no song in it; names it.
    """
    songs = []
    for path in _entries(folder):
        if path.is_file() and path.suffix.lower() in SOUNDS:
            songs.append(Song(path.stem, path))
        elif path.is_dir():
            songs += [Song(path.name, sound) for sound in _own_sound(path)]
    if not songs:
        raise ValueError(f"{folder}: holds no song ({', '.join(SOUNDS)}, or folders with an audio file)")
    return tuple(songs)


def folder_pairs(
    system: str, folder: PathLike, songs: Sequence[Song], *, kind: str = GENERATED, slice_stride: float | None = None
) -> Pairing:
    """The dances of one system, those of each seed in a subfolder where there are any, with their songs.

    Parameters
    ----------
    system : str
    folder : str or path
    songs : Songs that they may be danced to
    kind : str, as in `Pair`
    slice_stride : float or None, seconds between two slices of a song, for files that are named by their slice

    Raises
    ------
    FileNotFoundError, ValueError
        There is no such folder, or nothing in it goes with a song; names it and the first reason. A file is named by
        its slice, and there is no stride.
    """
    pairs: list[Pair] = []
    unpaired: list[Unpaired] = []
    for seed, motion in _motions(Path(folder), unpaired, system):
        song = song_of(motion, songs)
        if twin := same_dance(motion, MOTIONS):
            unpaired.append(Unpaired(motion, f"has the name of {twin.name}, which alone counts"))
        elif _is_about_another(motion):
            unpaired.append(Unpaired(motion, NO_MOTION))
        elif isinstance(song, str):
            unpaired.append(Unpaired(motion, song, system) if _is_dance(motion) else Unpaired(motion, NO_MOTION))
        else:
            offset, begins = slice_start(motion, song, slice_stride)
            pairs.append(Pair(system, seed, song.name, motion, song.path, kind, offset, begins))
    if not pairs:
        first = next((f"{one.file.name}: {one.reason}" for one in unpaired), "there is no motion file")
        raise ValueError(f"{folder}: no dance goes with a song ({first}); --pairs names them in a list")
    return Pairing(tuple(pairs), tuple(unpaired))


def song_of(motion: Path, songs: Sequence[Song]) -> Song | str:
    """The song that a motion's name asks for, by the first rule of the module that fits; else the reason for none."""
    name = motion.name if motion.is_dir() else motion.stem
    seeded = _SEED_AND_SONG.search(name)
    words = seeded[1] if seeded and not _same_name(name, songs) else name
    for rule in _RULES:
        matches = rule(words, songs)
        if len(matches) > 1:
            return f"goes with {len(matches)} songs: {', '.join(sorted(one.path.name for one in matches[:4]))}"
        if matches:
            return matches[0]
    own = _own_sound(motion) if motion.is_dir() else []
    return Song(name, own[0]) if own else "no song has its name, or a word of its name"


def slice_start(motion: Path, song: Song, stride: float | None) -> tuple[float | None, str]:
    """The `offset` of a dance that is named by its slice of a song, and `SLICED`; None and "" for another name.

    A dance to a file that is the slice begins with it.

    >>> slice_start(Path("mBR0_slice7.pkl"), Song("mBR0", Path("mBR0.wav")), 0.5)
    (3.5, 'slice')

    Raises
    ------
    ValueError
        The name has the number of a slice, and there is no stride; names the file and the option.
    """
    number = _SLICE.search(motion.stem)
    if number is None:
        return None, ""
    if _SLICE.search(song.path.stem):
        return 0.0, SLICED
    if stride is None:
        raise ValueError(
            f"{motion}: is slice {number[1]} of its song; pass --slice-stride, the seconds between the starts of two "
            "slices (0.5 in EDGE's training, 2.5 in its test.py, 4 in FineDance's z@), or name the offset in --pairs"
        )
    return int(number[1]) * stride, SLICED


def _same_name(name: str, songs: Sequence[Song]) -> list[Song]:
    return [song for song in songs if _folded(song.name) == _folded(name)]


def _folded(name: str) -> str:
    """A name that does not depend on case, nor on how a letter with an accent is written."""
    # The piece 005 of FineDance's 063z@005 is not the song 005.
    return unicodedata.normalize("NFC", unicodedata.normalize("NFC", name).casefold()).replace("z@", " slice")


def is_named_by_seed(motion: Path) -> bool:
    """True for a file that is named as FACT names its dances, by the recording of its seed and by its song."""
    return _SEED_AND_SONG.search(motion.stem) is not None


def _word_of_name(name: str, songs: Sequence[Song]) -> list[Song]:
    """The songs with most words, of those whose words stand in the name in a row."""
    sizes = {song: words.count(" ") for song in songs if (words := _words(song.name)).strip() and words in _words(name)}
    return [song for song, size in sizes.items() if size == max(sizes.values())]


def _same_music_id(name: str, songs: Sequence[Song]) -> list[Song]:
    number = _MUSIC_ID.search(name)
    return [song for song in songs if number and number[1] in _MUSIC_ID.findall(song.name)]


_RULES: tuple[Callable[[str, Sequence[Song]], list[Song]], ...] = (_same_name, _word_of_name, _same_music_id)


def _words(name: str) -> str:
    """The words of a name with a blank before and behind each."""
    # The vowels of many scripts are marks, which are parts of words as letters are.
    letters = (one if one.isalnum() or unicodedata.category(one)[0] == "M" else " " for one in _folded(name))
    return f" {' '.join(''.join(letters).split())} "


def _motions(folder: Path, unpaired: list[Unpaired], system: str = "") -> Iterator[tuple[str, Path]]:
    """(seed, motion) of the motions in a folder and in its subfolders; the other files are added to `unpaired`."""
    for path in _entries(folder):
        if path.is_symlink() and (reason := _useless_link(path)):
            unpaired.append(Unpaired(path, reason, system))
        elif is_motion(path):
            yield "", path
        elif _is_open(path):
            inside = _entries(path)
            yield from ((path.name, motion) for motion in inside if is_motion(motion))
            unpaired += [_no_motion(one, system) for one in inside if not is_motion(one)]
        else:
            unpaired.append(_no_motion(path, system))


def _is_open(path: Path) -> bool:
    """True for a folder whose content may be read."""
    return path.is_dir() and os.access(path, os.R_OK | os.X_OK)


def _no_motion(path: Path, system: str) -> Unpaired:
    """A file or folder that is no motion, and what it is."""
    if path.is_dir() and not _is_open(path):
        return Unpaired(path, CLOSED, system)
    is_deep = path.is_dir() and any(map(is_motion, _entries(path)))
    return Unpaired(path, TOO_DEEP, system) if is_deep else Unpaired(path, NO_MOTION)


def _useless_link(path: Path) -> str:
    """The reason why a link leads to no dances of its own; "" where it does."""
    try:
        target, folder = path.resolve(strict=True), path.parent.resolve()
    except (OSError, RuntimeError):  # RuntimeError: a link to itself, before Python 3.13
        return "is a link that leads nowhere"
    if target == folder or target in folder.parents:
        return "is a link to a folder that it lies in"
    return f"is a link to {target.name}, which is there too" if target.parent == folder else ""


def _is_dance(path: Path) -> bool:
    """False for a JSON file that holds something else than a motion, as many do that lie in folders of dances."""
    if path.is_dir() or path.suffix.lower() not in (".json", ".jsonl"):
        return True
    try:
        read_any_motion(path)
    except (ValueError, OSError) as error:
        return isinstance(error, MissingFrameRate)
    return True


def _is_about_another(path: Path) -> bool:
    """True for a JSON object without frames that is named by a motion beside it, as mBR0_info.json by mBR0.npz."""
    parts = re.finditer(r"[\W_]", path.stem) if path.is_file() and path.suffix.lower() == ".json" else ()
    if not any(path.with_name(path.stem[: part.start()] + ending).exists() for part in parts for ending in MOTIONS):
        return False
    try:
        with reading(path, "JSON") as file:
            content = read_json(file)
    except (ValueError, OSError):  # a dance that is damaged, and missed
        return False
    values = content.values() if isinstance(content, dict) else [content]
    return not any(isinstance(value, list) and value and isinstance(value[0], list | dict) for value in values)


def is_motion(path: Path) -> bool:
    """True for a file whose suffix is that of a motion, and for the folder of a recording or of frames."""
    if _is_open(path):
        is_recording = any((path / part).is_file() for part in ("motion.npz", "skeletons.json"))
        return is_recording or any(one.name.endswith(FRAME_ENDS) for one in path.iterdir())
    return path.suffix.lower() in MOTIONS


def listed_pairs(
    table: PathLike, songs_folder: PathLike | None, systems: Mapping[str, PathLike], *, default: str = GENERATED,
    slice_stride: float | None = None, keep: Callable[[Pair], bool] = lambda pair: True,
) -> Pairing:  # fmt: skip
    """The pairs of a CSV file with the columns motion and music, and perhaps system, seed and offset.

    Paths are relative to the folder of the system and to that of the songs, else to the folder of the CSV file. Motions
    in the systems' folders that it does not name are listed.

    Parameters
    ----------
    table : str or path
    songs_folder : str or path, or None
    systems : name -> folder of the systems that have one
    default : str, the system where there is no such column, or nothing in it
    slice_stride : as in `folder_pairs`, for lines without an offset
    keep : function of a Pair; those that it is false of are left out as the list is read, line by line

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; ValueError also for a column that is not known, an offset that is no time, where none of
        its pairs, or of a system's, is there, and where one stands in it twice.
    """
    folders = {name: Path(folder) for name, folder in systems.items()}
    with reading(table, "a list of pairs", max_bytes=None) as file:
        pairs: dict[str, Pair] = {}
        unpaired: list[Unpaired] = []
        paired: dict[str, None] = {}
        songs: dict[str, Path] = {}
        for motion, music, named, seed, start in _lines(column_lines(file, COLUMNS[:2])):
            system = named or default
            dance = _first_there(motion, (folders.get(system), file.parent))
            song = _first_there(music, (None if songs_folder is None else Path(songs_folder), file.parent))
            if dance is None or song is None:
                missing = motion if dance is None else music
                unpaired.append(Unpaired(Path(motion), f"{missing}: no such file", system))
                continue
            name = next(name for name in _song_names(song) if _is_same(songs.setdefault(name, song), song))
            offset, begins = (_seconds(start), LISTED) if start else slice_start(dance, Song(name, song), slice_stride)
            pair = Pair(system, seed, name, dance, song, offset=offset, begins=begins)
            paired[system] = None
            if not keep(pair):
                continue
            if pair.key in pairs:
                raise ValueError(f"names {motion} with {music} twice for one system and seed")
            pairs[pair.key] = pair
        if not paired:
            raise ValueError(f"names no pair that is there ({unpaired[0].reason if unpaired else 'it has no lines'})")
        if lost := next((one for one in unpaired if one.system not in paired), None):
            raise ValueError(f"names no pair of {lost.system!r} that is there ({lost.reason})")
    return Pairing(tuple(pairs.values()), (*unpaired, *_unlisted(Path(table), pairs.values(), folders)), tuple(paired))


def _lines(lines: Iterable[Mapping[str, str]]) -> Iterator[tuple[str, ...]]:
    """The words of each line of a list in the order of `COLUMNS`, "" where there is no such column."""
    for line in lines:
        if unknown := [name for name in line if name not in COLUMNS]:
            perhaps = ", ".join(COLUMNS[2:])
            raise ValueError(f"has a column {unknown[0]!r}; columns are motion and music, and perhaps {perhaps}")
        yield tuple(line.get(name, "") for name in COLUMNS)


def _seconds(text: str) -> float:
    """An offset in a list."""
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not abs(seconds) <= MOST_SECONDS:
        raise ValueError(f"offset must be the second of the song at which the dance begins, got {text[:30]!r}")
    return seconds


def _is_same(one: Path, other: Path) -> bool:
    """True for two names of one file, and for two files with the same content."""
    return one == other or filecmp.cmp(one, other, shallow=False)


def _song_names(song: Path) -> tuple[str, ...]:
    """The name of a song's file, of the recording's folder where it lies in one, as in `songs_in`; then longer ones.

    Another song of the same name has one of those: dances to two songs are not averaged as dances to one.
    """
    name = song.parent.name if song.stem == "audio" or is_motion(song.parent) else song.stem
    return name, f"{name} ({song.parent.name})", f"{name} ({song})"


def _first_there(name: str, folders: Iterable[Path | None]) -> Path | None:
    """The first path of this name below one of the folders that is there."""
    places = (folder / name for folder in folders if folder is not None)
    return next((place for place in places if name and place.exists()), None)


def _unlisted(table: Path, pairs: Iterable[Pair], systems: Mapping[str, Path]) -> Iterator[Unpaired]:
    """The motions of the systems' folders that no line of a list names."""
    listed = {pair.motion.resolve() for pair in pairs}
    for folder in systems.values():
        for _, motion in _motions(folder, []):
            if motion.resolve() not in listed:
                yield Unpaired(motion, f"is not in {table.name}")


def unused_songs(songs: Iterable[Song], pairs: Iterable[Pair]) -> tuple[Unpaired, ...]:
    """The songs that no pair has."""
    used = {pair.music for pair in pairs}
    return tuple(Unpaired(song.path, "no dance goes with this song") for song in songs if song.path not in used)


def dance_of(music: Path) -> str:
    """The dance of a song, as the recording's folder that it lies in says; "" where that is unknown."""
    return recording_files(music.parent).dance if is_motion(music.parent) else ""


def annotation_of(music: Path) -> Path | None:
    """The beats that stand beside a song: SONG.beats, or beats.json in a recording's folder; None without."""
    places = [music.with_suffix(".beats"), *([music.parent / "beats.json"] if is_motion(music.parent) else [])]
    return next(filter(Path.is_file, places), None)


def input_stamp(*paths: Path) -> str:
    """A text that changes with files, and with the annotation and configuration beside them: sizes and times of change.

    Of folders, such as a recording's, all files count but hidden ones, such as .DS_Store, which no reader looks at. No
    errors: a file that is missing has a state, too.
    """
    states = (f"{file.name} {_state(file)}\0" for path in paths for file in _input_files(path))
    return hashlib.sha256("".join(states).encode()).hexdigest()[:16]


def _input_files(path: Path) -> list[Path]:
    try:
        return sorted(file for file in path.iterdir() if not file.name.startswith("."))
    except OSError:  # no folder
        return [path, path.with_suffix(".beats"), path.parent / "beats.json", path.parent / "config.json"]


def _state(file: Path) -> tuple[int, ...]:
    try:
        status = file.stat()
    except OSError:
        return ()
    return (status.st_size, status.st_mtime_ns) if os.access(file, os.R_OK) else ()


def _entries(folder: PathLike) -> list[Path]:
    """The content of a folder but for hidden files and harmolab's own corpus.json, dance_2 before dance_10."""
    folder = Path(folder)
    if not folder.exists():
        raise FileNotFoundError(f"{folder}: no such folder")
    if not folder.is_dir():
        raise ValueError(f"{folder}: is a file; name the folder it lies in")
    content = (path for path in folder.iterdir() if path.name != "corpus.json" and not path.name.startswith("."))
    return sorted(content, key=natural)


def _own_sound(folder: Path) -> list[Path]:
    """The sound of a recording's folder; none where it holds none, and one that cannot be read where it is closed."""
    if not _is_open(folder):
        return [folder / "audio.wav"]
    try:
        return [find_audio(folder)]
    except FileNotFoundError:
        return []
