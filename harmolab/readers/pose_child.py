"""Finds a body in pictures with MediaPipe, in a process of its own: `python -I -S pose_child.py FOLDER`.

FOLDER holds MediaPipe and a numpy of its own, older than ours: two of them do not fit into one process. Nothing of
harmolab is imported here, and no module from outside FOLDER and Python itself.

In, for each picture: height, width, and whether to look for other people, as three unsigned 32-bit numbers, then its
RGB bytes. A height of 0 ends. Out: the 8 bytes of `READY`; then for each picture its people, 33 landmarks each, as
32-bit numbers (x and y as shares of the picture; x, y, z in metres; visibility), NaN without one. One person is
followed; where others are looked for, a second one comes after her, whom she does not cover.
"""

import os
import struct
import sys
from typing import Any, BinaryIO

READY = b"POSE0001"
HEADER = struct.Struct("<3I")
MAX_SIDE = 4096  # pixels
LANDMARKS = 33
MARGIN = 0.15  # of a person's size, around her, is painted over before others are looked for
UNUSED = ("cv2", "matplotlib", "matplotlib.pyplot")  # imported by MediaPipe for drawing, which is not done here


def main() -> None:
    """Answer pictures until there are no more."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer
    sys.path.insert(0, sys.argv[1])
    follow, look = _bodies()
    answers.write(READY)
    answers.flush()
    while (picture := _picture(sys.stdin.buffer)) is not None:
        pixels, is_looked_at = picture
        person = _landmarks(follow, pixels)
        answers.write(person.tobytes())
        if is_looked_at:
            answers.write(_landmarks(look, painted_over(pixels, person)).tobytes())
        answers.flush()


def _bodies() -> tuple[Any, Any]:
    """A finder that follows one person from picture to picture, and one that takes each picture by itself."""
    from types import ModuleType

    sys.modules.update({name: ModuleType(name) for name in UNUSED})
    from mediapipe.python.solutions.pose import Pose  # type: ignore[import-not-found]

    # Its own smoothing delays; ours, over the positions, does not.
    options = {"model_complexity": 1, "smooth_landmarks": False, "enable_segmentation": False}
    return Pose(static_image_mode=False, **options), Pose(static_image_mode=True, **options)


def _picture(stream: BinaryIO) -> tuple[Any, bool] | None:
    """The next picture (H, W, 3), and whether to look for others in it; None after the last."""
    import numpy as np

    header = stream.read(HEADER.size)
    if len(header) < HEADER.size:
        return None
    height, width, is_looked_at = HEADER.unpack(header)
    if not (0 < height <= MAX_SIDE and 0 < width <= MAX_SIDE):
        return None
    content = stream.read(height * width * 3)
    if len(content) < height * width * 3:
        return None
    return np.frombuffer(content, np.uint8).reshape(height, width, 3), bool(is_looked_at)


def _landmarks(body: Any, pixels: Any) -> Any:
    """(33, 6) landmarks of the person in a picture, NaN without one."""
    import numpy as np

    result = body.process(pixels)
    if not result.pose_landmarks or not result.pose_world_landmarks:
        return np.full((LANDMARKS, 6), np.nan, np.float32)
    pairs = zip(result.pose_landmarks.landmark, result.pose_world_landmarks.landmark, strict=True)
    rows = [(flat.x, flat.y, world.x, world.y, world.z, flat.visibility) for flat, world in pairs]
    return np.array(rows, np.float32)


def painted_over(pixels: Any, person: Any) -> Any:
    """The picture (H, W, 3) with its mean colour over the person's box; as it is where she is not found."""
    import numpy as np

    if np.isnan(person).any():
        return pixels
    size = np.array(pixels.shape[1::-1])
    low, high = person[:, :2].min(axis=0), person[:, :2].max(axis=0)
    margin = MARGIN * (high - low).max()
    (left, top), (right, bottom) = (np.clip([low - margin, high + margin], 0, 1) * size).astype(int)
    painted = pixels.copy()
    painted[top:bottom, left:right] = pixels.mean(axis=(0, 1)).astype(np.uint8)
    return painted


if __name__ == "__main__":
    main()
