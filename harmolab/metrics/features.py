"""Features of a motion, one vector a dance, and numbers of sets of dances: Fréchet distance, diversity, multimodality.

*Kinetic features* say how much energy each joint has and spends (Onuma et al. 2008), in the order and with the windows
of AIST++ (Li et al. 2021), whose code took them from fairmotion. Masses are left out, so energies are squared speeds.

*Geometric features* say how often 32 things are true of the body, such as "the right hand moves forward" or "the left
knee is bent" (Müller et al. 2005). Each is a relation between points of the body that is true or false at a moment. The
tables have points, directions and thresholds (Müller and Röder 2006); those of "aist++" are as AIST++'s code has them.

The *Fréchet distance* of their features says how unlike two sets of dances are as wholes (FID). *Diversity* is the
variety of one set, *multimodality* that of the dances to one song.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from types import MappingProxyType
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.distance import pdist

from harmolab.body.skeletons import Skeleton, named_joints
from harmolab.metrics.quality import Sampled, sampled
from harmolab.score import check_whole
from harmolab.types import BoolArray, FloatArray, IntArray, Motion, frozen_array

# Kinetic features (Onuma et al. 2008)

AIST_FPS = 60.0  # hertz; windows and differences of AIST++ are so many frames of this rate
_BEFORE, _AFTER = 3, 2  # sixtieths before and after a moment that its window of five steps reaches


def _dense(motion: Motion, form: str) -> Sampled:
    """`motion` at the lowest multiple of 60 fps that loses no frames; errors of `sampled`, and for another form."""
    if form not in ("fixed", "aist++"):
        raise ValueError(f"form must be fixed or aist++, got {form!r}")
    return sampled(motion, 1 / AIST_FPS, steps=2)


def kinetic_features(motion: Motion, *, form: Literal["fixed", "aist++"] = "fixed") -> FloatArray:
    """Horizontal energy, vertical energy and energy expenditure of every joint, in this order, joint after joint.

    Velocity and acceleration are means over five steps of 1/60 s around each frame (fewer at the ends). The energies
    are the mean squares over time of the horizontal and of the vertical velocity (m^2/s^2); the expenditure is the mean
    length of the acceleration (m/s^2). Frames whose window is not valid do not count.

    Parameters
    ----------
    motion : Motion, three-dimensional, y up
        Other rates than 60 frames per second are brought to a multiple of it, so that the features do not show them.
    form : "fixed" or "aist++"
        The published code (fairmotion, copied by AIST++, Bailando and others) divides by the time step too early: the
        first velocity of each acceleration is p(t) - p(t - 1) / dt where it should be (p(t) - p(t - 1)) / dt.
        What it calls an acceleration is therefore a + p (1 / dt^2 - 1 / dt): at 60 frames per second 3540 times the
        place of the joint, which no real acceleration comes near. A third of its features depend on where in the room
        the dancer was, and published distances on kinetic features hang on it. "aist++" does the same, to compare with
        those. Reported as google-research/mint issue 62, facebookresearch/fairmotion pull request 87 and
        google/aistplusplus_api pull request 33.

    Returns
    -------
    (3 J,) array

    Raises
    ------
    ValueError
        If the motion is two-dimensional, too short or nowhere valid, or `form` is another word.
    """
    dense = _dense(motion, form)
    positions, stride = dense.positions, dense.stride
    weights = _weights(dense)
    step = 1 / AIST_FPS
    moved, steps = _over_window(positions, len(positions), stride)
    moved *= moved
    energy = (weights / (steps * step) ** 2 @ moved.reshape(len(moved), -1)).reshape(-1, 3)
    # The mean of five second differences is the last first difference less the first one.
    gained, steps = _over_window(positions[stride:] - positions[:-stride], len(positions), stride)
    if form == "aist++":
        gained += ((1 - step) * steps)[:, None, None] * _mean_places(positions, stride)
    gained *= gained
    # A product with a matrix: numpy's own sums over three numbers take three times as long.
    lengths = np.sqrt(gained.reshape(-1, 3) @ np.ones(3)).reshape(len(gained), -1)
    spent = weights / (steps * step**2) @ lengths
    return np.column_stack([energy[:, 0] + energy[:, 2], energy[:, 1], spent]).ravel()


def _over_window(series: FloatArray, n_frames: int, stride: int) -> tuple[FloatArray, FloatArray]:
    """The gain of a (S, J, 3) series over the window of each frame from `stride` on, and the window's sixtieths.

    Both ends of a window stay within the series, the first entry of which belongs to frame 0.
    """
    first, last = _window_ends(n_frames, stride, 0, len(series) - 1)
    gain = np.empty((len(first), *series.shape[1:]))
    reach = (_BEFORE + _AFTER) * stride
    full = slice((_BEFORE - 1) * stride, max(len(series) - _BEFORE * stride, (_BEFORE - 1) * stride))
    # Whole windows by slices, which copy nothing; only those at the ends one by one.
    np.subtract(series[reach:], series[:-reach], out=gain[full])
    ends = np.delete(np.arange(len(first)), full)
    gain[ends] = series[last[ends]] - series[first[ends]]
    return gain, (last - first) / stride


def _window_ends(n_frames: int, stride: int, lowest: int, highest: int) -> tuple[IntArray, IntArray]:
    """First and last frame of the window of each frame from `stride` on, kept within `lowest` and `highest`."""
    moments = np.arange(stride, n_frames)
    return np.maximum(moments - _BEFORE * stride, lowest), np.minimum(moments + _AFTER * stride, highest)


def _mean_places(positions: FloatArray, stride: int) -> FloatArray:
    """Mean of the positions at which a window's second differences are taken, (T - stride, J, 3)."""
    first, last = _window_ends(len(positions), stride, 0, len(positions) - 1 - stride)
    total = np.concatenate([np.zeros_like(positions[:1]), np.cumsum(positions, axis=0)])
    return (total[last + 1] - total[first + stride]) / (last + 1 - first - stride)[:, None, None]


def _weights(dense: Sampled) -> FloatArray:
    """Weight of each frame from `stride` on in means over time: those whose window is valid share 1."""
    first, last = _window_ends(len(dense.valid), dense.stride, 0, len(dense.valid) - 1 - dense.stride)
    invalid = np.concatenate([[0], np.cumsum(~dense.valid)])
    # A second difference needs one more step than a first one.
    usable = invalid[last + dense.stride + 1] == invalid[first]
    if not usable.any():
        raise ValueError("the motion is nowhere valid for 1/12 s, the window of its features")
    return usable / usable.sum()


# Points of the body that geometric features are about, by the names of joints

# Words for a part, the clearest first. BVH files call the shoulder "arm" and the collar bone "shoulder", the
# knee "leg" and the ankle "foot", where SMPL's foot is the ball of the foot. The root of a rig may
# stand where the dancer is not.
_PAIRED = {
    "hip": ("hip", "upleg", "upperleg", "thigh"),
    "knee": ("knee", "leg", "lowerleg", "shin", "calf"),
    "ankle": ("ankle", "foot"),
    "toes": ("toes", "toe", "toebase", "bigtoe", "toe0", "ball", "foot"),
    "shoulder": ("arm", "uparm", "upperarm", "shoulder"),
    "elbow": ("elbow", "forearm", "lowerarm"),
    "wrist": ("wrist", "hand"),
}
_CENTRAL = {
    "root": ("pelvis", "hips", "midhip", "root"),
    "belly": ("belly", "spine", "spine1", "torso", "waist", "spine01"),
    "chest": ("chest", "spine3", "spine2", "spine1", "spine03", "spine02"),
    "neck": ("neck", "neck01"),
}
# Points that lie between others, where no joint is called so; the later may rest on the earlier.
_BETWEEN = {"root": ("lhip", "rhip"), "neck": ("lshoulder", "rshoulder"), "chest": ("belly", "neck")}

BODY_POINTS = (
    *("root", "belly", "chest", "neck", "lhip", "rhip", "lknee", "rknee", "lankle", "rankle", "ltoes", "rtoes"),
    *("lshoulder", "rshoulder", "lelbow", "relbow", "lwrist", "rwrist"),
)


@lru_cache(maxsize=64)
def body_points(skeleton: Skeleton) -> FloatArray:
    """Weights (18, J) that make the points `BODY_POINTS` of the joints of a skeleton; each row's sum is 1.

    Joints are identified by name, in the words of AIST++, SMPL, BVH files, Unreal, 3ds Max, Character Creator and Tang
    et al. (who call a left wrist hand).
    Root, neck and chest are put half way between hips, shoulders, or belly and neck where no joint is called so.

    Raises
    ------
    ValueError
        If points are missing; the message names them.
    """
    rows = {point: np.eye(len(skeleton.joints))[joint] for point, joint in point_joints(skeleton).items()}
    for point, (one, other) in _BETWEEN.items():
        if point not in rows and one in rows and other in rows:
            rows[point] = (rows[one] + rows[other]) / 2
    missing = [point for point in BODY_POINTS if point not in rows]
    if missing:
        raise ValueError(f"no joint is called {', '.join(missing)}, or alike; joints are {', '.join(skeleton.joints)}")
    weights = np.array([rows[point] for point in BODY_POINTS])
    weights.setflags(write=False)
    return weights


def point_joints(skeleton: Skeleton) -> dict[str, int]:
    """The joint of each body point that has one of its own; of several that fit, the first."""
    joints = named_joints(skeleton)
    words = {(side, side[:1] + part): names for part, names in _PAIRED.items() for side in ("left", "right")}
    words |= {("", part): names for part, names in _CENTRAL.items()}
    points: dict[str, int] = {}
    for (side, point), names in words.items():
        fitting = [joints[side, name] for name in names if (side, name) in joints]
        # A foot that stands for the ankle cannot be the toes too, nor a spine both belly and chest.
        free = [joint for joint in fitting if joint not in points.values()]
        if free:
            points[point] = free[0]
    return points


# Frechet distance, diversity and multimodality

SPLITS = 10


@dataclass(frozen=True)
class FrechetResult:
    """A Frechet distance and the sample sizes it rests on.

    Parameters
    ----------
    value : float
        The distance; what small samples add is taken off if that was asked for. Chance can then make it negative.
    n_a, n_b : int
        Number of feature vectors on either side.
    raw : float
        The distance by the formula alone, as papers report it.
    """

    value: float
    n_a: int
    n_b: int
    raw: float


def frechet_distance(
    features_a: ArrayLike, features_b: ArrayLike, *, correct_bias: bool = True, seed: int = 0
) -> FrechetResult:
    """Fréchet distance of two sets of features (FID): how unlike two sets of dances are (Heusel et al. 2017).

    Both sets are taken as normal distributions with the means m and covariances C of the samples:
    ``|m_a - m_b|^2 + tr(C_a + C_b - 2 (C_a C_b)^(1/2))``. 0 is reached by equal distributions.

    Parameters
    ----------
    features_a, features_b : (n, d) and (m, d) arrays
        A row for each dance, such as `harmolab.metrics.features.kinetic_features`. Bring the columns to one scale first
        (`harmolab.metrics.features.standardise`).
    correct_bias : bool
        Whether to take off what small samples add (see the notes).
    seed : int
        Of the splits behind this correction.

    Returns
    -------
    FrechetResult
        `value`, the distance; `raw`, by the formula alone, as papers report it; `n_a` and `n_b`, the numbers of rows.

    Raises
    ------
    ValueError
        If the arrays are not (n, d) and (m, d), hold NaN or infinity, or have fewer than two rows (four with
        `correct_bias`).

    Notes
    -----
    Two samples of one distribution are never 0 apart. The formula gives about c_a / n + c_b / m too much (Chong and
    Forsyth 2020); with few dances that is several times the distances that matter. They extrapolate to infinite
    samples. Here c is measured at each side alone: halves of one sample are about 4 c / n apart, where 0 is the truth.
    So a quarter of their distance, in the mean over ten seeded splits, is the bias of that side. In simulations this
    had as little bias as the extrapolation, and less variance.

    Some bias stays where samples are smaller than about twice the number of features. Clips that overlap are not
    independent: they count as more than they are, and too little is taken off.

    The roots of the eigenvalues of C_a C_b are the singular values of R_a R_b^T, where R are the triangular factors of
    the centred samples. So no matrix is squared or rooted, and covariances may be singular.

    Examples
    --------
    >>> frechet_distance([[0.0], [2.0]], [[3.0], [5.0]], correct_bias=False).raw
    9.0
    """
    check_whole(seed=seed)
    least = 4 if correct_bias else 2
    a, b = _checked(features_a, "features_a", least), _checked(features_b, "features_b", least)
    if a.shape[1] != b.shape[1]:
        raise ValueError(f"features_a and features_b must have the same columns, got {a.shape[1]} and {b.shape[1]}")
    raw = _distance(a, b)
    rng = np.random.default_rng(seed)
    bias = sum(_own_bias(side, rng) for side in (a, b)) if correct_bias else 0.0
    return FrechetResult(raw - bias, len(a), len(b), raw)


def standardise(features: ArrayLike, reference: ArrayLike) -> FloatArray:
    """`features` in units of the reference: each column less the reference's mean, divided by its SD (AIST++).

    A column in which all of the reference agrees keeps its unit, where AIST++ divides by 1e-10. It agrees where its SD
    is a billionth of the largest feature at most: what a joint that does not move has are errors of rounding.

    Parameters
    ----------
    features, reference : (n, d) and (m, d) arrays

    Returns
    -------
    (n, d) array

    Raises
    ------
    ValueError
        As `frechet_distance`; one row each is enough.
    """
    values, model = _checked(features, "features", 1), _checked(reference, "reference", 1)
    if (columns := values.shape[1]) != model.shape[1]:
        raise ValueError(f"features and reference must have the same columns, got {columns} and {model.shape[1]}")
    spread = model.std(axis=0)
    constant = spread <= 1e-9 * np.abs(model).max()
    return (values - model.mean(axis=0)) / np.where(constant, 1.0, spread)


def diversity(features: ArrayLike) -> float:
    """Variety of a set of dances: the mean Euclidean distance between the features of two of them, as AIST++ has it.

    Parameters
    ----------
    features : (n, d) array
        A row for each dance, at least two; all columns on one scale.

    Raises
    ------
    ValueError
        If the array is not (n, d), holds NaN or infinity, or has fewer than two rows.

    Examples
    --------
    >>> diversity([[0.0, 0.0], [3.0, 4.0]])
    5.0
    """
    return float(pdist(_checked(features, "features", 2)).mean())


def multimodality(groups: Sequence[ArrayLike]) -> float:
    """Variety of the dances to one song: `diversity` of each song's own (n_i, d) features, mean over the songs.

    Raises
    ------
    ValueError
        If there is no song, or as `diversity` for any of them.
    """
    if not len(groups):
        raise ValueError("multimodality needs the features of one song at least, got none")
    return float(np.mean([diversity(features) for features in groups]))


def _checked(features: ArrayLike, name: str, least: int) -> FloatArray:
    array = frozen_array(features, name)
    if array.ndim != 2 or array.shape[1] == 0:
        raise ValueError(f"{name} must be (samples, features), got shape {array.shape}")
    if len(array) < least:
        raise ValueError(f"{name} must have at least {least} rows, got {len(array)}")
    return array


def _distance(a: FloatArray, b: FloatArray) -> float:
    means = a.mean(axis=0), b.mean(axis=0)
    pairs = zip((a, b), means, strict=True)
    factors = [np.linalg.qr(side - mean, mode="r") / np.sqrt(len(side) - 1) for side, mean in pairs]
    spread = sum(float((factor**2).sum()) for factor in factors)
    common = float(np.linalg.svd(factors[0] @ factors[1].T, compute_uv=False).sum())
    return max(float(((means[0] - means[1]) ** 2).sum()) + spread - 2 * common, 0.0)


def _own_bias(sample: FloatArray, rng: np.random.Generator) -> float:
    """The part of a distance from this side that its finite size adds."""
    half = len(sample) // 2
    shuffled = [rng.permutation(sample) for _ in range(SPLITS)]
    distance = np.mean([_distance(rows[:half], rows[half : 2 * half]) for rows in shuffled])
    return float(distance) / 2 * half / len(sample)


# Geometric features (Müller et al. 2005)

GEOMETRIC_FEATURES = (
    *("right hand moves forward", "left hand moves forward", "right hand above neck", "left hand above neck"),
    *("right hand moves up", "left hand moves up", "right elbow bent", "left elbow bent"),
    *("hands far apart sideways", "hands approach each other", "right hand leaves root", "left hand leaves root"),
    *("right hand fast", "left hand fast", "right foot behind left leg", "left foot behind right leg"),
    *("right foot raised", "left foot raised", "feet far apart sideways", "right knee bent", "left knee bent"),
    *("right foot fast", "left foot fast", "right upper arm abducted", "left upper arm abducted"),
    *("right thigh abducted", "left thigh abducted", "root behind frontal plane", "spine horizontal"),
    *("right hand low", "left hand low", "root fast"),
)

# Direction: from one point to another, or the normal (b - a) x (c - a) of a plane through three points. Then a vector
# between two points. True where the part of the vector along the direction is beyond the threshold, in upper arms,
# shoulder widths or hip widths of the dancer.
LINES = (
    ("right hand above neck", "chest neck", "neck rwrist", 0.2, "humerus"),
    ("left hand above neck", "chest neck", "neck lwrist", 0.2, "humerus"),
    ("hands far apart sideways", "lshoulder rshoulder", "lwrist rwrist", 2.5, "shoulders"),
    ("feet far apart sideways", "lhip rhip", "lankle rankle", 2.1, "hips"),
)
# The same with a direction and a vector of each form, "fixed" and "aist++", and thresholds in upper arms. What moves
# is compared by the change of the vector in a second.
PLANES = (
    ("right foot behind left leg", ("root lhip ltoes", "root rankle"), ("root ltoes lhip", "root rankle"), 0.38),
    ("left foot behind right leg", ("root rtoes rhip", "root lankle"), ("root rtoes rhip", "root lankle"), 0.38),
    ("root behind frontal plane", ("rankle neck lankle", "rankle root"), ("rankle lankle neck", "rankle root"), 0.5),
)
MOVING = (
    ("right hand moves forward", ("neck rhip lhip", "neck rwrist"), ("neck lhip rhip", "neck rwrist"), 1.8),
    ("left hand moves forward", ("neck rhip lhip", "neck lwrist"), ("neck rhip lhip", "neck lwrist"), 1.8),
    ("right hand moves up", ("belly chest", "chest rwrist"), ("belly chest", "belly chest"), 1.8),
    ("left hand moves up", ("belly chest", "chest lwrist"), ("belly chest", "belly chest"), 1.8),
    ("hands approach each other", ("lwrist rwrist", "rwrist lwrist"), ("lwrist rwrist", "lwrist rwrist"), 1.4),
    ("right hand leaves root", ("rwrist root", "rwrist root"), ("rwrist root", "rwrist lwrist"), 1.4),
    ("left hand leaves root", ("lwrist root", "lwrist root"), ("lwrist root", "lwrist rwrist"), 1.4),
)
# Two vectors, and what the angle between them is above, or, with a minus, below: degrees.
ANGLES = (
    ("right elbow bent", "relbow rshoulder", "relbow rwrist", -110),
    ("left elbow bent", "lelbow lshoulder", "lelbow lwrist", -110),
    ("right knee bent", "rknee rhip", "rknee rankle", -110),
    ("left knee bent", "lknee lhip", "lknee lankle", -110),
    ("right upper arm abducted", "neck root", "rshoulder relbow", 25),
    ("left upper arm abducted", "neck root", "lshoulder lelbow", 25),
    ("right thigh abducted", "neck root", "rhip rknee", 50),
    ("left thigh abducted", "neck root", "lhip lknee", 50),
)
# Point, and its speed in upper arms a second.
FAST = (
    ("right hand fast", "rwrist", 2.5),
    ("left hand fast", "lwrist", 2.5),
    ("right foot fast", "rankle", 2.5),
    ("left foot fast", "lankle", 2.5),
    ("root fast", "root", 2.3),
)
HEIGHT = 1.2  # upper arms above the lowest joint of the moment
RAISED = MappingProxyType({"right foot raised": "rankle", "left foot raised": "lankle"})
LOW = MappingProxyType({"right hand low": "rwrist", "left hand low": "lwrist"})

Points = dict[str, FloatArray]  # name -> (3, T)

# The body of SMPL's mean shape, which AIST++ takes for all dancers.
_AIST_SIZES = {"humerus": 0.2568381092115207, "shoulders": 0.39084835854945527, "hips": 0.11924706586886204}
# AIST++ motion has 60 frames per second; its code divides by the time step of 120, as fairmotion has it.
_AIST_RATE = 120.0
_UPRIGHT = math.cos(math.radians(70.0))  # a spine between 70 and 110 degrees from the vertical is horizontal


def geometric_features(motion: Motion, *, form: Literal["fixed", "aist++"] = "fixed") -> FloatArray:
    """Share of the time that each of the 32 `GEOMETRIC_FEATURES` is true.

    Parameters
    ----------
    motion : Motion, three-dimensional, y up
        With the joints that `body_points` asks for. Other rates than 60 frames per second are brought to a multiple of
        it; velocities are differences over 1/60 s. A moment counts if both its frames are valid.
    form : "fixed" or "aist++"
        The code of AIST++, taken from fairmotion, departs from the features' definitions in five places. "aist++"
        repeats them, to compare with its scores:

        * velocities are divided by 1/120 s in motion of 60 frames per second, so they are twice what they are;
        * a velocity along a line is that of the third point against the first, where it should be that of the fourth
          against the third: "moves up" forgets the hand, "approach" becomes its opposite;
        * a hand that leaves the root is measured by the velocity of the other hand;
        * normals of planes point the wrong way, and for the left side, where left and right have changed places, the
          other way again: the right hand must move backward, the left one forward;
        * thresholds are lengths of SMPL's mean body. "fixed" measures the dancer: medians over time.

        The lowest joint stands for the floor in both.

    Returns
    -------
    (32,) array in [0, 1]

    Raises
    ------
    ValueError
        If joints are missing (the message names them), the motion is two-dimensional, too short or nowhere valid, or
        `form` is another word.
    """
    weights = body_points(motion.skeleton)
    dense = _dense(motion, form)
    # Joints first and frames last, so that all that follows runs along neighbouring numbers.
    joints = np.ascontiguousarray(dense.positions.transpose(1, 2, 0))
    places = (weights @ joints.reshape(len(joints), -1)).reshape(len(weights), 3, -1)
    points = dict(zip(BODY_POINTS, places, strict=True))
    sizes, rate = (_AIST_SIZES, _AIST_RATE) if form == "aist++" else (_measured(points), AIST_FPS)
    now = {name: place[:, dense.stride :] for name, place in points.items()}
    before = {name: place[:, : -dense.stride] for name, place in points.items()}
    true = {
        **_projections(now, before, sizes, rate, form),
        **_angles(now),
        **_heights(now, joints[:, 1, dense.stride :].min(axis=0), sizes["humerus"]),
    }
    for name, point, threshold in FAST:
        true[name] = _lengths(now[point] - before[point]) > threshold * sizes["humerus"] / rate
    usable = dense.valid[dense.stride :] & dense.valid[: -dense.stride]
    return np.array([true[name] for name in GEOMETRIC_FEATURES])[:, usable].mean(axis=1)


def _vector(points: Points, names: str) -> FloatArray:
    """The vector (3, T) between two points, or the normal of the plane through three."""
    first, *others = (points[name] for name in names.split())
    arms = [other - first for other in others]
    return arms[0] if len(arms) == 1 else np.cross(arms[0], arms[1], axis=0)


def _projections(now: Points, before: Points, sizes: dict[str, float], rate: float, form: str) -> dict[str, BoolArray]:
    """The features of `LINES`, `PLANES` and `MOVING`, (T',) each; velocities are differences over a sixtieth."""
    true, column = {}, 1 if form == "aist++" else 0
    for name, direction, vector, threshold, size in LINES:
        true[name] = _beyond(_vector(now, vector), _vector(now, direction), threshold * sizes[size])
    for name, *forms, threshold in PLANES:
        direction, vector = forms[column]
        true[name] = _beyond(_vector(now, vector), _vector(now, direction), threshold * sizes["humerus"])
    for name, *forms, threshold in MOVING:
        direction, vector = forms[column]
        change = _vector(now, vector) - _vector(before, vector)
        true[name] = _beyond(change, _vector(now, direction), threshold * sizes["humerus"] / rate)
    return true


def _beyond(vectors: FloatArray, directions: FloatArray, limit: float) -> BoolArray:
    """True where the part of (3, T') vectors along directions exceeds the limit."""
    # Both sides times the direction's length: where a plane has no normal, nothing is beyond it.
    return (directions * vectors).sum(axis=0) > limit * _lengths(directions)


def _angles(now: Points) -> dict[str, BoolArray]:
    """The features that are about angles, (T',) each."""
    spine = now["root"] - now["neck"]
    true = {"spine horizontal": np.abs(spine[1]) < _UPRIGHT * _lengths(spine)}
    for name, first, second, bound in ANGLES:
        one, other = _vector(now, first), _vector(now, second)
        excess = (one * other).sum(axis=0) - math.cos(math.radians(bound)) * _lengths(one) * _lengths(other)
        true[name] = excess > 0 if bound < 0 else excess < 0
    return true


def _heights(now: Points, lowest: FloatArray, humerus: float) -> dict[str, BoolArray]:
    """The features that are about heights above the lowest joint (T',), (T',) each."""
    raised = {name: now[point][1] - lowest > HEIGHT * humerus for name, point in RAISED.items()}
    return raised | {name: now[point][1] - lowest < HEIGHT * humerus for name, point in LOW.items()}


def _measured(points: Points) -> dict[str, float]:
    """The dancer's own sizes, metres: medians over time."""
    bones = ("lshoulder lelbow", "rshoulder relbow", "lshoulder rshoulder", "lhip rhip")
    left, right, shoulders, hips = (float(np.median(_lengths(_vector(points, bone)))) for bone in bones)
    return {"humerus": (left + right) / 2, "shoulders": shoulders, "hips": hips}


def _lengths(vectors: FloatArray) -> FloatArray:
    """Lengths of (3, T) vectors, (T,)."""
    return np.sqrt((vectors * vectors).sum(axis=0))
