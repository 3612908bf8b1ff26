"""The song and the dance that a command is called with: two files, or one folder or video that holds both."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import typer

import harmolab
from harmolab import lab
from harmolab.cli.common import MOTIONS, JudgeOptions, check_untold, is_told, note_assumptions
from harmolab.cli.data import offer_poses
from harmolab.cli.screen import detail, finding_beats, note, progress
from harmolab.files import SOUNDS

if TYPE_CHECKING:
    from harmolab.lab.explain.performance import Performance
    from harmolab.types import Audio, BeatTrack, Clip, Motion

ALONE = "the folder of one recording, or a video with its music, may stand alone"
FOR_FILES = ("fps", "scale", "joints", "smpl", "up")  # options of motion files, of no use for a video
UNPLACED = (
    "{0.motion}: no sound in it tells where in {0.song} it begins; pass --offset, or use `harmolab score --why`, which "
    "looks for the place by the movement"
)
APART = "{}: --offset lays the picture {:g} s {} than its own sound; leave it out where the two belong together"
UNHEARD = 1.0  # seconds of a dance before or after its song that need no word
MULTIPLES = (1 / 3, 1 / 2, 1, 2, 3)  # of a tempo that count the same music
SAME_TEMPO = 0.03
OTHER_TEMPO = (
    "{song} by itself goes at {own:.0f} beats a minute. A dance called {dance} has some {low:g} to {high:g}, so beats "
    "were sought there, and {tempo:.0f} were taken. If that is wrong, leave the dance out, or say its beats (--beats)"
)


class Sources(NamedTuple):
    """A song and a dance to it, which may be one video; the song's annotated beats, the dance's name, and a "one"."""

    song: Path
    motion: Path
    beats: Path | None = None
    dance: str = ""
    one: float | None = None

    @property
    def is_video(self) -> bool:
        """True where the dance is a video."""
        from harmolab.readers.video import is_video

        return is_video(self.motion)


def sources(context: typer.Context, song: Path, motion: Path | None, options: JudgeOptions) -> Sources:
    """The files that a command reads, with what the folder of a recording says beside them; checked before any work.

    Raises
    ------
    FileNotFoundError, ValueError
        There is no such file, no dance, more than one, or no dance of that name; options of motion files go with a
        video.
    """
    from harmolab.clips import check_dance

    files = _paired(context, song, motion)
    files = files._replace(beats=options.beats or files.beats, dance=options.dance or files.dance, one=options.one)
    if options.pattern is None:  # a file of patterns has names of its own
        # A name on the command line is to be one of ours, or it would change nothing beside annotated beats.
        check_dance(files.dance, None if options.dance else files.beats, options.one)
    if any(is_told(context, name) for name in FOR_FILES) and files.is_video:
        check_untold(context, FOR_FILES, f"is for motion files, and {files.motion} is a video; leave it out")
    if (offset := context.params.get("offset")) and files.song == files.motion and files.is_video:
        note(APART.format(files.motion.name, abs(offset), "later" if offset > 0 else "earlier"))
    for word, path in {"song": files.song, "dance": files.motion, "beats": files.beats}.items():
        if path is not None:
            detail(f"reads {word}: {path}")
    return files


def _paired(context: typer.Context, song: Path, motion: Path | None) -> Sources:
    """The files, before options are looked at."""
    from harmolab.readers.video import is_video

    if song.is_dir():
        files = _in_folder(song)
        return files if motion is None else files._replace(motion=motion)
    if motion is None:
        if not is_video(song):
            raise ValueError(f"{song}: {context.info_name} takes SONG DANCE; {ALONE}")
        motion = song
    if motion.is_dir():
        motion = _only(motion, MOTIONS) or motion
    return Sources(song, motion)


def _in_folder(folder: Path) -> Sources:
    """The files of a recording's folder; or its only sound and only motion; or its only video.

    Raises
    ------
    FileNotFoundError
        For a folder of something else; says what it lacks.
    """
    from harmolab.data.recordings import missing_parts, recording_files
    from harmolab.readers import video

    if missing_parts(folder):
        sound, motion, film = (_only(folder, suffixes) for suffixes in (SOUNDS, MOTIONS, video.SUFFIXES))
        song = sound or film
        if song and (motion or film):
            return Sources(song, motion or film or song, _only(folder, (".beats",)))
    files = recording_files(folder)
    return Sources(files.song, folder, files.beats, files.dance)


OWN = ("motion.npz", "skeletons.json", "config.json", "beats.json")  # parts of a recording, which is read as a whole


def _only(folder: Path, suffixes: tuple[str, ...]) -> Path | None:
    """The only file of a folder with one of these endings; None where there are none or several, or a part of ours."""
    files = [path for path in folder.iterdir() if path.suffix.lower() in suffixes]
    return files[0] if len(files) == 1 and files[0].name not in OWN else None


def clip_of(files: Sources, *, offset: float | None = None, movement: Motion | None = None, **options: Any) -> Clip:
    """The song and the dance with the music's beats; the movement of a video is that of its dancer.

    A line on the screen says where a good part of the dance has no music, and where its name bends the music's tempo.

    Parameters
    ----------
    files : Sources
    offset : as in `load_clip`
    movement : Motion in place of that of the file
    options : further ones of `load_clip`

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; ValueError where it is not clear from its sound where in the song a video begins.
    """
    if movement is None and files.is_video:
        movement, offset = _of_video(files, offset)
    with finding_beats():
        clip = harmolab.load_clip(
            files.song, movement or files.motion, offset=offset, dance=files.dance, beats=files.beats, one=files.one,
            report=note_assumptions, **options,
        )  # fmt: skip
        seconds, duration = clip.audio.duration - clip.offset, clip.motion.duration if clip.motion else 0.0
    for remark in music_remarks(-clip.offset, seconds, duration, files.song):
        note(remark)
    if files.dance and clip.beats is not None:
        note_tempo(files.song, files.dance, clip.beats)
    return clip


def _of_video(files: Sources, offset: float | None) -> tuple[Motion, float]:
    """The movement of a video, and the song's time at which it begins, by its sound unless told."""
    performance = dance_performance(files)
    if offset is None and files.song.resolve() != files.motion.resolve():
        offset = sound_offset(files, performance.sound)
        if offset is None:
            raise ValueError(UNPLACED.format(files))
    return performance.motion, offset or 0.0


def film_offset(files: Sources, film: Path) -> float | None:
    """Second of the song at which a film begins: by the file of its points, else by its sound; None where unclear."""
    from harmolab.data.recordings import recorded_offset
    from harmolab.readers.audio import video_sound
    from harmolab.readers.video import first_picture

    if (begin := recorded_offset(files.motion)) is not None:
        return begin - first_picture(film)
    if files.song.resolve() == film.resolve():
        return 0.0
    with suppress(ValueError):  # the film has no sound that can be read
        return sound_offset(files._replace(motion=film), video_sound(film))
    return None


def sound_offset(files: Sources, sound: Audio | None) -> float | None:
    """Second of the song at which a video with this sound begins, and a line on it; None where the sound is unclear."""
    from harmolab.lab.explain.offset import REPEATS, find_sound_offset

    song, place = harmolab.load_sound(files.song), None
    if sound is not None:
        with suppress(ValueError):  # its sound is silent, or shorter than can be compared
            place = find_sound_offset(sound, song)
    if place is None or not place.is_clear:
        return None
    begins, doubt = ("begins", "") if place.is_unique else ("may begin", f". {REPEATS.removesuffix('.')}")
    note(f"{files.motion.name} {begins} at {round(place.seconds, 2) + 0.0:.2f} s of the song, by its sound{doubt}")
    return place.seconds


def dance_performance(files: Sources, **reading: Any) -> Performance:
    """The movement of the dance, `reading` as in `load_performance`, and lines on how it was read.

    Of a video also its sound; first the question whether what finds bodies may be fetched.
    """
    if files.is_video:
        offer_poses(files.motion)
    performance = lab.load_performance(files.motion, report=note_assumptions, progress=progress, **reading)
    for sentence in performance.notes:
        note(f"{files.motion.name}: {sentence}")
    return performance


def check_signs(files: Sources, clip: Clip, scores: Iterable[harmolab.HarmonyScore]) -> None:
    """ValueError where a video was read poorly, and no sign of the beat was seen; that is no verdict."""
    for score in scores:
        if clip.motion is not None and (fault := reading_fault(score, files.motion, clip.motion)):
            raise ValueError(fault)


def reading_fault(score: harmolab.HarmonyScore, dance: Path, motion: Motion) -> str:
    """The reason why a video was read too poorly for the verdict of a score; "" where it was not."""
    if score.judgement is not None and score.judgement.level == 1:
        from harmolab.lab.explain.filmed import check_sign

        try:
            check_sign(dance, motion)
        except ValueError as error:
            return str(error)
    return ""


def note_tempo(song: Path, dance: str, beats: BeatTrack) -> None:
    """A line with the `tempo_remark`."""
    with finding_beats():
        remark = tempo_remark(song, dance, beats)
    if remark:
        note(remark)


def tempo_remark(song: Path, dance: str, beats: BeatTrack) -> str:
    """A sentence where beats were tracked among the tempi of a dance, and the song surely has another one; else ""."""
    if beats.fit is None or len(beats) < 2 or dance not in harmolab.DANCES:
        return ""
    own = harmolab.audio_beats(harmolab.load_sound(song))
    if not own.is_sure or min(abs(own.tempo / beats.tempo / times - 1) for times in MULTIPLES) <= SAME_TEMPO:
        return ""
    low, high = harmolab.DANCES[dance].tempo
    return OTHER_TEMPO.format(song=song.name, own=own.tempo, dance=dance, low=low, high=high, tempo=beats.tempo)


def music_remarks(before: float, until: float, duration: float, song: Path) -> Iterator[str]:
    """Sentences where a dance of a duration begins seconds `before` its music, or goes on when its music has ended."""
    if before > UNHEARD:
        yield f"the dance begins {before:.1f} s before {song.name}: a verdict counts minutes from the begin of the song"
    if duration - until > UNHEARD:
        only = f"{until - before:.1f} s" if before > 0 else f"the first {until:.1f} s"
        ends = f"the music of {song.name} ends {duration - until:.1f} s before the dance does"
        yield f"{ends}: only {only} of the dance have music and are judged"
