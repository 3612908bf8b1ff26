"""One person's dance beside its song: read, placed by its offset, scored and explained in findings.

*Findings* are sentences behind a verdict: on the number, the tempo, the lag and its change, and the beats met. All
their numbers are those of the judgement, so that none can contradict the verdict. "Early", "late" and milliseconds are
said only where the judgement places the movement in the beat (levels 3 and 4). Intervals are from bar to bar: they say
how well a take's mean is known, and are no evidence that its place in the beat is more than luck.

The *offset* is the moment of the song at which the dance begins. It comes from the surest of four sources: the user,
the file or folder of the recording, the sound of the video (`find_sound_offset`), or the movement, up to whole beats
(`find_offset`). An offset from the movement is no evidence of a place in the beat. Then there is neither a number nor a
sentence about the place, and the verdict is "in time" at best.

A film can be read in two ways: by the body of the dancer, and by the flow of the picture.
"""

from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, NamedTuple, Unpack, cast

import numpy as np
import pandas as pd

from harmolab.beats.audio import music_beats
from harmolab.beats.meter import describe_beats
from harmolab.clips import load_clip
from harmolab.data.recordings import ReadingReport, load_any_motion, recorded_offset
from harmolab.files import PathLike, Progress, named_faults, plain, silent
from harmolab.lab.explain.filmed import check_sign, filmed_motion, has_body
from harmolab.lab.explain.offset import REPEATS, find_offset, find_sound_offset
from harmolab.params import HarmonyParams
from harmolab.readers.audio import video_sound
from harmolab.readers.motion_file import ReadingKeywords
from harmolab.readers.pose import pose_environment
from harmolab.readers.video import is_video
from harmolab.score import HarmonyScore, chance_level
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.evidence import PlaceTest, place_test
from harmolab.verdict.judge import Judgement, score_clip

# Findings behind a verdict

SMALLEST = 0.02  # seconds; smaller changes are not noticed
FEWEST = 8  # beats in a half: two blocks that can be drawn from
EVENTS = ("rest", "hit")  # readings whose events are a score's visual beats
Interval = tuple[float, float]
NOTHING: Interval = (float("nan"), float("nan"))


class MeanOffset(NamedTuple):
    """Lag (seconds, late is positive) between two times, with its spread from bar to bar."""

    start: float
    end: float
    mean: float
    interval: Interval


@dataclass(frozen=True)
class Finding:
    """One statistic of a dance, and its sentence.

    Parameters
    ----------
    kind : "score", "tempo", "rate", "lag", "change" or "hits"
    value : float
        Harmony above chance; p-value of the time test; movements a beat; seconds late; seconds later in the second
        half; share of beats met.
    sentence : str
    interval : (float, float), spread of the value from bar to bar; NaN where there is none
    """

    kind: str
    value: float
    sentence: str
    interval: Interval = NOTHING


@dataclass(frozen=True)
class Explanation:
    """Findings in the order of their sentences, and the lag of each half where lags are spoken of."""

    findings: tuple[Finding, ...] = ()
    halves: tuple[MeanOffset, ...] = field(default=(), kw_only=True)

    @property
    def sentences(self) -> tuple[str, ...]:
        """The sentence of each finding."""
        return tuple(finding.sentence for finding in self.findings)

    def __str__(self) -> str:
        return "\n".join(self.sentences)


def explain(score: HarmonyScore) -> Explanation:
    """The findings about a score.

    Parameters
    ----------
    score : HarmonyScore by ``HarmonyParams.recommended()``

    Returns
    -------
    Explanation; without findings where there is too little to judge (level 0).

    Raises
    ------
    ValueError
        The score has no judgement: its measure is not "shape".

    Examples
    --------
    >>> from harmolab import HarmonyParams, score_clip, synthetic_clip
    >>> words = explain(score_clip(synthetic_clip("rumba", seconds=24.0, seed=3), HarmonyParams.recommended()))
    >>> [finding.kind for finding in words.findings]
    ['score', 'tempo', 'rate', 'hits']
    """
    judgement = score.judgement
    if judgement is None:
        raise ValueError(f"words need a score of measure 'shape', got {score.params.measure!r}")
    if judgement.place is None:
        return Explanation()
    findings = [*_score(judgement), _tempo(judgement)]
    if judgement.level >= 2:
        findings.append(_rate(judgement))
    if judgement.level < 3:
        return Explanation(tuple(findings))
    halves = _half_lags(judgement)
    if not judgement.has_start:  # what changes from half to half does not ask for the place in the beat
        return Explanation((*findings, *_change(halves)))
    findings += [*_lag(judgement), *_change(halves), *_hits(score)]
    return Explanation(tuple(findings), halves=halves if judgement.pattern else ())


def _score(judgement: Judgement) -> list[Finding]:
    """The number, where a place can be judged."""
    if not judgement.is_placed:
        return []
    value, (low, high) = judgement.harmony_above_chance, judgement.interval
    spread = "" if np.isnan(low) else f"; {low:.2f} to {high:.2f} by its bars"
    sentence = (
        f"Harmony above chance is {value:.2f} (0 is chance, 1 the best moment of the take on every beat{spread})."
    )
    return [Finding("score", value, sentence, judgement.interval)]


def _tempo(judgement: Judgement) -> Finding:
    """The share of tempi that fit as well as the music's."""
    share, tempo = 100 * judgement.p_time, judgement.tempo
    sentence = (
        f"Of the tempi around the music's {tempo:.1f} bpm, {share:.1f} % fit your movement as well (the limit is 5 %)."
    )
    return Finding("tempo", judgement.p_time, sentence)


def _rate(judgement: Judgement) -> Finding:
    rate = float(judgement.time.rate) if judgement.time else np.nan
    return Finding("rate", rate, f"Movements a beat: {rate:.2g}.")


def _lag(judgement: Judgement) -> list[Finding]:
    """The lag, where it was told from what."""
    if judgement.pattern is None:
        return []
    low, high = (edge * 60 / judgement.tempo for edge in judgement.lag_interval)
    spread = "" if np.isnan(low) else f" (its mean is within {1000 * low:+z.0f} to {1000 * high:+z.0f} ms)"
    sentence = f"Your lag is {1000 * judgement.lag_s:+z.0f} ms, where + is late{spread}."
    if judgement.is_opposite:
        sentence = f"You are {1000 * abs(judgement.lag_s):.0f} ms off, about half a beat: neither late nor early."
    return [Finding("lag", judgement.lag_s, sentence, (low, high))]


def _half_lags(judgement: Judgement) -> tuple[MeanOffset, ...]:
    """The lag of the first and of the second half; none where a half has too few beats."""
    beats, signal, pattern = judgement.beats, judgement.signal, judgement.pattern
    second = beats.times >= (beats.times[0] + beats.times[-1]) / 2
    halves = beats.select(~second), beats.select(second)
    if signal is None or judgement.place is None or min(map(len, halves)) <= max(FEWEST, judgement.place.pattern.beats):
        return ()
    reading = judgement.place.pattern
    tests = [place_test(signal, half.times, half.bar_places if pattern else None, reading) for half in halves]
    return tuple(_mean_offset(judgement, half, test) for half, test in zip(halves, tests, strict=True))


def _mean_offset(judgement: Judgement, beats: BeatTrack, test: PlaceTest) -> MeanOffset:
    """The lag of a stretch of beats, of all places that are one the nearest to the lag of the whole."""
    period = 60 / judgement.tempo
    apart = (test.lag - judgement.lag + test.reach) % (2 * test.reach) - test.reach  # beyond +- reach is another beat
    lag = judgement.lag + apart
    low, high = (edge - test.lag + lag for edge in test.spread()[1])
    return MeanOffset(float(beats.times[0]), float(beats.times[-1]), lag * period, (low * period, high * period))


def _change(halves: tuple[MeanOffset, ...]) -> list[Finding]:
    """The change of the lag between the halves, where their spreads from bar to bar do not meet."""
    if not halves:
        return []
    first, second = halves
    change = second.mean - first.mean
    interval = second.interval[0] - first.interval[1], second.interval[1] - first.interval[0]
    if abs(change) < SMALLEST or not (interval[0] > 0 or interval[1] < 0):
        return []
    words = f"{abs(change) * 1000:.0f} ms {'later' if change > 0 else 'earlier'}"
    return [Finding("change", change, f"In the second half you are {words} than in the first.", interval)]


def _hits(score: HarmonyScore) -> list[Finding]:
    """The share of beats with a rest, or a hit, close by, against chance; for those who are there on the beat."""
    judgement, delay = score.judgement, score.params.reaction_delay
    if judgement is None or judgement.level < 4 or judgement.reading not in EVENTS:
        return []
    times = score.visual.times - score.params.lag
    chance = chance_level(times, delay=delay, duration=score.music.duration)
    met = int((score.pairs >= 0).sum())
    sentence = (
        f"{met} of {len(score.music)} beats have a {judgement.reading} within {1000 * delay:.0f} ms; at random "
        f"moments it would be {100 * chance:.0f} % of them."
    )
    return [Finding("hits", met / len(score.music), sentence)]


# A dance: read, placed in its song, scored

SURE = 0.95  # confidence of an offset by movement, below which it means little
# Numbers that mean nothing where the offset was fitted to the movement.
PLACED = (
    *("harmony_above_chance", "interval", "p_value", "p_place", "lag_s", "lag_interval_s", "reading"),
    *("fastest_after_beat_s", "stillest_after_beat_s"),
)
Source = Literal["given", "folder", "same", "sound", "movement"]


@dataclass(frozen=True, eq=False)
class Performance:
    """A motion or video of one person's dance, not yet placed in a song.

    Parameters
    ----------
    path : Path
    motion : Motion; of a video as by `harmolab.lab.explain.filmed.filmed_motion`
    is_video : bool
    sound : Audio or None, of a video whose sound can be read
    start : float or None, seconds
        Song time of frame 0 where the motion's file, or the folder of the recording, holds it.
    notes : sentences about how a video was read
    """

    path: Path
    motion: Motion
    is_video: bool = False
    sound: Audio | None = None
    start: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def has_body(self) -> bool:
        """False where the movement is that of a whole picture."""
        return has_body(self.motion)


@dataclass(frozen=True)
class Placement:
    """Offset of a dance in its song, and its source.

    Parameters
    ----------
    seconds : float, song time of frame 0
    source : "given", "folder" (or the motion's own file), "same" (song and dance are one video), "sound" or "movement"
    period : float or None, seconds
        By movement the offset is known modulo this.
    confidence : float or None
        Of an offset by movement, as in `harmolab.lab.explain.offset.Offset`.
    repeats : bool
        By sound: another place fits nearly as well, since the song repeats itself, or since it is another song.
    """

    seconds: float
    source: Source
    period: float | None = None
    confidence: float | None = None
    repeats: bool = False

    @property
    def is_absolute(self) -> bool:
        """True where the offset is known outright, so that early or late throughout means something."""
        return self.source != "movement"

    @property
    def is_sure(self) -> bool:
        """False where the movement gives no evidence of any place."""
        return self.confidence is None or self.confidence >= SURE

    def __str__(self) -> str:
        if self.source == "same":
            return "Song and dance are one video, so they begin together."
        period = f"{self.period:.2f} s" if self.period else "a beat"
        reason = {
            "given": ", as you said.",
            "folder": ", as its recording says.",
            "sound": ": found by comparing the video's sound with the song.",
            "movement": f", or whole beats of {period} earlier or later (found from your movement, as if you rested "
            "on the beat; which beat is not known).",
        }[self.source]
        weak = "" if self.is_sure else " The evidence for this place is weak."
        doubt = f" {REPEATS}" if self.repeats else weak
        begins, seconds = "may begin" if doubt else "begins", round(self.seconds, 2)
        place = f"{-seconds:.2f} s before the song" if seconds < 0 else f"at {seconds + 0.0:.2f} s of the song"
        return f"Your dance {begins} {place}{reason}{doubt}"


def load_performance(
    path: PathLike,
    *,
    by_flow: bool = False,
    report: ReadingReport = lambda path, file: None,
    progress: Progress = silent,
    **reading: Unpack[ReadingKeywords],
) -> Performance:
    """Read one person's dance from a motion file, a folder, or a video with its sound; `explain_performance` scores it.

    Parameters
    ----------
    path : str or path
        A video is known by its ending.
    by_flow : bool
        Of a video: take the movement of the whole picture, and do not look for the body.
    report : function(path, MotionFile)
        Called with how a motion file was read.
    progress : function(iterable, label) -> iterable
        Reports on the frames of a video, such as a progress bar.
    **reading
        fps, scale, joints, smpl and up, as in `harmolab.load_motion`; not for a video.

    Returns
    -------
    Performance
        `motion`, and where they are known `sound` (of a video) and `start`, the moment of the song at which it begins.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    path = Path(path)
    if is_video(path):
        filmed = filmed_motion(path, by_flow=by_flow, progress=progress)
        sound = None
        with suppress(ValueError):  # none, or none that can be read: the movement has to do
            sound = video_sound(path)
        return Performance(path, filmed.motion, True, sound, notes=filmed.notes)
    return Performance(path, load_any_motion(path, report=report, **reading), start=recorded_offset(path))


def place_performance(
    performance: Performance, song: Audio, music: BeatTrack, *, guess: float | None = None, search: float = 2.0
) -> Placement:
    """The offset of a performance in its song: by its folder, else by its sound, else by its movement.

    Parameters
    ----------
    performance : Performance
    song : Audio
    music : BeatTrack, the song's beats
    guess : float, seconds, optional
        Offset around which the movement is searched, where neither folder nor sound says it.
    search : float, seconds
        Largest distance from the guess, to either side.

    Raises
    ------
    ValueError
        As `harmolab.lab.explain.offset.find_offset`.
    """
    if performance.start is not None:
        return Placement(performance.start, "folder")
    if performance.sound is not None:
        with suppress(ValueError):  # too short, or silent
            by_sound = find_sound_offset(performance.sound, song)
            if by_sound.is_clear:
                return Placement(by_sound.seconds, "sound", repeats=not by_sound.is_unique)
    with named_faults(performance.path):
        offset = find_offset(song, performance.motion, music=music, guess=guess or 0.0, search=search)
    return Placement(offset.seconds, "movement", offset.period, offset.confidence)


@dataclass(frozen=True, eq=False)
class OwnDance:
    """A performance beside its song, scored.

    Parameters
    ----------
    song : str, name of the file
    performance : Performance
    audio : Audio, the part of the song that is danced to
    music : BeatTrack on the dance's time line
    motion : Motion, the part of the dance that has music
    skipped : float, seconds of the dance before that part
    placement : Placement
    score : HarmonyScore
    words : Explanation
    """

    song: str
    performance: Performance
    audio: Audio
    music: BeatTrack
    motion: Motion
    skipped: float
    placement: Placement
    score: HarmonyScore
    words: Explanation

    @property
    def name(self) -> str:
        """Name of the performance's file or folder."""
        return self.performance.path.name or str(self.performance.path)

    @property
    def clip(self) -> Clip:
        """The part of the dance that has music, with it, as labs and players take it."""
        source, has_start = f"{self.song}, {self.name}", self.placement.is_absolute
        return Clip(self.name, self.audio, self.motion, source=source, beats=self.music, has_start=has_start)

    @property
    def judgement(self) -> Judgement:
        """The judgement behind the score, as far as the place in the song is known."""
        return cast(Judgement, self.score.judgement)

    @property
    def is_together(self) -> bool:
        """True with evidence that the dancer keeps time with the song, be it early or late."""
        return self.judgement.level >= 2

    @property
    def level(self) -> int:
        """Level of the verdict; 3 at most where the place in the beat is not known, since 4 differs by it alone."""
        return self.judgement.level

    @property
    def verdict(self) -> str:
        """The result in a sentence or two for a dancer."""
        return self.judgement.verdict

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences to read below the verdict; those on the place in the beat only where it is known."""
        return self.judgement.remarks

    @property
    def summary(self) -> tuple[str, ...]:
        """Verdict, remarks and place in the song: the lines for a dancer."""
        return (self.verdict, *self.remarks, str(self.placement))

    @property
    def details(self) -> tuple[str, ...]:
        """All that else is known about it, in sentences."""
        return (f"music: {describe_beats(self.music)}", *self.judgement.details, *self.words.sentences)

    def to_dict(self) -> dict[str, Any]:
        """Numbers and text, ready for JSON."""
        content = {
            "song": self.song, "recording": self.name, "verdict": self.verdict, "remarks": list(self.remarks),
            "words": list(self.words.sentences), "findings": [vars(one) for one in self.words.findings],
            "offset": {"text": str(self.placement), **vars(self.placement)},
            "harmony_above_chance": self.score.harmony_above_chance, "interval": self.score.interval,
            "p_value": self.score.p_value, "music": describe_beats(self.music), "music_beats": len(self.music),
            "movements": len(self.score.visual), "seconds": self.motion.duration,
        }  # fmt: skip
        content = self.judgement.to_dict() | content
        if not self.placement.is_absolute:
            content |= dict.fromkeys(PLACED)
        return dict(plain(content))


def explain_performance(
    song: PathLike,
    performance: Performance,
    *,
    offset: float | None = None,
    guess: float | None = None,
    search: float = 2.0,
    beats: PathLike | None = None,
    one: float | None = None,
    dance: str = "",
    params: HarmonyParams | None = None,
    seed: int = 0,
) -> OwnDance:
    """Place a dance in its song, score it, and explain the score in sentences.

    Parameters
    ----------
    song : str or path
        A sound file or a video; the film of the dance itself, where the song plays in it.
    performance : Performance
        As `load_performance` returns it.
    offset : float, seconds, optional
        Moment of the song at which the dance begins. When left out it comes from the dance's file or folder, else from
        its sound, else from its movement.
    guess : float, seconds, optional
        Moment around which the movement is placed, where neither file nor sound says it. The sound is compared
        everywhere.
    search : float, seconds
        Largest distance from the guess, to either side.
    beats, one, dance : as in `harmolab.load_clip`
    params : HarmonyParams of measure "shape"
        When left out the recommended ones, with the usual course of the dance where it is known.
    seed : int
        Of the draws behind the intervals from bar to bar.

    Returns
    -------
    OwnDance
        `score`, `words` (verdict and findings), `placement`, and the parts of song and motion that they share.
        `save_page` and `dance_player` show it.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; ValueError also for a setting out of range.
    """
    if not isinstance(performance, Performance):
        raise ValueError(f"a performance is needed, got {type(performance).__name__}; load_performance reads one")
    unplaced = load_clip(song, performance.motion, offset=0.0, dance=dance, beats=beats, one=one)
    music = music_beats(unplaced)
    if offset is not None:
        placement = Placement(offset, "given")
    elif performance.is_video and Path(song).resolve() == performance.path.resolve():
        placement = Placement(0.0, "same")
    else:
        placement = place_performance(performance, unplaced.audio, music, guess=guess, search=search)
    with named_faults(performance.path):
        clip = replace(unplaced, name=performance.path.name, offset=placement.seconds, has_start=placement.is_absolute)
    score, shared = score_clip(clip, params, seed=seed), clip.shared()
    if score.judgement is not None and score.judgement.level == 1:
        check_sign(performance.path, performance.motion)
    return OwnDance(
        Path(song).name, performance, shared.audio, cast(BeatTrack, shared.beats), cast(Motion, shared.motion),
        clip.shared_frame() / performance.motion.fps, placement, score,
        explain(score),
    )  # fmt: skip


# One film, read by the body and by the flow

BODY, FLOW = "the body", "the flow of the picture"
COLUMNS = ["verdict", "how sure", "offset"]
ABSENT = "not read: what finds bodies is not there (`harmolab data pose --install` fetches it)"


def film_readings(song: PathLike, film: PathLike, **settings: Any) -> pd.DataFrame:
    """The verdict on a film, read in two ways: by the body of the dancer, and by the flow of the picture.

    Parameters
    ----------
    song : str or path
    film : str or path of a video
    **settings
        As of `explain_performance`.

    Returns
    -------
    DataFrame
        A row for each way, with the columns "verdict" (or the reason why there is none), "how sure" and "offset". The
        body needs the pose environment (`harmolab data pose --install`).
    """
    by_body = _reading(song, film, by_flow=False, **settings) if pose_environment() else {"verdict": ABSENT}
    rows = {BODY: by_body, FLOW: _reading(song, film, by_flow=True, **settings)}
    return pd.DataFrame.from_dict(rows, orient="index", columns=list(COLUMNS)).rename_axis("read").fillna("")


def _reading(song: PathLike, film: PathLike, *, by_flow: bool, **settings: Any) -> dict[str, str]:
    try:
        result = explain_performance(song, load_performance(film, by_flow=by_flow), **settings)
    except ValueError as error:
        return {"verdict": str(error).removeprefix(f"{film}: ")}
    return {"verdict": result.verdict, "how sure": " ".join(result.remarks[:1]), "offset": str(result.placement)}
