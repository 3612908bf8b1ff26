"""Pages about musicians: hands beside their sound, performances that a network makes of a sound, avatars.

The page about one musician says: do the hands meet the sound, where do they part, the player, the numbers, the doubts.

A performance that a network makes of a sound is the points, the figure that is drawn, and how the hands meet the notes.
With a truth, the playing that was filmed, it has also the error of the points and the score of both beside each other.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from harmolab.files import PathLike, write_text
from harmolab.lab.explain.page import NARROW, WIDE, explained_page
from harmolab.lab.figures.beats import png_text, timing_figure
from harmolab.lab.player_data import LONGEST, PLAYING, Dancer, Player
from harmolab.musician import explain
from harmolab.musician.avatar import avatar
from harmolab.musician.events import BOW_HAND, PlayingScore, onset_beats, playing_score
from harmolab.musician.explain import EVENTS, MANY_EVENTS, ExplainedPlaying, PlayingFindings
from harmolab.musician.performances import Performance
from harmolab.readers.motion import motion_part
from harmolab.readers.player_points import SIDES, hand_joints
from harmolab.score import HarmonyScore
from harmolab.types import Audio, BeatTrack, Motion, Notes

MOST_PARTINGS = 200  # rows of the list of single moments


def save_playing_page(path: PathLike, playing: ExplainedPlaying) -> None:
    """Write the page about a musician to a file: verdict, moments at which hands and sound part, player, numbers.

    It is one HTML file, written whole or not at all.

    Parameters
    ----------
    path : str or path
    playing : ExplainedPlaying
        As `explain_playing` returns it.
    """
    write_text(path, playing_page(playing))


def playing_page(playing: ExplainedPlaying) -> str:
    """One HTML page about a musician's hands and their sound; it needs no network.

    The player is part of it where there is sound, of ten minutes at most.
    """
    performance, score, partings = playing.performance, playing.score, playing.words.partings
    return explained_page(
        "own_playing.html.j2",
        score.score,
        numbers=_numbers(playing),
        title=f"{performance.name}: {performance.instrument}",
        performance=performance,
        playing=playing,
        is_together=score.is_together and playing.words.verdict != explain.OTHER_SOUND,
        verdict=playing.words.verdict,
        sentences=playing.words.sentences,
        pictures=_pictures(playing),
        player=playing_player(playing).page if playing.audio and playing.motion.duration <= LONGEST else "",
        partings=partings[:MOST_PARTINGS],
        n_partings=len(partings),
        event=EVENTS[performance.instrument],
        events=MANY_EVENTS[performance.instrument],
        delay=1000 * score.score.params.reaction_delay,
        has_notes=isinstance(playing.sound, Notes),
        missing=float(1 - performance.detected.mean()),
    )


def playing_player(playing: ExplainedPlaying) -> Player:
    """The player of a musician: points and sound, with the onsets, and the strikes or turns of the bow, as its beats.

    Parameters
    ----------
    playing : ExplainedPlaying
        As `explain_playing` returns it.

    Returns
    -------
    `harmolab.lab.Player`

    Raises
    ------
    ValueError
        If there is no sound, or more than the ten minutes that a player holds.
    """
    name, instrument, score = playing.performance.name, playing.performance.instrument, playing.score.score
    if playing.audio is None:
        raise ValueError(f"{name}: has no sound to play; render its notes first")
    dancer = Dancer(name, playing.motion, score, moving=moving_hands(playing.motion, instrument))
    return Player(playing.audio, [dancer], music=score.music, title=name, words=PLAYING[instrument])


def moving_hands(motion: Motion, instrument: str) -> Motion | None:
    """The points of the hands, of a violinist those of the hand that bows; None without any."""
    sides = (BOW_HAND,) if instrument == "violin" else SIDES
    names = {name for side in sides for name in (f"{side}_wrist", *hand_joints(side))}
    joints = [name for name in motion.skeleton.joints if name in names]
    return motion_part(motion, joints, "hands") if joints else None


def _pictures(playing: ExplainedPlaying) -> list[dict[str, str]]:
    """One picture for each hand where its notes are known, else one of all: its title, and base64 of PNG in two widths.

    It shows every onset along time.
    """
    event = EVENTS[playing.performance.instrument]
    about = ", synthetic player" if playing.performance.source == "synthetic" else ""
    sizes = {"wide": WIDE, "narrow": NARROW}
    pictures = []
    for hand, score in (playing.score.hands or {"": playing.score.score}).items():
        title = (f"{hand.capitalize()} hand" if hand else "All onsets") + about
        figures = {name: timing_figure(score, title=title, event=event, size=size) for name, size in sizes.items()}
        pictures.append({"title": title} | {name: png_text(figure) for name, figure in figures.items()})
    return pictures


def _numbers(playing: ExplainedPlaying) -> dict[str, str]:
    """The numbers of the page's table: name -> text."""
    score, events = playing.score, MANY_EVENTS[playing.performance.instrument]
    rows = {"All": score.score} | {f"{hand.capitalize()} hand": own for hand, own in score.hands.items()}
    numbers = {f"{name}: harmony above chance (0: chance, 1: all)": _number(own) for name, own in rows.items()}
    numbers["Whole body, as dances are scored"] = _number(score.body)
    numbers[f"Onsets, {events}"] = f"{score.score.n_audio}, {score.score.n_visual}"
    numbers["Onsets hit, and at random moments"] = f"{score.score.mean_share:.2f}, {score.score.chance:.2f}"
    numbers["Lag (late is positive)"] = f"{1000 * score.lag.seconds:+z.0f} ms"
    numbers["Length"] = f"{playing.motion.duration:.1f} s at {playing.motion.fps:g} frames per second"
    return numbers


def _number(score: HarmonyScore) -> str:
    return "{:.2f} ({:.2f} to {:.2f}; p = {:.3f})".format(score.harmony_above_chance, *score.interval, score.p_value)


# Performances that a network makes of a sound

if TYPE_CHECKING:  # torch is loaded by those who have a network
    from harmolab.musician.system import Audio2Body
    from harmolab.musician.train import Compared

TRUTH, PREDICTION = "the truth", "from the sound"
ROWS = {
    "notes": "notes and sound",
    "score": "hands and sound",
    "hand": "hand by hand",
    "other hand": "wrong hand",
    "lag": "early or late",
    "stretch": "where they meet least",
    "body": "the whole body",
}
AVATAR = (
    "an avatar: hands and arms go where the 2-D points are; how far forward they are follows from the lengths of their "
    "bones, and legs, seat and instrument are added"
)
POINTS = "the 2-D points, as a camera would see them"


@dataclass(frozen=True, eq=False)
class Performed:
    """A performance that a network made of a sound: points of the musician, and what there is to say about them.

    `performed` makes it, `save_performed` writes its page.

    Parameters
    ----------
    instrument : "piano" or "violin"
    points : Motion
        (T, P, 2) pixels, y down.
    audio : Audio
        The part of the recording that begins with the first frame.
    start : float, seconds
        Moment of the recording at which the first frame stands.
    notice : str
        A sentence on whom the network was trained; it stands on everything that is made of this.
    is_avatar : bool
        Whether an avatar is drawn, or the points.
    truth : ExplainedPlaying or None
        The playing that was filmed, cut to the same time, where it is known.
    compared : Compared or None
        The points of both in one place, and their errors; None without a truth.
    """

    instrument: str
    points: Motion
    audio: Audio
    start: float
    notice: str
    is_avatar: bool = True
    truth: ExplainedPlaying | None = None
    compared: Compared | None = None

    @cached_property
    def figure(self) -> Motion:
        """The motion that is drawn: an avatar, (T, J, 3) metres, or the points."""
        return avatar(self.points, self.instrument) if self.is_avatar else self.points

    @cached_property
    def sound(self) -> Notes | BeatTrack:
        """The notes where the truth brings them, else the onsets that a program finds in the sound."""
        return onset_beats(self.audio) if self.truth is None else self.truth.sound

    @cached_property
    def score(self) -> PlayingScore:
        """The score of the predicted hands with `sound`."""
        return playing_score(self.points, self.sound, self.instrument)

    @cached_property
    def words(self) -> PlayingFindings:
        """Verdict and findings on the predicted hands in words."""
        return explain.playing_findings(self.score, is_filmed=False)

    @property
    def errors(self) -> tuple[str, ...]:
        """Sentences on the error of the points; none without a truth."""
        if self.compared is None:
            return ()
        errors = self.compared.errors
        if np.isfinite(errors.shoulder_width):
            own, mean = f"{errors.percent:.1f} % of the shoulder width", f"{errors.mean_pose_percent:.1f} %"
        else:
            own, mean = f"{errors.pixels:.1f} (unit of the points, which have no shoulders)", f"{errors.mean_pose:.1f}"
        return (
            f"The points are {own} from the truth: root mean square of a coordinate, mean over frames.",
            f"The mean pose, which hears nothing and never moves, is {mean} from it.",
            f"{errors.points} points were compared, in the {errors.accepted:.0%} of the frames that cleaning accepts.",
        )

    @property
    def facts(self) -> dict[str, str]:
        """Facts about the performance for a table: name -> text."""
        events, whole = MANY_EVENTS[self.instrument], self.score.score
        by = "those of the notes" if isinstance(self.sound, Notes) else "found in the sound by a program"
        facts = {
            "drawn": AVATAR if self.is_avatar else POINTS,
            "time": f"{self.points.duration:.2f} s, from {self.start:.2f} s of the sound on",
            "onsets": f"{whole.n_audio}, {by}",
            events: str(whole.n_visual),
        } | _rows(self.words)
        if self.truth is not None:
            facts["error of the points"] = " ".join(self.errors)
            facts |= {f"the truth: {name}": text for name, text in _rows(self.truth.words).items()}
        return facts


def _rows(words: PlayingFindings) -> dict[str, str]:
    """Name -> sentences of the findings of a kind."""
    kinds = dict.fromkeys(finding.kind for finding in words.findings)
    return {ROWS[kind]: " ".join(each.sentence for each in words.findings if each.kind == kind) for kind in kinds}


def performed(
    system: Audio2Body,
    audio: Audio,
    *,
    start: float = 0.0,
    seconds: float | None = None,
    is_avatar: bool = True,
    truth: Performance | None = None,
) -> Performed:
    """Let a network play to a sound: the points of a musician, as `harmolab perform` has them.

    Parameters
    ----------
    system : Audio2Body
    audio : Audio
        The whole recording.
    start : float, seconds
        Where the performance begins in the recording, at the nearest frame.
    seconds : float
        Its length; to the end when left out.
    is_avatar : bool
        Whether an avatar is drawn, or the points.
    truth : `harmolab.musician.performances.Performance`, optional
        The playing that was filmed, with `audio` as its sound. The performance is cut to its time, and compared with
        it.

    Returns
    -------
    Performed

    Raises
    ------
    ValueError
        As `Audio2Body.generate`; with a truth as `explain_playing` and `harmolab.musician.train.compared`.

    Examples
    --------
    >>> pianist = Audio2Body.shipped("piano")  # doctest: +SKIP
    >>> save_performed("page.html", performed(pianist, audio), title="A pianist")  # doctest: +SKIP
    """
    instrument, notice = system.network.instrument, system.trained_on
    if truth is None:
        begin = float(np.round(start * system.network.params.fps)) / system.network.params.fps
        points = system.generate(audio, start=begin, seconds=seconds)
        return Performed(instrument, points, audio.span(begin, points.duration), begin, notice, is_avatar)
    from harmolab.musician.train import compared

    playing = explain.explain_playing(performance_span(truth, start, seconds))
    part, sound, whole = playing.motion, playing.audio, playing.performance.audio
    if sound is None or whole is None:
        raise ValueError(f"{truth.name}: has no sound to play to")
    first, begin = round(playing.skipped * part.fps), playing.performance.offset + playing.skipped
    beside = compared(system.network, playing.performance.frames(first, first + part.n_frames))
    points = system.generate(whole, start=begin, seconds=part.duration)
    return Performed(instrument, points, sound, begin, notice, is_avatar, playing, beside)


def performance_span(performance: Performance, start: float, seconds: float | None) -> Performance:
    """A performance from `start` seconds of its sound on, so many seconds of it; ValueError where it has no frames."""
    motion = performance.motion
    first = max(round((start - performance.offset) * motion.fps), 0)
    end = motion.n_frames if seconds is None else round((start + seconds - performance.offset) * motion.fps)
    last = min(end, motion.n_frames)
    if start < 0 or last - first < 2:
        raise ValueError(f"{performance.name}: its points have nothing at these seconds of the sound; choose others")
    return performance.frames(first, last)


def save_performed(path: PathLike, performed: Performed, *, title: str, facts: Mapping[str, str] | None = None) -> None:
    """Write a page that plays a performance that a network made; with a truth, beside it, or as points over it.

    It is one HTML file, written whole or not at all.

    Parameters
    ----------
    path : str or path
    performed : Performed
    title : str
    facts : dict
        Name -> text, shown before those of the performance.

    Raises
    ------
    ValueError
        As `harmolab.lab.Player`.
    """
    Player(
        performed.audio,
        _dancers(performed),
        music=performed.score.score.music,
        title=title,
        facts=dict(facts or {}) | performed.facts,
        overlaid=performed.compared is not None and not performed.is_avatar,
        words=PLAYING[performed.instrument],
        notice=performed.notice,
    ).save(path)


def _dancers(performed: Performed) -> list[Dancer]:
    """The figure, behind that of the truth where there is one."""
    beside, truth = performed.compared, performed.truth
    figure = performed.figure if beside is None or performed.is_avatar else beside.prediction
    hands = moving_hands(performed.points, performed.instrument)
    dancer = Dancer(PREDICTION, figure, performed.score.score, instead=performed.words.verdict, moving=hands)
    if beside is None or truth is None:
        return [dancer]
    drawn = avatar(beside.truth, performed.instrument) if performed.is_avatar else beside.truth
    hands = moving_hands(beside.truth, performed.instrument)
    return [Dancer(TRUTH, drawn, truth.score.score, instead=truth.words.verdict, moving=hands), dancer]


# Avatars of one or two musicians with one sound, in a player


def avatar_player(
    audio: Audio,
    points: Mapping[str, Motion],
    notes: Notes,
    instrument: str,
    *,
    title: str,
    seconds: float,
    notice: str = "",
    n_rotations: int = 1000,
) -> Player:
    """A player of one or two avatars, drawn persons who play to one sound, with the onsets that their hands meet.

    Parameters
    ----------
    audio : Audio
    points : dict
        Name -> Motion (T, P, 2) from the beginning of the audio on, its points named as in
        `harmolab.readers.player_points`. Strikes or turns of the bow are read from these points.
    notes : Notes
        Of the sound.
    instrument : "piano" or "violin"
    title : str
    seconds : float
        Length that is shown, from the beginning.
    notice : str
        A sentence above the picture, such as where the points are from.
    n_rotations : int
        Of the null distribution of each score.

    Returns
    -------
    `harmolab.lab.Player`

    Raises
    ------
    ValueError
        As `harmolab.lab.Player`, `harmolab.musician.avatar.avatar` and `harmolab.playing_score`.
    """
    dancers, facts = [], {}
    for name, motion in points.items():
        part = motion.span(0.0, seconds)
        score = playing_score(part, notes, instrument, n_rotations=n_rotations)
        hits = score.score
        facts[f"{name}: onsets hit"] = f"{hits.hits.sum()} of {hits.n_audio}, {hits.chance:.0%} by chance"
        figure, hands = avatar(motion, instrument).span(0.0, seconds), moving_hands(part, instrument)
        dancers.append(Dancer(name, figure, hits, instead=explain.playing_findings(score).verdict, moving=hands))
    music = dancers[0].score.music
    return Player(audio, dancers, music=music, title=title, facts=facts, words=PLAYING[instrument], notice=notice)
