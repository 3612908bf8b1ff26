"""Numbers of dances from any source, in one long table: a line for each system, song, seed and measure.

Every table of dances is made of these: `harmolab evaluate` for files, `measure_dances` for motions in memory. A measure
is a function of one dance in this module. Those that stand in the table of an evaluation have their words in
`MEASURES`. The simplest number of a dance says whether the body comes to rest on the beats (`rests_on_beat`).
`dance_scores` is for a table beside one generated dance: harmony, beats, jerk, skating, likeness to recorded dancers.
"""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import cache
from importlib.util import find_spec
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, cast

import lazy_loader
import numpy as np

from harmolab.beats.visual import visual_beats
from harmolab.body.kinematics import NANOMETRE, in_body, joint_speed
from harmolab.body.skeletons import HIPS, body_frame, heading, turned
from harmolab.lab.evaluate.pairing import RECORDED
from harmolab.lab.evaluate.sets import FEATURES, SETS, feature_cells, set_numbers
from harmolab.metrics.beat_alignment import kinematic_params, other_scores
from harmolab.metrics.features import geometric_features, kinetic_features
from harmolab.metrics.likeness import MEASURES as BODY_MEASURES
from harmolab.metrics.likeness import Likeness, LikenessLimits, likeness
from harmolab.metrics.quality import foot_skating, freezing, jerk, or_nan, pfc, relative_jerk
from harmolab.params import DANCE_PATTERNS, HarmonyParams
from harmolab.score import HarmonyScore, harmony_from_hits
from harmolab.shape_speed import without_fingers
from harmolab.systems.choreographer.form import Form
from harmolab.systems.training.features import check_choice
from harmolab.types import Audio, BeatTrack, BoolArray, FloatArray, Motion, check_kind
from harmolab.verdict.judge import Judgement, score_motion

if TYPE_CHECKING:
    import pandas as pd
else:  # half a second, which no worker needs to wait for
    pd = lazy_loader.load("pandas")

# Rests on the beats


def rests_on_beat(
    motion: Motion, music: BeatTrack, *, late: float = 0.0, frame: Literal["body", "room"] = "body"
) -> float:
    """Harmony above chance of the moments at which the joints are slowest: does the body come to rest on the beats?

    It is the score of `HarmonyParams.valleys`. The way of the body through the room and its turns are taken out before.
    Recorded ballroom dancers have about .06, since they do not rest on every beat.

    Parameters
    ----------
    motion : Motion
    music : BeatTrack
        Beats of the music on the motion's time line.
    late : float, beats
        The music is taken to be so much later. Compare 0 with .5: there a dancer who rests on the beat is below chance.
    frame : "body" or "room"
        "room" leaves the way and the turns in, which alone may come to rest.

    Returns
    -------
    float: 0 at chance, 1 for a rest on every beat; NaN where nothing moves in the body, or with fewer than two beats

    Raises
    ------
    ValueError
        For another frame, and unless a Motion and a BeatTrack are passed.
    """
    check_kind(music, BeatTrack)
    check_kind(motion, Motion)
    check_choice("frame", frame, ("body", "room"))
    if len(music) < 2:
        return float("nan")
    music = later(music, late) if late else music
    motion = in_body(motion) if frame == "body" else motion
    score = score_motion(music, motion, params=HarmonyParams.valleys(), n_rotations=0)
    return score.harmony_above_chance if score.n_visual else float("nan")


def later(music: BeatTrack, beats: float) -> BeatTrack:
    """Music of which every beat comes so many beats later; those beyond its end are left out."""
    steps = np.diff(music.times)
    times = music.times + beats * np.append(steps, steps[-1:])
    return replace(music, times=times, duration=max(music.duration, times[-1])).span(0.0, music.duration)


def silent_frames(motion: Motion, audio: Audio, music: BeatTrack, *, start: float = 0.0) -> BoolArray:
    """Frames (T,) of a motion from audio time `start` in which the song of these beats is silent for a second or more.

    Whoever holds a pose there has not stopped dancing (`likeness`, `held`).
    """
    period = float(np.median(np.diff(music.times))) if len(music) > 1 else 0.0
    times, silent = start + np.arange(motion.n_frames) / motion.fps, np.zeros(motion.n_frames, bool)
    for first, last in Form.of(audio).silences(period):
        silent |= (first <= times) & (times < last)
    return silent


# Measures of a dance, and the long table

NETWORK_PACKAGES = ("torch", "safetensors")  # that a pose network is run and read by
PIECE = 2.0  # seconds of a dance that the pose network sees at once; a dance is the mean of its pieces
ALPHA = 0.05  # a dance whose p-value is at most this is in harmony beyond luck
# Motion beats of AIST++ between frames: on frames they lie half a frame late, and slow frame rates lower the scores.
MOTION_BEATS = replace(kinematic_params(), subframe=True)
BODY = ("hands", "steps", "turns", "nearest")  # measures of likeness that are columns of their own


class Dance(NamedTuple):
    """One dance to one song, ready to be measured by `measure_dances`.

    Parameters
    ----------
    system : str
        Name of the system that made it; "recorded" for a recorded dance.
    song : str
    motion : Motion
    music : BeatTrack
        Beats of the music on the motion's time line.
    seed : str or int
        Of the draw, or of the training.
    dance : str
        Such as "waltz"; "" where unknown.
    limits : LikenessLimits
        Of recorded dancers; those that come with harmolab when left out.
    silent : (T,) bool array
        Frames in which the music is silent; the measures of likeness leave them out.
    """

    system: str
    song: str
    motion: Motion
    music: BeatTrack
    seed: str | int = ""
    dance: str = ""
    limits: LikenessLimits | None = None
    silent: BoolArray | None = None


class Measure(NamedTuple):
    """A measure of the table.

    Parameters
    ----------
    words : str
    better : int, 1 where more is better, -1 where less is, 0 where neither
    head : str, of its column in the LaTeX table; "" for none there
    drawn : bool, whether the page has a chart of it
    """

    words: str
    better: int
    head: str = ""
    drawn: bool = False


MUSIC_MEASURES: Mapping[str, Measure] = {
    "harmony": Measure("harmony above chance", 1, "Harmony", True),
    "harmony_dance": Measure("harmony above chance, by the song's dance", 1, "H. of dance", True),
    "significant": Measure(f"share of dances with p <= {ALPHA:g}", 1),
    "paper_harmony": Measure("harmony h (paper)", 1, r"$h$", True),
    "paper_harmony_chance": Measure("h of as many beats at random moments", 0, r"$h$ by chance"),
    "paper_hit_rate": Measure("hit rate (paper)", 1),
    "paper_hit_rate_chance": Measure("hit rate by chance", 0),
    "beat_align_motion": Measure("beat alignment, over motion beats (AIST++)", 1, r"BA$_\mathrm{motion}$", True),
    "beat_align_music": Measure("beat alignment, over music beats (Bailando)", 1, r"BA$_\mathrm{music}$", True),
    "beat_coverage": Measure("beat coverage", 0),
    "beat_hit_rate": Measure("beat hit rate", 1),
    "mir_eval_f": Measure("F-measure of mir_eval", 1, "Beat $F$", True),
}
DANCE_MEASURES: Mapping[str, Measure] = {
    "pfc": Measure("physical foot contact, m²/s²", -1, "PFC", True),
    "foot_skating": Measure("foot skating, m/s", -1, "Skating", True),
    "freezing": Measure("freezing, share of windows", -1, "Freezing", True),
    "jerk": Measure("jerk, m/s³", 0, drawn=True),
    "likeness": Measure("share that moves like the recorded dancers", 1, "Likeness", True),
    **{name: Measure(BODY_MEASURES[name], 0) for name in BODY},
    "seconds": Measure("length of a dance, s", 0),
}
MEASURES = MappingProxyType({**MUSIC_MEASURES, **DANCE_MEASURES})


def dance_numbers(dance: Dance, measures: Iterable[str]) -> dict[str, float]:
    """The numbers of these names of one dance, NaN for those that it does not have; ValueError for another name."""
    names = tuple(measures)
    if unknown := [name for name in names if name not in SOURCES]:
        raise ValueError(f"no measure of a dance is called {unknown[0]!r}; there are: {', '.join(SOURCES)}")
    numbers: dict[str, float] = {}
    for source in dict.fromkeys(SOURCES[name] for name in names):
        numbers |= source(dance)
    return {name: numbers[name] for name in names}


def measure_dances(
    dances: Iterable[Dance],
    measures: Sequence[str],
    *,
    others: Mapping[str, Callable[[Dance], float]] = MappingProxyType({}),
    of_sets: Mapping[str, Callable[[Sequence[Dance], Sequence[Dance]], float]] = MappingProxyType({}),
) -> pd.DataFrame:
    """Numbers of many dances in one long table: a line for each dance and measure.

    Parameters
    ----------
    dances : iterable of Dance
        Pieces of a dance may stand for it. Recorded dances have the system "recorded".
    measures : sequence of str
        Names of three kinds.

        * Of single dances, in `harmolab.lab.evaluate.measured.SOURCES`: "harmony", "beat_align_motion", "jerk",
          "foot_skating", "likeness" and others.
        * In multiples of the mean of the recorded dances: "jerk_ratio", "skating_ratio", "speed_ratio".
        * Of sets of dances: "fid", "diversity" or "multimodality", then "_kinetic" or "_geometric". The "fid" of a
          system is its Fréchet distance from the recorded dances; what small samples add is taken off.
    others : dict
        Name -> function of a Dance to a number: measures of your own.
    of_sets : dict
        Name -> function to a number of two lists of Dances: those of a system and seed, and all recorded ones.

    Returns
    -------
    DataFrame
        Columns system, song, seed, measure and value, dance by dance. Lines of sets of dances have the song "", and the
        seed "" where all dances of a system are one set. What cannot be measured of a dance is NaN; of a set the line
        is left out.

    Raises
    ------
    ValueError
        For an unknown measure, what is no Dance, and without recorded dances where a measure needs them.

    Examples
    --------
    >>> from harmolab import synthetic_clip
    >>> clips = [synthetic_clip("waltz", seconds=12.0, seed=seed) for seed in (1, 2)]
    >>> dances = [Dance("recorded", f"song {place}", one.motion, one.beats) for place, one in enumerate(clips)]
    >>> dances += [one._replace(system="statue", motion=statue(one.motion)) for one in dances]
    >>> table = measure_dances(dances, ["harmony", "jerk_ratio"])
    >>> table[table["measure"] == "harmony"].groupby("system")["value"].mean().round(1).to_dict()
    {'recorded': 0.8, 'statue': 0.0}
    """
    kinds = {name.partition("_")[2] for name in measures if name in SET_MEASURES}
    ratios = [name for name in measures if name in RATIOS]
    single = [RATIOS.get(name, name) for name in measures if name not in SET_MEASURES]
    dances = list(dances)
    if strangers := {type(one).__name__ for one in dances if not isinstance(one, Dance)}:
        raise ValueError(f"dances must be a list of Dance(system, song, motion, music), got {', '.join(strangers)}")
    recorded = [one for one in dances if one.system == RECORDED]
    if not recorded and (kinds or ratios or of_sets):
        raise ValueError(f"distances and ratios need dances of the system {RECORDED!r}")
    lines: list[tuple[Any, ...]] = []
    for one in dances:
        numbers = dance_numbers(one, single) | {name: measure(one) for name, measure in others.items()}
        lines += [(one.system, one.song, one.seed, name, value) for name, value in numbers.items()]
    for name in ratios:
        plain = [line for line in lines if line[3] == RATIOS[name]]
        mean = np.nanmean([line[4] for line in plain if line[0] == RECORDED])
        lines += [(*line[:3], name, line[4] / mean) for line in plain]
    lines = [line for line in lines if line[3] in {*measures, *others}]
    sets: dict[tuple[str, str | int], list[Dance]] = {}
    for one in dances:
        sets.setdefault((one.system, one.seed), []).append(one)
    for (system, each), own in sets.items():
        lines += [(system, "", each, name, measure(own, recorded)) for name, measure in of_sets.items()]
    numbers_of = set_numbers(_feature_tables(dances, kinds)) if kinds else {}
    lines += [(system, "", "", name, one.value) for (system, name), one in numbers_of.items() if name in measures]
    return pd.DataFrame(lines, columns=["system", "song", "seed", "measure", "value"])


def _feature_tables(dances: Iterable[Dance], kinds: Collection[str]) -> dict[str, pd.DataFrame]:
    """The features of dances by system, as `Collected.features` has them."""
    rows = [
        {"system": one.system, "song": one.song, "seed": one.seed,
         "skeleton": " ".join(without_fingers(one.motion).skeleton.joints),
         **feature_cells(motion_features(one.motion, None, kinds))}
        for one in dances
    ]  # fmt: skip
    return {str(system): own for system, own in pd.DataFrame(rows).groupby("system", sort=False)}


def statue(motion: Motion) -> Motion:
    """The mean pose of a dancer on the dancer's own path, turning as the dancer turns: what it keeps is no dance."""
    body = body_frame(motion.positions, motion.fps, motion.skeleton)
    angles = heading(motion.positions, motion.fps, motion.skeleton, parts=HIPS, smoothing=0.0)[:, None]
    torso = (motion.positions - turned(body, angles))[:, :1]
    pose = np.repeat(body.mean(axis=0, keepdims=True), len(body), axis=0)
    # To the nanometre: the valleys of rounding errors would be the beats of a statue that stands.
    return replace(motion, positions=(turned(pose, angles) + torso).round(NANOMETRE))


def harmony_numbers(dance: Dance) -> dict[str, float]:
    """The recommended score without a pattern, and by the bar pattern of the dance where there is one."""
    values = _recommended(dance, HarmonyParams.recommended())
    p, by_bar = values["p_value"], {"harmony": float("nan"), "p_value": float("nan")}
    if dance.dance in DANCE_PATTERNS:
        by_bar = _recommended(dance, HarmonyParams.recommended(DANCE_PATTERNS[dance.dance]))
    of_dance = {"harmony_dance": by_bar["harmony"], "p_value_dance": by_bar["p_value"]}
    return values | {"significant": math.nan if math.isnan(p) else float(p <= ALPHA)} | of_dance


def _recommended(dance: Dance, params: HarmonyParams) -> dict[str, float]:
    """A recommended score. A body in which nothing moves has a harmony of 0 and a p-value of 1, not none.

    To unsure beats every dance has numbers: were those left out that do not follow them, luck alone would be averaged.
    """
    music = replace(dance.music, fit=None, windows=None)
    judgement = cast(Judgement, score_motion(music, dance.motion, params=params).judgement)
    (low, high), level = judgement.interval, float(judgement.level if judgement.level > 1 or dance.music.is_sure else 0)
    if judgement.floor:
        return {"harmony": 0.0, "p_value": 1.0, "harmony_low": 0.0, "harmony_high": 0.0, "level": level}
    values = {"harmony": judgement.place_harmony, "p_value": judgement.p_harmony}
    return values | {"harmony_low": low, "harmony_high": high, "level": level}


def paper_numbers(music: BeatTrack, motion: Motion) -> dict[str, float]:
    """Harmony and hit rate in paper mode, each with what as many visual beats at random moments reach, and M."""
    params = HarmonyParams.paper()
    paper = score_motion(music, motion, params=params, n_rotations=0)
    expected = paper.chance * float(paper.music.strengths.sum())
    return {
        "paper_harmony": paper.harmony,
        "paper_harmony_chance": harmony_from_hits(expected, paper.n_audio, paper.n_visual, params.beta),
        "paper_hit_rate": paper.hit_rate,
        "paper_hit_rate_chance": paper.chance,
        "paper_visual_beats": paper.n_visual,
    }


def beat_numbers(music: BeatTrack, motion: Motion) -> dict[str, float]:
    """The field's measures of music beats and of the motion beats of AIST++, which need not lie on frames here."""
    return other_scores(music, visual_beats(motion, params=MOTION_BEATS), only=("f",))


def rest_numbers(dance: Dance) -> dict[str, float]:
    """Harmony above chance of rests: in the body, with the music half a beat late, in the room, and of the statue.

    A dance that is no better than its statue has danced with its path.
    """
    motion, music = dance.motion, dance.music
    return {
        "rests": rests_on_beat(motion, music),
        "rests_late": rests_on_beat(motion, music, late=0.5),
        "room_rests": rests_on_beat(motion, music, frame="room"),
        "statue_rests": rests_on_beat(statue(motion), music, frame="room"),
    }


def quality_numbers(dance: Dance) -> dict[str, float]:
    """Foot contact, skating, freezing, jerk, jerk for the speed, mean speed of a joint in m/s; fingers left out."""
    motion = without_fingers(dance.motion)
    speed = float(joint_speed(motion.positions, motion.fps).mean() / len(motion.skeleton.joints))
    return {name: or_nan(measure, motion) for name, measure in QUALITY.items()} | {"speed": speed}


def guard_numbers(dance: Dance) -> dict[str, float]:
    """1 where the dance moves like the recorded dancers, 0 where not, the share of its measures within, and each."""
    judged = likeness(without_fingers(dance.motion), dance=dance.dance, limits=dance.limits, held=dance.silent)
    values = {name: judged.values.get(name, float("nan")) for name in BODY_MEASURES}
    return {
        "likeness": float("nan") if judged.passed is None else float(judged.passed),
        "likeness_within": 1 - len(judged.fails) / max(len(judged.values), 1),
        **{name: values[name] for name in BODY},
        **{f"likeness_{name}": value for name, value in values.items()},
    }


QUALITY: Mapping[str, Callable[[Motion], float]] = {
    **{"pfc": pfc, "foot_skating": foot_skating, "freezing": freezing, "jerk": jerk, "relative_jerk": relative_jerk}
}
HARMONY = (
    *("harmony", "p_value", "harmony_low", "harmony_high", "level", "significant", "harmony_dance", "p_value_dance"),
)
PAPER = ("paper_harmony", "paper_harmony_chance", "paper_hit_rate", "paper_hit_rate_chance")
BEATS = ("beat_align_motion", "beat_align_music", "beat_coverage", "beat_hit_rate", "mir_eval_f")
NUMBERS = tuple(dict.fromkeys(("seconds", *HARMONY, *MEASURES)))  # of a dance in the table of clips, in their order
# Name of a measure -> the function of a dance that gives it, with others.
SOURCES: Mapping[str, Callable[[Dance], Mapping[str, float]]] = {
    "seconds": lambda dance: {"seconds": dance.motion.duration},
    **dict.fromkeys(HARMONY, harmony_numbers),
    **dict.fromkeys((*PAPER, "paper_visual_beats"), lambda dance: paper_numbers(dance.music, dance.motion)),
    **dict.fromkeys(BEATS, lambda dance: beat_numbers(dance.music, dance.motion)),
    **dict.fromkeys(("rests", "rests_late", "room_rests", "statue_rests"), rest_numbers),
    **dict.fromkeys((*QUALITY, "speed"), quality_numbers),
    **dict.fromkeys(("likeness", "likeness_within", *BODY, *map("likeness_{}".format, BODY_MEASURES)), guard_numbers),
}
# Measures in multiples of the mean of the recorded dances.
RATIOS = MappingProxyType({"jerk_ratio": "jerk", "skating_ratio": "foot_skating", "speed_ratio": "speed"})
SET_MEASURES = tuple(f"{kind}_{name}" for kind in SETS for name in FEATURES if name != "pose")


def motion_features(motion: Motion, pose_net: Path | None, kinds: Collection[str] = FEATURES) -> dict[str, FloatArray]:
    """The features of these kinds of a motion as a whole, without fingers; without those it cannot have."""
    features: dict[str, FloatArray] = {}
    motion = without_fingers(motion)
    for name, measure in (("kinetic", kinetic_features), ("geometric", geometric_features)):
        with suppress(ValueError):  # joints that it needs are missing, or frames
            features |= {name: measure(motion)} if name in kinds else {}
    pose = pose_features(motion, pose_net) if pose_net is not None and "pose" in kinds else None
    return features if pose is None else features | {"pose": pose}


def has_networks() -> bool:
    """True where the packages are installed that read a pose network and run it: torch alone does not do."""
    return all(find_spec(name) for name in NETWORK_PACKAGES)


def shipped_pose_net() -> Path | None:
    """The weights of the pose network that comes with harmolab; None where it cannot be run."""
    weights = Path(__file__).parents[2] / "systems" / "harmogan" / "weights" / "pose_net"
    return weights if has_networks() else None


def weights_digest(weights: Path | None) -> str:
    """A text that changes with the weights of a pose network; "" for none."""
    from harmolab.systems.training.about import json_file, weights_stem

    return "" if weights is None else hashlib.sha256(json_file(weights_stem(weights)).read_bytes()).hexdigest()[:16]


def pose_features(motion: Motion, weights: Path) -> FloatArray | None:
    """Mean features of the pieces of a motion by a pose network, (D,); None where joints or length do not fit.

    Raises
    ------
    ModuleNotFoundError
        torch is not installed.
    """
    from harmolab.systems.training.layers import one_thread
    from harmolab.systems.training.pose_network import embed_windows

    net = _pose_net(weights)
    if motion.skeleton.joints != net.skeleton.joints or motion.positions.shape[2] != 3 or motion.duration < PIECE:
        return None
    with one_thread():
        features: FloatArray = embed_windows([motion], net, seconds=PIECE).mean(axis=0)
    return features


@cache
def _pose_net(weights: Path):  # type: ignore[no-untyped-def]
    from harmolab.systems.training.pose_network import load_pose_net

    return load_pose_net(weights)


# Scores of one generated dance

Entry = float | int | str | None
ABOVE_CHANCE = "harmony above chance"
# What speaks of harmony: of a dance that fails by likeness none is told.
OF_HARMONY = (ABOVE_CHANCE, "level, 0 to 4", "p in time", "paper: harmony", "paper: hit rate", "paper: chance")
MEANINGLESS = "not meaningful"
# Measure of `dance_numbers` -> its words.
WORDS: Mapping[str, str] = {
    "paper_harmony": "paper: harmony",
    "paper_hit_rate": "paper: hit rate",
    "paper_hit_rate_chance": "paper: chance",
    "paper_visual_beats": "paper: visual beats M",
    "jerk": "jerk, m/s³",
    "foot_skating": "foot skating, m/s",
}


def dance_scores(
    motion: Motion, music: BeatTrack, score: HarmonyScore | None = None, *, likeness: Likeness | None = None
) -> dict[str, Entry]:
    """Name -> number of every score of a dance; None where it is too short for that, or has no feet to judge.

    With a likeness "looks like dancing" says how many measures pass, and every measure stands there with the range that
    recorded dancers had; of a dance that fails all that speaks of harmony (`OF_HARMONY`) is "not meaningful".

    Parameters
    ----------
    motion : Motion
    music : BeatTrack on the motion's time line
    score : HarmonyScore of the two by the recommended settings, computed without a dance's pattern when left out
    likeness : Likeness of the motion (`harmolab.likeness`)
    """
    score = score or score_motion(music, motion)
    numbers = dance_numbers(Dance("", "", motion, music), WORDS)
    measured = {WORDS[name]: None if math.isnan(value) else value for name, value in numbers.items()}
    scores: dict[str, Entry] = {**_judged(score), **measured}
    return scores if likeness is None else _guarded(scores, likeness)


def _guarded(scores: dict[str, Entry], likeness: Likeness) -> dict[str, Entry]:
    """The scores with those of likeness after harmony, which says nothing where they fail."""
    if likeness.passed is False:
        scores |= dict.fromkeys(OF_HARMONY, MEANINGLESS)
    first = {ABOVE_CHANCE: scores[ABOVE_CHANCE], "looks like dancing": likeness.cannot or likeness.count}
    body = {f"like dancing: {words}": _measured(likeness, name) for name, words in BODY_MEASURES.items()}
    return first | scores | body


def _measured(likeness: Likeness, name: str) -> str | None:
    """A measure, the range that recorded dancers had, and "fails" where it is too far from it."""
    if name not in likeness.values:
        return None
    low, _, high = likeness.recorded[name]
    fails = " fails" if name in likeness.fails else ""
    return f"{likeness.values[name]:.3g} (recorded {low:.3g} to {high:.3g}){fails}"


def _judged(score: HarmonyScore) -> dict[str, Entry]:
    """The numbers of the recommended score, beginning with the one to read."""
    verdict = score.judgement.to_dict() if score.judgement else {}
    return {
        ABOVE_CHANCE: score.above_chance,
        "level, 0 to 4": verdict.get("level"),
        "p in time": verdict.get("p_time"),
        "pulse, 1/s": verdict.get("pulse"),
        "share inside the body": verdict.get("share"),
        "music beats N": score.n_audio,
    }
