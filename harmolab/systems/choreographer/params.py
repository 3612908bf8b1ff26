"""The numbers of the choreographer: what a seam, another tempo, a beat out of place and a repetition cost."""

from __future__ import annotations

from dataclasses import dataclass, fields

# Costs of a choice that is to be avoided, in centimetres of seam. Never infinite: a small corpus must still dance.
TOO_SHORT, TOO_LONG = 60.0, 80.0
USUAL_METER = 4  # beats in a bar where none is known


@dataclass(frozen=True)
class ChoreographerParams:
    """Costs are in centimetres: what a seam of that size costs.

    Parameters
    ----------
    seam : float, for any seam beside its size D
    tempo : float
        For |log(interval of the music / interval of the recorded beat)|, divided by the beats in a bar.
    harmony : float, for a beat that fits the bar pattern of its dance worst
    variety : float, for a beat that looks like the one just danced, divided by the beats in a bar
    alike : float, centimetres; beats this far apart look alike by 1 / e
    forgetting : float, beats after which a repetition costs 1 / e
    noise : float
        How much the seed has to say: each recorded beat costs .3 times this, times a Gumbel number, less.
    longest_run : int, beats that are taken from one recording in a row
    unplaced_run : int, shortest run where bars are unknown; else it is one bar
    twin : float, centimetres; a seam below is none: the same figure in another recording
    edge : float, for a seam that reaches beyond the end of a recording, or into frames that are filler
    foot_weight : float, of ankles, heels and toes in a seam; other joints weigh 1
    samples : int, in the beat around a seam
    dense : int, nodes up to which all distances are kept; of more, only those to the `nearest`
    nearest : int
    paths : int, the best of which are followed from beat to beat
    """

    seam: float = 3.0
    tempo: float = 40.0
    harmony: float = 6.0
    variety: float = 30.0
    alike: float = 6.0
    forgetting: float = 32.0
    noise: float = 3.0
    longest_run: int = 8
    unplaced_run: int = 4
    twin: float = 1.5
    edge: float = 15.0
    foot_weight: float = 2.0
    samples: int = 7
    dense: int = 3000
    nearest: int = 200
    paths: int = 500

    def __post_init__(self) -> None:
        for field in fields(self):
            value, is_count = getattr(self, field.name), isinstance(field.default, int)
            if not int(is_count) <= value < 1e9 or (is_count and not isinstance(value, int)):
                least = "a whole number from 1" if is_count else "zero or more"
                raise ValueError(f"{field.name} must be {least}, got {value}")
        if min(self.alike, self.forgetting, self.foot_weight) == 0:
            raise ValueError("alike, forgetting and foot_weight must be positive")
