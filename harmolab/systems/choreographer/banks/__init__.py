"""Movement that comes with harmolab, so that `harmolab dance` needs nothing else: two recorded banks and a puppet.

========  ============================================================================================================
salsa     the follower of a salsa couple, 11 takes, 5 minutes: CMU Graphics Lab Motion Capture Database, subject 61
indian    an Indian solo dance, 6 takes, 2 minutes: subject 94 of the same
puppet    synthetic dancers, made on the spot; no person was recorded
========  ============================================================================================================

The recorded takes have a notice of their own beside them (NOTICE) and are not under the licence of the package.
Neither bank knows the beats that it was danced to: each song cuts it anew, at the rests of the body.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
from scipy.ndimage import binary_opening

from harmolab.body.kinematics import joint_speed, smooth
from harmolab.data.synthetic import ClipSettings, planted_clip
from harmolab.files import PathLike
from harmolab.readers.motion import load_motion
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.choreographer.takes import Take, take_of
from harmolab.types import Clip, Motion

FOLDER = Path(__file__).parent
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
STYLES = (*TAKES, "puppet")
REMARKS: Mapping[str, str] = MappingProxyType(
    {
        "salsa": "salsa steps on the beat, practised without the partner",
        "indian": "Indian dance on the beat; limits from six short takes",
        "puppet": "a puppet: synthetic dancers, no person was recorded",
    }
)
STANDING = 0.5  # of a take's median speed: what is slower at its ends is standing
SMOOTHING = 0.3  # seconds, standard deviation, of that speed
KEPT_UP = 1.0  # seconds for which a dance goes on at least; a shorter movement is a change of stance
SHORTEST = 2.0  # seconds of a part that is kept
PUPPETS, PUPPET_SECONDS, PUPPET_FPS = 14, 23.0, 30.0  # clips, seconds of each, hertz


def shipped_bank(style: str = "salsa", dance: str = "") -> Choreographer:
    """The choreographer of a style that comes with harmolab.

    Parameters
    ----------
    style : "salsa", "indian" or "puppet"
    dance : name of one of `DANCES`, which a puppet can all dance (cha-cha when left out); else of no effect

    Raises
    ------
    ValueError
        For another style, or a dance that no puppet knows.
    FileNotFoundError
        If the recorded movement was left out of this installation.
    """
    if style not in STYLES:
        raise ValueError(f"unknown style {style!r}; there are {', '.join(STYLES)}")
    if style == "puppet":
        return Choreographer.of(puppets(dance or "cha-cha"))
    return Choreographer.load(FOLDER / style)


def write_bank(
    takes: Mapping[str, Motion], out: PathLike, *, style: str = "", holes: Mapping[str, Sequence[Hole]] = HOLES
) -> Choreographer:
    """A choreographer of recorded takes without beats, saved in a folder, with limits of likeness that are their own.

    Standing at the start and at the end of each take is cut off. The shipped banks are
    ``write_bank(shipped_takes(folder, style), FOLDER / style, style=style)``.

    Parameters
    ----------
    takes : name -> Motion, all of one skeleton
    out : folder, made if need be
    style : name of what is danced
    holes : name -> parts (from, to), seconds, that are left out

    Raises
    ------
    ValueError
        If nothing is left, or skeletons differ.
    """
    parts = [part for name, motion in takes.items() for part in danced_parts(name, motion, holes.get(name, ()))]
    choreographer = Choreographer([replace(part, dance=style) for part in parts])
    choreographer.save(out)
    return choreographer


def shipped_takes(folder: PathLike, style: str) -> dict[str, Motion]:
    """Name -> motion of the takes of a style, from a folder of files such as cmu61_01_salsa.npz."""
    return {name: load_motion(Path(folder) / f"{name}_{style}.npz") for name in TAKES[style]}


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


def dancing_span(motion: Motion) -> tuple[float, float]:
    """Seconds at which the dance of a take begins and ends: it moves at least half as fast there as it mostly does."""
    speed = smooth(joint_speed(motion.positions, motion.fps), SMOOTHING, motion.fps)
    is_moving = binary_opening(speed >= STANDING * np.median(speed), np.ones(max(1, round(KEPT_UP * motion.fps)), bool))
    moving = np.flatnonzero(is_moving) if is_moving.any() else np.arange(motion.n_frames)
    return float(moving[0]) / motion.fps, float(moving[-1] + 1) / motion.fps


def puppets(dance: str, *, clips: int = PUPPETS, seconds: float = PUPPET_SECONDS) -> list[Clip]:
    """Synthetic dancers of one dance, whose beats and bars are known; ValueError for an unknown dance."""
    settings = (ClipSettings(dance, seconds=seconds, fps=PUPPET_FPS, seed=seed) for seed in range(1, clips + 1))
    return [
        replace(planted.clip, name=f"puppet {number}", beats=planted.annotation.track(seconds))
        for number, planted in enumerate(map(planted_clip, settings), 1)
    ]
