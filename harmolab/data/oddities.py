"""Odd things in a motion, its song and its beats, a sentence each: what `harmolab data check` and `evaluate` name.

A fault is an odd thing that spoils numbers in silence: another unit, another axis, a frame rate that no dance has,
joints that cannot be told apart. `harmolab evaluate` measures no such file.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from harmolab.body.skeletons import tree_order
from harmolab.data.recordings import load_config, true_runs
from harmolab.readers.motion_file import UPRIGHT, head_above_feet
from harmolab.shape_speed import unturn, without_glitches
from harmolab.types import Audio, FloatArray, Motion

MAX_SPEED = 10.0  # metres per second
SELDOM = 30.0  # seconds a jump; with sides swapped for .2 s once in 37 to 56 s, 22 of 23 dancers kept their verdict
FROZEN_SECONDS = 0.5
STILL_METRES = 1e-4
HEIGHTS = (0.8, 2.5)  # metres that a body extends over
BODIES = (0.3, 4.0)  # metres, beyond which a file is of another unit, whatever is in it
SLOWEST_FPS = 10.0  # hertz; movement at 120 beats a minute has five samples a beat there
ALWAYS = 0.9  # share of the frames in which a body stands along one axis, from which on that axis points up
CROUCHING = 0.6  # height over depth of a body without names, below which it is remarked on
LATE_SECONDS = 0.1  # by which a motion may end after its song
GAP = 2.5  # median beat intervals


class Oddity(str):
    """A sentence on an odd thing, `brief`, the same in a few words and without numbers, and whether it `is_fault`.

    `spoils` is its name where it spoils a training in silence, "" for others.

    >>> Oddity("frozen once, longest 1.50 s at 3.00 s", "frozen").brief
    'frozen'
    """

    brief: str
    is_fault: bool
    spoils: str

    def __new__(cls, sentence: str, brief: str = "", is_fault: bool = False, spoils: str = "") -> "Oddity":
        self = super().__new__(cls, sentence)
        self.brief, self.is_fault, self.spoils = brief, is_fault, spoils
        return self


def motion_oddities(motion: Motion) -> tuple[Oddity, ...]:
    """All odd things in a motion: first those of `body_oddities`, then rate, stretches without movement, speed."""
    return (*body_oddities(motion), *_rate(motion), *_frozen(motion), *_too_fast(motion))


def body_oddities(motion: Motion) -> tuple[Oddity, ...]:
    """Odd things at any frame rate: a skeleton that is none, filler, a body of unlikely size, another axis up."""
    return (*_skeleton(motion), *_filler(motion), *_size(motion), *_axis(motion))


def faults_of(motion: Motion) -> tuple[Oddity, ...]:
    """The odd things in a motion that spoil its numbers."""
    return tuple(one for one in (*body_oddities(motion), *_rate(motion)) if one.is_fault)


def _skeleton(motion: Motion) -> Iterator[Oddity]:
    names, parents = motion.skeleton.joints, motion.skeleton.parents
    if twins := sorted({name for name in names if names.count(name) > 1}):
        yield Oddity(f"several joints have one name: {', '.join(map(repr, twins[:4]))}", "joints of one name", True)
    try:
        tree_order(parents)
    except ValueError:
        yield Oddity("the parents of its joints lead round in a circle", "parents in a circle", True)


def _filler(motion: Motion) -> Iterator[Oddity]:
    if count := int((~motion.valid).sum()):
        yield Oddity(f"{count} of {motion.n_frames} frames are filler (splices, unseen joints)", "frames of filler")


def _size(motion: Motion) -> Iterator[Oddity]:
    if motion.positions.shape[2] != 3:
        return
    extent = float(np.median(np.ptp(motion.positions, axis=1).max(axis=1)))
    if not HEIGHTS[0] <= extent <= HEIGHTS[1]:
        is_fault = len(motion.skeleton.joints) > 1 and not BODIES[0] <= extent <= BODIES[1]
        cure = "pass scale (--scale); beside files in metres, convert this one by harmolab data convert A B --scale"
        yield Oddity(f"the body extends over {extent:.3g} m: other units? {cure}", "a body of another size", is_fault)


CURES = {
    "z": "turn it by harmolab data convert A B --up z",
    "-z": "if it was read as z up, harmolab data convert A B --up y reads it as it is",
    "-y": "it stands on its head: turn it by half a turn about x (y and z with the other sign) before it is read",
}


def _axis(motion: Motion) -> Iterator[Oddity]:
    """One sentence where y does not point up: by head and feet, else by the extent of the body."""
    if motion.positions.shape[2] != 3:
        return
    way = head_above_feet(motion.positions, motion.skeleton.joints)
    if way is None:
        _, height, depth = np.median(np.ptp(motion.positions, axis=1), axis=0)
        if height < CROUCHING * depth:
            yield Oddity(f"the body is {height:.2g} m high and {depth:.2g} m deep: does z point up?", "y up in doubt")
        return
    for axis, sign in (("y", -1), ("z", 1), ("z", -1)):
        lengths = np.linalg.norm(way, axis=1)
        if (sign * way[:, "xyz".index(axis)] > UPRIGHT * lengths).mean() >= ALWAYS:
            up = f"{'-' if sign < 0 else ''}{axis}"
            yield Oddity(f"the head is above the feet along {up}, and not along y; {CURES[up]}", f"{up} up", True)


def _rate(motion: Motion) -> Iterator[Oddity]:
    if motion.fps < SLOWEST_FPS:
        sentence = f"{motion.fps:g} frames a second are too few for a dance; is the rate right?"
        yield Oddity(sentence, f"fewer than {SLOWEST_FPS:g} frames a second", True)


def _frozen(motion: Motion) -> Iterator[Oddity]:
    """Stretches of half a second and more in which no joint moves."""
    size = 1.0 if motion.positions.shape[2] == 3 else float(np.median(np.ptp(motion.positions, axis=1).max(axis=1)))
    still = np.abs(np.diff(motion.positions, axis=0)).max(axis=(1, 2)) <= STILL_METRES * size
    runs = [run for run in true_runs(still) if (run[1] - run[0]) / motion.fps >= FROZEN_SECONDS]
    if runs:
        first, last = max(runs, key=lambda run: run[1] - run[0])
        times = "once" if len(runs) == 1 else f"{len(runs)} times"
        longest = f"longest {(last - first) / motion.fps:.2f} s at {first / motion.fps:.2f} s"
        brief, spoils = f"frozen for {FROZEN_SECONDS:g} s and more", "without movement" if still.all() else ""
        yield Oddity(f"frozen {times}, {longest}", brief, spoils=spoils)


def jumps_inside(motion: Motion) -> tuple[Oddity, ...]:
    """One sentence where joints jump inside the body, and stay away for more than a frame: a verdict counts that.

    Jumps and turns of the whole body, and single frames that are wrong, are taken out before it, and not named; nor are
    fewer frames than one in 30 s.
    """
    if not any(_too_fast(motion, fewest := max(2, int(len(motion.positions) / motion.fps / SELDOM)))):
        return ()
    inside = replace(motion, positions=unturn(without_glitches(motion).positions))
    return tuple(_too_fast(inside, fewest))


def _too_fast(motion: Motion, fewest: int = 1) -> Iterator[Oddity]:
    """Valid frames in which a joint of a 3-D motion is faster than 10 m/s, where there are so many of them."""
    if motion.positions.shape[2] != 3:
        return
    speed = np.linalg.norm(np.diff(motion.positions, axis=0), axis=2) * motion.fps
    speed[~motion.valid[1:]] = 0.0
    if (count := int((speed.max(axis=1) > MAX_SPEED).sum())) >= fewest:
        frames = frames_text(count)
        frame, joint = divmod(int(np.argmax(speed)), speed.shape[1])
        peak = f"{speed.max():.1f} m/s ({motion.skeleton.joints[joint]}, {(frame + 1) / motion.fps:.2f} s)"
        brief = f"faster than {MAX_SPEED:g} m/s"
        yield Oddity(f"{brief} in {frames}, up to {peak}", brief, spoils=brief)


def sound_oddities(audio: Audio) -> tuple[Oddity, ...]:
    """Odd things in samples."""
    peak = float(np.abs(audio.samples).max())
    if peak == 0:
        return (Oddity("silent from beginning to end", "silent", spoils="silent"),)
    loud = Oddity(f"amplitudes reach {peak:.3g}; full scale is 1", "louder than full scale")
    return (loud,) if peak > 2 else ()


def beat_oddities(times: FloatArray) -> tuple[Oddity, ...]:
    """Odd things in annotated beats, (B,) seconds: a gap among them."""
    steps = np.diff(times)
    if not steps.size or steps.max() <= GAP * np.median(steps):
        return ()
    last = times[int(np.argmax(steps))]
    sentence = f"no beat for {steps.max():.2f} s after {last:.2f} s, others are {np.median(steps):.2f} s apart"
    return (Oddity(sentence, "a gap among the annotated beats"),)


def late_end(offset: float, motion: Motion, audio: Audio) -> tuple[Oddity, ...]:
    """One sentence where a motion that begins at `offset` seconds ends after its song."""
    beyond = offset + motion.duration - audio.duration
    sentence = f"the motion ends {beyond:.2f} s after the audio"
    return (Oddity(sentence, "ends after its song"),) if beyond > LATE_SECONDS else ()


def span_oddities(folder: Path, motion: Motion) -> tuple[Oddity, ...]:
    """One sentence where the length of a recorded motion of Tang et al. differs from its config.json."""
    if not (folder / "config.json").is_file() or (folder / "motion.npz").is_file():
        return ()
    span = load_config(folder / "config.json")
    frames = span.end - span.start
    short = frames - motion.n_frames
    relation = "shorter" if short > 0 else "longer"
    sentence = f"{frames_text(abs(short))} {relation} than config.json says ({frames})"
    return (Oddity(sentence, "of another length than config.json says"),) if short else ()


def frames_text(count: int) -> str:
    """A number of frames in words."""
    return "1 frame" if count == 1 else f"{count} frames"


def brief_text(oddities: Sequence[Oddity]) -> str:
    """The oddities in short, each once."""
    return ", ".join(dict.fromkeys(one.brief for one in oddities))


def training_lines(odd: Mapping[Any, Sequence[Oddity]]) -> list[str]:
    """A line for each kind of oddity that spoils a training, with the names of the recordings that have it."""
    kinds = dict.fromkeys(one.spoils for own in odd.values() for one in own if one.spoils)
    having = {kind: [str(name) for name, own in odd.items() if kind in [one.spoils for one in own]] for kind in kinds}
    end = "to leave them out, move them to another folder"
    return [f"trained on although {kind}: {', '.join(names)}; {end}" for kind, names in having.items()]
