"""The evaluation in memory: from the dances of a training loop to the numbers of `harmolab evaluate`."""

import json
import math
import os
from collections import Counter
from collections.abc import Iterable, Sequence
from copy import copy
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from harmolab.body.skeletons import Skeleton
from harmolab.data.oddities import brief_text, faults_of
from harmolab.files import PathLike, named_faults
from harmolab.lab.evaluate import measured
from harmolab.lab.evaluate.measured import NUMBERS, Dance, dance_numbers, motion_features
from harmolab.lab.evaluate.pairing import GENERATED, RECORDED
from harmolab.lab.evaluate.reference import Reference, load_reference
from harmolab.lab.evaluate.rows import Row, limits_of, skeleton_digest
from harmolab.lab.evaluate.sets import LEAST, Collected, feature_cells, feature_names, set_numbers
from harmolab.metrics.likeness import SHORTEST
from harmolab.params import DANCE_PATTERNS
from harmolab.readers.array_files import SKELETONS, steady_skeleton
from harmolab.score import check_whole
from harmolab.types import BeatTrack, Motion
from harmolab.verdict.evidence import FEWEST_BEATS

if TYPE_CHECKING:
    from torchmetrics import Metric

Positions = Any  # (T, J, 3) array or tensor, metres, y up; or a Motion
ReferenceLike = Reference | PathLike | Sequence[Positions] | None


def evaluate(
    motions: Iterable[Positions],
    beats: Iterable[Any],
    *,
    reference: ReferenceLike = None,
    fps: float | None = None,
    skeleton: Skeleton | None = None,
    songs: Sequence[str] | None = None,
    seeds: Sequence[str | int] | None = None,
    dances: Sequence[str] | None = None,
    seed: int = 0,
) -> dict[str, Any]:
    """Numbers of generated dances in memory: harmony, beats, jerk, sliding, likeness, Fréchet distances.

    They are those that `harmolab evaluate` has for one system. In a training loop take `DanceMetric`, batch by batch.

    Parameters
    ----------
    motions : N dances
        Motions, or (T, J, 3) arrays or tensors of joint positions, metres, y up. One array (N, T, J, 3) will do.
    beats : N times the beats of the music
        BeatTracks on the time line of each motion, or arrays of seconds. Beats of an array count alike, so that
        "paper_harmony", which weighs them by their strengths, is another number than with tracked beats.
    reference : recorded dances, or None
        For Fréchet distances, diversity and the limits of likeness: a list of motions, a file that `harmolab evaluate`
        has saved (--save-reference), or "synthetic", the file that comes with harmolab. With None there are neither
        distances nor diversity, and likeness has the limits that come with harmolab (`LikenessLimits.recorded`).
    fps : float, frames per second
        Needed for arrays.
    skeleton : Skeleton
        Of arrays. Without one, 17 joints are taken for COCO, 22 and 24 for SMPL.
    songs : N names
        Dances to one song are averaged first. When left out, each dance has a song of its own.
    seeds : N names of the draws or trainings
    dances : N names of dances
        Such as "waltz", for harmony by the bar pattern of the dance.
    seed : int
        Of the splits behind the correction of distances.

    Returns
    -------
    dict
        Name of a measure -> its mean over songs, or its number for the set; NaN where it cannot be measured. "remarks"
        -> list of the reasons, in sentences.

    Raises
    ------
    FileNotFoundError
        If there is no file of the name that `reference` has.
    ValueError
        If a motion has a gradient, no frame rate, a wrong shape, or no two frames at 15 a second, or its beats are not
        on its time line; the message names which. If `reference` holds no recorded dances, or `seed` is no whole number
        from 0 on.

    Examples
    --------
    >>> from harmolab import synthetic_clip
    >>> clips = [synthetic_clip("jive", seconds=5.0, seed=seed) for seed in (1, 2)]
    >>> numbers = evaluate([clip.motion for clip in clips], [clip.beats for clip in clips])
    >>> numbers["beat_align_motion"] > 0.6, numbers["harmony"]
    (True, nan)
    >>> numbers["remarks"][0]  # doctest: +ELLIPSIS
    'harmony of 2 of 2 dances is NaN: it needs 16 beats of the music, some 8 s, and a body that moves; ...'
    """
    metric = DanceMetric(reference, fps=fps, skeleton=skeleton, seed=seed)
    metric.update(motions, beats, songs=songs, seeds=seeds, dances=dances)
    return {**metric.compute(), "remarks": list(metric.remarks)}


class DanceMetric:
    """The numbers of `evaluate` in a training loop: `update` with each batch, `compute` at the end, then `reset`.

    Dances are measured on the CPU, in double precision and without gradients; as a loss take `soft_harmony`.
    `merge_state` joins what other processes measured, in any order: the numbers are those of one process.
    `DanceMetric.torchmetrics` makes a `torchmetrics.Metric`, which joins processes by itself.

    Parameters
    ----------
    reference, fps, skeleton, seed : as in `evaluate`

    Examples
    --------
    >>> from harmolab import synthetic_clip
    >>> clip = synthetic_clip("jive", seconds=5.0, seed=1)
    >>> metric = DanceMetric()
    >>> metric.update([clip.motion], [clip.beats])
    >>> metric.compute()["beat_align_motion"] > 0.6
    True
    """

    def __init__(
        self,
        reference: ReferenceLike = None,
        *,
        fps: float | None = None,
        skeleton: Skeleton | None = None,
        seed: int = 0,
    ) -> None:
        check_whole(seed=seed)
        self.fps, self.skeleton, self.seed = fps, skeleton, seed
        self.pose_net = measured.shipped_pose_net()
        self.reference = self._as_reference(reference)
        self.rows: list[Row] = []

    def _as_reference(self, reference: ReferenceLike) -> Reference | None:
        if reference is None:
            return None
        if not isinstance(reference, Reference | str | os.PathLike):
            with named_faults("reference"):
                return reference_of(_motions(reference, self.fps, self.skeleton), pose_net=self.pose_net)
        saved = reference if isinstance(reference, Reference) else load_reference(reference)
        return saved.for_pose_net(measured.weights_digest(self.pose_net))

    def update(
        self,
        motions: Iterable[Positions],
        beats: Iterable[Any],
        *,
        songs: Sequence[str] | None = None,
        seeds: Sequence[str | int] | None = None,
        dances: Sequence[str] | None = None,
    ) -> None:
        """Measure the dances of a batch. Parameters and errors are those of `evaluate`; a batch counts whole or not."""
        bodies = _motions(motions, self.fps, self.skeleton)
        tracks = _tracks(beats, bodies)
        named: dict[str, list[str]] = {}
        for name, words in {"songs": songs, "seeds": seeds, "dances": dances}.items():
            each = words if words is not None and len(words) else [""] * len(bodies)
            # A number of a tensor prints with its device, which is another one in each process.
            each = [word.item() if hasattr(word, "item") else word for word in each]
            named[name] = ["" if pd.isna(word) else str(word) for word in each]
            if len(each) != len(bodies):
                raise ValueError(f"{name} must have one entry a dance ({len(bodies)}), got {len(each)}")
        limits = None if self.reference is None else self.reference.limits
        rows = []
        for place, (motion, music, song, seed, dance) in enumerate(zip(bodies, tracks, *named.values(), strict=True)):
            with named_faults(f"motions[{place}]"):
                rows.append(self._row(Dance(GENERATED, song, motion, music, seed, dance, limits)))
        self.rows += rows

    def _row(self, dance: Dance) -> Row:
        """A dance as a row of the table of clips; its features only where there are some to compare them with."""
        kinds = [] if self.reference is None else feature_names(self.reference.features)
        return {
            "system": GENERATED, "seed": str(dance.seed), "song": dance.song, "kind": GENERATED, "error": "",
            "skeleton": skeleton_digest(dance.motion), "music_beats": len(dance.music),
            "odd": brief_text(faults_of(dance.motion)), "dance": dance.dance,
            **dance_numbers(dance, NUMBERS), **feature_cells(motion_features(dance.motion, self.pose_net, kinds)),
        }  # fmt: skip

    def compute(self) -> dict[str, float]:
        """Name of a measure -> its mean over songs, or its number for the set; NaN where it cannot be measured.

        Raises
        ------
        ValueError
            If nothing was measured yet.
        """
        collected = self._collected()
        means = collected.song_means.mean()
        numbers = {name: float(means[name]) for name in measured.MEASURES}
        if self.reference is None:
            return numbers
        features = {RECORDED: self.reference.features, GENERATED: collected.features[GENERATED]}
        sets = set_numbers(features, seed=self.seed)
        return numbers | {name: one.value for (system, name), one in sets.items() if system == GENERATED}

    def _collected(self) -> Collected:
        if not self.rows:
            raise ValueError("nothing was measured yet; call update with dances and their beats first")
        # In an order that does not depend on which process measured which.
        ordered = sorted(self.rows, key=lambda row: (row["seed"], row["song"], json.dumps(row)))
        collected = Collected()
        # A dance whose song has no name has one of its own, which no process could have given it.
        rows = ((f"{place:09d}", row) for place, row in enumerate(ordered))
        collected.add(pd.DataFrame({"key": name, **row, "song": row["song"] or f"dance {name}"} for name, row in rows))
        return collected

    @property
    def remarks(self) -> tuple[str, ...]:
        """Sentences on dances whose numbers mean little, such as a body on its side, and on what is NaN or missing.

        Of the numbers of single dances they name harmony, likeness and foot_skating.
        """
        return tuple(_remarks(self.rows, self.reference))

    def reset(self) -> None:
        """Forget all dances."""
        self.rows = []

    def merge_state(self, other: "DanceMetric | Iterable[Row]") -> None:
        """Take in the dances of a metric of another process, or its `rows`, which can be sent from there.

        Raises
        ------
        ValueError
            For anything else, such as a list of metrics.
        """
        rows = list(other.rows if isinstance(other, DanceMetric) else other)
        if not all(isinstance(row, dict) for row in rows):
            raise ValueError("one DanceMetric is needed, or the rows of one; merge several one by one")
        self.rows = [*self.rows, *rows]

    def torchmetrics(self) -> "Metric":
        """A `torchmetrics.Metric` of the same settings, which gathers the dances of all processes in `compute`.

        Raises
        ------
        ValueError
            If torchmetrics is not installed.
        """
        try:
            from harmolab.lab.evaluate.torch_metric import TorchDanceMetric
        except ModuleNotFoundError as error:
            raise ValueError(f"this needs {error.name}; run: pip install torchmetrics") from None
        return TorchDanceMetric(copy(self))


def reference_of(motions: Sequence[Motion], *, pose_net: Path | None = None) -> Reference:
    """The reference that recorded dances in memory are: their features, and their limits of likeness."""
    rows = [
        {"key": f"{place:09d}", "error": "", "system": RECORDED, "seed": "", "song": f"{place:09d}", "kind": RECORDED,
         "skeleton": skeleton_digest(motion), **feature_cells(motion_features(motion, pose_net))}
        for place, motion in enumerate(motions)
    ]  # fmt: skip
    if not rows:
        raise ValueError("the reference holds no motion")
    return Reference(pd.DataFrame(rows), limits_of(motions), pose_net=measured.weights_digest(pose_net))


def _motions(values: Iterable[Positions], fps: float | None, skeleton: Skeleton | None) -> list[Motion]:
    """The motions of a batch; ValueError that names the first that is none."""
    if not isinstance(values, Iterable) or getattr(values, "ndim", 4) == 3:
        kind = type(values).__name__
        raise ValueError(f"motions are several dances: put the one that there is into a list; got {kind}")
    return [_motion(value, f"motions[{place}]", fps, skeleton) for place, value in enumerate(values)]


def _motion(value: Positions, name: str, fps: float | None, skeleton: Skeleton | None) -> Motion:
    if isinstance(value, Motion):
        return value
    positions = _array(value, name)
    if positions.dtype.kind in "OU":
        raise ValueError(f"{name} must be a Motion or an array of joint positions, got {type(value).__name__}")
    if fps is None:
        raise ValueError(f"{name} is an array, which has no frame rate: pass fps, such as fps=30.0")
    with named_faults(name):
        if positions.ndim != 3:
            raise ValueError(f"positions must be (frames, joints, 3), got shape {positions.shape}")
        joints = positions.shape[1]
        if skeleton is None and joints not in SKELETONS:
            raise ValueError(f"has {joints} joints: pass skeleton=harmolab.Skeleton(names, parents)")
        return Motion(positions, fps, skeleton or steady_skeleton(positions.astype(np.float64))[0])


def _array(value: Any, name: str) -> NDArray[Any]:
    """An array as it is, or a tensor in double precision, on the CPU; ValueError for a tensor with a gradient."""
    if getattr(value, "requires_grad", False):
        raise ValueError(f"{name} is a tensor with a gradient: pass {name}.detach(); a loss is harmolab.soft_harmony")
    if hasattr(value, "detach"):
        value = value.detach().cpu().double().numpy()  # bfloat16 has no kind of numpy's
    with named_faults(name):
        return np.asanyarray(value)  # the record that it goes into refuses masked, complex and other entries


def _tracks(beats: Iterable[Any], motions: Sequence[Motion]) -> list[BeatTrack]:
    """The beats of each motion, on its time line and no longer than it; ValueError that names the first that fails."""
    if not isinstance(beats, Iterable):
        raise ValueError(f"beats are those of several dances: one entry a dance in a list; got {type(beats).__name__}")
    tracks = list(beats)
    if len(tracks) != len(motions):
        raise ValueError(f"beats must have one entry a dance ({len(motions)}), got {len(tracks)}")
    return [_track(value, f"beats[{place}]", motions[place]) for place, value in enumerate(tracks)]


def _track(value: Any, name: str, motion: Motion) -> BeatTrack:
    if isinstance(value, BeatTrack):
        is_longer = value.duration > motion.duration + 1 / motion.fps
        return value.span(0.0, motion.duration) if is_longer else value
    if getattr(getattr(value, "dtype", None), "itemsize", 4) < 4:
        raise ValueError(f"{name} are of {value.dtype}: one at 30 s would be up to 60 ms off; pass seconds of 32 bits")
    times = _array(value, name).ravel()
    with named_faults(name):
        return BeatTrack(times, np.ones(times.size), motion.fps, motion.duration)


def _remarks(rows: Sequence[Row], reference: Reference | None) -> Iterable[str]:
    """Sentences on faults of dances, on what is NaN in rows, and on the numbers of sets that are missing."""
    for fault, count in Counter(row["odd"] for row in rows if row["odd"]).items():
        yield f"The numbers of {count} of {len(rows)} dances mean little: {fault}. Places are in metres, y up."
    beats = max((int(row["music_beats"]) for row in rows), default=0)
    reasons = {
        "harmony": f"it needs {FEWEST_BEATS} beats of the music, some 8 s, and a body that moves; the most beats of a "
        f"dance here are {beats}",
        "likeness": f"it needs {SHORTEST:g} s of movement in three dimensions, of joints with names",
        "foot_skating": "it needs three dimensions, and a joint that is called a foot or an ankle",
    }
    for name, reason in reasons.items():
        if count := sum(math.isnan(float(row[name])) for row in rows):
            yield f"{name} of {count} of {len(rows)} dances is NaN: {reason}."
    for kind, count in Counter(row["dance"] for row in rows if row["dance"] not in ("", *DANCE_PATTERNS)).items():
        yield f"harmony_dance of {count} of {len(rows)} dances is NaN: {kind!r} is none of {', '.join(DANCE_PATTERNS)}."
    if reference is None or not rows:
        return
    recorded = reference.features
    if min(len(rows), len(recorded)) < LEAST:
        yield f"There is no Fréchet distance: it needs {LEAST} dances on either side."
    if not {row["skeleton"] for row in rows} & set(recorded["skeleton"]):
        yield "There is no Fréchet distance on kinetic features: the joints are not those of the reference."
