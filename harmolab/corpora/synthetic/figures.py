"""The vocabulary of the synthetic dancer: eight figures for each of seven dances, and the manner of each dance.

A figure is a string with one step per beat, over two bars:

    f forward, b back, o out to the side, c close, x cross in front, k cross behind, t tap without weight, - no step

and any number of turns behind the letter, each of 45 degrees: `>` to the right, `<` to the left. The free foot moves,
so that a figure danced from the other foot is its mirror image. The names are the ballroom's; the figures are sketches.
"""

from __future__ import annotations

from dataclasses import dataclass
from types import MappingProxyType

_BOOK = {
    "cha-cha": {
        "basic": "o f b o c b f o",
        "New Yorker": "o x> b< c o x< b> c",
        "spot turn": "o x>> f>> c o x<< f<< c",
        "hand to hand": "o k> f< c o k< f> c",
        "side chasse": "o c o t o c o t",
        "walks": "f f f c b b b c",
        "time step": "o k f o c k f c",
        "points": "t c t c o k f o",
    },
    "jive": {
        "basic": "b f o c o c o c",
        "link": "b f f - f b b -",
        "flicks": "t c t c b f o c",
        "American spin": "b f o> o> b f o> o>",
        "side chasse": "o c o - o c o -",
        "walks": "f f f f b b b b",
        "toe heel": "t t c - t t c -",
        "change of place": "b f> o> - b f< o< -",
    },
    "quickstep": {
        "quarter turn": "f> - o c b< - o c",
        "progressive chasse": "b - o c o - f -",
        "lock step": "f - f k f - f -",
        "natural turn": "f> - o> - c> - b -",
        "running finish": "f f f - f f f -",
        "back lock": "b - b x b - b -",
        "tipple chasse": "b - o> c o> - f -",
        "woodpecker": "t c t c t - c -",
    },
    "rumba": {
        "basic": "- f b o - b f o",
        "walks": "- f f f - b b b",
        "alemana": "- f b c> - f> f> o>",
        "cucaracha": "- o b c - o b c",
        "New Yorker": "- x> b< o - x< b> o",
        "spot turn": "- x>> f>> o - x<< f<< o",
        "hand to hand": "- k> f< o - k< f> o",
        "fan": "- b f o< - f b o>",
    },
    "samba": {
        "whisk": "o k f - o k f -",
        "bounce": "f c - t b c - t",
        "volta": "x o x o x o x o",
        "bota fogo": "x o f - x o f -",
        "walks": "f - f - f b f -",
        "corta jaca": "f b f b o b f b",
        "side rock": "o c o t o c o t",
        "spot volta": "x> o> x> o> x> o> x> o>",
    },
    "tango": {
        "walk": "f - f - f f o c",
        "promenade": "o x o c o x o c",
        "rock": "f b f - b f b -",
        "closed turn": "f< o< c - b< o< c -",
        "swivel": "f> - f< - f> - f< c",
        "side points": "t - c - t - o c",
        "back walk": "b - b - b b o c",
        "corte": "b - - f f o c -",
    },
    "waltz": {
        "box": "f o c b o c",
        "natural turn": "f> o> c b> o> c>",
        "reverse turn": "f< o< c b< o< c<",
        "hesitation": "f c - b c -",
        "balance": "o k - o k -",
        "progressive": "f f f b b b",
        "whisk": "f o k f o c",
        "twinkle": "x o c x o c",
    },
}
FIGURES = MappingProxyType({dance: MappingProxyType(figures) for dance, figures in _BOOK.items()})


def figure_names(dance: str) -> tuple[str, ...]:
    """The figures of a dance, by the names that `beats.json` uses, such as "waltz box"."""
    return tuple(f"{dance} {name}" for name in FIGURES[dance])


# Degrees: elevation of the upper arm from hanging, its azimuth from the side to the front, plane of the elbow (0 bends
# a hanging arm forward, 90 a raised one upward), bend of the elbow, bend of the wrist.
ARM_POSES = MappingProxyType(
    {
        "low": (14.0, 50.0, 10.0, 25.0, 5.0),
        "side": (78.0, 10.0, 40.0, 20.0, 10.0),
        "front": (65.0, 75.0, 50.0, 35.0, 5.0),
        "high": (150.0, 30.0, 30.0, 30.0, 10.0),
        "chest": (42.0, 45.0, 15.0, 110.0, 5.0),
        "bent": (28.0, 30.0, 20.0, 85.0, 0.0),
        "hip": (45.0, -25.0, -50.0, 95.0, 25.0),
        "frame": (72.0, 25.0, 35.0, 70.0, 5.0),
        "wide frame": (84.0, 5.0, 35.0, 45.0, 5.0),
        "close frame": (58.0, 40.0, 25.0, 95.0, 5.0),
    }
)


@dataclass(frozen=True)
class Manner:
    """The manner of a dance. Lengths are metres for a dancer of 1.7 m and a movement of half a second;
    angles degrees.

    Parameters
    ----------
    step : float, length of a step
    hips : float, tilt of the pelvis over the supporting leg
    sway : float, lean and twist of the chest
    rise : heights of the waist above its middle, one per beat of the bar
    heels : lifts of the heels, one per beat of the bar
    arms : names of the arm poses in use
    """

    step: float
    hips: float
    sway: float
    rise: tuple[float, ...]
    heels: tuple[float, ...]
    arms: tuple[str, ...]


JIVE = ("low", "bent", "front", "side")
LATIN = ("low", "side", "front", "high", "chest", "hip")
BALLROOM = ("frame", "wide frame", "close frame")

MANNERS = MappingProxyType(
    {
        "cha-cha": Manner(0.34, 9.0, 11.0, (0.0, -0.03, 0.0, -0.02), (0.0, 4.0, 0.0, 8.0), LATIN),
        "jive": Manner(0.3, 7.0, 10.0, (-0.04, 0.01, -0.04, 0.01), (6.0, 14.0, 6.0, 14.0), JIVE),
        "quickstep": Manner(0.5, 3.0, 8.0, (-0.04, 0.0, 0.02, 0.03), (0.0, 6.0, 16.0, 20.0), BALLROOM),
        "rumba": Manner(0.4, 11.0, 12.0, (0.01, -0.02, 0.0, -0.02), (0.0, 4.0, 4.0, 4.0), LATIN),
        "samba": Manner(0.34, 10.0, 12.0, (-0.05, 0.0, -0.05, 0.0), (0.0, 8.0, 0.0, 8.0), LATIN),
        "tango": Manner(0.45, 2.0, 14.0, (-0.05, -0.03, -0.06, -0.02), (0.0, 0.0, 0.0, 0.0), BALLROOM),
        "waltz": Manner(0.5, 3.0, 13.0, (-0.06, 0.0, 0.04), (0.0, 12.0, 26.0), BALLROOM),
    }
)  # fmt: skip
