"""A dance brought into harmony with its music: small movements of the joints put it on the beat.

The relaxed harmony of `soft_harmony` is raised by its gradient, and the usual score decides which motion is kept. Two
things hold exactly, whatever the gradient asks for: no joint moves further than it may, and every bone keeps the length
that it has in each frame.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import torch
from torch import Tensor

from harmolab.body.skeletons import ancestors
from harmolab.files import Progress, silent
from harmolab.params import HOW_PATTERNS, BarPattern, HarmonyParams
from harmolab.score import check_whole
from harmolab.soft_score import anneal, soft_harmony
from harmolab.systems.harmogan.losses import foot_loss, jerk_loss
from harmolab.types import BeatTrack, Motion, check_kind
from harmolab.verdict.bar_pattern import first_place
from harmolab.verdict.evidence import LEAST_PULSE, PlaceTest, place_test
from harmolab.verdict.judge import Judgement, score_motion

KNOT = 0.15  # seconds between the knots of the splines that offsets follow: little above 3 Hz is added
RATE = 30.0  # hertz: the search looks at this many frames a second, or a few more
SOFTNESS = (0.5, 0.05)  # tau at the first and at the last step
FIRST_MOVE = 0.01  # of the reach: size of the random movement that the search starts from
RATE_OF_STEPS = 0.03  # of the reach: Adam's change of a knot in one step, about
DISTANCE_WEIGHT, JERK_WEIGHT, FOOT_WEIGHT = 1.0, 0.2, 0.5
FOOT_HEIGHT = 0.05  # metres: a joint that comes as close as this to the lowest one of all is part of a foot
SHARPNESS = 16  # exponent of the bound: the higher, the closer to the reach a joint may come
LOOKS = 6  # times during the search that the hard score decides on the best motion so far


def harmonise(
    motion: Motion,
    beats: BeatTrack,
    *,
    reach: float = 0.1,
    params: HarmonyParams | None = None,
    pattern: BarPattern | None = None,
    steps: int = 300,
    seed: int = 0,
    progress: Progress = silent,
) -> Motion:
    """A dance brought onto the beat: the same motion, its joints moved a little. Needs torch.

    A gradient raises the harmony above chance, while joints are held near to where they were, and more jerk than the
    motion's own is avoided. Bones keep their lengths.

    Parameters
    ----------
    motion : Motion
        Frames that are not valid stay as they are.
    beats : BeatTrack
        Beats of the music on the motion's time line (`music_and_motion` makes both of a clip).
    reach : float, metres (or the motion's unit)
        The most that a joint may move in any frame.
    params : HarmonyParams
        The score to raise; ``HarmonyParams.recommended()`` when left out. ``HarmonyParams.valleys()`` brings the
        moments at which the joints are slowest onto the beats.
    pattern : BarPattern
        The movement that is meant, such as one of `HOW_PATTERNS`, in place of that of `params`. Without a pattern the
        recommended score raises the one that the dance is closer to: a rest on the beat, or a hit.
    steps : int
        Gradient steps, at least one.
    seed : int
        Of the tiny random movement that the search starts from.
    progress : function(iterable, label) -> iterable
        Reports on the steps, such as ``lambda steps, label: tqdm(steps, label)``.

    Returns
    -------
    Motion
        One with a higher score than `motion`. `motion` itself where there are no beats, where its score can be no
        higher, or where no better motion was met.

    Raises
    ------
    ValueError
        For a reach that is not positive, no steps, a seed that is no whole number, or params that have no relaxation.
    """
    check_kind(motion, Motion)
    check_kind(beats, BeatTrack)
    if not 0 < reach < float("inf"):
        raise ValueError(f"reach must be positive, got {reach}")
    check_whole(steps=steps, seed=seed)
    if steps < 1:
        raise ValueError(f"steps must be at least 1, got {steps}")
    params = params or HarmonyParams.recommended()
    music = beats.span(0.0, motion.duration)
    params = _aim(motion, music, params if pattern is None else replace(params, pattern=pattern))
    best = _above_chance(motion, music, params)
    if len(music) == 0 or best >= 1 - 1e-9:
        return motion
    body, splines = _Body.of(motion), _Splines.of(motion)
    best_motion, turns = motion, progress(range(steps), "harmonising")
    for knots in _search(motion, music, params, reach, turns, steps, seed):
        candidate = replace(motion, positions=body.moved(splines.at(knots), reach).numpy())
        score = _above_chance(candidate, music, params)
        if score > best:
            best, best_motion = score, candidate
    return best_motion


@dataclass(frozen=True, eq=False)
class _Body:
    """A motion as bones: (T, J, D) vectors from each joint's parent (roots: from the origin), and the tree."""

    bones: Tensor
    lengths: Tensor  # (T, J, 1)
    directions: Tensor  # (T, J, D)
    is_root: Tensor  # (J,)
    above: Tensor  # (J, J), 1 where the second joint is the first or one of its ancestors

    @classmethod
    def of(cls, motion: Motion) -> "_Body":
        """The body of a motion's frames."""
        positions, parents = torch.tensor(motion.positions), torch.tensor(motion.skeleton.parents)
        is_root = parents < 0
        bones = torch.where(is_root[:, None], positions, positions - positions[:, parents.clamp(min=0)])
        lengths = torch.linalg.vector_norm(bones, dim=-1, keepdim=True)
        directions = bones / torch.where(lengths > 0, lengths, torch.ones_like(lengths))
        return cls(bones, lengths, directions, is_root, bones.new_tensor(ancestors(motion.skeleton.parents)))

    def moved(self, offsets: Tensor, reach: float) -> Tensor:
        """Joint positions (T, J, D) after each bone's end is moved sideways by its offset (T, J, D) and roots anywhere.

        A joint moves no further than the offsets between it and its root add up to, since turning a bone towards
        ``bone + sideways`` moves its end by less than ``sideways``. Where the sum is too much, all offsets of the frame
        shrink, so that no joint leaves its reach.
        """
        free = self.is_root[:, None]
        stretch = (offsets * self.directions).sum(dim=-1, keepdim=True)
        sideways = torch.where(free, offsets, offsets - stretch * self.directions)
        size = (sideways.square().sum(dim=-1) + 1e-24).sqrt()  # (T, J)
        excess = ((size @ self.above.T) / reach).pow(SHARPNESS).sum(dim=1)
        turned = self.bones + sideways * (1 + excess).pow(-1 / SHARPNESS)[:, None, None]
        reached = torch.linalg.vector_norm(turned, dim=-1, keepdim=True)
        rigid = turned * (self.lengths / torch.where(reached > 0, reached, torch.ones_like(reached)))
        return torch.einsum("ij,tjd->tid", self.above, torch.where(free, turned, rigid))


@dataclass(frozen=True, eq=False)
class _Splines:
    """Uniform cubic B-splines over time: the first of the four knots that matter to each frame, and their weights."""

    first: Tensor  # (T,)
    weights: Tensor  # (T, 4)

    @classmethod
    def of(cls, motion: Motion) -> "_Splines":
        """The splines at a motion's frames."""
        place = torch.arange(motion.n_frames, dtype=torch.float64) / (motion.fps * KNOT)
        first = place.floor()
        x = place - first
        weights = [(1 - x) ** 3, 3 * x**3 - 6 * x**2 + 4, -3 * x**3 + 3 * x**2 + 3 * x + 1, x**3]
        return cls(first.long(), torch.stack(weights, dim=1) / 6)

    def free(self, motion: Motion) -> Tensor:
        """(K, 1, 1), 1 for the knots that may move: 0 for those that matter to a frame that is not valid."""
        free = torch.ones(int(self.first[-1]) + 4, 1, 1, dtype=torch.float64)
        free[self.first[torch.tensor(~motion.valid)][:, None] + torch.arange(4)] = 0.0
        return free

    def at(self, knots: Tensor) -> Tensor:
        """(T, J, D) values at the frames, of knots (K, J, D)."""
        parts = [knots[self.first + place] * self.weights[:, place, None, None] for place in range(4)]
        return torch.stack(parts).sum(dim=0)


def _search(
    motion: Motion, music: BeatTrack, params: HarmonyParams, reach: float, turns: Iterable[int], steps: int, seed: int
) -> Iterator[Tensor]:
    """Knots (K, J, D) after every sixth part of the steps."""
    stride = max(1, int(motion.fps // RATE))
    sparse = Motion(motion.positions[::stride], motion.fps / stride, motion.skeleton, motion.valid[::stride])
    body, splines = _Body.of(sparse), _Splines.of(sparse)
    free = _Splines.of(motion).free(motion)
    shape, generator = (len(free), *motion.positions.shape[1:]), torch.Generator().manual_seed(int(seed))
    knots = (FIRST_MOVE * reach * torch.randn(shape, generator=generator, dtype=torch.float64) * free).requires_grad_()
    knots.register_hook(free.mul)
    adam = torch.optim.Adam([knots], lr=RATE_OF_STEPS * reach)
    for step in turns:
        adam.zero_grad()
        positions = body.moved(splines.at(knots), reach)
        _loss(positions, sparse, music, reach, anneal(step, steps, *SOFTNESS), params).backward()
        adam.step()
        if (step + 1) * LOOKS // steps > step * LOOKS // steps:
            yield knots.detach().clone()


def _loss(places: Tensor, motion: Motion, music: BeatTrack, reach: float, tau: float, params: HarmonyParams) -> Tensor:
    """-h_cc, mean squared distance in reaches, jerk above that of the motion, and feet that slide more than in it."""
    moved, before, valid = places[None], torch.tensor(motion.positions)[None], torch.tensor(motion.valid)[None]
    times, strengths = torch.tensor(music.times)[None], torch.tensor(music.strengths)[None]
    real, frames = torch.ones_like(times), torch.ones_like(valid)
    first = None if music.bar_places is None else torch.tensor([first_place(music.bar_places)])
    soft = soft_harmony(moved, times, strengths, real, valid, fps=motion.fps, tau=tau, params=params, bar_places=first)
    loss = -soft.above_chance.sum() + DISTANCE_WEIGHT * (moved - before).square().sum(dim=-1).mean() / reach**2
    loss = loss + JERK_WEIGHT * jerk_loss(moved, before, frames, fps=motion.fps)
    if feet := _feet(motion):
        loss = loss + FOOT_WEIGHT * foot_loss(moved, before, frames, feet=feet, fps=motion.fps)
    return loss


def _feet(motion: Motion) -> list[int]:
    """Joints that come near the floor; none in a flat picture."""
    if motion.positions.shape[2] < 3:
        return []
    lowest = motion.positions[..., 1].min(axis=0)
    return np.flatnonzero(lowest <= lowest.min() + FOOT_HEIGHT).tolist()


def _above_chance(motion: Motion, music: BeatTrack, params: HarmonyParams) -> float:
    """The hard score of a motion, above chance; that of the place test where too little can be judged."""
    score = score_motion(music, motion, params=params, n_rotations=0)
    if score.judgement is None:
        return score.harmony_above_chance
    place = _place(score.judgement)
    return -1.0 if place is None else place.harmony_above_chance


def _aim(motion: Motion, music: BeatTrack, params: HarmonyParams) -> HarmonyParams:
    """The params with a pattern: without one, a rest or a hit on the beat, whichever is nearer."""
    if params.measure != "shape" or params.pattern is not None:
        return params
    readings = [replace(params, pattern=HOW_PATTERNS[name]) for name in ("rest", "hit")]
    judgements = [score_motion(music, motion, params=each, n_rotations=0).judgement for each in readings]
    places = [None if judgement is None else _place(judgement) for judgement in judgements]
    return readings[int(np.argmin([np.inf if place is None else abs(place.lag) for place in places]))]


def _place(judgement: Judgement) -> PlaceTest | None:
    """The place test of a judgement, also where beats are too few to judge; None below the floor of movement."""
    signal, beats, pattern = judgement.signal, judgement.beats, judgement.pattern
    if judgement.place is not None or signal is None or pattern is None:
        return judgement.place
    is_little = signal.pulse < LEAST_PULSE or len(beats) <= pattern.beats
    return None if is_little else place_test(signal, beats.times, beats.bar_places, pattern)
