"""Visual beats of a motion: turning points of the joint speed (Eq. 7-9), its valleys or peaks, and motion SD.

Symbols of the paper: J_v(t) is the joint speed, the sum over the joints i of their velocities v_s(t, i) (Eq. 7), and
d~(t) the sign of its change (Eq. 8). B~_v(t) is 1 at visual beats, where this sign turns (Eq. 9). They have times
p_v(b) and strengths s_v(b), the values of J_v there.
"""

from weakref import WeakKeyDictionary

import numpy as np

from harmolab.body import kinematics
from harmolab.params import HarmonyParams
from harmolab.shape_speed import shape_speed
from harmolab.types import BeatTrack, FloatArray, Motion

RATE = 120.0  # hertz: with `subframe`, slower motion is interpolated first, so that its frame rate does not show

# Several scores, pictures and pages of one motion read the same curve: each is computed once while the motion is alive.
_curves: WeakKeyDictionary[Motion, dict[tuple[object, ...], tuple[FloatArray, float]]] = WeakKeyDictionary()


def motion_curve(motion: Motion, params: HarmonyParams) -> tuple[FloatArray, float]:
    """The curve over time that the visual beats of a motion are read from, such as its joint speed, and its rate.

    Parameters
    ----------
    motion : Motion
    params : HarmonyParams
        Its `measure` and `detector` say which curve; `fps`, `subframe`, both smoothings and `speed` how it is computed.

    Returns
    -------
    curve : (F,) array, read-only
        Measure "shape": the shape speed (`harmolab.shape_speed`), smoothed by ``params.position_smoothing`` alone.
        Else the joint speed (Eq. 7) in units of the positions per second, or for the detector "direction" the spread
        of the joints' changes of direction; both are also smoothed by ``params.smoothing``.
    fps : float, hertz
        Value i belongs to second i / fps; with ``params.subframe`` a value of the latter two half a sample earlier.

    Raises
    ------
    ValueError
        Unless a Motion and HarmonyParams are passed.
    """
    for kind, value in ((Motion, motion), (HarmonyParams, params)):
        if not isinstance(value, kind):  # here, since a score that asks in another room walks farther
            raise ValueError(f"a harmolab.{kind.__name__} is needed, got {type(value).__name__}")
    kinds = params.measure == "shape", params.detector == "direction"
    key = (params.fps, params.subframe, params.position_smoothing, params.smoothing, params.speed, *kinds)
    curves = _curves.setdefault(motion, {})
    if key not in curves:
        curves[key] = _motion_curve(motion, params)
    return curves[key]


def _motion_curve(motion: Motion, params: HarmonyParams) -> tuple[FloatArray, float]:
    """The curve of `motion_curve`, computed; read-only, since it is shared."""
    if params.measure == "shape":
        shape = shape_speed(motion, smoothing=params.position_smoothing)
        return shape.speed, shape.fps
    positions, fps = motion.positions, motion.fps
    if params.fps is not None:
        positions, fps = kinematics.resample_positions(positions, fps, params.fps), params.fps
    elif params.subframe:
        positions, fps = kinematics.upsample_positions(positions, fps, RATE), max(fps, RATE)
    positions = kinematics.smooth_positions(positions, params.position_smoothing, fps)
    if params.detector == "direction":
        curve = kinematics.direction_spread(positions)
    else:
        curve = kinematics.joint_speed(positions, fps, reading=params.speed)
    curve = kinematics.smooth(curve, params.smoothing, fps)
    curve.setflags(write=False)
    return curve, fps


def curve_delay(params: HarmonyParams) -> float:
    """Samples by which the moment of a value of `motion_curve` lies before its place: half of one for a difference."""
    return 0.5 if params.subframe and params.measure != "shape" else 0.0


def curve_beats(curve: FloatArray, fps: float, params: HarmonyParams) -> BeatTrack:
    """Visual beats of a motion curve (Eq. 8-9); their strength is the curve's value s_v.

    Parameters
    ----------
    curve : (T,) array
    fps : float, hertz
    params : HarmonyParams
        ``detector``, ``plateau`` and ``subframe`` are read.
    """
    finders = {"turns": kinematics.turning_points, "valleys": kinematics.valley_frames}  # all others look for peaks
    delay, find = curve_delay(params), finders.get(params.detector, kinematics.peak_frames)
    frames = find(curve, plateau=params.plateau)
    positions = kinematics.refine_extrema(curve, frames) if params.subframe else frames.astype(np.float64)
    # The speed may be signed in one reading; a strength never is.
    return BeatTrack((positions - delay) / fps, np.abs(curve[frames]), fps, len(curve) / fps)


def visual_beats(motion: Motion, *, params: HarmonyParams | None = None) -> BeatTrack:
    """The visual beats of a motion: the moments that a viewer may take for beats, such as rests.

    Beats on frames that are not valid (`Motion.valid`) are left out. A motion in which nothing moves has none.

    Parameters
    ----------
    motion : Motion
    params : HarmonyParams
        Its `detector` says which moments of `motion_curve` are beats. ``HarmonyParams.paper()`` when left out: all
        turning points of the joint speed (Eq. 7-9).

    Returns
    -------
    BeatTrack
        Times in seconds from the first frame; the strength of a beat is the value of the curve there.

    Raises
    ------
    ValueError
        Unless a Motion and HarmonyParams are passed.

    Examples
    --------
    >>> from harmolab.types import Skeleton
    >>> angle = np.sin(2 * np.pi * np.arange(61) / 60)
    >>> arm = np.stack([np.sin(angle), -np.cos(angle)], axis=-1)[:, None, :]
    >>> visual_beats(Motion(arm, 60.0, Skeleton.unnamed(1)), params=HarmonyParams.valleys()).times.round(2)
    array([0.25, 0.75])
    """
    params = params or HarmonyParams.paper()
    curve, fps = motion_curve(motion, params)
    track = curve_beats(curve, fps, params)
    nearest = np.minimum((track.times * motion.fps).round().astype(np.int64), motion.n_frames - 1)
    return track.select(motion.valid[nearest])
