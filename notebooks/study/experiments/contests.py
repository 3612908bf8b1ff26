"""Dancers and their music: the corpora and songs of the comparison, and dances that need no training.

Those are recorded movement as it is, retimed, or in pieces laid on the song's beats; a comparison means little without
them. Pieces are the training units that networks learn from, in the same code and with the same floor and feet; of each
only the seven beats between its first and last half beat are danced, so that no piece begins or ends on a beat, where a
join would pass for a rest.

Of every song some seconds are danced, as in the paper; beats are those of the whole song. Where a dancer was recorded
to the song, or planted with it, that movement comes with it.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from itertools import chain, product
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from scipy.interpolate import CubicSpline, PchipInterpolator

from harmolab.beats.audio import audio_beats
from harmolab.beats.visual import visual_beats
from harmolab.data.recordings import Recording, find_recordings, load_recording, recording_beats
from harmolab.lab.compare.windows import dance_patterns
from harmolab.metrics.likeness import SHORTEST, LikenessLimits
from harmolab.params import DANCES, BarPattern, HarmonyParams
from harmolab.readers.audio import load_audio
from harmolab.retime.retime import motion_at
from harmolab.retime.warps import beat_warp
from harmolab.systems.training.features import FeatureParams, audio_features
from harmolab.systems.training.feet import on_floor, planted_feet
from harmolab.systems.training.layers import PATH_CHANNELS
from harmolab.systems.training.motion_code import continued
from harmolab.systems.training.pose_network import PoseNet
from harmolab.systems.training.splits import Split, stretches, training_spans
from harmolab.systems.training.units import DanceUnit, UnitSet, filled_beats
from harmolab.types import BeatTrack, Clip, FloatArray, Motion
from study.experiments.generation import (
    SYNTHETIC,
    VARIANTS,
    Trained,
    corpus_root,
    generator_corpora,
    paper_split,
    trained,
)
from study.experiments.study import corpus_folders, data_root, planted_song, readable_recordings, spread
from study.profile import RunProfile

SECONDS = 6.0  # of a song that are danced, as in the paper
BEGIN = 12.0  # seconds of a song of seven dances at which they begin
SONG_SECONDS = 30.0
WINDOWS = 4  # of one recording at most
VALID_SHARE = 0.9  # of a window's frames must be recorded movement
UNHEARD = 700_000  # first seed of the songs of seven dances; those of corpora are drawn from another sequence
SYNTHETIC_SONGS, BALLROOM_SONGS, RECORDED_SONGS = "synthetic songs", "Ballroom songs", "recorded songs"

# Folders of the Ballroom set (Gouyon et al. 2006). Viennese waltz is no dance of the paper's tables.
BALLROOM: Mapping[str, str] = {
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

    def longer(self, seconds: float) -> Self:
        """As much as that of the same song, from the same moment or, where the song or its dancer ends, from before."""
        motion = self.clip.motion
        first = 0.0 if motion is None else max(0.0, self.clip.offset)
        last = self.clip.audio.duration if motion is None else self.clip.offset + motion.duration
        length = min(seconds, last - first)
        start = max(first, min(self.start, last - length))
        if motion is not None:  # on a frame
            start = self.clip.offset + round((start - self.clip.offset) * motion.fps) / motion.fps
        return replace(self, start=start, seconds=length)


def seven_dances(profile: RunProfile) -> tuple[str, list[Excerpt]]:
    """Songs of the seven dances that no system was trained on: what they are, and an excerpt of each.

    Files of the Ballroom set, where ``HARMOLAB_DATA`` holds some of every dance; else `synthetic_songs`. Beats are
    tracked in all of a song, with the tempo of its dance as prior; the paper does not say how it tracks them.
    """
    root = data_root()
    files = {} if root is None else ballroom_files(root)
    if set(files) != set(DANCES):
        return SYNTHETIC_SONGS, synthetic_songs(profile)
    songs = []
    for dance in DANCES:
        for path in spread(files[dance], profile.songs):
            name = f"{path.parent.name}/{path.stem}"
            songs.append(_tracked(Clip(name, load_audio(path), None, 0.0, "Ballroom", dance=dance)))
    return BALLROOM_SONGS, songs


def synthetic_songs(profile: RunProfile) -> list[Excerpt]:
    """As many synthetic songs of each of the seven dances as the profile says, with their planted dancers."""
    pairs = product(DANCES, range(profile.songs))
    return [_tracked(planted_song(dance, number, SONG_SECONDS, UNHEARD)) for dance, number in pairs]


def ballroom_files(root: Path) -> dict[str, list[Path]]:
    """The songs of the Ballroom set below a folder: dance -> files in order of their names."""
    files: dict[str, list[Path]] = {}
    for path in sorted(root.rglob("*.wav")):
        if path.parent.name in BALLROOM:
            files.setdefault(BALLROOM[path.parent.name], []).append(path)
    return files


def _tracked(clip: Clip) -> Excerpt:
    """Seconds 12 to 18 of a song, or the last six of a shorter one, with tracked beats."""
    clip = replace(clip, beats=audio_beats(clip.audio, tempo=clip.dance))
    return Excerpt(clip.name, clip, max(0.0, min(BEGIN, clip.audio.duration - SECONDS)))


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
    sample = spread(folders, profile.n_sequences or len(folders))
    recordings = chain.from_iterable(map(readable_recordings, sample))
    return [excerpt for recording in recordings for excerpt in windows(recording)]


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


# Dances that need no training

EDGE = 0.5  # beats of a piece that are not danced at either end
MFCC = FeatureParams.paper()  # what tells how similar two pieces of music are


@dataclass(frozen=True, eq=False)
class Material:
    """All that dances without training are made of: one corpus.

    Parameters
    ----------
    units : UnitSet of the training side
    dancers : sequence of Excerpt with recorded (or planted) movement of the corpus
    """

    units: UnitSet
    dancers: Sequence[Excerpt]

    @cached_property
    def timbres(self) -> FloatArray:
        """Mean MFCC of the music of every unit, (N, K)."""
        return np.stack([unit.audio[:, : self.units.features.n_mfcc].mean(axis=0) for unit in self.units.units])

    def places_of(self, dance: str) -> list[int]:
        """The places of the units of a dance; of all units where none is of that dance."""
        own = [place for place, unit in enumerate(self.units.units) if unit.dance == dance]
        return own or list(range(len(self.units)))


Baseline = Callable[[Material, Excerpt, np.random.Generator], Motion]


def recorded(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """The movement recorded (or planted) there."""
    return excerpt.dancer


def another_song(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """The movement recorded to another song of the same dance; of any dance where no other song has the same.

    Raises
    ------
    ValueError
        If there is no dancer of another song.
    """
    others = [other for other in material.dancers if other.song != excerpt.song]
    same = [other for other in others if other.clip.dance == excerpt.clip.dance]
    if not others:
        raise ValueError(f"{excerpt.song}: there is no other song whose dancer could be taken")
    other = (same or others)[int(rng.integers(len(same or others)))]
    return other.longer(excerpt.seconds).dancer


def retimed_dance(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """The movement recorded there, else to another song, bent in time so that its valleys meet the beats."""
    at_home = any(other.song == excerpt.song for other in material.dancers)
    motion = (recorded if at_home else another_song)(material, excerpt, rng)
    music, last = excerpt.beats.span(excerpt.start, motion.duration), (motion.n_frames - 1) / motion.fps
    warp = beat_warp(visual_beats(motion, params=HarmonyParams.valleys()), music, last)
    return motion_at(motion, warp.inverse(np.arange(motion.n_frames) / motion.fps))


def nearest_neighbour(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """The training pieces whose music is most similar, by mean MFCC, to what is played; its beats on the song's."""
    scale = material.timbres.std(axis=0) + 1e-9

    def nearest(begin: float, end: float) -> DanceUnit:
        times = np.arange(begin, end, 1 / MFCC.fps)
        music = audio_features(excerpt.clip.audio, excerpt.beats, times, MFCC)[:, : material.timbres.shape[1]]
        apart = np.linalg.norm((material.timbres - music.mean(axis=0)) / scale, axis=1)
        return material.units.units[int(np.argmin(apart))]

    return _laid(material, excerpt, nearest, music_anchors)


def random_pieces(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """Training pieces of the dance drawn at random, the beats of their music on the song's."""
    return _laid(material, excerpt, _drawn(material, excerpt, rng), music_anchors)


def resting_pieces(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Motion:
    """The same pieces, their rests on the song's beats: `rest_anchors`."""
    return _laid(material, excerpt, _drawn(material, excerpt, rng), rest_anchors)


def _drawn(material: Material, excerpt: Excerpt, rng: np.random.Generator) -> Callable[[float, float], DanceUnit]:
    places = material.places_of(excerpt.clip.dance)
    return lambda begin, end: material.units.units[places[int(rng.integers(len(places)))]]


BASELINES: Mapping[str, Baseline] = {
    "recorded, right song": recorded,
    "recorded, another song": another_song,
    "recorded, retimed": retimed_dance,
    "nearest neighbour": nearest_neighbour,
    "random pieces, beats on beats": random_pieces,
    "random pieces, rests on beats": resting_pieces,
}
DRAWN = ("recorded, another song", "random pieces, beats on beats", "random pieces, rests on beats")  # by a seed


class Anchors(NamedTuple):
    """Moments of a unit's movement that belong on beats of a song.

    Parameters
    ----------
    beats : (K,) array, numbers of the beats, rising from 0
    seconds : (K,) array, seconds from the unit's frame 0
    """

    beats: FloatArray
    seconds: FloatArray


def music_anchors(unit: DanceUnit, units: UnitSet) -> Anchors:
    """The beats of the music that the unit was danced to; it ends with one beat more."""
    return Anchors(np.arange(unit.beats.size + 1.0), np.append(unit.beats, unit.n_frames / unit.fps))


def rest_anchors(unit: DanceUnit, units: UnitSet) -> Anchors:
    """The rests of the unit (valleys of the joint speed), each on a beat.

    A rest comes as many beats after the one before as their distance has, at least one; of rests that lie closer than
    half a beat the first is taken. So nothing is danced at less than half or more than one and a half times its speed.
    A unit with fewer than three beats between its rests keeps its `music_anchors`.
    """
    valleys = visual_beats(units.decoded(unit.motion.astype(np.float64)), params=HarmonyParams.valleys()).times
    period = unit.n_frames / unit.fps / unit.beats.size
    rests: list[float] = []
    numbers: list[int] = []
    for valley in valleys.tolist():
        if not rests or valley - rests[-1] >= period / 2:
            numbers.append(numbers[-1] + max(1, round((valley - rests[-1]) / period)) if rests else 0)
            rests.append(valley)
    if not numbers or numbers[-1] < 3:
        return music_anchors(unit, units)
    return Anchors(np.array(numbers, np.float64), np.array(rests))


def _laid(
    material: Material,
    excerpt: Excerpt,
    choose: Callable[[float, float], DanceUnit],
    anchors: Callable[[DanceUnit, UnitSet], Anchors],
) -> Motion:
    """Pieces one after the other, the `anchors` of each on the song's beats.

    `choose` answers the seconds of the song that a piece may be danced to with the unit to take it from.
    """
    units, fps = material.units, material.units.features.fps
    length = units.features.unit_beats
    beats, _ = filled_beats(excerpt.beats, excerpt.start, excerpt.start + excerpt.seconds, before=2)
    times = excerpt.start + np.arange(int(excerpt.seconds * fps + 1e-6)) / fps
    places = np.interp(times, beats, np.arange(beats.size))  # of every frame, in beats
    code = np.zeros((0, units.units[0].motion.shape[1]))
    origin = np.floor(places[0] - EDGE)  # the beat that a piece's beat 0 lies on
    while len(code) < times.size:
        unit = choose(*np.interp([origin + EDGE, origin + length - EDGE], np.arange(beats.size), beats))
        held = anchors(unit, units)
        end = origin + held.beats[-1] - EDGE
        frames = slice(len(code), int(np.searchsorted(places, end)))
        piece = danced_at(unit, held, places[frames] - origin, times[frames])
        code = np.concatenate([code, continued(code, piece, fps) if len(code) else piece])
        origin = end - EDGE
    positions = on_floor(units.decoded(code).positions, fps)
    return Motion(planted_feet(positions, fps, units.skeleton), fps, units.skeleton)


def danced_at(unit: DanceUnit, anchors: Anchors, beats: FloatArray, times: FloatArray) -> FloatArray:
    """A unit's motion code where it is at given places in beats, one a frame: (T, C).

    Poses are interpolated; the rates of the path are scaled by how much faster the piece is danced.

    Parameters
    ----------
    unit : DanceUnit
    anchors : Anchors of the unit
    beats : (T,) array, places within the anchors' beats
    times : (T,) array, seconds at which they are danced
    """
    own = PchipInterpolator(anchors.beats, anchors.seconds)(beats)
    frames = np.clip(own * unit.fps, 0.0, unit.n_frames - 1)
    code: FloatArray = CubicSpline(np.arange(unit.n_frames), unit.motion.astype(np.float64))(frames)
    speed = np.gradient(own, times) if times.size > 1 else np.ones(times.size)
    code[:, -PATH_CHANNELS:] *= speed[:, None]
    return code


# Contests

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

    @property
    def about(self) -> dict[str, str]:
        """Its columns in tables."""
        return {"music": self.music, "corpus": self.corpus}

    @cached_property
    def split(self) -> Split:
        """The units of the corpus as the paper's systems hear them."""
        return paper_split(self.profile, self.corpus)

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
        clips = {excerpt.song: excerpt.clip for excerpt in self.dancers}.values()
        pairs = [(clip.motion, clip.dance) for clip in clips if clip.motion is not None]
        long = [(motion, dance) for motion, dance in pairs if motion.duration >= SHORTEST]
        return LikenessLimits.of([motion for motion, _ in long], [dance for _, dance in long]) if long else None

    @cached_property
    def _judge(self) -> Trained:
        """The first training with the paper's losses, whose pose network judges all."""
        return trained(self.profile, self.corpus, VARIANTS["paper"], 1)

    @property
    def pose_net(self) -> PoseNet:
        """The pose network behind the Frechet distance."""
        return self._judge.pose_net

    @property
    def pose_net_name(self) -> str:
        """A name that tells that network from others; "" in a contest without trainings, which has none."""
        return self._judge.folder.name if self.trainings else ""

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
        recorded = recorded_songs(profile, None if is_planted else paper_split(profile, corpus))
        dancers = tuple(planted if is_planted else recorded)
        if not dancers:
            raise ValueError(f"{corpus}: no recording has {SECONDS:g} s of movement in a row to compare with")
        rows.append(Contest(profile, corpus, music, tuple(songs), dancers, trainings))
        if recorded:
            rows.append(Contest(profile, corpus, RECORDED_SONGS, tuple(recorded), dancers, trainings))
    return rows


@cache
def teachers(profile: RunProfile, corpus: str) -> tuple[Recording, ...]:
    """The stretches of a corpus's recordings that its training units cover, in the order in which HarmoGAN has them."""
    root, spans = corpus_root(profile, corpus).resolve().parent, training_spans(paper_split(profile, corpus))
    return tuple(
        stretch for name, pieces in sorted(spans.items()) for stretch in stretches(load_recording(root / name), pieces)
    )


@cache
def patterns(profile: RunProfile, corpus: str) -> Mapping[str, BarPattern]:
    """The bar patterns of a recorded corpus, by dance; none of a synthetic one, whose dancers rest on every beat."""
    if corpus == SYNTHETIC:
        return {}
    own = [one for one in teachers(profile, corpus) if one.clip.dance in PATTERNED and one.annotation is not None]
    return dance_patterns(own) if own else {}
