"""Summaries of files and corpora, with all that is odd about them: the rows of `harmolab data check PATH`.

Nothing here fails on a file: one that cannot be read becomes a row that says why.
"""

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import cast

from harmolab.data import oddities
from harmolab.data import recordings as tang2018
from harmolab.data.recordings import find_recordings, load_recording, read_any_motion, recorded_offset, walk
from harmolab.files import MAX_JSON_BYTES, SOUNDS, MissingFrameRate, PathLike, read_json, reading
from harmolab.musician import performances
from harmolab.readers.audio import audio_info, load_audio
from harmolab.readers.beats import load_annotation
from harmolab.readers.keypoints import FRAME_ENDS
from harmolab.readers.player_points import BODY, SIDES, hand_joints
from harmolab.types import Motion

LEAST_DETECTED = 0.8  # share of frames

_BEATS = (".beats", ".csv", ".txt")
_MOTION = (".npz", ".npy", ".bvh", ".pkl", ".pickle", ".json", ".jsonl", ".c3d")
_KNOWN = (*SOUNDS, *_BEATS, *_MOTION)
_JSON = ("beats.json", "skeletons.json", "config.json")
_HEAD = 100_000  # bytes


@dataclass(frozen=True)
class FileSummary:
    """Content of one file or one folder of a recording: a row of the table.

    Parameters
    ----------
    path : str
    kind : "sequence", "performance", "audio", "motion", "beats" or "unreadable"
    frames : int or None
        Frames of motion, samples of audio, or number of beats.
    rate : float or None
        Frames or samples a second; None where the file does not tell.
    joints : int or None
    seconds : float or None
    offset : float or None, seconds
        Audio time of motion frame 0.
    note : str
        Further content: dimensions, format, dance, tempo.
    odd : tuple of str
        One sentence for each odd thing, missing part, or the reason why it cannot be read.
    how : tuple of str
        How a motion was read, one sentence each: body, unit, axis that points up, rate, and what of it is guessed.
    """

    path: str
    kind: str
    frames: int | None = None
    rate: float | None = None
    joints: int | None = None
    seconds: float | None = None
    offset: float | None = None
    note: str = ""
    odd: tuple[str, ...] = ()
    how: tuple[str, ...] = ()

    @property
    def is_faulty(self) -> bool:
        """True for what cannot be read, and for what has a fault (`harmolab.data.oddities`)."""
        return self.kind == "unreadable" or any(isinstance(one, oddities.Oddity) and one.is_fault for one in self.odd)


def check(path: PathLike) -> list[FileSummary]:
    """One row for a file, or one for each recording, performance and loose file of a folder.

    JSON in a folder has a row where it holds beats or a motion, or is damaged.

    Raises
    ------
    FileNotFoundError
        There is nothing at `path`. Whatever is there gives rows, never an error.
    """
    path = Path(path)
    if not path.exists():
        raise FileNotFoundError(f"{path}: no such file or folder")
    if not path.is_dir():
        return [_guarded(_file, path)]
    players, faults = performances.find_performances(path)
    playing = {folder for folder in (*players, *(fault.folder for fault in faults)) if _has_musician(folder)}
    folders, problems = find_recordings(path)
    dancing = [folder for folder in folders if not _inside(folder, playing)]
    problems = (*(p for p in faults if p.folder in playing), *(p for p in problems if not _inside(p.folder, playing)))
    rows = [_guarded(_recording, folder) for folder in dancing]
    rows += [_guarded(_performance, folder) for folder in players if folder in playing]
    rows += [FileSummary(str(folder), "unreadable", odd=(message,)) for folder, message in problems]
    taken = {*dancing, *(folder for folder, _ in problems)}
    loose = [_guarded(_file, file) for file in _loose(path, taken) if not _inside(file, playing)]
    rows += [row for row in loose if not _is_other_json(row)]
    return rows or [FileSummary(str(path), "unreadable", odd=(f"{path}: holds no file that is known",))]


def _has_musician(folder: Path) -> bool:
    """True where a folder says that it holds a musician's performance, by performance.json or by its name."""
    return (folder / performances.ABOUT).is_file() or bool(performances.named_instrument(folder))


def _inside(path: Path, folders: set[Path]) -> bool:
    """True for one of the folders and for all that is in it."""
    return not folders.isdisjoint((path, *path.parents))


def _guarded(summary: Callable[[Path], FileSummary], path: Path) -> FileSummary:
    """The `summary` of a path, or a row with the error that it raises."""
    try:
        return summary(path)
    except (ValueError, OSError) as error:
        return FileSummary(str(path), "unreadable", odd=(str(error),))


def _loose(root: Path, recordings: set[Path]) -> list[Path]:
    """Files that can be read below `root`, outside of the folders of recordings, and folders of frames."""
    loose, places = list[Path](), {recording.resolve() for recording in recordings}
    for folder, _, files in walk(root):
        if folder.resolve() in places:
            continue
        if any(file.endswith(FRAME_ENDS) for file in files):
            loose.append(folder)
        alone = (file for file in sorted(files) if not file.endswith(FRAME_ENDS))
        loose += [folder / file for file in alone if Path(file).suffix.lower() in _KNOWN]
    return loose


def _is_other_json(row: FileSummary) -> bool:
    """True for whole JSON that holds neither beats nor a motion, as much does that lies beside dances."""
    path = Path(row.path)
    if row.kind != "unreadable" or path.suffix.lower() != ".json" or path.name in _JSON:
        return False
    with suppress(ValueError, OSError), reading(path, "JSON", max_bytes=MAX_JSON_BYTES):
        read_json(path)
        return True
    return False


def _file(path: Path) -> FileSummary:
    """The row of one file, or of a folder of frames."""
    suffix = "" if path.is_dir() else path.suffix.lower()
    if suffix in SOUNDS:
        return _sound(path)
    if path.name == "config.json":
        span = tang2018.load_config(path)
        return FileSummary(str(path), "sequence", span.end - span.start, tang2018.FPS, offset=span.start / tang2018.FPS)
    if suffix in _BEATS or (suffix == ".json" and _is_annotation(path)):
        return _beats(path)
    return _motion(path)


def _is_annotation(path: Path) -> bool:
    """True for a JSON file of beats, by its name or by the one field, ours or other programs', that those must have."""
    with path.open("rb") as file:
        head = file.read(_HEAD)
    return path.name == "beats.json" or b'"beats_s"' in head or b'"beats"' in head


def _sound(path: Path) -> FileSummary:
    """The row of a sound file; the samples of up to an hour are read."""
    info = audio_info(path)
    samples = round(info.seconds * info.sample_rate)
    note = f"{info.format}, mono" if info.channels == 1 else f"{info.format}, {info.channels} channels"
    odd: tuple[str, ...] = ("longer than an hour, so its samples were not looked at; read it in spans",)
    if info.seconds <= 3600:
        odd = oddities.sound_oddities(load_audio(path, sample_rate=None))
    return FileSummary(str(path), "audio", samples, info.sample_rate, seconds=info.seconds, note=note, odd=odd)


def _beats(path: Path) -> FileSummary:
    """The row of a beat annotation."""
    annotation = load_annotation(path)
    track = annotation.track()
    facts = [annotation.dance] if annotation.dance else []
    facts += [] if annotation.bpm is None else [f"{annotation.bpm:.1f} beats a minute"]
    facts += [] if annotation.meter is None else [f"{annotation.meter} beats a bar"]
    facts += [f"{len(annotation.units)} units"] if annotation.units else []
    odd = oddities.beat_oddities(annotation.times)
    return FileSummary(str(path), "beats", len(track), seconds=track.duration, note=", ".join(facts), odd=odd)


def _motion(path: Path) -> FileSummary:
    """The row of a motion; one whose file holds no rate is read with a rate that is not shown."""
    try:
        file, has_rate = read_any_motion(path), True
    except MissingFrameRate:
        file, has_rate = read_any_motion(path, fps=25.0), False
    row = _motion_row(path, file.motion)
    row = replace(row, note=f"{row.note}, {file.kind}", how=file.notes)
    try:
        row = replace(row, offset=recorded_offset(path))
    except ValueError as error:  # of the annotation beside it, which takes nothing from the motion
        row = replace(row, odd=(*row.odd, str(error)))
    odd = ("holds no frame rate: pass fps (--fps)", *oddities.body_oddities(file.motion))
    return row if has_rate else replace(row, rate=None, seconds=None, odd=odd)


def _motion_row(path: Path, motion: Motion) -> FileSummary:
    """The row that describes a motion."""
    frames, joints, dimensions = motion.positions.shape
    note, odd = f"{dimensions}-D", oddities.motion_oddities(motion)
    return FileSummary(str(path), "motion", frames, motion.fps, joints, motion.duration, note=note, odd=odd)


def _recording(folder: Path) -> FileSummary:
    """The row of a folder with a recording."""
    recording = load_recording(folder, sample_rate=None)
    clip, motion, annotation = recording.clip, cast(Motion, recording.clip.motion), recording.annotation
    facts = [clip.dance or "dance not told", f"{clip.audio.duration:.2f} s of audio"]
    if annotation is not None:
        facts += [f"{annotation.times.size} beats", *([f"{len(annotation.units)} units"] if annotation.units else [])]
    row = _motion_row(folder, motion)
    late = oddities.late_end(clip.offset, motion, clip.audio)
    of_beats = () if annotation is None else oddities.beat_oddities(annotation.times)
    odd = (*oddities.span_oddities(folder, motion), *oddities.sound_oddities(clip.audio), *of_beats, *row.odd, *late)
    return replace(row, kind="sequence", offset=clip.offset, note=", ".join(facts), odd=odd)


def _performance(folder: Path) -> FileSummary:
    """The row of a folder with a musician's performance."""
    try:
        performance, has_rate = performances.load_performance(folder, sample_rate=None), True
    except MissingFrameRate:
        performance, has_rate = performances.load_performance(folder, sample_rate=None, fps=25.0), False
    files, row = performances.performance_files(folder), _motion_row(folder, performance.motion)
    facts = [performance.instrument, f"points of {', '.join(file.name for file in files.points)}"]
    audio, notes = performance.audio, performance.notes
    facts += [] if audio is None else [f"{audio.duration:.2f} s of {'rendered ' if performance.rendered else ''}audio"]
    facts += [] if notes is None else [f"{len(notes)} notes"]
    of_sound = ("no sound",) if audio is None else oddities.sound_oddities(audio)
    odd = [*of_sound, *row.odd, *_odd_hands(performance)]
    if not has_rate:
        row, odd = replace(row, rate=None, seconds=None), ["holds no frame rate: pass fps (--fps)", *odd]
    return replace(row, kind="performance", offset=performance.offset, note=", ".join(facts), odd=tuple(odd))


def _odd_hands(performance: performances.Performance) -> Iterator[str]:
    """One sentence for each hand, and for the body, that is missing or not detected in a fifth of the frames."""
    names = performance.motion.skeleton.joints
    for group, points in {"body": BODY, **{f"{side} hand": hand_joints(side) for side in SIDES}}.items():
        columns = [names.index(point) for point in points if point in names]
        share = performance.detected[:, columns].all(axis=1).mean()
        if not columns:
            yield f"no point of the {group}"
        elif share < LEAST_DETECTED:
            yield f"all its points of the {group} are detected in {share:.0%} of the frames only"
