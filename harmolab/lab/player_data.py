"""A dance and its music as one page that plays anywhere: in a notebook, in the offline report, as a file.

The page holds the movement, the parts of the drawn person, and the camera. Its words are those of a dance or of a
musician's hands. `demo` is a page to begin with, made of what comes with harmolab.
"""

import base64
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, NamedTuple, cast

import numpy as np
import soundfile
from numpy.typing import NDArray

from harmolab.beats.audio import music_beats
from harmolab.beats.meter import describe_beats
from harmolab.beats.visual import curve_delay, motion_curve
from harmolab.body.kinematics import resample_motion, upsample_motion
from harmolab.data.synthetic.beats import ClipSettings
from harmolab.data.synthetic.music import planted_music
from harmolab.files import PathLike, write_text
from harmolab.lab import person
from harmolab.lab.person import shared_wall, stage_of
from harmolab.lab.report.templates import framed, rendered
from harmolab.params import HOW_PATTERNS, HarmonyParams
from harmolab.readers.audio import ogg_checksum
from harmolab.score import HarmonyScore
from harmolab.systems.choreographer.banks import shipped_bank
from harmolab.types import FRAME_EDGE, Audio, BeatTrack, Clip, FloatArray, Motion, check_kind
from harmolab.verdict.evidence import ALPHA
from harmolab.verdict.judge import score_clip, score_motion

# Movement of one dancer, as the page holds it

SLOWEST, FASTEST = 30.0, 60.0  # frames per second that the page holds
LEVELS = 65535  # steps of a number in the page
# Constants of the figure, with which the page's script draws what `harmolab.lab.person` draws.
LOOK = {
    "angle": person.ANGLE,
    "distance": person.DISTANCE,
    "middle": person.MIDDLE,
    "corners": person.CORNERS,
    "paler": person.PALER,
    "range": person.LEAST_RANGE,
    "thinnest": person.THINNEST,
    "shadow": [person.SHADOW_LEAST, person.SHADOW_SPREAD],
    "paints": {name: list(colour) for name, colour in person.PAINTS.items()},
    "outlines": list(person.OUTLINES),
}


def movement_data(motion: Motion, *, wall: FloatArray | None = None) -> dict[str, Any]:
    """Data from which the page draws a motion.

    Parameters
    ----------
    motion : Motion, (T, J, 3) metres or (T, J, 2) image coordinates
    wall : (2, 2) array, low and high corner of the picture, in image coordinates; the motion's own when left out
    """
    motion = page_motion(motion)
    stage = stage_of(motion, wall=wall)
    return {
        "flat": stage.flat,
        "aim": stage.aim,
        "lift": stage.lift,
        "front": stage.front,
        "fps": motion.fps,
        "frames": motion.n_frames,
        "joints": len(motion.skeleton.joints),
        "size": stage.size,
        "room": stage.room,
        "stature": stage.plan.stature,
        "points": [_sparse(row) for row in stage.plan.weights[len(motion.skeleton.joints) :]],
        "parts": stage.plan.parts,
        "hips": _sparse(stage.plan.hips),
        "shadow": np.flatnonzero(stage.plan.shadow).tolist(),
        "positions": quantised(stage.positions),
        "way": quantised(stage.way),
    }


def page_motion(motion: Motion) -> Motion:
    """The motion at a rate of `SLOWEST` to `FASTEST` frames per second, as the page holds it."""
    return resample_motion(upsample_motion(motion, SLOWEST), min(max(motion.fps, SLOWEST), FASTEST))


def _sparse(weights: FloatArray) -> list[tuple[int, float]]:
    """(joint, weight) where weights (J,) are not 0."""
    return [(int(joint), float(weights[joint])) for joint in np.flatnonzero(weights)]


def quantised(values: FloatArray) -> dict[str, Any]:
    """(T, ..., K) numbers as base64 of 16-bit steps: value = low[k] + step[k] * number."""
    columns = values.reshape(-1, values.shape[-1])
    low = columns.min(axis=0)
    step = np.maximum((columns.max(axis=0) - low) / LEVELS, 1e-12)
    numbers: NDArray[np.uint16] = np.rint((columns - low) / step).astype("<u2")
    return {"low": low.tolist(), "step": step.tolist(), "numbers": base64.b64encode(numbers.tobytes()).decode()}


# Words of a page, and the sentences that follow the sliders of a lab


@dataclass(frozen=True)
class PageWords:
    """Words for what a player shows.

    Parameters
    ----------
    figure : the stick figure, for people who hear the page
    piece : noun for all of it, as in "the dance is silent"
    sound, mover : names of the two lamps, and of their clicks
    onset, unit : a beat of the sound; the short word for one that is met or missed
    event : a beat of the movement
    curve : the curve under the marks
    """

    figure: str
    piece: str
    sound: str
    mover: str
    onset: str
    unit: str
    event: str
    curve: str = "speed"


DANCING = PageWords(
    figure="a stick figure that dances to the music", piece="dance", sound="music", mover="dancer",
    onset="music beat", unit="beat", event="dancer's beat",
)  # fmt: skip
PLAYING: Mapping[str, PageWords] = {
    "piano": PageWords(
        figure="a stick figure that plays the piano", piece="performance", sound="notes", mover="fingers",
        onset="note onset", unit="onset", event="strike", curve="speed of the hands",
    ),
    "violin": PageWords(
        figure="a stick figure that plays the violin", piece="performance", sound="notes", mover="bow",
        onset="note onset", unit="onset", event="turn of the bow", curve="speed of the hand that bows",
    ),
}  # fmt: skip

# The labs' script in the browser fills the same sentences.
LAB_SENTENCES: Mapping[str, str] = {
    "hits": "Now {hits} of {beats} music beats are met; by chance alone {chance} % would be.",
    "more": " Hardly any other start of the music would do as well (p = {p}).",
    "luck": " Other starts of the music do as well (p = {p}).",
    "unheard": "No music beat is loud enough to count.",
    "unseen": "No movement is large enough to count.",
    "kept": "Now {music} of {beats} music beats and {dance} of {movements} movements are noticed.",
    "planted": "Now {found} of {planted} planted rests are found within {near} ms; "
    "{beats} visual beats for {music} music beats.",
    "detected": "Now there are {beats} visual beats for {music} music beats.",
    "meter": "Now {strong} of {beats} beats are strong, and meter units cover {covered} % of the time.",
    "downbeats": " Of the downbeats among them {strong_downbeats} of {downbeats} are strong.",
    "corpus": "The true music wins in {wins} of {clips} dances, with {ties} ties. AUC {auc} %; a coin has 50 %.",
}
LUCK = 0.05  # p-values above it are called luck


def percent(share: float) -> str:
    """A share in whole per cent; halves are rounded up, in the browser too."""
    return str(math.floor(100 * share + 0.5))


# Names of numbers, as tables of computed scores have them, in words that say what they mean.
PLAIN_FACTS: Mapping[str, str] = {
    "harmony above chance": "harmony above chance (0: as by luck, 1: all)",
    "p in time": "share of other tempi that fit as well (p)",
    "level, 0 to 4": "level of the verdict, 0 to 4",
    "pulse, 1/s": "pulse of the movement, 1/s",
    "share inside the body": "share of the movement inside the body",
    "music beats N": "beats of the music that count",
    "paper: harmony": "harmony as the paper computes it",
    "paper: hit rate": "beats met, as the paper counts (share)",
    "paper: chance": "the same by luck alone",
    "paper: visual beats M": "beats of the dancer, as the paper counts",
    "jerk, m/s³": "jerk: how abrupt the movement is, m/s³",
    "foot skating, m/s": "speed of feet that slide on the floor, m/s",
}


# The player

IN_TIME = 2  # the least level of a verdict that says that a dance is in time
HEIGHT = 880  # pixels of the frame
LONGEST = 600.0  # seconds; a page of more is too large to open
RATES = (3000, 192000)  # hertz
BLOCK = 65536  # samples; libsndfile's Vorbis coder overflows its stack on long ones


@dataclass(frozen=True, eq=False)
class Dancer:
    """One dancer of a `Player`.

    Parameters
    ----------
    name : str
    motion : Motion
        (T, J, 3) metres or (T, J, 2) image coordinates; it begins with the player's sound.
    score : HarmonyScore
        Of the motion with the player's music. Beats and hits that the player shows are those of this score.
    number : HarmonyScore, optional
        The score whose number and verdict the page prints, where `motion` is a part of a dance or has another frame
        rate: that of the whole dance.
    instead : str
        Words in place of number and verdict, where these mean nothing.
    moving : Motion, optional
        The motion whose speed is drawn as a curve, such as the hands of a musician; all of `motion` when left out.
    """

    name: str
    motion: Motion
    score: HarmonyScore
    number: HarmonyScore | None = None
    instead: str = ""
    moving: Motion | None = None


class Player:
    """A player of one dance, or of two side by side, with sound, beats and hits; it plays in any browser.

    It shows itself in a notebook and in the report. `Player.save` writes it as one HTML page that holds all and asks
    the network for nothing. The sound is its clock: it is cut, or filled with silence, to the length of the longest
    motion, and coded as Ogg Vorbis, which puts no delay before the first sample.

    Parameters
    ----------
    audio : Audio
        It begins with the first frame of the motions.
    dancers : sequence of one or two Dancers
        Of ten minutes at most.
    music : BeatTrack
        Beats of the music on the same time line; those after the last frame are left out.
    title : str
    facts : dict
        Name -> text, shown as a table.
    overlaid : bool
        Whether two motions in one picture's coordinates lie over each other: the first, the truth, broad and red, the
        second, the prediction, narrow and green.
    words : PageWords
        Words of the page; those of a dance when left out.
    notice : str
        A sentence above the picture.
    command : str
        A line of the shell that writes the same as a video, shown to be copied.

    Raises
    ------
    ValueError
        Unless there are one or two dancers, of ten minutes at most, and two in image coordinates where they are
        overlaid; for a sample rate outside 3 to 192 kHz, and for what is no Audio, BeatTrack, Dancer or Motion.

    Examples
    --------
    >>> Player(audio, [Dancer("one", motion, score)], music=track, title="A cha-cha").save("x.html")  # doctest: +SKIP
    """

    def __init__(
        self,
        audio: Audio,
        dancers: Sequence[Dancer],
        *,
        music: BeatTrack,
        title: str,
        facts: Mapping[str, str] = MappingProxyType({}),
        overlaid: bool = False,
        words: PageWords = DANCING,
        notice: str = "",
        command: str = "",
    ) -> None:
        check_kind(audio, Audio)
        check_kind(music, BeatTrack, "music")
        if not all(isinstance(dancer, Dancer) for dancer in dancers):
            raise ValueError("dancers must be a list of Dancer(name, motion, score)")
        motions = [dancer.motion for dancer in dancers]
        duration = _duration(motions)
        wall = shared_wall(motions) if overlaid else None
        score = dancers[0].score
        beats = _music(music.span(0.0, duration), score)
        movements = [_dancer(dancer, wall) for dancer in dancers]
        data = {
            "duration": duration,
            "sound": coded_sound(audio, duration),
            "music": beats,
            "bars": any(beat["first"] for beat in beats),
            "sides": any(part.paint == "left" for movement in movements for part in movement["parts"]),
            "look": LOOK,
            "delay": score.params.reaction_delay,
            "lag": score.params.lag,
            "dancers": movements,
            "overlaid": overlaid,
        }
        self.title = title
        plain = {PLAIN_FACTS.get(name, name): text for name, text in facts.items()}
        texts = {"title": title, "facts": plain, "words": words, "notice": notice, "command": command}
        self.page = rendered("player.html.j2", data=data, **texts)

    def _repr_html_(self) -> str:
        return framed(self.page, title=f"{self.title}: player", height=HEIGHT)

    def save(self, path: PathLike) -> None:
        """Write the page to a file, whole or not at all."""
        write_text(path, self.page)


def player_of(
    clips: Sequence[Clip],
    *,
    start: float | None = None,
    seconds: float | None = None,
    title: str = "",
    params: HarmonyParams | None = None,
    command: str = "",
    looks: int = 1,
) -> Player:
    """A player of a clip, or of two dances to the same music side by side, cut to what music and motions share.

    Parameters
    ----------
    clips : one Clip with a motion, or two that share their sound; the second is shown at the rate of the first
    start : float, seconds of audio time; where all motions have begun when left out
    seconds : float, length; to the end of the music when left out
    title, command : as in `Player`, whose facts are the verdict on each whole dance and its number
    params : HarmonyParams, default the recommended ones with the pattern of each clip's dance, if known
    looks : int, dances among which a clip was picked by its harmony: the page says no verdict that does not hold for so
        many (Bonferroni)

    Raises
    ------
    ValueError
        As `Player`; also where there is no music or no motion, or start and seconds are no times.
    """
    if start is not None and not 0 <= start < np.inf:
        raise ValueError(f"start must be a finite number of seconds, got {start:g}; the music begins at 0")
    if seconds is not None and not 0 < seconds < np.inf:
        raise ValueError(f"seconds must be positive and finite, got {seconds:g}")
    if len({clip.name for clip in clips}) < len(clips):  # of two folders: the table has a row for each name
        sides = zip(clips, ("left", "right"), strict=False)
        clips = [replace(clip, name=f"{clip.name}, {side}") for clip, side in sides]
    first = clips[0]
    begun = max(0.0, *[clip.offset for clip in clips])  # by all, so that two numbers are of the same music
    begins = begun if start is None else max(begun, start)
    if begins >= first.audio.duration:
        raise ValueError(f"there is nothing to show from {begins:g} s on: the music ends at {first.audio.duration:g} s")
    frame = 1 / _motion_of(first).fps  # one of the first is the moment at which all begin
    begins = first.offset + math.ceil((begins - first.offset) / frame - FRAME_EDGE) * frame
    length = first.audio.duration - begins if seconds is None else seconds
    beats = music_beats(first)
    dancers, spans = [], []
    for clip in clips:
        whole, picture = (replace(each, beats=beats) for each in (clip, _alike(clip, first)))
        if begun > max(0.0, clip.offset):
            whole = whole.span(begun, first.audio.duration - begun)
        if seconds is not None or begins > clip.offset:
            picture = _with_frame_at(picture, begins).span(begins, length)
        picture = picture.shared()
        dancers.append(_picked(_scored(whole.shared(), picture, params), looks))
        spans.append(picture)
    longest = max(spans, key=lambda clip: clip.audio.duration)
    facts = {name: text for dancer in dancers for name, text in _facts(dancer).items()}
    music = cast(BeatTrack, longest.beats)
    facts["music"] = describe_beats(music)
    if any(one.number and one.number.music.duration > one.score.music.duration + frame for one in dancers):
        facts["judged"] = "the whole dance, of which this is a part"
    return Player(longest.audio, dancers, music=music, title=title, facts=facts, command=command)


def _scored(whole: Clip, picture: Clip, params: HarmonyParams | None) -> Dancer:
    """The dancer of a part as the page shows it; the number is that of the whole dance as it was danced."""
    motion, danced, score = _motion_of(picture), _motion_of(whole), score_clip(picture, params)
    is_same = (danced.fps, danced.n_frames) == (motion.fps, motion.n_frames)
    return Dancer(picture.name, motion, score, None if is_same else score_clip(whole, params))


def _picked(dancer: Dancer, looks: int) -> Dancer:
    """The dancer, without a verdict of being in time that may be the luck of the best of so many dances."""
    judgement = (dancer.number or dancer.score).judgement
    if looks < 2 or judgement is None or judgement.level < IN_TIME:
        return dancer
    p = judgement.p_harmony
    luck = min(1.0, looks * p)
    if luck <= ALPHA:
        return dancer
    words = f"No verdict: picked among {looks} dances. Its p = {p:.3f} is {luck:.2g} once corrected for so many."
    return replace(dancer, instead=words)


def _alike(clip: Clip, other: Clip) -> Clip:
    """The clip with its motion at the frame rate of the other, so that one frame of each is one moment."""
    fps = _motion_of(other).fps
    return replace(clip, motion=resample_motion(upsample_motion(_motion_of(clip), fps), fps))


def _motion_of(clip: Clip) -> Motion:
    """The motion of a clip; ValueError without one."""
    if clip.motion is None:
        raise ValueError(f"{clip.name}: there is no motion to play")
    return clip.motion


def _with_frame_at(clip: Clip, time: float) -> Clip:
    """The clip with its motion interpolated between its frames, so that one falls on a time of the audio."""
    motion = _motion_of(clip)
    part = (time - clip.offset) * motion.fps % 1.0
    if min(part, 1.0 - part) < FRAME_EDGE:
        return clip
    positions = motion.positions[:-1] + part * np.diff(motion.positions, axis=0)
    motion = replace(motion, positions=positions, valid=motion.valid[:-1] & motion.valid[1:])
    return replace(clip, motion=motion, offset=clip.offset + part / motion.fps)


OF_DANCE = {
    "you are": "it is", "you keep": "it keeps", "you move": "it moves", "you rest": "it rests", "you hit": "it hits",
    "you dance": "it dances", "you follow": "it follows", "you stand still or move": "it stands still or moves",
    "you only": "it only", "you mostly": "it mostly", "turn and travel": "turns and travels", "your own": "its own",
    "your place": "its place", "your mean place": "its mean place", "your movement": "its movement",
    "points of you are": "points of it are",
}  # fmt: skip


def of_dance(words: str) -> str:
    """Words of a verdict said of the dance, where whoever reads them may not be the dancer.

    >>> of_dance("You are on the beat: you rest on it. Your own tempo is 120.0 bpm.")
    'The dance is on the beat: it rests on it. Its own tempo is 120.0 bpm.'
    """
    return re.sub("|".join(OF_DANCE), _of_dance, words, flags=re.IGNORECASE)


def _of_dance(match: re.Match[str]) -> str:
    words = OF_DANCE[match[0].lower()]
    return words if match[0].islower() else words.capitalize().replace("It ", "The dance ")


def _facts(dancer: Dancer) -> dict[str, str]:
    """Name and text of the verdict on a dancer, its remarks, and its number."""
    score = dancer.number or dancer.score
    p = f"p = {score.p_value:.3f}" if score.judgement is None else f"p in time = {score.judgement.p_time:.3f}"
    number = "-" if np.isnan(score.above_chance) else f"{score.above_chance:.3f} ({p})"
    facts = {f"{dancer.name}: harmony above chance": number}
    if score.judgement is None:
        return facts
    if dancer.instead:
        return {f"{dancer.name}: level": dancer.instead}
    words = of_dance(" ".join([score.judgement.verdict, *score.judgement.remarks]))
    return {f"{dancer.name}: level": f"{score.judgement.level} of 4: {words}"} | facts


def blind_page(audio: Audio, motions: Sequence[Motion]) -> str:
    """A player for raters of a study: dance and sound alone, and nothing that gives the answer away.

    Neither names nor beats nor settings stand in the page or in its source. Two dancers are called "left" and "right".

    Parameters
    ----------
    audio : Audio
        It begins with the first frame of the motions.
    motions : sequence of one or two Motions
        Two stand side by side; (T, J, 3) metres or (T, J, 2) image coordinates.

    Returns
    -------
    str, one HTML page

    Raises
    ------
    ValueError
        As `Player`.
    """
    check_kind(audio, Audio)
    duration = _duration(motions)
    names = ("left", "right") if len(motions) == 2 else ("dancer",)
    dancers = [{"name": name, **movement_data(motion)} for name, motion in zip(names, motions, strict=True)]
    data = {"duration": duration, "sound": coded_sound(audio, duration), "look": LOOK, "dancers": dancers}
    return rendered("blind.html.j2", data=data, words=DANCING)


def _duration(motions: Sequence[Motion]) -> float:
    """Seconds of the longest motion; ValueError unless there are one or two, not too long."""
    if len(motions) not in (1, 2):
        raise ValueError(f"the player shows one dancer or two, got {len(motions)}")
    for motion in motions:
        check_kind(motion, Motion)
    duration = max(motion.duration for motion in motions)
    if duration > LONGEST:
        raise ValueError(f"the player shows {LONGEST:g} s at most, got {duration:.1f} s; cut it (--start, --seconds)")
    return duration


def _music(music: BeatTrack, score: HarmonyScore) -> list[dict[str, Any]]:
    """The music's beats: time, if they are salient, if they begin a bar, their count in it and its number.

    Count and number are 0 where no bars are known; beats before the first whole bar are of bar 0.
    """
    salient = np.any(np.abs(music.times[:, None] - score.music.times) < 1e-6, axis=1)
    places = np.full(len(music), -1) if music.bar_places is None else music.bar_places
    bars = np.cumsum(places == 0)
    return [
        {
            "time": _seconds(time), "salient": bool(is_salient), "first": bool(place == 0), "count": int(place) + 1,
            "bar": int(bar),
        }
        for time, is_salient, place, bar in zip(music.times, salient, places, bars, strict=True)
    ]  # fmt: skip


def _dancer(dancer: Dancer, wall: FloatArray | None) -> dict[str, Any]:
    """Name, movement, speed, beats and hits of one dancer."""
    return {
        "name": dancer.name,
        **movement_data(dancer.motion, wall=wall),
        "speed": _speed(dancer.moving or dancer.motion, dancer.score.params),
        "visual": [_seconds(time) for time in dancer.score.visual.times],
        "marks": _marks(dancer.score),
        "number": {"verdict": dancer.instead} if dancer.instead else _number(dancer.number or dancer.score),
    }


def _number(score: HarmonyScore) -> dict[str, float | str | None]:
    """The number of a dance as `harmolab score` gives it, and the verdict on it where there is one."""
    plain = score.to_dict()
    verdict = of_dance(score.judgement.verdict) if score.judgement else None
    return {"harmony_above_chance": plain["harmony_above_chance"], "level": plain.get("level"), "verdict": verdict}


def _speed(motion: Motion, params: HarmonyParams) -> dict[str, Any]:
    """The curve that visual beats are read from, at a rate that shows it smooth."""
    times = np.arange(0.0, motion.duration, 1.0 / FASTEST)
    curve, fps = motion_curve(motion, params)
    seconds = (np.arange(curve.size) - curve_delay(params)) / fps
    return {"fps": FASTEST, **quantised(np.interp(times, seconds, curve)[:, None])}


def _marks(score: HarmonyScore) -> list[dict[str, float | None]]:
    """Each salient music beat, and the dancer's beat that hits it; None for a miss."""
    return [
        {"time": _seconds(time), "met": _seconds(score.visual.times[pair]) if pair >= 0 else None}
        for time, pair in zip(score.music.times, score.pairs, strict=True)
    ]


def _seconds(time: float) -> float:
    return round(float(time), 4)


def coded_sound(audio: Audio, duration: float) -> dict[str, Any]:
    """The sound of `duration` seconds as base64 of Ogg Vorbis."""
    rate = round(audio.sample_rate)
    if not RATES[0] <= rate <= RATES[1]:  # above, the coder crashes; below, browsers refuse
        raise ValueError(f"the player takes sound of {RATES[0]} to {RATES[1]} Hz, got {rate}; load it at 44100 Hz")
    samples = np.zeros(max(round(duration * rate), 1), dtype=np.float32)
    sound = np.clip(audio.samples[: samples.size], -1.0, 1.0)
    samples[: sound.size] = sound
    stream = io.BytesIO()
    with soundfile.SoundFile(stream, "w", rate, 1, format="OGG", subtype="VORBIS") as file:
        for first in range(0, samples.size, BLOCK):
            file.write(samples[first : first + BLOCK])
    return {"rate": rate, "ogg": base64.b64encode(_numbered(stream.getvalue())).decode()}


def _numbered(stream: bytes) -> bytes:
    """An Ogg stream with 1 in place of its number, which libsndfile draws at random: the same sound, the same bytes.

    Each page has the number at byte 14, its checksum at 22, and the lengths of its parts from 27 on (RFC 3533).
    """
    pages, start = bytearray(stream), 0
    while start < len(pages):
        body = start + 27 + pages[start + 26]
        end = body + sum(pages[start + 27 : body])
        pages[start + 14 : start + 18] = (1).to_bytes(4, "little")
        pages[start + 22 : start + 26] = bytes(4)
        pages[start + 22 : start + 26] = ogg_checksum(bytes(pages[start:end]))
        start = end
    return bytes(pages)


# The demo: one dance twice, in time with its music and late

SONG, TEMPO = "rumba", 75.0  # beats a minute
SECONDS = 25.0
SEED = 2  # a dance that meets nearly all beats; picked to show clearly what is in time, and no result
LATE = 0.25  # of a beat: half a beat late, rests on the beat become hits on it
NOTICE = (
    "The song is synthetic: a small band that a program plays. The movement is recorded salsa (CMU Graphics Lab Motion "
    "Capture Database), laid on the beats by harmolab. Both dancers are the same one; the right one moves {late:.2f} s "
    "later, a quarter of a beat."
)
FACTS = {
    "try": "slow motion and the clicks: does the body come to rest on the beat?",
    "movement": "subject 61 of mocap.cs.cmu.edu, a database created with funding from NSF EIA-0196217",
    "chosen": "the dance was picked because it meets most beats: it shows what the words mean, and is no result",
}


class Demo(NamedTuple):
    """A page with two dancers and the scores of both.

    Parameters
    ----------
    player : Player
    late : float, seconds that the second dancer is late
    in_time, delayed : HarmonyScore of the first and of the second
    """

    player: Player
    late: float
    in_time: HarmonyScore
    delayed: HarmonyScore


def demo() -> Demo:
    """The page, made anew in a few seconds; nothing is read but what comes with harmolab, and no beats are tracked.

    Raises
    ------
    FileNotFoundError
        If the recorded movement was left out of this installation.

    Examples
    --------
    >>> demo().player.save("demo.html")  # doctest: +SKIP
    """
    music = planted_music(ClipSettings(SONG, seconds=SECONDS, tempo=TEMPO, seed=3))
    motion = shipped_bank().choreograph(music.audio, music.beats, seed=SEED).motion
    late = round(LATE * 60.0 / TEMPO * motion.fps) / motion.fps
    length = motion.duration - late
    beats = music.beats.span(late, length)
    motions = {"in time": motion.span(late, length), "late": motion.span(0.0, length)}
    # Laid with its rests on the beats, so a rest is what is asked for.
    params = HarmonyParams.recommended(HOW_PATTERNS["rest"])
    dancers = [Dancer(name, each, score_motion(beats, each, params=params)) for name, each in motions.items()]
    player = Player(
        music.audio.span(late, length), dancers, music=beats, title="harmolab demo: the same dance, in time and late",
        facts=FACTS, notice=NOTICE.format(late=late),
    )  # fmt: skip
    return Demo(player, late, dancers[0].score, dancers[1].score)
