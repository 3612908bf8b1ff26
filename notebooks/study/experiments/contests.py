"""Dancers and their music: a corpus that systems are trained on, and the songs that they then dance."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cache, cached_property

from harmolab.data.recordings import Recording, load_recording
from harmolab.lab.compare.windows import dance_patterns
from harmolab.metrics.likeness import SHORTEST, LikenessLimits
from harmolab.params import BarPattern
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.pose_network import PoseNet
from harmolab.systems.training.splits import Split
from study.experiments.baselines import Material
from study.experiments.generation import (
    SYNTHETIC,
    VARIANTS,
    Trained,
    corpus_root,
    generator_corpora,
    trained,
    training_split,
)
from study.experiments.songs import (
    RECORDED_SONGS,
    SECONDS,
    SYNTHETIC_SONGS,
    Excerpt,
    recorded_songs,
    seven_dances,
    synthetic_songs,
)
from study.profile import RunProfile

GUARDED = 4  # one in so many of the songs a dance is danced for longer, for the guard
PATTERNED = ("cha-cha", "rumba", "waltz")  # dances whose recordings follow a bar pattern


@dataclass(frozen=True, eq=False)
class Contest:
    """One corpus and the songs that are danced by systems trained on it.

    Parameters
    ----------
    profile : RunProfile
    corpus : str, of the training
    music : str, kind of the songs
    excerpts : the songs
    dancers : excerpts of songs with recorded (or planted) dancers of the corpus: what dances are held against
    trainings : int, of each network; 0 for a contest of dances without training, which has no pose network either
    """

    profile: RunProfile
    corpus: str
    music: str
    excerpts: tuple[Excerpt, ...]
    dancers: tuple[Excerpt, ...]
    trainings: int = 1
    about: dict[str, str] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "about", {"music": self.music, "corpus": self.corpus})

    @cached_property
    def split(self) -> Split:
        """The units of the corpus as the paper's systems hear them."""
        return _split(self.profile, self.corpus)

    @cached_property
    def material(self) -> Material:
        """All that dances without training are made of."""
        return Material(self.split.train, self.dancers)

    @cached_property
    def has_own_dancers(self) -> bool:
        """True if the corpus has dancers to these very songs."""
        return {excerpt.song for excerpt in self.excerpts} <= {excerpt.song for excerpt in self.dancers}

    @property
    def teachers(self) -> tuple[Recording, ...]:
        """The stretches of recordings that training units cover: nothing of any figure of the test side."""
        return teachers(self.profile, self.corpus)

    @property
    def patterns(self) -> Mapping[str, BarPattern]:
        """The bar pattern of each of `PATTERNED` that was recorded, learnt on the `teachers`."""
        return patterns(self.profile, self.corpus)

    @cached_property
    def limits(self) -> LikenessLimits | None:
        """The measures that dancers of the corpus had; None (for the shipped ones) where none is long enough."""
        clips = {excerpt.song: excerpt.clip for excerpt in self.dancers}
        long = [clip for clip in clips.values() if clip.motion is not None and clip.motion.duration >= SHORTEST]
        motions = [clip.motion for clip in long if clip.motion is not None]
        return LikenessLimits.of(motions, [clip.dance for clip in long]) if long else None

    @cached_property
    def _first(self) -> Trained:
        """The first training with the paper's losses, whose pose network judges all."""
        return trained(self.profile, self.corpus, VARIANTS["paper"], 1)

    @property
    def pose_net(self) -> PoseNet:
        """The pose network behind the Frechet distance."""
        return self._first.pose_net

    @property
    def pose_net_name(self) -> str:
        """A name that tells that network from others; "" in a contest without trainings, which has none."""
        return self._first.folder.name if self.trainings else ""

    @property
    def guarded(self) -> tuple[Excerpt, ...]:
        """Up to a quarter as many songs of each dance as the profile compares on, at least one."""
        kept = []
        for dance in dict.fromkeys(excerpt.clip.dance for excerpt in self.excerpts):
            songs = {one.song: one for one in reversed(self.excerpts) if one.clip.dance == dance}
            names = sorted(songs)
            kept += [songs[name] for name in names[: max(1, self.profile.songs // GUARDED)]]
        return tuple(kept)


def contests(profile: RunProfile, trainings: int) -> list[Contest]:
    """Every corpus with the songs of seven dances and, with ``HARMOLAB_DATA``, with recorded songs.

    Of a recorded corpus those of its songs are danced that have units on the test side; for systems trained on another
    corpus all of its songs.

    Raises
    ------
    ValueError
        If no recording of a corpus that systems are trained on is long enough to be danced to.
    """
    music, songs = seven_dances(profile)
    planted = songs if music == SYNTHETIC_SONGS else synthetic_songs(profile)
    rows = []
    for corpus in generator_corpora(profile):
        is_planted = corpus == SYNTHETIC
        recorded = recorded_songs(profile, None if is_planted else _split(profile, corpus))
        dancers = tuple(planted if is_planted else recorded)
        if not dancers:
            raise ValueError(f"{corpus}: no recording has {SECONDS:g} s of movement in a row to compare with")
        rows.append(Contest(profile, corpus, music, tuple(songs), dancers, trainings))
        if recorded:
            rows.append(Contest(profile, corpus, RECORDED_SONGS, tuple(recorded), dancers, trainings))
    return rows


def _split(profile: RunProfile, corpus: str) -> Split:
    return training_split(profile, corpus, FeatureParams.paper())


@cache
def teachers(profile: RunProfile, corpus: str) -> tuple[Recording, ...]:
    """The stretches of a corpus's recordings that its training units cover."""
    root, spans = corpus_root(profile, corpus), training_spans(_split(profile, corpus))
    return tuple(
        stretch for name, pieces in spans.items() for stretch in _stretches(load_recording(root / name), pieces)
    )


@cache
def patterns(profile: RunProfile, corpus: str) -> Mapping[str, BarPattern]:
    """The bar patterns of a recorded corpus, by dance; none of a synthetic one, whose dancers rest on every beat."""
    if corpus == SYNTHETIC:
        return {}
    own = [one for one in teachers(profile, corpus) if one.clip.dance in PATTERNED and one.annotation is not None]
    return dance_patterns(own) if own else {}


def training_spans(split: Split) -> dict[str, list[tuple[float, float]]]:
    """Folder name of each recording -> stretches of audio time, in seconds, that its training units cover."""
    spans: dict[str, list[tuple[float, float]]] = {}
    for unit in sorted(split.train.units, key=lambda unit: unit.start):
        pieces = spans.setdefault(unit.sequence.rpartition("/")[2], [])
        if pieces and unit.start <= pieces[-1][1]:
            pieces[-1] = (pieces[-1][0], max(pieces[-1][1], unit.end))
        else:
            pieces.append((unit.start, unit.end))
    return spans


def _stretches(recording: Recording, spans: list[tuple[float, float]]) -> list[Recording]:
    """A recording with its movement cut to each of some stretches of audio time."""
    clip, motion = recording.clip, recording.clip.motion
    if motion is None:
        raise ValueError(f"{recording.folder}: has no motion")
    cut = []
    for number, (start, end) in enumerate(spans, 1):
        first = max(0, round((start - clip.offset) * motion.fps))
        part = motion.span(first / motion.fps, end - start)
        offset = clip.offset + first / motion.fps
        cut.append(replace(recording, clip=replace(clip, name=f"{clip.name} {number}", motion=part, offset=offset)))
    return cut
