"""One person's dance beside its song: read, placed by its offset, scored and explained.

The offset comes from the surest of four sources: the user, the file or folder of the recording, the sound of the video
(`find_sound_offset`), or the movement, modulo the beat (`find_offset`). An offset fitted to the movement is no evidence
of a place in the beat: then there is neither a number nor a sentence about it, and the verdict is "in time" at best.
"""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal, cast

from harmolab.beats.audio import music_beats
from harmolab.beats.meter import describe_beats
from harmolab.corpora.files import load_clip
from harmolab.corpora.folders import ReadingReport, load_any_motion, recorded_offset
from harmolab.harmony import score_clip
from harmolab.io.files import PathLike, Progress, plain, silent
from harmolab.io.video import is_video
from harmolab.io.video_sound import video_sound
from harmolab.lab.timing.filmed import check_sign, filmed_motion, has_body
from harmolab.lab.timing.findings import Explanation, explain
from harmolab.lab.timing.movement import find_offset
from harmolab.lab.timing.sound import find_sound_offset
from harmolab.params import HarmonyParams
from harmolab.types import Audio, BeatTrack, Motion
from harmolab.verdict.judge import Judgement
from harmolab.verdict.score import HarmonyScore

SURE = 0.95  # confidence of an offset by movement, below which it means little
# Numbers that mean nothing where the offset was fitted to the movement.
PLACED = (
    *("harmony_above_chance", "interval", "p_value", "p_place", "lag_s", "lag_interval_s", "reading"),
    *("fastest_after_beat_s", "stillest_after_beat_s"),
)
IN_TIME = (
    "You are in time with this song. Where in its beat you dance cannot be told from your movement alone: say where "
    "the dance begins (--offset), or film with the song playing."
)

Source = Literal["given", "folder", "same", "sound", "movement"]


@dataclass(frozen=True, eq=False)
class Performance:
    """A motion or video of one person's dance, not yet placed in a song.

    Parameters
    ----------
    path : Path
    motion : Motion; of a video as by `harmolab.lab.timing.filmed.filmed_motion`
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
        Of an offset by movement, as in `harmolab.lab.timing.movement.Offset`.
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
            "movement": f", or whole beats of {period} from there: found from your movement alone, which says which "
            "place in the beat, not which beat.",
        }[self.source]
        doubt = "" if self.is_sure else " The evidence for this place is weak."
        if self.repeats:
            doubt = " Another place fits nearly as well: the song repeats itself, or another song plays in the video."
        return f"Your dance begins at {round(self.seconds, 2) + 0.0:.2f} s of the song{reason}{doubt}"


def load_performance(
    path: PathLike,
    *,
    fps: float | None = None,
    scale: float | None = None,
    joints: Sequence[str] | None = None,
    smpl: PathLike | None = None,
    up: str = "",
    by_flow: bool = False,
    report: ReadingReport = lambda path, file: None,
    progress: Progress = silent,
) -> Performance:
    """A motion file, a folder, or a video (by its suffix) with its sound.

    Parameters
    ----------
    path : str or path
    fps, scale, joints, smpl, up : see `harmolab.io.motion.load_motion`; not for a video
    by_flow : see `harmolab.lab.timing.filmed.filmed_motion`
    report : function(path, MotionFile), called with how a motion file was read
    progress : function(iterable, label) -> iterable

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
    names = None if joints is None else tuple(joints)
    motion = load_any_motion(path, fps=fps, scale=scale, joints=names, smpl=smpl, up=up, report=report)
    return Performance(path, motion, start=recorded_offset(path))


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
        Offset around which the movement is searched; the sound searches everywhere.
    search : float, seconds
        Largest distance from the guess, to either side.

    Raises
    ------
    ValueError
        As `harmolab.lab.timing.movement.find_offset`.
    """
    if performance.start is not None and guess is None:
        return Placement(performance.start, "folder")
    if performance.sound is not None:
        with suppress(ValueError):  # too short, or silent
            by_sound = find_sound_offset(performance.sound, song)
            if by_sound.is_clear:
                return Placement(by_sound.seconds, "sound", repeats=not by_sound.is_unique)
    try:
        offset = find_offset(song, performance.motion, music=music, guess=guess or 0.0, search=search)
    except ValueError as error:
        raise ValueError(f"{performance.path}: {error}") from None
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
    def judgement(self) -> Judgement:
        """The judgement behind the score."""
        return cast(Judgement, self.score.judgement)

    @property
    def is_together(self) -> bool:
        """True with evidence that the dancer keeps time with the song, be it early or late."""
        return self.judgement.level >= 2

    @property
    def level(self) -> int:
        """Level of the verdict; 3 at most where the place in the beat is not known, since 4 differs by it alone."""
        return self.judgement.level if self.placement.is_absolute else min(self.judgement.level, 3)

    @property
    def verdict(self) -> str:
        """The result in a sentence or two for a dancer."""
        return IN_TIME if self.judgement.level >= 3 and not self.placement.is_absolute else self.judgement.verdict

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences to read below the verdict; those on the place in the beat only where it is known."""
        if self.placement.is_absolute:
            return self.judgement.remarks
        # With nothing told, level 3 judges no place: how sure it is, without the number.
        return replace(self.judgement, pattern=None, level=min(self.judgement.level, 3)).remarks[:1]

    def to_dict(self) -> dict[str, Any]:
        """Numbers and text, ready for JSON."""
        content = {
            "song": self.song,
            "recording": self.name,
            "verdict": self.verdict,
            "remarks": list(self.remarks),
            "words": list(self.words.sentences),
            "findings": [
                {"kind": one.kind, "sentence": one.sentence, "value": one.value, "interval": one.interval}
                for one in self.words.findings
            ],
            "offset": {"text": str(self.placement), **vars(self.placement)},
            "harmony_above_chance": self.score.harmony_above_chance,
            "interval": self.score.interval,
            "p_value": self.score.p_value,
            "music": describe_beats(self.music),
            "music_beats": len(self.music),
            "movements": len(self.score.visual),
            "seconds": self.motion.duration,
        }
        content = self.judgement.to_dict() | content
        if not self.placement.is_absolute:
            content |= dict.fromkeys(PLACED)
        return dict(plain(content | {"level": self.level}))


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
    n_rotations: int = 1000,
    seed: int = 0,
) -> OwnDance:
    """A performance beside a song: placed, scored and explained.

    Parameters
    ----------
    song : str or path, a sound file or a video (the performance itself, where the song plays in it)
    performance : Performance
    offset : float, seconds, optional
        Song time of the first frame; default that of `place_performance`.
    guess, search : see `place_performance`
    beats, one, dance : as in `harmolab.corpora.files.load_clip`
    params : HarmonyParams of measure "shape", default the recommended ones with the pattern of the dance, if known
    n_rotations, seed : see `harmolab.harmony.score_clip`

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    unplaced = load_clip(song, performance.motion, offset=0.0, dance=dance, beats=beats, one=one)
    music = music_beats(unplaced)
    if offset is not None:
        placement = Placement(offset, "given")
    elif performance.is_video and Path(song).resolve() == performance.path.resolve():
        placement = Placement(0.0, "same")
    else:
        placement = place_performance(performance, unplaced.audio, music, guess=guess, search=search)
    try:
        clip = replace(unplaced, name=performance.path.name, offset=placement.seconds)
    except ValueError as error:
        raise ValueError(f"{performance.path}: {error}") from None
    score, shared = score_clip(clip, params, n_rotations=n_rotations, seed=seed), clip.shared()
    check_sign(performance.path, performance.motion, score.judgement.level if score.judgement else 0)
    words = explain(score)
    return OwnDance(
        Path(song).name,
        performance,
        shared.audio,
        cast(BeatTrack, shared.beats),
        cast(Motion, shared.motion),
        clip.shared_frame() / performance.motion.fps,
        placement,
        score,
        words if placement.is_absolute else words.relative(),
    )
