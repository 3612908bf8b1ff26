"""Is Lee et al.'s system, as trained here, trained well enough to be compared? It is asked about known figures."""

from __future__ import annotations

import math
from collections import Counter

from harmolab.systems.lee2019.networks import DancingToMusic
from harmolab.systems.lee2019.train import (
    code_error,
    critic_accuracy,
    drawn_movements,
    movement_nats,
    rebuilt,
    speed,
    split_pieces,
    style_accuracy,
)
from harmolab.systems.training.splits import Split

Results = dict[str, tuple[float, tuple[float, float], bool]]


def entry_lee2019(network: DancingToMusic, split: Split) -> Results:
    """The entry tests: for each its value, the range asked for, and whether the value lies in it.

    The first four are about pieces of the training split, rebuilt by the means of their codes; a guess of the dance is
    the most frequent one of the validation units, whose songs are heard in training too.

    Parameters
    ----------
    network : DancingToMusic, trained
    split : that it was trained on
    """
    network.eval()
    train, held_out = (split_pieces(network, units) for units in (split.train, split.validation))
    pieces = train.poses.flatten(0, 1)
    again, still = rebuilt(network, pieces), pieces.mean(dim=1, keepdim=True).expand_as(pieces)
    drawn, recorded = drawn_movements(network, pieces), speed(network, pieces)
    guess = Counter(unit.dance for unit in split.validation.units).most_common(1)[0][1] / len(held_out)
    right = critic_accuracy(network, held_out)
    values = {
        "L1 of rebuilt pieces over their own mean pose's": (
            code_error(network, again, pieces) / code_error(network, still, pieces), 0.0, 0.5,
        ),
        "speed of rebuilt pieces over recorded": (speed(network, again) / recorded, 0.7, 1.2),
        "speed of drawn movements over recorded": (speed(network, drawn) / recorded, 0.6, 1.2),
        "divergence of z_move (nats)": (movement_nats(network, pieces), 20.0, math.inf),
        "dance told by style, over guessing": (style_accuracy(network, held_out) / guess, 2.0, math.inf),
        "critic of units right": (right["units"], 0.55, 0.95),
        "critic of dances right": (right["dance"], 0.55, 0.95),
    }  # fmt: skip
    return {name: (value, (low, high), low <= value <= high) for name, (value, low, high) in values.items()}
