"""Avatars of musicians in a player, one or two side by side, with the hits of their hands."""

from __future__ import annotations

from collections.abc import Mapping

from harmolab.lab.widgets.player import Dancer, Player
from harmolab.metrics.playing import playing_score
from harmolab.systems.audio2body.avatar import avatar
from harmolab.types import Audio, Motion, Notes

SECONDS = 15.0  # that a player shows


def avatar_player(
    audio: Audio,
    points: Mapping[str, Motion],
    notes: Notes,
    instrument: str,
    *,
    title: str,
    seconds: float = SECONDS,
    n_rotations: int = 1000,
) -> Player:
    """The first seconds of one or two avatars with one sound; strikes or bow turns are read from their points.

    Parameters
    ----------
    audio : Audio
    points : name -> Motion, (T, P, 2) as in `harmolab.io.player_points`, from audio time 0 on
    notes : Notes of the sound
    instrument : "piano" or "violin"
    title : str
    seconds : float
    n_rotations : int, of the null distribution of each score

    Raises
    ------
    ValueError
        As `Player`, `avatar` and `playing_score`.
    """
    dancers, facts = [], {}
    for name, motion in points.items():
        part = motion.span(0.0, seconds)
        score = playing_score(part, notes, instrument, n_rotations=n_rotations).score
        dancers.append(Dancer(name, avatar(motion, instrument).span(0.0, seconds), score))
        facts[f"{name}: onsets hit"] = f"{score.hits.sum()} of {score.n_audio}, {score.chance:.0%} by chance"
    return Player(audio, dancers, music=dancers[0].score.music, title=title, facts=facts)
