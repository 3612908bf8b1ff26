"""From two files to a score: the first step of the ladder files, clip, beat tracks, arrays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from harmolab.beats.audio import music_beats
from harmolab.data.folders import load_any_motion, recorded_offset
from harmolab.harmony import score_clip
from harmolab.io.beats import load_annotation
from harmolab.io.files import PathLike
from harmolab.io.video_sound import load_sound
from harmolab.params import DANCES, HarmonyParams
from harmolab.types import Clip, HarmonyScore


def score_files(
    song: PathLike,
    motion: PathLike,
    *,
    offset: float | None = None,
    seconds: float | None = None,
    dance: str = "",
    beats: PathLike | None = None,
    fps: float | None = None,
    params: HarmonyParams | None = None,
    n_rotations: int = 1000,
    seed: int = 0,
) -> HarmonyScore:
    """Harmony of a motion file with a song file.

    Parameters
    ----------
    song, motion, offset, seconds, dance, beats, fps : as in `load_clip`
    params : HarmonyParams, default ``HarmonyParams.recommended()``
    n_rotations, seed : as in `score_clip`

    Raises
    ------
    FileNotFoundError, ValueError
        As `load_clip` and `score_clip`; of a file, they name it.

    Examples
    --------
    >>> score_files("song.mp3", "dance.bvh", offset=12.4, dance="waltz").harmony_above_chance  # doctest: +SKIP
    0.61
    """
    clip = load_clip(song, motion, offset=offset, seconds=seconds, dance=dance, beats=beats, fps=fps)
    return score_clip(clip, params, n_rotations=n_rotations, seed=seed)


def load_clip(
    song: PathLike,
    motion: PathLike,
    *,
    offset: float | None = None,
    seconds: float | None = None,
    dance: str = "",
    beats: PathLike | None = None,
    fps: float | None = None,
) -> Clip:
    """A song and a motion as a clip with its music beats, read or tracked once.

    Parameters
    ----------
    song : str or path: wav, flac, ogg or mp3, or a video with sound
    motion : str or path: anything that `load_motion` reads, or a folder of a corpus
    offset : float, seconds, audio time of motion frame 0; left out, what the motion's folder says, else 0
    seconds : float, length of the motion that is taken; all of it when left out
    dance : str, a prior of the tempo where it is one of `DANCES`
    beats : str or path of an annotation (.beats, csv, beats.json) in place of beat tracking
    fps : float, frame rate, for files that do not hold it

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. ValueError also for an unknown dance without annotated beats.
    """
    motion = Path(motion)
    if dance and beats is None and dance not in DANCES:
        raise ValueError(f"unknown dance {dance!r}; known: {', '.join(DANCES)}")
    audio, movement = load_sound(song), load_any_motion(motion, fps=fps)
    if seconds is not None:
        movement = movement.span(0.0, seconds)
    if offset is None:
        offset = recorded_offset(motion) or 0.0
    track = None if beats is None else load_annotation(beats).track(audio.duration)
    try:
        clip = Clip(motion.stem or motion.name, audio, movement, offset, beats=track, dance=dance)
    except ValueError as error:
        raise ValueError(f"{song} and {motion}: {error}") from None
    return replace(clip, beats=music_beats(clip))
