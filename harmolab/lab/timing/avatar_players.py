"""Avatars of one or two musicians with one sound, in a player."""

from __future__ import annotations

from collections.abc import Mapping

from harmolab.lab.timing.playing import playing_findings
from harmolab.lab.timing.playing_page import moving_hands
from harmolab.lab.widgets.player import Dancer, Player
from harmolab.lab.widgets.words import PLAYING
from harmolab.metrics.playing import playing_score
from harmolab.systems.audio2body.avatar import avatar
from harmolab.types import Audio, Motion, Notes


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
    """The first seconds of one or two avatars, which hear one sound; strikes or bow turns are read from their points.

    Parameters
    ----------
    audio : Audio
    points : name -> Motion, (T, P, 2) as in `harmolab.io.player_points`, from audio time 0 on
    notes : Notes of the sound
    instrument : "piano" or "violin"
    title : str
    seconds : float
    notice : str, a sentence above the picture, such as where the points are from
    n_rotations : int, of the null distribution of each score

    Raises
    ------
    ValueError
        As `Player`, `avatar` and `playing_score`.
    """
    dancers, facts = [], {}
    for name, motion in points.items():
        part = motion.span(0.0, seconds)
        score = playing_score(part, notes, instrument, n_rotations=n_rotations)
        hits = score.score
        facts[f"{name}: onsets hit"] = f"{hits.hits.sum()} of {hits.n_audio}, {hits.chance:.0%} by chance"
        figure, hands = avatar(motion, instrument).span(0.0, seconds), moving_hands(part, instrument)
        dancers.append(Dancer(name, figure, hits, instead=playing_findings(score).verdict, moving=hands))
    music = dancers[0].score.music
    return Player(audio, dancers, music=music, title=title, facts=facts, words=PLAYING[instrument], notice=notice)
