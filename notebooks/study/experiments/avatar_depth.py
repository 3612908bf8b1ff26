"""The depth of an avatar: what its settings recover of planted players whose place in space is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

import numpy as np
import pandas as pd

from harmolab.musician.avatar import SHOULDERS, AvatarParams, avatar
from harmolab.readers.player_points import INSTRUMENTS, SIDES
from harmolab.types import FloatArray, Motion
from study.experiments.player_in_space import FOREARM, HALF_SHOULDERS, PlayerInSpace, elbow_angles, player_in_space
from study.profile import RunProfile

RECOMMENDED = AvatarParams()
DEPTH_SETTINGS: Mapping[str, AvatarParams] = MappingProxyType(
    {
        "ours": RECOMMENDED,
        "ours, lengths not smoothed": replace(RECOMMENDED, smoothing=0.0),
        "ours, longest forearm": replace(RECOMMENDED, percentile=100.0),
        "ours, longest, not smoothed": replace(RECOMMENDED, percentile=100.0, smoothing=0.0),
        "ours, linear depth": replace(RECOMMENDED, depth="linear"),
        "ours, forearm alone": replace(RECOMMENDED, elbow_depth=False),
        "as in the paper": AvatarParams.paper(),
    }
)
# Per cent of the forearm and degrees: the most that an avatar may miss.
DEPTH_LIMITS: Mapping[str, float] = MappingProxyType({"wrist depth": 15.0, "elbow": 12.0})
N_PLAYERS, QUICK_PLAYERS = 5, 1  # planted players of each instrument


def depth_table(profile: RunProfile) -> pd.DataFrame:
    """Errors of avatars against planted players in space, 4 m from the camera, with noise of one pixel, 20 s each.

    Returns
    -------
    DataFrame with the columns settings (of `DEPTH_SETTINGS`), instrument, players, "wrist depth" (median error, per
    cent of the forearm), "elbow" (median error of its angle, degrees), both means over the players, and
    "wrist depth, worst", "elbow, worst" of them
    """
    count = N_PLAYERS if profile.epochs is None else QUICK_PLAYERS
    rows = []
    for instrument in INSTRUMENTS:
        players = [player_in_space(instrument, seed=seed) for seed in range(1, count + 1)]
        for name, params in DEPTH_SETTINGS.items():
            avatars = [avatar(player.points, instrument, params=params) for player in players]
            pairs = list(zip(players, avatars, strict=True))
            depths, elbows = [wrist_depth_error(*pair) for pair in pairs], [elbow_error(*pair) for pair in pairs]
            rows.append(
                {"settings": name, "instrument": instrument, "players": count,
                 "wrist depth": np.mean(depths), "wrist depth, worst": max(depths),
                 "elbow": np.mean(elbows), "elbow, worst": max(elbows)}
            )  # fmt: skip
    return pd.DataFrame(rows)


def wrist_depth_error(player: PlayerInSpace, result: Motion) -> float:
    """Median error of the wrists' depth before their shoulders, both hands, per cent of the planted forearm.

    The avatar is first brought to the planted width of the shoulders, which a picture does not show.
    """
    scale = 2 * HALF_SHOULDERS / SHOULDERS
    errors = [np.abs(scale * _depth(result, side) - _depth(player.space, side)) for side in SIDES]
    return float(100 * np.median(errors) / FOREARM)


def elbow_error(player: PlayerInSpace, result: Motion) -> float:
    """Median error of the angles of both elbows, degrees."""
    return float(np.degrees(np.median(np.abs(elbow_angles(result) - player.elbow_angles()))))


def _depth(motion: Motion, side: str) -> FloatArray:
    """(T,) metres that a wrist is nearer to the camera than its shoulder."""
    wrist, shoulder = (motion.skeleton.joints.index(f"{side}_{part}") for part in ("wrist", "shoulder"))
    return motion.positions[:, wrist, 2] - motion.positions[:, shoulder, 2]
