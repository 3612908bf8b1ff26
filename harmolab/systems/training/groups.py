"""Motion groups of recordings, so that no movement is in both training and test.

The recordings reuse choreography, so a random split of clips leaks. A motion group is an annotated figure, or, without
annotation, all stretches between splices whose motion is nearly the same. Stretches are compared after each was
brought to the same number of poses, so that a figure danced faster is still that figure.
"""

import itertools
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from harmolab.data.recordings import Recording, true_runs
from harmolab.systems.training.motion_code import encode_motion
from harmolab.types import FloatArray, IntArray, Motion, SingleArray

# Mean distance of the joints, metres, below which two stretches are the same movement. In the beat-locked recordings
# 98 % of the pairs that repeat a unit lie below it and none of two figures; most copies in Tang's lie below .02.
NEAR = 0.06
N_POSES = 24  # that a stretch is compared by
SHORTEST = 0.5  # seconds; a shorter stretch is joined with the next
# A recording may be a part of another. Three seconds of a part lie .023 m from the whole at most (by poses 15 times a
# second, at other moments), and .037 at least from other takes of the same salsa by the same two dancers.
COPIED, EXCERPT, RATE = 0.03, 3.0, 15.0  # metres, seconds, hertz


class Segment(NamedTuple):
    """A span of audio time, seconds, and its label: the motion group danced in it."""

    start: float
    end: float
    group: str


class Outline(NamedTuple):
    """The poses of a recording that its motion groups are found from.

    Parameters
    ----------
    name : str, corpus folder and folder of the recording
    dance : str
    edges : (S + 1,) array, seconds of audio time, of S stretches
    figures : tuple of S str, "" where none is annotated
    poses : (S, 24, 3 J) array, metres, single precision: joints in a canonical heading
    whole : (T, 3 J) array, the same at `RATE` of a recording of one stretch without a figure; no rows of others
    """

    name: str
    dance: str
    edges: FloatArray
    figures: tuple[str, ...]
    poses: SingleArray
    whole: SingleArray


def motion_groups(recordings: Iterable[Recording]) -> list[list[Segment]]:
    """The labelled segments of every recording, in order and without gaps.

    Figures of `beats.json` are groups. Without them the motion is cut where it is spliced (`Motion.valid` is False),
    and near-duplicates share a group: that of a figure where one is near, else one of its own, "<dance> <number>". So
    do whole recordings that overlap, as a take and a part of it.

    Raises
    ------
    ValueError
        If a recording has no motion in three dimensions.
    """
    return group_outlines([outline(recording) for recording in recordings])


def outline(recording: Recording) -> Outline:
    """The outline of one recording, so that the recording itself need not be kept.

    Raises
    ------
    ValueError
        If it has no motion in three dimensions.
    """
    clip, motion = recording.clip, motion_in_space(recording)
    edges, figures = _annotated_stretches(recording, motion)
    if not figures:
        edges = clip.offset + _between_splices(motion)
        figures = ("",) * (len(edges) - 1)
    local = encode_motion(motion.positions, motion.fps, motion.skeleton)[:, :-3]
    at = np.arange(0, motion.n_frames - 0.5, motion.fps / RATE).round().astype(np.int64)
    whole = local[at] if figures == ("",) else local[:0]
    poses = _poses(local, motion, edges - clip.offset)
    return Outline(sequence_name(recording.folder), clip.dance, edges, figures, poses, whole)


def motion_in_space(recording: Recording) -> Motion:
    """The motion of a recording; ValueError without one in three dimensions."""
    motion = recording.clip.motion
    if motion is None or motion.positions.shape[2] != 3:
        raise ValueError(f"{recording.folder}: needs a motion in three dimensions")
    return motion


def sequence_name(folder: Path) -> str:
    """Corpus folder and folder of a recording."""
    return f"{folder.resolve().parent.name}/{folder.resolve().name}"


def _annotated_stretches(recording: Recording, motion: Motion) -> tuple[FloatArray, tuple[str, ...]]:
    """Edges and figures of the annotated units; each lasts to the next, the first and last to the motion's ends."""
    start, end = recording.clip.offset, recording.clip.offset + motion.duration
    units = recording.annotation.units if recording.annotation else ()
    inside = sorted((unit for unit in units if unit.start < end and unit.end > start), key=lambda unit: unit.start)
    edges = np.array([start, *(unit.start for unit in inside[1:]), end])
    return edges, tuple(unit.figure or unit.name for unit in inside)


def _between_splices(motion: Motion) -> FloatArray:
    """Edges, seconds from frame 0, of the stretches between the middles of splices; ends of the motion included."""
    edges = [0.0]
    for first, last in true_runs(~motion.valid):
        middle = (first + last) / 2 / motion.fps
        if middle - edges[-1] >= SHORTEST and motion.duration - middle >= SHORTEST:
            edges.append(middle)
    return np.array([*edges, motion.duration])


def _poses(local: SingleArray, motion: Motion, edges: FloatArray) -> SingleArray:
    """`N_POSES` poses of each stretch, evenly in time, (S, N_POSES, 3 J); the lowest point is at 0 on average."""
    starts, ends = edges[:-1, None], edges[1:, None]
    at = (starts + (ends - starts) * (np.arange(N_POSES) + 0.5) / N_POSES) * motion.fps
    at = np.minimum(at, motion.n_frames - 1)
    left = np.minimum(at.astype(np.int64), motion.n_frames - 2)
    poses = local[left] + (at - left)[..., None].astype(np.float32) * (local[left + 1] - local[left])
    floor = poses[..., 1::3].min(axis=2).mean(axis=1)
    poses[..., 1::3] -= floor[:, None, None]
    return poses


def group_outlines(outlines: Sequence[Outline]) -> list[list[Segment]]:
    """The motion groups of recordings given by their outlines; see `motion_groups`.

    Raises
    ------
    ValueError
        If stretches without a figure are to be compared, and the bodies differ.
    """
    names = iter(_group_names(outlines))
    return [
        [Segment(start, end, next(names)) for start, end in itertools.pairwise(item.edges.tolist())]
        for item in outlines
    ]


def _group_names(outlines: Sequence[Outline]) -> list[str]:
    """The group of every stretch, recording by recording."""
    groups = [figure for item in outlines for figure in item.figures]
    if all(groups):
        return groups
    widths = {item.poses.shape[2] for item in outlines}
    if len(widths) > 1:
        raise ValueError(
            f"motions of {' and '.join(str(width // 3) for width in sorted(widths))} joints have no figures "
            "that could be compared"
        )
    dances = [item.dance for item in outlines for _ in item.figures]
    poses = np.concatenate([item.poses for item in outlines])
    nameless = np.array([not figure for figure in groups])
    free, named = np.flatnonzero(nameless), np.flatnonzero(~nameless)
    count = 0
    for cluster in _clusters(poses[free], np.searchsorted(free, _overlapping(outlines))):
        members = free[cluster]
        figure = _nearest(poses[members], poses[named])
        count += figure is None
        name = f"{dances[members[0]] or 'movement'} {count}" if figure is None else groups[named[figure]]
        for member in members:
            groups[member] = name
    return groups


def _overlapping(outlines: Sequence[Outline]) -> IntArray:
    """Pairs (P, 2) of stretches, recordings whole, of which one begins or ends in the other, or has its middle there.

    Only excerpts that move are looked for, since many recordings begin and end by standing.
    """
    length, rows = round(EXCERPT * RATE), np.cumsum([0, *(len(item.figures) for item in outlines)]).tolist()
    wholes = [(row, item.whole) for row, item in zip(rows, outlines, strict=False) if len(item.whole) >= length]
    if not wholes:
        return np.zeros((0, 2), np.int64)
    windows = [(row, window) for row, whole in wholes for window in sliding_window_view(whole, length, axis=0)]
    tree, pairs = cKDTree([window.mean(axis=1) for _, window in windows]), []
    for row, whole in wholes:
        for first in (0, (len(whole) - length) // 2, len(whole) - length):
            excerpt = whole[first : first + length].T
            mean = excerpt.mean(axis=1)
            if not _is_near(excerpt, mean[:, None]):
                near = tree.query_ball_point(mean, COPIED * (len(mean) / 3) ** 0.5)
                pairs += [(row, windows[at][0]) for at in near if _is_near(excerpt, windows[at][1])]
    return np.array(pairs, np.int64).reshape(-1, 2)


def _is_near(one: SingleArray, other: SingleArray) -> bool:
    """True where poses (3 J, T) are apart by less than `COPIED`, root mean square over joints and time."""
    return bool(np.square(one - other).mean() * 3 < COPIED**2)


def _clusters(poses: SingleArray, others: IntArray) -> list[IntArray]:
    """Indices of stretches (S, K, 3 J) joined by chains of near-duplicates and of `others` (P, 2), by their first."""
    rows = [np.flatnonzero(_distances(one, poses) < NEAR) for one in poses]
    near = np.repeat(np.arange(len(rows)), [row.size for row in rows]), np.concatenate(rows)
    first, second = (np.concatenate(each) for each in zip(near, others.T, strict=True))
    links = coo_array((np.ones(first.size, dtype=bool), (first, second)), shape=(len(rows), len(rows)))
    labels = connected_components(links, directed=False)[1]
    return [np.flatnonzero(labels == label) for label in dict.fromkeys(labels.tolist())]


def _nearest(members: SingleArray, named: SingleArray) -> int | None:
    """Index of the named stretch closest to any of `members`; None when none is near."""
    if not len(named):
        return None
    table = np.array([_distances(one, named) for one in members])
    return int(table.min(axis=0).argmin()) if table.min() < NEAR else None


def _distances(one: SingleArray, many: SingleArray) -> FloatArray:
    """Mean distance of the joints between one stretch (K, 3 J) and each of (S, K, 3 J), metres; (S,) array.

    The smallest of three: as they are, and either one pose ahead, since splices are not placed to the frame.
    """
    # Mean poses further apart than that cannot belong to near-duplicates, and most pairs need no closer look.
    close = _joint_distances(many.mean(axis=1) - one.mean(axis=0)).mean(axis=1) < 2 * NEAR
    near = many[close]
    pairs = ((near, one), (near[:, 1:], one[:-1]), (near[:, :-1], one[1:]))
    distances = np.full(len(many), np.inf)
    distances[close] = np.min([_joint_distances(other - this).mean(axis=(1, 2)) for other, this in pairs], axis=0)
    return distances


def _joint_distances(steps: SingleArray) -> SingleArray:
    """Lengths of the joints' displacements: (..., 3 J) to (..., J)."""
    parted = steps.reshape(*steps.shape[:-1], steps.shape[-1] // 3, 3)
    return np.sqrt(np.einsum("...d,...d->...", parted, parted))
