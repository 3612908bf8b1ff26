"""A dance as it was recorded, and where it begins in its song.

The surest of four sources tells the start: the user, the folder of the recording, the sound of the video
(`find_sound_offset`), or the movement, modulo the beat (`find_offset`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from harmolab.alignment import SoundOffset, find_offset, find_sound_offset, picture_motion
from harmolab.data.folders import load_any_motion, told_start
from harmolab.io.files import PathLike, Progress, silent
from harmolab.io.video import is_video, video_frames
from harmolab.io.video_sound import video_sound
from harmolab.types import Audio, BeatTrack, Motion

__all__ = ["Placement", "Recording", "load_recording", "place_recording"]

HEIGHT = 160  # pixels of the video that flow is measured on
SURE = 0.95  # confidence of an offset by movement, below which it means little

Source = Literal["given", "folder", "same", "sound", "movement"]


@dataclass(frozen=True, eq=False)
class Recording:
    """A dance as it was recorded.

    Parameters
    ----------
    path : Path
    motion : Motion; of a video `picture_motion`
    is_video : bool
    sound : Audio or None, of a video whose sound can be read
    start : float or None, seconds
        Song time of frame 0 where the recording's folder tells it.
    """

    path: Path
    motion: Motion
    is_video: bool = False
    sound: Audio | None = None
    start: float | None = None


@dataclass(frozen=True)
class Placement:
    """Where a dance begins in its song, and how that is known.

    Parameters
    ----------
    seconds : float, song time of frame 0
    source : "given", "folder", "same" (song and dance are one video), "sound" or "movement"
    period : float or None, seconds
        By movement the offset is known modulo this.
    confidence : float or None
        Of an offset by movement, as in `harmolab.alignment.Offset`.
    repeats : bool
        By sound: another place fits nearly as well, since the song repeats itself, or since it is another song.
    """

    seconds: float
    source: Source
    period: float | None = None
    confidence: float | None = None
    repeats: bool = False

    @property
    def is_absolute(self) -> bool:
        """Whether early or late throughout can be told."""
        return self.source != "movement"

    @property
    def is_sure(self) -> bool:
        """False where the movement gives no evidence of any place."""
        return self.confidence is None or self.confidence >= SURE

    def __str__(self) -> str:
        told = f"Your dance begins at {self.seconds:.2f} s of the song"
        if self.source == "given":
            return f"{told}, as you said."
        if self.source == "folder":
            return f"{told}, as the recording's folder says."
        if self.source == "same":
            return "Song and dance are one video, so they begin together."
        if self.source == "sound":
            again = " Another place fits nearly as well: the song repeats itself, or another song plays in the video."
            return f"{told}: found by comparing the video's sound with the song.{again if self.repeats else ''}"
        period = f"{self.period:.2f} s" if self.period else "a beat"
        doubt = "" if self.is_sure else " The evidence is weak: beats of another tempo fit your movement as well."
        return (
            f"{told}, or whole beats of {period} from there: found from your movement alone, which says which place in "
            f"the beat, not which beat.{doubt}"
        )


def load_recording(
    path: PathLike,
    *,
    fps: float | None = None,
    joints: Sequence[str] | None = None,
    height: int = HEIGHT,
    progress: Progress = silent,
) -> Recording:
    """A motion file, a folder, or a video (by its suffix) with its sound.

    Parameters
    ----------
    path : str or path
    fps, joints : see `harmolab.io.motion.load_motion`; not for a video
    height : int, pixels that a video is made smaller to
    progress : function(iterable, label) -> iterable

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    path = Path(path)
    if is_video(path):
        frames = video_frames(path, height=height)
        try:
            motion = picture_motion(frames, frames.fps, progress=progress)
        except ValueError as error:
            raise ValueError(str(error) if str(error).startswith(str(path)) else f"{path}: {error}") from None
        return Recording(path, motion, True, _sound(path))
    motion = load_any_motion(path, fps=fps, joints=None if joints is None else tuple(joints))
    return Recording(path, motion, start=told_start(path))


def _sound(path: Path) -> Audio | None:
    """The sound of a video; None where there is none, or none that can be read: the movement must do then."""
    try:
        return video_sound(path)
    except ValueError:
        return None


def place_recording(
    recording: Recording, song: Audio, music: BeatTrack, *, guess: float | None = None, search: float = 2.0
) -> Placement:
    """Where a recording begins in its song: by its folder, else by its sound, else by its movement.

    Parameters
    ----------
    recording : Recording
    song : Audio
    music : BeatTrack, the song's beats
    guess : float, seconds, optional
        Where to look by movement; the sound searches everywhere.
    search : float, seconds
        How far from the guess to look, to either side.

    Raises
    ------
    ValueError
        As `harmolab.alignment.find_offset`.
    """
    if recording.start is not None and guess is None:
        return Placement(recording.start, "folder")
    heard = _by_sound(recording.sound, song)
    if heard is not None and heard.is_clear:
        return Placement(heard.seconds, "sound", repeats=not heard.is_unique)
    try:
        found = find_offset(song, recording.motion, music=music, guess=guess or 0.0, search=search)
    except ValueError as error:
        raise ValueError(f"{recording.path}: {error}") from None
    return Placement(found.seconds, "movement", found.period, found.confidence)


def _by_sound(sound: Audio | None, song: Audio) -> SoundOffset | None:
    """Where the sound of a video lies in the song; None without sound, or where it is too short or silent."""
    try:
        return None if sound is None else find_sound_offset(sound, song)
    except ValueError:
        return None
