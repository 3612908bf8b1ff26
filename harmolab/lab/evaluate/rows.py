"""Rows of the table of clips: one dance to one song, measured; and the controls that every table has.

Controls are recorded dances, the same with another song, and a pose that is held. A table in which recorded dances do
not win, or a held pose does not lose, measures something else than dancing. Note in which columns it wins: what stands
still neither slides nor jerks.
"""

import hashlib
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, cast

import numpy as np

from harmolab.clips import song_beats
from harmolab.data import oddities
from harmolab.data.recordings import read_any_motion, recorded_offset
from harmolab.files import PathLike, Progress, plain
from harmolab.lab.evaluate import measured, pairing
from harmolab.lab.evaluate.pairing import FROZEN, GENERATED, OTHER_SONG, RECORDED, Pair
from harmolab.lab.evaluate.protocols import protocol_of, published_music_and_motion
from harmolab.lab.evaluate.sets import feature_cells
from harmolab.metrics.likeness import LikenessLimits, window_measures
from harmolab.params import DANCES
from harmolab.readers.audio import load_sound
from harmolab.readers.motion_file import MotionFile
from harmolab.readers.smpl import FACT_SEED
from harmolab.shape_speed import without_fingers
from harmolab.types import BeatTrack, Clip, FloatArray, Motion
from harmolab.verdict.judge import music_and_motion

KEPT, ASSUMED, ASSUMED_OF_EDGE = "kept in the file", "assumed", "assumed, file of EDGE"
BEGINS = (pairing.LISTED, pairing.SLICED, KEPT, ASSUMED, ASSUMED_OF_EDGE)  # sources of the start of a dance in its song
SONGS_KEPT = 2  # songs that a process holds, as dances to one song come in a row
Row = dict[str, float | int | str]


@dataclass(frozen=True)
class RowOptions:
    """Settings of the measurement of a dance.

    Parameters
    ----------
    fps : float or None, hertz, of files that hold no rate
    scale, smpl : as in `harmolab.readers.motion.load_motion`; `smpl` for files of SMPL parameters only
    up : str, the axis that points up in files that leave it open, "" to have it guessed
    protocols : names in `harmolab.lab.evaluate.protocols.PROTOCOLS`
    pose_net : Path or None, weights of the pose network; None leaves its features out
    limits : LikenessLimits of the recorded dancers; the shipped ones when left out
    """

    fps: float | None = None
    scale: float | None = None
    protocols: tuple[str, ...] = ()
    pose_net: Path | None = None
    limits: LikenessLimits | None = None
    smpl: PathLike | None = None
    up: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The settings as JSON holds them: of network and body what is in the files, wherever they lie."""
        smpl = "" if self.smpl is None else hashlib.sha256(Path(self.smpl).read_bytes()).hexdigest()[:16]
        return {**plain(self), "pose_net": measured.weights_digest(self.pose_net), "smpl": smpl}


def clip_row(pair: Pair, options: RowOptions) -> Row:
    """Everything that is measured of one dance.

    Returns
    -------
    dict : system, seed, song, motion, music, kind; offset (seconds into the song at which it is danced) and begins (one
        of `BEGINS`, the source of that); fps, joints, skeleton (`skeleton_digest`), beats ("annotated" or
        "tracked"), music_beats (their number), dance (of the song, "" where unknown), assumptions (in short, on how the
        motion was read), odd (in short, odd things in motion and song) and oddities (the same in sentences), remarks
        (of the protocols); `MEASURES`; p_value, harmony_low, harmony_high and level of the recommended score,
        p_value_dance of that by the dance's pattern; the numbers of the protocols; f_NAME_000 and so on, the features
        of the dance by name, but not with another song. NaN for what this motion does not have.

    Raises
    ------
    FileNotFoundError, ValueError
        Motion or song cannot be read, the motion has a fault (`harmolab.data.oddities`) or no frame behind its seed,
        or they do not overlap; names the file.
    """
    file = pair_file(pair, options)
    clip = _clip(pair, file.motion, _song_of(pair))
    odd = () if pair.kind == FROZEN else _oddities(pair, clip, file.motion)
    music, motion = music_and_motion(clip)
    silent = measured.silent_frames(motion, clip.shared().audio, music)
    about: Row = {
        "system": pair.system, "seed": pair.seed, "song": pair.song, "motion": str(pair.motion),
        "music": str(pair.music), "kind": pair.kind, "fps": motion.fps, "joints": len(motion.skeleton.joints),
        "skeleton": skeleton_digest(motion),
        "beats": "annotated" if pairing.annotation_of(pair.music) else "tracked", "music_beats": len(music),
        "dance": clip.dance, "assumptions": ", ".join(_assumptions(pair, file)), "offset": clip.offset,
        "begins": _begins(pair, file), "odd": oddities.brief_text(odd), "oddities": "; ".join(odd),
    }  # fmt: skip
    dance = measured.Dance(pair.system, pair.song, motion, music, pair.seed, clip.dance, options.limits, silent)
    numbers = measured.dance_numbers(dance, measured.NUMBERS)
    # Distances count a recorded dance once, with its own song.
    features = {} if pair.kind == OTHER_SONG else measured.motion_features(motion, options.pose_net)
    remarks = []
    for name in options.protocols:
        own, vectors, remark = protocol_numbers(clip, pair, name)
        numbers, features = numbers | own, features | vectors
        remarks += [f"{name}: {remark}"] if remark else []
    about |= {"remarks": " ".join(remarks)} if options.protocols else {}
    return about | numbers | feature_cells(features)


def skeleton_digest(motion: Motion) -> str:
    """A text that is another one for other names of joints; fingers do not count where they are many."""
    return hashlib.sha256(" ".join(without_fingers(motion).skeleton.joints).encode()).hexdigest()[:8]


def protocol_numbers(clip: Clip, pair: Pair, name: str) -> tuple[dict[str, float], dict[str, FloatArray], str]:
    """The numbers and features of a protocol for a pair and its clip, "NAME PFC" and so on, and its remarks on it.

    There are none where the body lacks the joints that it takes, and the remark says so.
    """
    protocol = protocol_of(name)
    try:
        music, motion = published_music_and_motion(clip, pair.music, pair.song, protocol.music_beats)
        numbers, features = protocol.clip(motion, music), protocol.features(motion)
    except ValueError as error:
        return {}, {}, f"No numbers: {error}."
    named = ({f"{name} {key}": value for key, value in part.items()} for part in (numbers, features))
    return *named, " ".join(protocol.remarks(motion, numbers))  # type: ignore[return-value]


def pair_clip(pair: Pair, options: RowOptions) -> Clip:
    """The motion of a pair on the time line of its song, with the beats of the song; errors as `clip_row`.

    A motion begins where a list or its slice says (`Pair.offset`), else where its file or its recording says, else
    with the song; later by the frames of its seed. To another song than its own it begins there too, or earlier, so
    that it ends with a song that is shorter.
    """
    return _clip(pair, pair_file(pair, options).motion, _song_of(pair))


def _clip(pair: Pair, motion: Motion, song: Clip) -> Clip:
    """As `pair_clip`, of a motion and a song that were read."""
    start = recorded_offset(pair.motion) if pair.offset is None else pair.offset
    offset = (start or 0.0) + pair.seed_frames / motion.fps
    if pair.kind == OTHER_SONG:
        offset = min(offset, max(0.0, song.audio.duration - motion.duration))
    try:
        return replace(song, name=pair.motion.stem, motion=motion, offset=offset)
    except ValueError as error:
        raise ValueError(f"{pair.motion} with {pair.music}: {error}") from None


def _assumptions(pair: Pair, file: MotionFile) -> tuple[str, ...]:
    """Assumptions in short; of a file that is named as FACT names its dances that its seed is in it, too."""
    brief = tuple(one.brief for one in file.assumptions)
    has_seed = pairing.is_named_by_seed(pair.motion) and pair.kind == GENERATED and not pair.seed_frames
    return (*brief, FACT_SEED.brief) if has_seed and FACT_SEED.brief not in brief else brief


def _begins(pair: Pair, file: MotionFile) -> str:
    """The source of a dance's start in its song, one of `BEGINS`."""
    if pair.begins:
        return pair.begins
    if recorded_offset(pair.motion) is not None:
        return KEPT
    return ASSUMED_OF_EDGE if file.kind.startswith("EDGE") else ASSUMED


def _oddities(pair: Pair, clip: Clip, motion: Motion) -> tuple[oddities.Oddity, ...]:
    """All that `harmolab data check` finds odd in a dance and its song."""
    late = () if pair.kind == OTHER_SONG else oddities.late_end(clip.offset, motion, clip.audio)
    span = () if pair.seed_frames else oddities.span_oddities(pair.motion, motion)
    of_song = _song_oddities(pair.music, pairing.input_stamp(pair.music))
    return (*span, *oddities.motion_oddities(motion), *late, *of_song)


@lru_cache(maxsize=SONGS_KEPT)
def _song_oddities(music: Path, stamp: str) -> tuple[oddities.Oddity, ...]:
    """Odd things in a song, and in its beats where they are annotated."""
    song = _song(music, stamp)
    beats = None if pairing.annotation_of(music) is None else song.beats
    return (*oddities.sound_oddities(song.audio), *(() if beats is None else oddities.beat_oddities(beats.times)))


def pair_file(pair: Pair, options: RowOptions) -> MotionFile:
    """The motion of a pair without its seed, with notes on how it was read; of "frozen pose" its middle frame, held.

    Errors as `clip_row`.
    """
    fps = options.fps if pair.fps is None else pair.fps
    file = read_any_motion(
        pair.motion, fps=fps, scale=options.scale, smpl=options.smpl, up=options.up, as_defaults=True
    )
    if pair.seed_frames:
        file = _without_seed(pair, file)
    if faults := oddities.faults_of(file.motion):
        raise ValueError(f"{pair.motion}: {'; '.join(faults)}")
    if pair.kind != FROZEN:
        return file
    motion = file.motion
    frames = np.flatnonzero(motion.valid)
    middle = frames[len(frames) // 2] if len(frames) else 0
    held = np.repeat(motion.positions[middle : middle + 1], motion.n_frames, axis=0)
    return file._replace(motion=replace(motion, positions=held))


def _without_seed(pair: Pair, file: MotionFile) -> MotionFile:
    """The file without the frames that the system was given."""
    motion, first = file.motion, pair.seed_frames
    if motion.n_frames < first + 2:
        raise ValueError(f"{pair.motion}: has {motion.n_frames} frames, none behind its seed (--seed-frames {first})")
    dance = replace(motion, positions=motion.positions[first:], valid=motion.valid[first:])
    return file._replace(motion=dance, notes=tuple(note for note in file.notes if note != FACT_SEED))


def _song_of(pair: Pair) -> Clip:
    return _song(pair.music, pairing.input_stamp(pair.music))


@lru_cache(maxsize=SONGS_KEPT)
def _song(music: Path, _: str) -> Clip:
    """A song and its beats, as a clip without motion; the second argument, its stamp, keeps it up to date."""
    audio, annotation, dance = load_sound(music), pairing.annotation_of(music), pairing.dance_of(music)
    beats = song_beats(audio, dance=dance if dance in DANCES else "", beats=annotation)
    if not len(beats):
        advice = "give them in a file SONG.beats" if annotation is None else "remove it to have the beats tracked"
        raise ValueError(f"{annotation or music}: holds no beats; {advice}")
    return Clip(music.stem, audio, beats=beats, dance=dance)


# Controls: recorded dances, the same with another song, a pose that is held

CONTROLS = (RECORDED, OTHER_SONG, FROZEN)
LIMIT_DANCES = 200  # recorded dances that the limits of likeness are taken from, at most


def control_pairs(recorded: Sequence[Pair]) -> tuple[Pair, ...]:
    """The pairs of all controls, from those of recorded dances and their own songs.

    The other song is the one half way further in the list of songs: neighbours are often of one kind. With one song
    there is none.
    """
    songs = {pair.song: pair.music for pair in sorted(recorded, key=lambda pair: pair.song)}
    names = list(songs)
    others = {name: names[(place + len(names) // 2) % len(names)] for place, name in enumerate(names)}
    swapped = tuple(
        replace(pair, system=OTHER_SONG, song=others[pair.song], music=songs[others[pair.song]], kind=OTHER_SONG)
        for pair in recorded
        if len(names) > 1
    )
    return (*recorded, *swapped, *(replace(pair, system=FROZEN, kind=FROZEN) for pair in recorded))


def recorded_limits(recorded: Sequence[Pair], options: RowOptions, *, progress: Progress) -> LikenessLimits | None:
    """The limits of likeness of the recorded dances, of `LIMIT_DANCES` of them evenly through the list at most.

    As in the row of a dance, only what is danced to music counts. None where none of them can be measured: they are
    two-dimensional, without names of joints, or shorter than 10 s.
    """
    places = np.unique(np.linspace(0, len(recorded) - 1, min(len(recorded), LIMIT_DANCES)).astype(int))
    pairs = (recorded[place] for place in progress(places.tolist(), "measuring recorded dancers"))
    return limits_of(_danced(pairs, options))


def _danced(pairs: Iterable[Pair], options: RowOptions) -> Iterator[Motion]:
    """The motions of pairs as far as their songs go, those that can be read; where a song is silent, no frame is valid.

    No beats are tracked.
    """
    for pair in pairs:
        with suppress(ValueError, OSError):  # the row of this dance says what is wrong with it
            song = Clip(pair.song, load_sound(pair.music))
            clip = _clip(pair, pair_file(pair, options).motion, song).shared()
            motion, no_beats = cast(Motion, clip.motion), BeatTrack(np.zeros(0), np.zeros(0), 1.0, clip.audio.duration)
            yield replace(motion, valid=motion.valid & ~measured.silent_frames(motion, clip.audio, no_beats))


def limits_of(motions: Iterable[Motion]) -> LikenessLimits | None:
    """The limits of likeness of dancers, fingers left out; None where none of them can be measured."""
    windows: list[dict[str, float]] = []
    for motion in motions:
        with suppress(ValueError):  # it is two-dimensional
            windows += filter(None, window_measures(without_fingers(motion)))
    return LikenessLimits.of_windows([windows], [""]) if windows else None
