"""One page about a musician: do the hands meet the sound, where do they part, the player, the numbers, the doubts."""

from __future__ import annotations

from importlib.metadata import version
from typing import NamedTuple

from harmolab.beats.notes import BOW_HAND
from harmolab.io.files import PathLike, write_text
from harmolab.io.motion import motion_part
from harmolab.io.player_points import SIDES, hand_joints
from harmolab.lab.figures.timing import png_text, timing_figure
from harmolab.lab.report.templates import rendered
from harmolab.lab.timing.page import NARROW, WIDE
from harmolab.lab.timing.playing import EVENTS, MANY_EVENTS, ExplainedPlaying
from harmolab.lab.widgets.player import LONGEST, Dancer, Player
from harmolab.lab.widgets.words import PLAYING
from harmolab.types import Motion, Notes
from harmolab.verdict.score import HarmonyScore

MOST_PARTINGS = 200  # rows of the list of single moments


class Picture(NamedTuple):
    """Every onset of a hand along time, in two widths, as base64 of PNG."""

    title: str
    wide: str
    narrow: str


def save_playing_page(path: PathLike, playing: ExplainedPlaying) -> None:
    """Write `playing_page` to a file, whole or not at all."""
    write_text(path, playing_page(playing))


def playing_page(playing: ExplainedPlaying) -> str:
    """One HTML page about a musician's hands and their sound; it needs no network.

    The player is part of it where there is sound, of ten minutes at most.
    """
    performance, score = playing.performance, playing.score
    partings = playing.words.partings
    return rendered(
        "own_playing.html.j2",
        title=f"{performance.name}: {performance.instrument}",
        performance=performance,
        playing=playing,
        is_together=score.is_together,
        verdict=playing.words.verdict,
        sentences=playing.words.sentences,
        pictures=_pictures(playing),
        player=playing_player(playing).page if _is_playable(playing) else "",
        numbers=_numbers(playing),
        partings=partings[:MOST_PARTINGS],
        n_partings=len(partings),
        event=EVENTS[performance.instrument],
        events=MANY_EVENTS[performance.instrument],
        delay=1000 * score.score.params.reaction_delay,
        has_notes=isinstance(playing.sound, Notes),
        missing=float(1 - performance.detected.mean()),
        settings=", ".join(f"{name} {value}" for name, value in vars(score.score.params).items() if name != "pattern"),
        version=version("harmolab"),
    )


def playing_player(playing: ExplainedPlaying) -> Player:
    """The points and the sound in a player, whose beats are the onsets and the events of the hands.

    Raises
    ------
    ValueError
        There is no sound, or more than the player holds.
    """
    name, score = playing.performance.name, playing.score.score
    if playing.audio is None:
        raise ValueError(f"{name}: has no sound to play; render its notes first")
    instrument = playing.performance.instrument
    dancer = Dancer(name, playing.motion, score, moving=moving_hands(playing.motion, instrument))
    return Player(playing.audio, [dancer], music=score.music, title=name, words=PLAYING[instrument])


def moving_hands(motion: Motion, instrument: str) -> Motion | None:
    """The points of the hands, of a violinist those of the hand that bows; None without any."""
    sides = (BOW_HAND,) if instrument == "violin" else SIDES
    names = {name for side in sides for name in (f"{side}_wrist", *hand_joints(side))}
    joints = [name for name in motion.skeleton.joints if name in names]
    return motion_part(motion, joints, "hands") if joints else None


def _is_playable(playing: ExplainedPlaying) -> bool:
    return playing.audio is not None and playing.motion.duration <= LONGEST


def _pictures(playing: ExplainedPlaying) -> list[Picture]:
    """One picture for each hand where its notes are known, else one of all."""
    event = EVENTS[playing.performance.instrument]
    about = ", synthetic player" if playing.performance.source == "synthetic" else ""
    scores: dict[str, HarmonyScore] = {
        f"{hand.capitalize()} hand{about}": score for hand, score in playing.score.hands.items()
    }
    return [
        Picture(
            title,
            *(png_text(timing_figure(score, title=title, event=event, size=size)) for size in (WIDE, NARROW)),
        )
        for title, score in (scores or {f"All onsets{about}": playing.score.score}).items()
    ]


def _numbers(playing: ExplainedPlaying) -> dict[str, str]:
    """The numbers of the page's table: name -> text."""
    score, events = playing.score, MANY_EVENTS[playing.performance.instrument]
    rows = {"All": score.score} | {f"{hand.capitalize()} hand": own for hand, own in score.hands.items()}
    numbers = {f"{name}: harmony above chance (0: chance, 1: all)": _number(own) for name, own in rows.items()}
    numbers["Whole body, as dances are scored"] = _number(score.body)
    numbers[f"Onsets, {events}"] = f"{score.score.n_audio}, {score.score.n_visual}"
    numbers["Onsets hit, and at random moments"] = f"{score.score.mean_share:.2f}, {score.score.chance:.2f}"
    numbers["Lag (late is positive)"] = f"{1000 * score.lag.seconds:+.0f} ms"
    numbers["Length"] = f"{playing.motion.duration:.1f} s at {playing.motion.fps:g} frames per second"
    return {name: text for name, text in numbers.items() if "nan" not in text}


def _number(score: HarmonyScore) -> str:
    low, high = score.interval
    return f"{score.harmony_above_chance:.2f} ({low:.2f} to {high:.2f}; p = {score.p_value:.3f})"
