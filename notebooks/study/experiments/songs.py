"""The songs that systems are compared on: of seven dances, and of recordings (Tables 1 and 2, Fig. 12).

Of every song some seconds are danced, as in the paper; beats are those of the whole song. Where a dancer was recorded
to the song, or planted with it, that movement comes with it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

import numpy as np

from harmolab.beats.audio import audio_beats
from harmolab.data.recordings import Recording, find_recordings, load_recording, recording_beats
from harmolab.data.synthetic import synthetic_clip
from harmolab.params import DANCES
from harmolab.readers.audio import load_audio
from harmolab.systems.training.splits import Split
from harmolab.types import Audio, BeatTrack, Clip, Motion
from study.experiments.study import corpus_folders, data_root
from study.profile import RunProfile

SECONDS = 6.0  # of a song that are danced, as in the paper
BEGIN = 12.0  # seconds of a song of seven dances at which they begin
SONG_SECONDS = 30.0
WINDOWS = 4  # of one recording at most
VALID_SHARE = 0.9  # of a window's frames must be recorded movement
UNHEARD = 700_000  # first seed of the songs of seven dances; those of corpora are drawn from another sequence
SYNTHETIC_SONGS, BALLROOM_SONGS, RECORDED_SONGS = "synthetic songs", "Ballroom songs", "recorded songs"

# Folders of the Ballroom set (Gouyon et al. 2006). Viennese waltz is no dance of the paper's tables.
BALLROOM = MappingProxyType(
    {
        "ChaChaCha": "cha-cha",
        "Jive": "jive",
        "Quickstep": "quickstep",
        "Rumba-American": "rumba",
        "Rumba-International": "rumba",
        "Rumba-Misc": "rumba",
        "Samba": "samba",
        "Tango": "tango",
        "Waltz": "waltz",
    }
)


@dataclass(frozen=True, eq=False)
class Excerpt:
    """Some seconds of a song to dance to.

    Parameters
    ----------
    song : str, unique among the songs of one kind
    clip : Clip
        The whole song with the beats of all of it; its motion, if any, is the dancer recorded or planted there.
    start : float, seconds of audio time
    seconds : float
    """

    song: str
    clip: Clip
    start: float
    seconds: float = SECONDS

    @property
    def name(self) -> str:
        """The song and the second at which the excerpt begins."""
        return f"{self.song} from {self.start:.1f} s"

    @property
    def beats(self) -> BeatTrack:
        """The beats of the whole song, on audio time; ValueError if the clip came without."""
        if self.clip.beats is None:
            raise ValueError(f"{self.song}: an excerpt needs the beats of its song")
        return self.clip.beats

    @property
    def dancer(self) -> Motion:
        """The movement recorded or planted there: frame 0 belongs to `start`. ValueError where there is none."""
        motion = self.clip.motion
        if motion is None:
            raise ValueError(f"{self.song}: nobody was recorded to this song")
        return motion.span(self.start - self.clip.offset, self.seconds)

    def longer(self, seconds: float) -> Excerpt:
        """As much as that of the same song, from the same moment or, where the song or its dancer ends, from before."""
        motion = self.clip.motion
        first = 0.0 if motion is None else max(0.0, self.clip.offset)
        last = self.clip.audio.duration if motion is None else self.clip.offset + motion.duration
        length = min(seconds, last - first)
        start = max(first, min(self.start, last - length))
        if motion is not None:  # on a frame
            start = self.clip.offset + round((start - self.clip.offset) * motion.fps) / motion.fps
        return Excerpt(self.song, self.clip, start, length)


def seven_dances(profile: RunProfile) -> tuple[str, list[Excerpt]]:
    """Songs of the seven dances that no system was trained on: what they are, and an excerpt of each.

    Files of the Ballroom set, where ``HARMOLAB_DATA`` holds some of every dance; else `synthetic_songs`. Beats are
    tracked in all of a song, with the tempo of its dance as prior, as the paper tracks them.
    """
    root = data_root()
    files = {} if root is None else ballroom_files(root)
    if set(files) != set(DANCES):
        return SYNTHETIC_SONGS, synthetic_songs(profile)
    excerpts = []
    for dance in DANCES:
        paths, count = files[dance], min(profile.songs, len(files[dance]))
        excerpts += [_ballroom(dance, paths[place * len(paths) // count]) for place in range(count)]
    return BALLROOM_SONGS, excerpts


def synthetic_songs(profile: RunProfile) -> list[Excerpt]:
    """As many synthetic songs of each of the seven dances as the profile says, with their planted dancers."""
    return [_synthetic(dance, number) for dance in DANCES for number in range(profile.songs)]


def ballroom_files(root: Path) -> dict[str, list[Path]]:
    """The songs of the Ballroom set below a folder: dance -> files in order of their names."""
    files: dict[str, list[Path]] = {}
    for path in sorted(root.rglob("*.wav")):
        if path.parent.name in BALLROOM:
            files.setdefault(BALLROOM[path.parent.name], []).append(path)
    return files


def _synthetic(dance: str, number: int) -> Excerpt:
    """The `number`-th synthetic song of a dance, and its planted dancer."""
    seed = UNHEARD + 1000 * list(DANCES).index(dance) + number
    clip = synthetic_clip(dance, seconds=SONG_SECONDS, seed=seed)
    return _excerpt(f"{dance} {number + 1}", clip.audio, dance, "synthetic", clip.motion)


def _ballroom(dance: str, path: Path) -> Excerpt:
    return _excerpt(f"{path.parent.name}/{path.stem}", load_audio(path), dance, "Ballroom", None)


def _excerpt(song: str, audio: Audio, dance: str, source: str, motion: Motion | None) -> Excerpt:
    """Seconds 12 to 18 of a song, or the last six of a shorter one."""
    clip = Clip(song, audio, motion, 0.0, source, audio_beats(audio, tempo=dance), dance)
    return Excerpt(song, clip, max(0.0, min(BEGIN, audio.duration - SECONDS)))


def recorded_songs(profile: RunProfile, split: Split | None = None) -> list[Excerpt]:
    """Up to `WINDOWS` excerpts, one after the other, of each song of the first recorded corpus.

    Beats are the annotated ones, else tracked in the whole song. Windows that lie outside the recorded movement, or of
    which more than a tenth is none, are left out, and so are recordings that cannot be read.

    Parameters
    ----------
    profile : RunProfile; as many songs as it takes, spread over the corpus
    split : Split, optional
        Only songs with units on its test side: those of a corpus that systems were trained on.

    Returns
    -------
    list of Excerpt; empty without ``HARMOLAB_DATA``
    """
    if data_root() is None:
        return []
    folders = find_recordings(next(iter(corpus_folders(profile).values()))).folders
    if split is not None:
        tested = {unit.sequence.rpartition("/")[2] for unit in split.test.units}
        folders = tuple(folder for folder in folders if folder.name in tested)
    count = min(profile.n_sequences or len(folders), len(folders))
    sample = (folders[place * len(folders) // count] for place in range(count))
    return [excerpt for recording in _readable(sample) for excerpt in windows(recording)]


def _readable(folders: Iterable[Path]) -> Iterable[Recording]:
    """The recordings of those folders that can be read."""
    for folder in folders:
        try:
            yield load_recording(folder)
        except (ValueError, FileNotFoundError):
            continue


def windows(recording: Recording) -> list[Excerpt]:
    """Up to `WINDOWS` excerpts of one recording, one after the other from where its movement begins."""
    clip, motion = recording.clip, recording.clip.motion
    if motion is None or motion.positions.shape[2] != 3:
        return []
    annotated = recording.annotation is not None and recording.annotation.times.size > 1
    beats = recording_beats(recording, "annotated" if annotated else "tracked")
    clip = Clip(clip.name, clip.audio, motion, clip.offset, clip.source, beats, clip.dance)
    last = min(motion.duration, clip.audio.duration - clip.offset)
    begins = np.arange(max(0.0, np.ceil(-clip.offset * motion.fps) / motion.fps), last - SECONDS + 1e-6, SECONDS)
    spans = [(begin, motion.span(begin, SECONDS)) for begin in begins.tolist()]
    whole = [begin for begin, part in spans if part.valid.mean() >= VALID_SHARE]
    return [Excerpt(clip.name, clip, clip.offset + round(begin * motion.fps) / motion.fps) for begin in whole[:WINDOWS]]
