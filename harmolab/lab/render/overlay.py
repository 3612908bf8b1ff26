"""A dancer's skeleton over the video that it comes from. Needs OpenCV, numpy, and PyAV for the video's frames."""

from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np

from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import skull_and_limbs
from harmolab.data.recordings import ReadingReport, load_any_motion
from harmolab.files import PathLike
from harmolab.lab.render.stick import FRACTION_BITS, BeatMarks, Frame, Stroke, check_positive, draw_strokes, fixed
from harmolab.readers.keypoints import COCO_17, OPENPOSE_18, OPENPOSE_25, load_keypoints
from harmolab.readers.player_points import joint_widths, limb_widths
from harmolab.readers.video import VideoFrames
from harmolab.score import HarmonyScore
from harmolab.types import Motion

CORE, RIM = (255, 255, 255), (20, 20, 20)  # a light line in a dark one is seen on any picture
THICKNESS = 1 / 110  # of a limb, in picture heights
SHARES_UP_TO = 2.0  # points whose median is below are shares of the picture: no body fits into two pixels
LEAST_INSIDE = 0.5  # share of the points that must lie in the picture
IN_SPACE = "is movement in space; over a video go points of its pictures (OpenPose, COCO, MediaPipe)"


def load_points(
    path: PathLike,
    *,
    fps: float | None = None,
    joints: tuple[str, ...] | None = None,
    report: ReadingReport = lambda path, file: None,
) -> Motion:
    """A dancer's points in a picture, from a file of key points or landmarks.

    Parameters
    ----------
    path : str or path
        COCO-17, OpenPose or MediaPipe, or our own `.npz`, as `load_any_motion` reads them.
    fps : float, frames per second, where the file holds no rate
    joints : names to keep, optional
        When left out, eyes and ears of COCO and OpenPose go where they were not always seen: a turn of the head hides
        one, and the whole frame would count as not valid.
    report : function(path, MotionFile), called with how the file was read

    Returns
    -------
    Motion with (T, J, 2) positions, as the file has them: pixels, or shares of the picture

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; a motion in space is an error.
    """
    motion = load_any_motion(path, fps=fps, joints=joints, report=report)
    if motion.positions.shape[2] != 2:
        raise ValueError(f"{path}: {IN_SPACE}")
    if Path(path).suffix.lower() == ".json":
        # MediaPipe's as shares of both sides, whatever proportions of the picture the file notes.
        motion = load_keypoints(path, fps=fps, aspect=1.0, joints=joints)
    if joints is None and motion.skeleton in (COCO_17, OPENPOSE_18, OPENPOSE_25) and not motion.valid.all():
        body = tuple(name for name in motion.skeleton.joints if not name.endswith(("_eye", "_ear")))
        motion = load_any_motion(path, fps=fps, joints=body)
    return motion


def points_in_picture(motion: Motion, video: VideoFrames) -> Motion:
    """The points in pixels of the frames that `video` gives.

    Points between 0 and 1 (MediaPipe) are taken as shares of the picture's width and height, others as pixels of the
    video's own pictures.

    Raises
    ------
    ValueError
        For a motion in space, and where most points lie outside the picture: they are of another one.
    """
    if motion.positions.shape[2] != 2:
        raise ValueError(f"the motion {IN_SPACE}")
    height, width = video.source_size
    points = motion.positions[motion.valid]
    are_shares = points.size and np.median(np.abs(points)) <= SHARES_UP_TO
    unit = np.array([1.0, 1.0] if are_shares else [width, height])
    inside = float(((points >= 0) & (points <= unit)).all(axis=-1).mean()) if points.size else 1.0
    if inside < LEAST_INSIDE:
        raise ValueError(
            f"{video.path}: {1 - inside:.0%} of the points lie outside its pictures of {width} x {height} pixels; "
            "are they of this video, at this size?"
        )
    places = motion.positions * (np.array([video.width, video.height]) / unit)
    return Motion(places, motion.fps, motion.skeleton, motion.valid)


def overlay_skeleton(
    frames: Iterable[Frame], fps: float, motion: Motion, *, score: HarmonyScore | None = None, begin: float = 0.0
) -> Iterator[Frame]:
    """The frames with the skeleton over them, as long as both last; the motion's first frame lies on the first frame.

    Parameters
    ----------
    frames : iterable of (H, W, 3) uint8 RGB arrays; they are not changed
    fps : float, hertz, of the frames
        A motion of another rate is interpolated.
    motion : Motion
        (T, J, 2) pixels of the frames, as from `points_in_picture`. Frames that are not valid are left undrawn.
    score, begin : as in `harmolab.lab.render.scene.render_dance`

    Yields
    ------
    (H, W, 3) uint8 arrays, frame i at i / fps seconds
    """
    if motion.positions.shape[2] != 2:
        raise ValueError(f"the motion {IN_SPACE}")
    check_positive(fps=fps)
    return _overlaid(frames, resample_motion(motion, fps), score, begin)


def _overlaid(frames: Iterable[Frame], motion: Motion, score: HarmonyScore | None, begin: float) -> Iterator[Frame]:
    _, limbs = skull_and_limbs(motion.skeleton)
    widths = [*limb_widths(motion.skeleton, limbs), *joint_widths(motion.skeleton)]
    marks: BeatMarks | None = None
    # The motion first: zip would else read one frame too many.
    for index, (places, is_valid, frame) in enumerate(zip(motion.positions, motion.valid, frames, strict=False)):
        marks = marks or BeatMarks(len(frame), score, begin=begin)
        drawn = frame.copy()
        if is_valid:
            draw_strokes(drawn, _strokes(fixed(places).tolist(), limbs, widths, len(frame)))
        marks.draw(drawn, index / motion.fps)
        yield drawn


def _strokes(
    points: list[list[int]], limbs: list[tuple[int, int]], widths: list[float], height: int
) -> Iterator[Stroke]:
    """Limbs and joints twice: thick and dark, then thinner and light; `widths` of limbs, then of joints."""
    thickness = max(2, round(THICKNESS * height))
    for colour, extra in ((RIM, thickness + 2), (CORE, 0)):
        for (start, end), width in zip(limbs, widths, strict=False):
            yield Stroke(points[start], points[end], max(1, round(width * (thickness + extra))), colour)
        for point, width in zip(points, widths[len(limbs) :], strict=True):
            radius = width * (0.3 * thickness + (thickness + extra) / 2) * 2**FRACTION_BITS
            yield Stroke(point, None, round(radius), colour)
