"""One dance to one song, measured: a row of the table of clips."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np

from harmolab.beats.visual import visual_beats
from harmolab.corpora.files import song_beats
from harmolab.corpora.folders import read_any_motion, recorded_offset
from harmolab.harmony import harmony_from_hits, music_and_motion, score_motion
from harmolab.io.files import PathLike, plain
from harmolab.io.motion_file import MotionFile
from harmolab.io.video_sound import load_sound
from harmolab.lab.evaluate.pairing import Pair, annotation_of, dance_of, input_stamp
from harmolab.lab.evaluate.protocols import PROTOCOLS, Protocol
from harmolab.lab.evaluate.published_music import published_music_and_motion
from harmolab.metrics.beats import beat_align, beat_coverage, beat_hit_rate, kinematic_params, mir_eval_scores
from harmolab.metrics.body_measures import MEASURES as BODY_MEASURES
from harmolab.metrics.geometric import geometric_features
from harmolab.metrics.kinetic import kinetic_features
from harmolab.metrics.likeness import LikenessLimits, likeness
from harmolab.metrics.quality import foot_skating, freezing, jerk, or_nan, pfc
from harmolab.params import DANCE_PATTERNS, HarmonyParams
from harmolab.types import BeatTrack, Clip, FloatArray, Motion
from harmolab.verdict.judge import Judgement

FROZEN, OTHER_SONG = "frozen pose", "recorded, other song"
FEATURES = ("kinetic", "geometric", "pose")  # kinds of features of a dance as a whole
PIECE = 2.0  # seconds of a dance that the pose network sees at once; a dance is the mean of its pieces
ALPHA = 0.05  # a dance whose p-value is at most this is in harmony beyond luck
SONGS_KEPT = 2  # songs that a process holds, as dances to one song come in a row
# Motion beats of AIST++ between frames: on frames they lie half a frame late, and slow frame rates lower the scores.
MOTION_BEATS = replace(kinematic_params(), subframe=True)
BODY = ("hands", "steps", "turns", "nearest")  # measures of likeness that are columns of their own
Row = dict[str, float | int | str]


class Measure(NamedTuple):
    """A measure of the table: its words, and 1 where more is better, -1 where less is, 0 where neither."""

    words: str
    better: int


MEASURES: Mapping[str, Measure] = {
    "harmony": Measure("harmony above chance", 1),
    "harmony_dance": Measure("harmony above chance, by the song's dance", 1),
    "significant": Measure(f"share of dances with p <= {ALPHA:g}", 1),
    "paper_harmony": Measure("harmony h (paper)", 1),
    "paper_harmony_chance": Measure("h of as many beats at random moments", 0),
    "paper_hit_rate": Measure("hit rate (paper)", 1),
    "paper_hit_rate_chance": Measure("hit rate by chance", 0),
    "beat_align_motion": Measure("beat alignment, over motion beats (AIST++)", 1),
    "beat_align_music": Measure("beat alignment, over music beats (Bailando)", 1),
    "beat_coverage": Measure("beat coverage", 0),
    "beat_hit_rate": Measure("beat hit rate", 1),
    "mir_eval_f": Measure("F-measure of mir_eval", 1),
    "pfc": Measure("physical foot contact, m²/s²", -1),
    "foot_skating": Measure("foot skating, m/s", -1),
    "freezing": Measure("freezing, share of windows", -1),
    "jerk": Measure("jerk, m/s³", 0),
    "likeness": Measure("share that moves like the recorded dancers", 1),
    **{name: Measure(BODY_MEASURES[name], 0) for name in BODY},
    "seconds": Measure("length of a dance, s", 0),
}
QUALITY: Mapping[str, Callable[[Motion], float]] = {
    "pfc": pfc, "foot_skating": foot_skating, "freezing": freezing, "jerk": jerk
}  # fmt: skip


@dataclass(frozen=True)
class RowOptions:
    """Settings of the measurement of a dance.

    Parameters
    ----------
    fps : float or None, hertz, of files that hold no rate
    scale, smpl : as in `harmolab.io.motion.load_motion`; `smpl` for files of SMPL parameters only
    up : str, the axis that points up in files that leave it open, "" to have it guessed
    protocol : str, name in `harmolab.lab.evaluate.protocols.PROTOCOLS`, "" for none
    pose_net : Path or None, weights of the pose network; None leaves its features out
    limits : LikenessLimits of the recorded dancers; the shipped ones when left out
    """

    fps: float | None = None
    scale: float | None = None
    protocol: str = ""
    pose_net: Path | None = None
    limits: LikenessLimits | None = None
    smpl: PathLike | None = None
    up: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The settings as JSON holds them."""
        return {**plain(self), "pose_net": str(self.pose_net or ""), "smpl": str(self.smpl or "")}


def clip_row(pair: Pair, options: RowOptions) -> Row:
    """Everything that is measured of one dance.

    Returns
    -------
    dict : system, seed, song, motion, music, kind; fps, joints, skeleton (a hash of the joints' names), beats
        ("annotated" or "tracked"), music_beats (their number), dance (of the song, "" where unknown), assumptions (in
        short, on how the motion was read), remarks (of the protocol); `MEASURES`; p_value, harmony_low, harmony_high
        and level of the recommended score, p_value_dance of that by the dance's pattern; the numbers of the protocol;
        f_NAME_000 and so on, the features of the dance by name. NaN for what this motion does not have.

    Raises
    ------
    FileNotFoundError, ValueError
        Motion or song cannot be read, or they do not overlap; names the file.
    """
    file = _pair_file(pair, options)
    clip = _clip(pair, file.motion)
    music, motion = music_and_motion(clip)
    joints = motion.skeleton.joints
    about: Row = {
        "system": pair.system, "seed": pair.seed, "song": pair.song, "motion": str(pair.motion),
        "music": str(pair.music), "kind": pair.kind, "fps": motion.fps, "joints": len(joints),
        "skeleton": hashlib.sha256(" ".join(joints).encode()).hexdigest()[:8],
        "beats": "annotated" if annotation_of(pair.music) else "tracked", "music_beats": len(music),
        "dance": clip.dance, "assumptions": ", ".join(one.brief for one in file.assumptions),
    }  # fmt: skip
    numbers = {"seconds": motion.duration, **_harmony(music, motion, clip.dance), **paper_numbers(music, motion)}
    numbers |= beat_numbers(music, motion) | {name: or_nan(measure, motion) for name, measure in QUALITY.items()}
    numbers |= _likeness(motion, clip.dance, options)
    features = motion_features(motion, options)
    if options.protocol:
        own, vectors, about["remarks"] = protocol_numbers(clip, pair, options.protocol)
        numbers, features = numbers | own, features | vectors
    columns = {f"f_{name}_{place:03d}": float(x) for name, row in features.items() for place, x in enumerate(row)}
    return about | numbers | columns


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


def protocol_of(name: str) -> Protocol:
    """A protocol of `harmolab.lab.evaluate.protocols` by its name.

    Raises
    ------
    ValueError
        There is no such protocol; names those that there are.
    """
    if name not in PROTOCOLS:
        raise ValueError(f"no protocol is called {name!r}; there are: {', '.join(PROTOCOLS)}")
    return PROTOCOLS[name]


def pair_clip(pair: Pair, options: RowOptions) -> Clip:
    """The motion of a pair on the time line of its song, with the beats of the song; errors as `clip_row`.

    A motion begins where its file or its recording says, else with the song. To another song than its own it begins
    there too, or earlier, so that it ends with a song that is shorter.
    """
    return _clip(pair, pair_motion(pair, options))


def _clip(pair: Pair, motion: Motion) -> Clip:
    """As `pair_clip`, of a motion that was read."""
    song = _song(pair.music, input_stamp(pair.music))
    offset = recorded_offset(pair.motion) or 0.0
    if pair.kind == OTHER_SONG:
        offset = min(offset, max(0.0, song.audio.duration - motion.duration))
    try:
        return replace(song, name=pair.motion.stem, motion=motion, offset=offset)
    except ValueError as error:
        raise ValueError(f"{pair.motion} with {pair.music}: {error}") from None


def pair_motion(pair: Pair, options: RowOptions) -> Motion:
    """The motion of a pair; of the control "frozen pose" its middle frame, held. Errors as `clip_row`."""
    return _pair_file(pair, options).motion


def _pair_file(pair: Pair, options: RowOptions) -> MotionFile:
    """As `pair_motion`, with notes on how the file was read."""
    file = read_any_motion(
        pair.motion, fps=options.fps, scale=options.scale, smpl=options.smpl, up=options.up, as_defaults=True
    )
    if pair.kind != FROZEN:
        return file
    motion = file.motion
    frames = np.flatnonzero(motion.valid)
    middle = frames[len(frames) // 2] if len(frames) else 0
    held = np.repeat(motion.positions[middle : middle + 1], motion.n_frames, axis=0)
    return file._replace(motion=replace(motion, positions=held))


@lru_cache(maxsize=SONGS_KEPT)
def _song(music: Path, _: str) -> Clip:
    """A song and its beats, as a clip without motion; the second argument, its stamp, keeps it up to date."""
    audio, annotation = load_sound(music), annotation_of(music)
    beats = song_beats(audio, beats=annotation)
    if not len(beats):
        advice = "give them in a file SONG.beats" if annotation is None else "remove it to have the beats tracked"
        raise ValueError(f"{annotation or music}: holds no beats; {advice}")
    return Clip(music.stem, audio, beats=beats, dance=dance_of(music))


def _harmony(music: BeatTrack, motion: Motion, dance: str) -> dict[str, float]:
    """The recommended score without a pattern, and by the bar pattern of the dance where there is one."""
    values = _recommended(music, motion, HarmonyParams.recommended())
    p = values["p_value"]
    numbers = values | {"significant": float(p <= ALPHA) if p == p else p}
    if dance not in DANCE_PATTERNS:
        return numbers | {"harmony_dance": float("nan"), "p_value_dance": float("nan")}
    danced = _recommended(music, motion, HarmonyParams.recommended(DANCE_PATTERNS[dance]))
    return numbers | {"harmony_dance": danced["harmony"], "p_value_dance": danced["p_value"]}


def _recommended(music: BeatTrack, motion: Motion, params: HarmonyParams) -> dict[str, float]:
    """A recommended score. A body in which nothing moves has a harmony of 0 and a p-value of 1, not none."""
    score = score_motion(music, motion, params=params)
    judgement = cast(Judgement, score.judgement)
    (low, high), level = judgement.interval, float(judgement.level)
    if judgement.floor:
        return {"harmony": 0.0, "p_value": 1.0, "harmony_low": 0.0, "harmony_high": 0.0, "level": level}
    values = {"harmony": judgement.place_harmony, "p_value": judgement.p_harmony}
    return values | {"harmony_low": low, "harmony_high": high, "level": level}


def paper_numbers(music: BeatTrack, motion: Motion) -> dict[str, float]:
    """Harmony and hit rate in paper mode, each with what as many visual beats at random moments reach."""
    params = HarmonyParams.paper()
    paper = score_motion(music, motion, params=params, n_rotations=0)
    expected = paper.chance * float(paper.music.strengths.sum())
    return {
        "paper_harmony": paper.harmony,
        "paper_harmony_chance": harmony_from_hits(expected, paper.n_audio, paper.n_visual, params.beta),
        "paper_hit_rate": paper.hit_rate,
        "paper_hit_rate_chance": paper.chance,
    }


def beat_numbers(music: BeatTrack, motion: Motion) -> dict[str, float]:
    """The field's measures of music beats and of the motion beats of AIST++, which need not lie on frames here."""
    audio, visual = music.times, visual_beats(motion, params=MOTION_BEATS).times
    return {
        "beat_align_motion": beat_align(visual, audio),
        "beat_align_music": beat_align(audio, visual),
        "beat_coverage": beat_coverage(len(visual), len(audio)),
        "beat_hit_rate": beat_hit_rate(visual, audio),
        **mir_eval_scores(audio, visual, only=("f",)),
    }


def _likeness(motion: Motion, dance: str, options: RowOptions) -> dict[str, float]:
    """1 where the dance moves like the recorded dancers, 0 where not, and four of its measures."""
    judged = likeness(motion, dance=dance, limits=options.limits)
    passed = float("nan") if judged.passed is None else float(judged.passed)
    return {"likeness": passed} | {name: judged.values.get(name, float("nan")) for name in BODY}


def motion_features(motion: Motion, options: RowOptions) -> dict[str, FloatArray]:
    """The features of a motion as a whole, "kinetic", "geometric" and "pose"; without those it cannot have."""
    features = {}
    for name, measure in (("kinetic", kinetic_features), ("geometric", geometric_features)):
        try:
            features[name] = measure(motion)
        except ValueError:
            continue
    if options.pose_net is not None and (pose := pose_features(motion, options.pose_net)) is not None:
        features["pose"] = pose
    return features


def pose_features(motion: Motion, weights: Path) -> FloatArray | None:
    """Mean features of the pieces of a motion by a pose network, (D,); None where joints or length do not fit.

    Raises
    ------
    ModuleNotFoundError
        torch is not installed.
    """
    from harmolab.systems.common.pose_network import embed_windows
    from harmolab.systems.common.threads import one_thread

    net = _pose_net(weights)
    if motion.skeleton.joints != net.skeleton.joints or motion.positions.shape[2] != 3 or motion.duration < PIECE:
        return None
    with one_thread():
        features: FloatArray = embed_windows([motion], net, seconds=PIECE).mean(axis=0)
    return features


@cache
def _pose_net(weights: Path):  # type: ignore[no-untyped-def]
    from harmolab.systems.common.pose_network import load_pose_net

    return load_pose_net(weights)
