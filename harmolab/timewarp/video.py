"""Video files seen at other moments."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from harmolab.io.files import PathLike
from harmolab.io.video import video_frames, write_video
from harmolab.timewarp.warps import TimeWarp
from harmolab.types import Audio

__all__ = ["warp_video", "warped_frames"]

Frame = NDArray[np.uint8]


def warped_frames(frames: Iterable[Frame], fps: float, warp: TimeWarp) -> Iterator[Frame]:
    """As many frames as came in: for each moment the frame nearest to it in source time.

    Slow stretches repeat a frame now and then, fast ones leave one out; none is blended. Frames are read once.
    """
    place = 0
    for index, frame in enumerate(frames):
        while float(warp.inverse(place / fps)) * fps <= index + 0.5:
            yield frame
            place += 1


def warp_video(path: PathLike, out: PathLike, warp: TimeWarp, audio: Audio | None = None, *, height: int = 480) -> None:
    """Write a video's frames at warped times, with the song.

    Parameters
    ----------
    path, out : str or path; `out` ends in .mp4 or .webm and appears whole or not at all
    warp : TimeWarp of the video's time line, as `retime` finds it for `harmolab.alignment.picture_motion` of the video
    audio : Audio, optional
        Sound from the first frame on. It is not warped: the frames go to the music.
    height : int, pixels
        A smaller video keeps its size.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    video = video_frames(path, height=height, colour=True)
    write_video(out, warped_frames(video, video.fps, warp), video.fps, audio=audio)
