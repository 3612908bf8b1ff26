"""Sketches: movements that a generator corrects, danced by a choreographer to the songs that it learns from.

The paper's V_f ends in a mean pose (Eq. 23), and one song has many dances: the best answer that a generator can give
there is their mean. A sketch is a whole dance of recorded beats, another one for each seed, and what is left to learn
is how it should differ to go with the music. Most sketches that are learnt from lie beside their music by up to half a
beat, so that what a generator gains it has to hear.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from harmolab.data.recordings import Recording, load_recording, recording_beats
from harmolab.files import Progress, silent
from harmolab.params import BarPattern
from harmolab.shape_speed import shape_signal, shape_speed
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.choreographer.moves import bar_patterns
from harmolab.systems.choreographer.takes import Take, take_of
from harmolab.systems.harmogan.params import TrainParams
from harmolab.systems.training.feet import grounded
from harmolab.systems.training.groups import motion_in_space, sequence_name
from harmolab.systems.training.motion_code import bone_lengths, coded, fixed_bones
from harmolab.systems.training.splits import SIDES, Split, stretches, training_spans
from harmolab.systems.training.units import DanceUnit
from harmolab.types import BeatTrack, Motion, SingleArray

SKETCHES = "sketches"  # folder of a run: the movement whose dances are corrected; or a style in its description
HALF_A_BEAT = 0.5


class Sketched(NamedTuple):
    """A split whose units have sketches; the choreographer of its training side; bar patterns by number."""

    split: Split
    choreographer: Choreographer
    patterns: tuple[BarPattern, ...]


class Song(NamedTuple):
    """Dances of one song from audio time `start` on: codes (T, C), its beats, and the number of its bar pattern.

    `recorded` is the code of its recorded dance as clean as a choreographer's: bones of one length, feet that stand;
    None where it is to stay as it is.
    """

    codes: list[SingleArray]
    recorded: SingleArray | None
    track: BeatTrack
    start: float
    pattern: int


def sketched(
    split: Split, folders: Sequence[Path], params: TrainParams, *, bank: Choreographer | None = None,
    progress: Progress = silent,
) -> Sketched:  # fmt: skip
    """A split whose units have sketches: training units `params.sketches` each, the others one that lies on the beat.

    A song is danced with the stretches of all other recordings that training units cover, or with a `bank`, whose
    movement has no bars; then units are those of its dances (`tools.ship`).

    Parameters
    ----------
    split : of the recordings in `folders`
    folders : of recordings
    params : TrainParams with sketches
    bank : Choreographer of the units' skeleton

    Raises
    ------
    ValueError
        If training units are of one recording: there is no other to dance its song with.
    """
    spans, named = training_spans(split), {sequence_name(folder): folder for folder in folders}
    takes: dict[str, list[Take]] = {}
    if bank is None:
        takes = {name: _takes(folder, spans.get(name, [])) for name, folder in named.items()}
        if sum(map(bool, takes.values())) < 2:
            fault = "each song is sketched with the other recordings: two with training units are needed at least"
            raise ValueError(f"{split.train.source}: {fault}; add recordings, or try another --split-seed")
    every_take = [take for own in takes.values() for take in own]
    patterns = dance_patterns(every_take)
    names = sorted(patterns)
    units: dict[str, list[DanceUnit]] = {side: [] for side in SIDES}
    for name, folder in progress(named.items(), "sketching"):
        own = {side: [unit for unit in getattr(split, side).units if unit.sequence == name] for side in SIDES}
        if not any(own.values()):
            continue  # unread: it may be left out because it cannot be read
        recording = load_recording(folder)
        others = bank or Choreographer([take for other in named if other != name for take in takes[other]])
        number = names.index(recording.clip.dance) if recording.clip.dance in patterns else -1
        song = _danced(others, recording, params, split.train.features.fps, number, cleans=bank is None)
        units["train"] += _training_units(own["train"], song, params)
        for side in SIDES[1:]:
            units[side] += [_with_sketch(unit, song, song.codes[0]) for unit in own[side]]
    sides = {side: replace(getattr(split, side), units=tuple(units[side])) for side in SIDES}
    return Sketched(replace(split, **sides), bank or Choreographer(every_take), tuple(patterns[name] for name in names))


def _takes(folder: Path, spans: list[tuple[float, float]]) -> list[Take]:
    """The stretches of a recording as movement to dance with."""
    return [take_of(stretch) for stretch in stretches(load_recording(folder), spans)] if spans else []


def dance_patterns(takes: Sequence[Take]) -> dict[str, BarPattern]:
    """The bar pattern of each dance whose takes know their places in the bar, learnt on them."""
    placed = [take for take in takes if take.dance and take.places.size]
    patterns, _ = bar_patterns(placed, [shape_signal(shape_speed(take.motion)) for take in placed])
    return {dance: replace(pattern, dance=dance) for (dance, _), pattern in patterns.items()}


def _danced(
    bank: Choreographer, recording: Recording, params: TrainParams, fps: float, pattern: int, *, cleans: bool
) -> Song:
    """The sketches of a recording's song, while there is movement to it; and that movement, if it `cleans` it."""
    clip, motion = recording.clip, motion_in_space(recording)
    before = clip.shared_frame() / motion.fps  # seconds of movement before the music begins
    motion = motion.span(before, motion.duration)
    track = recording_beats(recording, "annotated" if recording.annotation is not None else "tracked")
    start, seconds = max(clip.offset + before, 0.0), motion.duration
    name = clip.dance if clip.dance in bank.dances else None  # of a dance that no other recording has: any of theirs
    seeds = range(params.seed * params.sketches, (params.seed + 1) * params.sketches)
    dances = (bank.generate(clip.audio, track, start=start, seconds=seconds, dance=name, seed=seed) for seed in seeds)
    recorded = _clean(motion, fps) if cleans else None
    return Song([coded(motion, fps) for motion in dances], recorded, track, start, pattern)


def _clean(motion: Motion, fps: float) -> SingleArray:
    """The code of a recorded motion whose bones have one length, and whose feet stand."""
    skeleton, positions = motion.skeleton, motion.positions
    whole = fixed_bones(positions, skeleton.parents, bone_lengths(positions, skeleton))
    return coded(replace(motion, positions=grounded(whole, motion.fps, skeleton, plant_feet=True)), fps)


def _training_units(units: Sequence[DanceUnit], song: Song, params: TrainParams) -> Iterator[DanceUnit]:
    """Each unit with each dance of its song, some of them beside the beat, and its recorded movement clean."""
    rng = np.random.default_rng(params.seed)
    for unit in units:
        period = float(np.median(np.diff(unit.beats))) * unit.fps
        for number, code in enumerate(song.codes):
            is_beside = rng.random() < params.shifted
            shift = round(rng.uniform(-HALF_A_BEAT, HALF_A_BEAT) * period) if is_beside else 0
            named = replace(_with_sketch(unit, song, code, shift), name=f"{unit.name}~{number}")
            yield named if song.recorded is None else replace(named, motion=_cut(song.recorded, unit, song))


def _with_sketch(unit: DanceUnit, song: Song, code: SingleArray, shift: int = 0) -> DanceUnit:
    """A unit with its stretch of a dance, `shift` frames later, and what is known of its bars."""
    return replace(unit, sketch=_cut(code, unit, song, shift), bar=(song.pattern, _place(song, unit)))


def _cut(code: SingleArray, unit: DanceUnit, song: Song, shift: int = 0) -> SingleArray:
    """The stretch of a dance's code that belongs to a unit, `shift` frames later; at its ends the nearest whole one."""
    first = round((unit.start - song.start) * unit.fps) + shift
    begin = min(max(first, 0), max(len(code) - unit.n_frames, 0))
    return code[np.minimum(begin + np.arange(unit.n_frames), len(code) - 1)]


def _place(song: Song, unit: DanceUnit) -> int:
    """Place in the bar of a unit's first beat; -1 where it is not known."""
    places, times = song.track.bar_places, song.track.times
    return -1 if places is None else int(places[np.abs(times - unit.start - unit.beats[0]).argmin()])
