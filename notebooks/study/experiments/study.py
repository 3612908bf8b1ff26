"""The running example, recordings or synthetic clips of the notebooks, and how music beats and visual beats agree."""

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from harmolab.data.recordings import (
    Problem,
    Recording,
    find_recordings,
    iter_recordings,
    load_any_motion,
    load_recording,
    recording_beats,
)
from harmolab.data.synthetic import ClipSettings, planted_clip, write_corpus
from harmolab.files import cache_folder
from harmolab.lab.compare.windows import cut_clips, learn_patterns
from harmolab.params import DANCES, BarPattern
from harmolab.score import hit_mask
from harmolab.significance import rotations
from harmolab.systems.choreographer.banks import shipped_bank
from harmolab.types import BeatTrack, Clip, Motion
from study.profile import RunProfile

Item = TypeVar("Item")
EXAMPLE_SECONDS = 12.0
SONG_SECONDS = 36.0
SOURCE = "synthetic song, CMU motion capture"


@cache
def example_recording(dance: str, *, seed: int = 1) -> Recording:
    """36 s of a synthetic song and a dance to it: recorded salsa, cut at its rests and laid on the song's beats.

    The beats of the music are planted, and so are the dancer's rests: on those beats, as closely as recorded movement
    rests on its own. The bank knows no other dance and no bar.

    Parameters
    ----------
    dance : str, one of `harmolab.DANCES`, the song's
    seed : int, of the song

    Raises
    ------
    ValueError
        For a dance that is unknown.
    """
    planted = planted_clip(ClipSettings(dance, SONG_SECONDS, seed=seed), name=f"example {dance}")
    song = planted.clip
    danced = shipped_bank("salsa").choreograph(song.audio, song.beats, seconds=SONG_SECONDS)
    clip = replace(song, motion=danced.motion, offset=danced.start, source=SOURCE)
    return Recording(clip, replace(planted.annotation, units=()), Path(clip.name))


def planted_song(dance: str, number: int, seconds: float, first_seed: int) -> Clip:
    """The `number`-th synthetic song of a dance, with its planted dancer, beats and bars.

    Songs of other uses have another `first_seed`; the seeds of corpora are drawn from another sequence.
    """
    seed = first_seed + 1000 * list(DANCES).index(dance) + number
    planted = planted_clip(ClipSettings(dance, seconds, seed=seed), name=f"{dance} {number + 1}")
    return replace(planted.clip, beats=planted.annotation.track(planted.clip.audio.duration))


def waltz_example(*, late: float = 0.0) -> Clip:
    """The notebooks' running example: twelve seconds of recorded movement that is free, laid on a synthetic waltz.

    Parameters
    ----------
    late : float, seconds by which the dance comes later than it was laid, rounded to whole frames

    Returns
    -------
    Clip from 0 s, its `beats` tracked in the whole song. Without recordings `clip_of_study` are the same seconds.
    """
    recording = example_recording("waltz")
    fps = cast(Motion, recording.clip.motion).fps
    offset = recording.clip.offset + round(late * fps) / fps
    clip = replace(recording.clip, beats=recording_beats(recording, "tracked"), offset=offset)
    return clip.span((SONG_SECONDS - EXAMPLE_SECONDS) / 2, EXAMPLE_SECONDS)


def middle_span(recording: Recording, seconds: float) -> tuple[float, float]:
    """Start in the music and length, in seconds, of the middle of what music and motion of a recording share.

    It starts on a frame of the motion and is at most `seconds` long.

    Raises
    ------
    ValueError
        If the recording has no motion.
    """
    clip, motion = recording.clip, recording.clip.motion
    if motion is None:
        raise ValueError(f"{recording.folder}: no motion")
    first, last = max(0.0, -clip.offset), min(motion.duration, clip.audio.duration - clip.offset)
    length = min(seconds, last - first)
    # On a frame, and never before the music.
    start = float(np.ceil((first + (last - first - length) / 2) * motion.fps - 1e-6) / motion.fps)
    return max(0.0, clip.offset + start), length


def excerpt(recording: Recording, seconds: float, beats: str = "tracked") -> Clip:
    """`middle_span` of a recording as a clip that starts at 0 s, with its music beats; as `clip_of_study`.

    Raises
    ------
    ValueError
        If the recording has no motion.
    """
    start, length = middle_span(recording, seconds)
    track = recording_beats(recording, "tracked" if recording.annotation is None else beats)
    clip = replace(recording.clip, name=f"{recording.clip.name} from {start:.1f} s", beats=track)
    return replace(clip.span(start, length), offset=0.0)  # the span starts on a frame


def data_root() -> Path | None:
    """The folder of recordings that ``HARMOLAB_DATA`` names; None when it is not set.

    Raises
    ------
    FileNotFoundError
        If the variable names no folder.
    """
    setting = os.environ.get("HARMOLAB_DATA")
    if not setting:
        return None
    root = Path(setting).expanduser()
    if not root.is_dir():
        raise FileNotFoundError(f"HARMOLAB_DATA names {root}, which is no folder; unset it to use synthetic data")
    return root


def synthetic_corpus(
    profile: RunProfile, *, seconds: float = 6.0, fps: float = 60.0, noise: float = 0.0, jitter: float = 0.0
) -> Path:
    """Folder of the synthetic corpus of these settings, written on first use and kept in the cache folder."""
    base = cache_folder() or Path(".harmolab")
    name = f"synthetic_{profile.n_clips}x{seconds:g}s_{fps:g}fps_noise{noise:g}_jitter{jitter:g}_seed{profile.seed}"
    settings: dict[str, Any] = {"seconds": seconds, "fps": fps, "noise": noise, "jitter": jitter}
    return write_corpus(base / name, clips=profile.n_clips, seed=profile.seed, **settings)


def corpus_folders(profile: RunProfile) -> dict[str, Path]:
    """The corpora to study: name -> folder. Recordings when ``HARMOLAB_DATA`` names some, else the synthetic corpus.

    Each folder that holds recordings is a corpus of its own, named by its way below the folder of corpora
    ("realdance/replays"); a corpus counts as itself. Those with movement in three dimensions come first.
    """
    root = data_root()
    if root is None:
        return {"synthetic": synthetic_corpus(profile)}
    parents = sorted({folder.parent for folder in find_recordings(root).folders})
    if not parents or not all(parent != root and parent.is_relative_to(root) for parent in parents):
        return {root.name: root}
    return {
        parent.relative_to(root).as_posix(): parent for parent in sorted(parents, key=lambda one: not in_space(one))
    }


@cache
def in_space(corpus: Path) -> bool:
    """True if the first recording of a corpus that has a motion has it in three dimensions."""
    for folder in find_recordings(corpus).folders:
        with suppress(ValueError, FileNotFoundError):
            return load_any_motion(folder).positions.shape[2] == 3
    return False


def study_recordings(profile: RunProfile, corpus: str | None = None) -> Iterator[Recording]:
    """Readable recordings of one corpus (default: the first), one in memory at a time, as many as the profile takes.

    A smaller number is spread over the corpus, so that every dance is there.

    Raises
    ------
    ValueError
        If there is no corpus of that name.
    """
    folders = corpus_folders(profile)
    name = corpus or next(iter(folders))
    if name not in folders:
        raise ValueError(f"there is no corpus {name!r}; there are {', '.join(folders)}")
    paths = find_recordings(folders[name]).folders
    most = None if name == "synthetic" else profile.n_sequences
    yield from map(load_recording, spread(paths, len(paths) if most is None else most))


def spread(items: Sequence[Item], count: int) -> list[Item]:
    """At most so many of some items, in order, at even steps from the first."""
    count = min(count, len(items))
    return [items[place * len(items) // count] for place in range(count)]


def readable_recordings(root: Path) -> Iterator[Recording]:
    """The recordings of a corpus that can be read."""
    return (item for item in iter_recordings(root) if not isinstance(item, Problem))


def clip_of_study(
    profile: RunProfile, *, dance: str = "waltz", seconds: float = EXAMPLE_SECONDS, beats: str = "tracked"
) -> Clip:
    """One clip to look at closely: the middle of the first recording of that dance (of any dance when there is none).

    Without recordings the middle of an `example_recording`: `waltz_example`, unless another dance is named.

    Parameters
    ----------
    profile : RunProfile
    dance : str
    seconds : float
    beats : "tracked" or "annotated"
        Music beats tracked in the whole recording, or the annotated ones (tracked where there is no annotation).

    Returns
    -------
    Clip from 0 s, `beats` its music beats on that time line.

    Raises
    ------
    ValueError
        If there are recordings, and none can be read.
    """
    return excerpt(_first_of_dance(profile, dance), seconds, beats)


def _first_of_dance(profile: RunProfile, dance: str) -> Recording:
    """The recording that `clip_of_study` cuts from."""
    if data_root() is None:
        return example_recording(dance)
    first = None
    for recording in study_recordings(profile):
        first = first or recording
        if recording.clip.dance == dance:
            return recording
    if first is None:
        raise ValueError(f"{data_root()}: holds no sequence that can be read")
    return first


def pattern_of_study(
    profile: RunProfile, *, dance: str = "waltz", seconds: float = EXAMPLE_SECONDS
) -> BarPattern | None:
    """The bar pattern to expect in `clip_of_study`: learnt on other recordings and other figures of its dance.

    None where nothing can be learnt: in the example, who rests on every beat, and without annotated beats.
    """
    if data_root() is None:
        return None
    recording = _first_of_dance(profile, dance)
    if recording.annotation is None:
        return None
    start, _ = middle_span(recording, seconds)
    cut = cut_clips(recording, "annotated", None)
    near = [clip for clip in cut if clip.start < start + seconds and start < clip.start + clip.duration]
    judged = replace(near[0], figures=frozenset().union(*(clip.figures for clip in near)))
    others = (item for item in readable_recordings(recording.folder.parent) if item.folder != recording.folder)
    annotated = (item for item in others if item.annotation is not None and item.clip.dance == recording.clip.dance)
    clips = [clip for item in annotated for clip in cut_clips(item, "annotated", None)]
    pattern = learn_patterns([judged], clips)[0]
    return None if pattern == BarPattern.stop_on_the_beat() else replace(pattern, dance=recording.clip.dance)


def agreement(music: BeatTrack, visual: BeatTrack, *, delay: float, n_rotations: int) -> dict[str, float]:
    """Hits of visual beats on music beats when each music beat takes its nearest one (Figs. 1, 3, 5).

    Parameters
    ----------
    music, visual : BeatTrack on the same time line
    delay : float, seconds, radius of the tolerance field
    n_rotations : int, rotations in time behind the chance level

    Returns
    -------
    dict of counts: "music beats", "visual beats", "omitted" (music beats without a visual beat of their own),
    "redundant" (visual beats that no music beat claims), "hits", "chance hits" (their mean over the rotations).
    """
    rotated = [np.mod(visual.times + shift, music.duration) for shift in rotations(music.duration, n_rotations)]
    tracks = [visual.times, *rotated]
    hits, *by_chance = [int(hit_mask(music.times, times, delay=delay, matching="nearest").sum()) for times in tracks]
    counts = {"music beats": len(music), "visual beats": len(visual)}
    counts |= {"omitted": len(music) - hits, "redundant": len(visual) - hits, "hits": hits}
    return {**counts, "chance hits": float(np.mean(by_chance))}


def agreement_words(met: Mapping[str, float]) -> str:
    """A record of `agreement` in words, for the title of a picture."""
    chance = met["chance hits"]
    alone = f"chance alone meets {chance:.1f}" if met["hits"] > chance else f"no more than chance ({chance:.1f})"
    left_over = f"{met['redundant']} of {met['visual beats']} visual beats left over"
    return f"{met['hits']} of {met['music beats']} music beats met, {alone}; {left_over}"
