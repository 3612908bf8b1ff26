"""The banks that come with harmolab: `python -m tools.bank FOLDER STYLE OUT`.

The folder has files such as cmu61_01_salsa.npz; for the style "ballroom" it is that of Music2Dance's weights, which
dream the takes. Standing at the ends of a take, and parts that show no dance, are cut off; NOTICE beside the banks says
what else was changed.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from harmolab.data.synthetic import synthetic_clip
from harmolab.files import PathLike
from harmolab.params import DANCES
from harmolab.readers.motion import load_motion
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.choreographer.takes import Take, dancing_span, take_of
from harmolab.systems.music2dance.system import Music2Dance
from harmolab.types import Motion

Hole = tuple[float, float]  # seconds, from and to

# Style -> names of its takes: subject and take of the CMU database.
TAKES: Mapping[str, tuple[str, ...]] = MappingProxyType(
    {
        "salsa": tuple(f"cmu61_{number:02d}" for number in (1, 2, 3, 4, 5, 6, 7, 9, 13, 14, 15)),
        "indian": tuple(f"cmu94_{number:02d}" for number in (4, 6, 8, 13, 14, 15)),
    }
)
# Take -> parts of it that are left out, seconds: a bow at the end, two dips that the partner holds (with what little
# comes after one of them), a knee that flips.
HOLES: Mapping[str, tuple[Hole, ...]] = MappingProxyType(
    {"cmu61_09": ((41.2, 43.0),), "cmu61_14": ((7.5, 9.1),), "cmu61_13": ((33.9, 38.0),), "cmu94_04": ((12.7, 13.7),)}
)
SHORTEST = 2.0  # seconds of a part that is kept
DREAMT = "ballroom"
DREAMS, DREAM_SECONDS = 3, 30.0  # of each dance that the network knows, from slow to fast
NO_RECORDING = "recorded dancers: these dances were dreamt by a network, the shipped Music2Dance, to synthetic songs"


def write_bank(
    takes: Mapping[str, Motion],
    out: PathLike,
    *,
    style: str = "",
    holes: Mapping[str, Sequence[Hole]] = HOLES,
    notes: Iterable[str] = (),
) -> Choreographer:
    """A choreographer of takes without beats, saved in a folder, with limits of likeness that are their own.

    Standing at the start and at the end of each take is cut off. The shipped banks are those of `main`.

    Parameters
    ----------
    takes : name -> Motion, all of one skeleton
    out : folder, made if need be
    style : name of what is danced
    holes : name -> parts (from, to), seconds, that are left out
    notes : lines about what the bank does not hold

    Raises
    ------
    ValueError
        If nothing is left, or skeletons differ.
    """
    parts = [part for name, motion in takes.items() for part in danced_parts(name, motion, holes.get(name, ()))]
    choreographer = Choreographer([replace(part, dance=style) for part in parts], notes=notes)
    choreographer.save(out)
    return choreographer


def shipped_takes(folder: PathLike, style: str) -> dict[str, Motion]:
    """Name -> motion of the takes of a style, from a folder of files such as cmu61_01_salsa.npz."""
    return {name: load_motion(Path(folder) / f"{name}_{style}.npz") for name in TAKES[style]}


def dreamt_takes(weights: PathLike) -> dict[str, Motion]:
    """Name -> motion of dances of a Music2Dance to synthetic songs, `DREAMS` of each dance that it knows."""
    system, takes = Music2Dance.load(weights), {}
    for dance in system.dances:
        tempos = np.linspace(*DANCES[dance].tempo, DREAMS + 2)[1:-1].tolist()
        for number, tempo in enumerate(tempos, 1):
            song = synthetic_clip(dance, seconds=DREAM_SECONDS, tempo=tempo, seed=number)
            takes[f"dreamt {dance} {number}"] = system.generate(song.audio, song.beats, seed=number, dance=dance)
    return takes


def danced_parts(name: str, motion: Motion, holes: Sequence[Hole] = ()) -> list[Take]:
    """The parts of a take that are danced: without standing at its ends, and without holes (from, to), seconds.

    The parts of a take in several are numbered: "name, part 1". Parts of less than 2 s are left out.
    """
    first, last = dancing_span(motion)
    edges = [first, *(edge for hole in sorted(holes) for edge in hole), last]
    spans = [
        (start, end - start) for start, end in zip(edges[::2], edges[1::2], strict=True) if end - start >= SHORTEST
    ]
    names = [name] if len(spans) == 1 else [f"{name}, part {number}" for number in range(1, len(spans) + 1)]
    return [replace(take_of(motion.span(*span)), name=part) for part, span in zip(names, spans, strict=True)]


def main(folder: str, style: str, out: str) -> None:
    """Write the bank of a style."""
    if style == DREAMT:
        write_bank(dreamt_takes(folder), out, style=style, notes=[NO_RECORDING])
    else:
        write_bank(shipped_takes(folder, style), out, style=style)


if __name__ == "__main__":
    if len(sys.argv) != 4:
        sys.exit(__doc__)
    main(*sys.argv[1:])
