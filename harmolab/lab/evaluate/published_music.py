"""Music beats as published evaluation codes take them: librosa's, on the frames of the motion, faults included."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from harmolab.beats.audio import HOP, librosa_beats
from harmolab.harmony import music_and_motion
from harmolab.io.video_sound import load_sound
from harmolab.types import Audio, BeatTrack, Clip, Motion

MusicBeats = Callable[[Audio, str], BeatTrack]  # sound of `HOP` samples a frame, name of the song -> its beats

FRAME_RATES = (10.0, 250.0)  # hertz, of motions on the frames of which beats are tracked
MOST_FRAMES = 54_000  # of a song: 15 minutes at 60 a second take 5 GB, which Bailando's way of tracking holds at once
TRACKS_KEPT = 2  # songs of which a process holds the beats, as dances to one song come in a row
OTHER_TEMPO = 120.0  # beats per minute, librosa's own, for songs that are not of AIST
_AIST_SONG = re.compile(r"(?:^|_)m(BR|PO|LO|MH|LH|WA|KR|JS|JB|HO)(\d)(?=_|$)")


def aist_tempo(song: str) -> float:
    """Tempo of a song of AIST by its name, beats per minute; that of `OTHER_TEMPO` for any other.

    >>> aist_tempo("mBR2"), aist_tempo("gHO_sBM_cAll_d19_mHO3_ch01"), aist_tempo("waltz")
    (100.0, 125.0, 120.0)
    """
    name = _AIST_SONG.search(song)
    if name is None:
        return OTHER_TEMPO
    return 110.0 + 5 * int(name[2]) if name[1] == "HO" else 80.0 + 10 * int(name[2])


def aist_beats(audio: Audio, song: str) -> BeatTrack:
    """Music beats of mint's `tools/preprocessing.py`: mean onset strength, the tempo in the song's name as a prior."""
    return librosa_beats(audio, start_tempo=aist_tempo(song))


def bailando_beats(audio: Audio, song: str) -> BeatTrack:
    """Music beats of Bailando's `extractor.py`: median onset strength of the percussive part, prior of 120 a minute."""
    return librosa_beats(audio, percussive=True)


def published_music_and_motion(
    clip: Clip, music: Path, song: str, music_beats: MusicBeats | None
) -> tuple[BeatTrack, Motion]:
    """As `music_and_motion`, with beats that a published code tracks in the file of the song.

    Parameters
    ----------
    clip : Clip with a motion
    music : Path of its song
    song : str, name of the song
    music_beats : function of the published code; the clip's own beats without one

    Raises
    ------
    FileNotFoundError, ValueError
        As `load_sound` and `music_and_motion`; also for a frame rate beyond `FRAME_RATES`, and a song of more than
        `MOST_FRAMES`.
    """
    if clip.motion is None or music_beats is None:
        return music_and_motion(clip)
    fps = clip.motion.fps
    if not FRAME_RATES[0] <= fps <= FRAME_RATES[1]:
        low, high = FRAME_RATES
        raise ValueError(
            f"the published code tracks beats on the motion's frames, {low:g} to {high:g} a second: {fps:g}"
        )
    if (frames := round(clip.audio.duration * fps)) > MOST_FRAMES:
        raise ValueError(f"{music} has {frames} frames, more than the {MOST_FRAMES} that are tracked at once; cut it")
    beats = _song_beats(music, music.stat().st_mtime_ns, song, fps, music_beats)
    return music_and_motion(replace(clip, beats=beats))


@lru_cache(maxsize=TRACKS_KEPT)
def _song_beats(music: Path, _: int, song: str, fps: float, music_beats: MusicBeats) -> BeatTrack:
    """The beats of a song; the second argument, its time of change, keeps them up to date."""
    return music_beats(load_sound(music, sample_rate=HOP * fps), song)
