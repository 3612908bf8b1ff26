"""From two files, a song and a movement, to a clip and its score."""

import os
from collections.abc import Iterable, Iterator, Sequence, Set
from contextlib import suppress
from dataclasses import replace
from difflib import get_close_matches
from math import inf
from pathlib import Path

from harmolab.beats.audio import music_beats
from harmolab.beats.meter import with_one
from harmolab.data import recordings
from harmolab.files import PathLike, Progress, named_faults, silent
from harmolab.params import DANCES, HarmonyParams
from harmolab.readers.audio import load_sound, resampled
from harmolab.readers.beats import load_annotation
from harmolab.readers.video import is_video
from harmolab.score import HarmonyScore
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_clip

TRACKED_AT = 22050.0  # hertz: beats are always tracked in sound of this rate


def score_files(
    song: PathLike,
    motion: PathLike,
    *,
    offset: float | None = None,
    seconds: float | None = None,
    dance: str = "",
    beats: PathLike | None = None,
    one: float | None = None,
    fps: float | None = None,
    params: HarmonyParams | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
) -> HarmonyScore:
    """The score of a motion file with a song file: is the dance in time with the song, and on the beat?

    It is `score_clip` of `load_clip`, as the command `harmolab score` has it. Say when the dance begins (`offset`) if
    you know it: where nothing tells, the verdict is "in time" at most.

    Parameters
    ----------
    song : str or path
        wav, flac, ogg, mp3 or m4a, or a video with sound.
    motion : str or path
        Any file that `load_motion` reads, or the folder of a recording.
    offset : float, seconds
        Moment of the song at which the motion begins. When left out, what the motion's file or folder says.
    seconds : float
        Length of the motion that is scored, from its beginning; all of it when left out.
    dance : str
        Name of the dance. If it is one of `DANCES`, the tempo is sought in its range. The usual course of cha-cha,
        rumba and waltz is then asked for.
    beats : str or path
        File of the song's beats (`load_beats`), in place of those that a program finds.
    one : float, seconds
        Moment of the song at which a bar begins; needs `dance`, which tells the beats in a bar.
    fps : float, frames per second
        As in `load_motion`.
    params, n_rotations, seed : as in `score_clip`

    Returns
    -------
    HarmonyScore

    Raises
    ------
    FileNotFoundError, ValueError
        As `load_clip` and `score_clip`; they name the file that is at fault.

    Examples
    --------
    >>> score = score_files("song.mp3", "dance.bvh", offset=12.4, dance="waltz")  # doctest: +SKIP
    >>> score.judgement.verdict, score.harmony_above_chance  # doctest: +SKIP
    """
    clip = load_clip(song, motion, offset=offset, seconds=seconds, dance=dance, beats=beats, one=one, fps=fps)
    return score_clip(clip, params, n_rotations=n_rotations, seed=seed)


def load_clip(
    song: PathLike,
    motion: PathLike | Motion,
    *,
    offset: float | None = None,
    seconds: float | None = None,
    dance: str = "",
    beats: PathLike | None = None,
    one: float | None = None,
    track: bool = True,
    fps: float | None = None,
    scale: float | None = None,
    joints: Sequence[str] | None = None,
    smpl: PathLike | None = None,
    up: str = "",
    sample_rate: float | None = TRACKED_AT,
    report: recordings.ReadingReport = lambda path, file: None,
) -> Clip:
    """A clip from a song and a motion, with the beats of the song: the first step of a score.

    Parameters
    ----------
    song : str or path
        wav, flac, ogg, mp3 or m4a, or a video with sound.
    motion : str, path or Motion
        Any file that `load_motion` reads, the folder of a recording, or a Motion.
    offset : float, seconds
        Moment of the song at which the motion begins. When left out: what the motion's file or folder says. Where these
        say nothing it is 0, and `Clip.has_start` is False. A Motion begins with the song.
    seconds : float
        Length of the motion that is taken, from its beginning; all of it when left out.
    dance : str
        Name of the dance. If it is one of `DANCES`, the tempo is sought in its range.
    beats : str or path
        File of the song's beats (.beats, csv, beats.json; see `load_beats`), in place of those that a program finds.
    one : float, seconds
        Moment of the song at which any bar begins; needs `dance`, which tells the beats in a bar.
    track : bool
        False leaves a clip without beats where there is no file of them.
    fps, scale, joints, smpl, up : as in `load_motion`, for a motion that is read
    sample_rate : float or None, hertz
        Rate of the clip's sound; None keeps the file's. The beats are the same at every rate. At rates other than
        22,050 Hz the sound of a video is decoded twice, since another resampler brings it to that rate.
    report : function(path, MotionFile)
        Called with how a motion file was read.

    Returns
    -------
    Clip

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file that is at fault. ValueError also for an unknown dance, unless `beats` are passed; for `one`
        without a dance of `DANCES`, or with no beat near it; and for `seconds` or `up` that cannot be.

    Examples
    --------
    >>> clip = load_clip("song.mp3", "dance.bvh", offset=12.4)  # doctest: +SKIP
    """
    check_dance(dance, beats, one)
    if seconds is not None and not 0 < seconds < inf:
        raise ValueError(f"seconds must be positive and finite, got {seconds:g}")
    if isinstance(motion, Motion):
        movement, path, files, has_start = motion, song, f"{song}", True
    else:
        offset = recordings.recorded_offset(motion) if offset is None else offset
        path, files, has_start = motion, f"{song} and {motion}", offset is not None
        movement = recordings.load_any_motion(
            motion, fps=fps, scale=scale, joints=joints, smpl=smpl, up=up, report=report
        )
    audio = load_sound(song, sample_rate=sample_rate)
    sound = audio if sample_rate == TRACKED_AT else tracked_sound(song, audio)
    annotated = None if beats is None else annotated_beats(beats, sound)
    with named_faults(files):
        movement = movement if seconds is None else movement.span(0.0, seconds)
        name = Path(path).stem or Path(path).name
        clip = Clip(name, audio, movement, offset or 0.0, beats=annotated, dance=dance, has_start=has_start)
    if track and annotated is None:
        clip = replace(clip, beats=music_beats(replace(clip, audio=sound)))
    if one is None or clip.beats is None:
        return clip
    return replace(clip, beats=with_one(clip.beats, one, DANCES[dance].meter))


def check_dance(dance: str, beats: PathLike | None = None, one: float | None = None) -> None:
    """ValueError for an unknown dance where its tempo or its bars are needed; it names the likeliest known one."""
    if dance and beats is None and dance not in DANCES:
        raise unknown_dance(dance, DANCES)
    if one is not None and dance not in DANCES:
        raise ValueError(f"to count from --one, say how long the bars are with --dance: {', '.join(DANCES)}")


def unknown_dance(dance: str, names: Iterable[str]) -> ValueError:
    """The error that a dance is none of `names`, with the likeliest of them."""
    alphabetical = sorted(names)
    nearest = get_close_matches(dance.casefold(), alphabetical, 1)
    hint = f" did you mean {nearest[0]!r}?" if nearest else ""
    return ValueError(f"unknown dance {dance!r};{hint} known: {', '.join(alphabetical)}")


def song_beats(audio: Audio, *, dance: str = "", beats: PathLike | None = None, one: float | None = None) -> BeatTrack:
    """The beats of a whole song: annotated ones of a file, else tracked ones; with bar places where "one" is told.

    Parameters
    ----------
    audio : Audio, of `TRACKED_AT` hertz where beats are tracked
    dance, beats, one : as in `load_clip`

    Raises
    ------
    FileNotFoundError, ValueError
        As in `load_clip`.
    """
    check_dance(dance, beats, one)
    annotated = None if beats is None else annotated_beats(beats, audio)
    track = music_beats(Clip("", audio, beats=annotated, dance=dance))
    return track if one is None else with_one(track, one, DANCES[dance].meter)


def annotated_beats(path: PathLike, audio: Audio) -> BeatTrack:
    """The beats of a song as a file has them; errors of `load_annotation`, and of beats that reach beyond the song."""
    annotation = load_annotation(path)
    with named_faults(path):
        return annotation.in_music(audio)


def tracked_sound(song: PathLike, sound: Audio) -> Audio:
    """The sound of a song at `TRACKED_AT`; a video is read again, since another resampler brings it there."""
    return load_sound(song) if is_video(song) else resampled(sound, TRACKED_AT)


def corpus_recordings(
    corpus: PathLike | Iterable[recordings.Recording],
    *,
    progress: Progress = silent,
    report: recordings.ProblemReport = lambda problem: None,
) -> Iterator[recordings.Recording]:
    """The recordings at or below a folder that can be read, one in memory at a time.

    Parameters
    ----------
    corpus : str or path; recordings in its place are handed on
    progress : Progress over the folders
    report : function(Problem), called for each recording that cannot be read

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the folder; ValueError where it holds no recording.
    """
    if not isinstance(corpus, str | os.PathLike):
        yield from corpus
        return
    recording_folders(corpus)
    for item in progress(recordings.iter_recordings(corpus), Path(corpus).name):
        if isinstance(item, recordings.Problem):
            report(item)
        else:
            yield item


def recording_folders(corpus: PathLike) -> recordings.RecordingFolders:
    """The folders of recordings at or below a folder; ValueError without one, else errors as `find_recordings`."""
    complete = recordings.find_recordings(corpus)
    if not complete.folders:
        raise ValueError(f"{corpus}: holds no folder of a recording; see `harmolab data check {corpus}`")
    return complete


def corpus_dances(corpus: PathLike) -> set[str]:
    """Names of the dances in a corpus, "" among them for recordings that name none; errors as `recording_folders`.

    Neither sound nor movement is read. Recordings whose annotation is damaged are left out.
    """
    names = set()
    for folder in recording_folders(corpus).folders:
        with suppress(ValueError, OSError):
            names.add(recordings.recording_files(folder).dance)
    return names


def check_dances(corpus: PathLike, dances: Sequence[str], names: Set[str]) -> None:
    """ValueError where dances are asked for, and none of them is among the names of a corpus's dances."""
    if dances and names.isdisjoint(dances):
        others = ", ".join(sorted(name or "unknown" for name in names)) or "none"
        raise ValueError(f"{corpus}: holds no {' or '.join(dances)}; its dances: {others}")
