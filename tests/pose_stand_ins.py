"""A process that answers as `harmolab.readers.pose_child`, without MediaPipe, and a command that installs like pip."""

import sys
from pathlib import Path

import numpy as np

from harmolab.readers.keypoints import MEDIAPIPE_33

# The redness of a picture's left half is the height of her wrists: 0 low, 255 one metre higher. The right half: the
# same of a second person, unless black. What goes wrong is told by "FAULT" in place of a picture's answer.
CHILD = """
import struct, sys, time
import numpy as np
out, read = sys.stdout.buffer, sys.stdin.buffer.read
body = np.load(sys.argv[1])
fault, at = sys.argv[2], int(sys.argv[3])
def answer(part):
    points = body.copy()
    level = part[..., 0].mean() / 255 if part[..., 0].mean() > 10 else 0
    points[15:17, 3] -= level
    points[:, 0] = points[:, 0] * 0.3 + 0.1
    if level == 0:
        points[:] = np.nan
    return points.astype(np.float32).tobytes()
if fault == "mute": time.sleep(60)
out.write(b"NONSENSE" if fault == "begin" else b"POSE0001"); out.flush()
index = 0
while True:
    header = read(12)
    if len(header) < 12: break
    height, width, looked_at = struct.unpack("<3I", header)
    pixels = np.frombuffer(read(height * width * 3), np.uint8).reshape(height, width, 3)
    if index == at and fault == "hang": time.sleep(60)
    if index == at and fault == "crash":
        print("Check failed: no such graph", file=sys.stderr); sys.exit(6)
    content = answer(pixels[:, : width // 2])
    if index == at and fault == "infinite": content = np.full((33, 6), np.inf, np.float32).tobytes()
    if index == at and fault == "half": content = content[:400] + np.full(98, np.nan, np.float32).tobytes()
    if index == at and fault == "short": out.write(content[:100]); out.flush(); sys.exit(0)
    out.write(content)
    if looked_at: out.write(answer(pixels[:, width // 2 :]))
    out.flush()
    index += 1
if fault == "long": out.write(b"more"); out.flush()
"""

PIP = """
import sys, time
from pathlib import Path
target = Path(sys.argv[sys.argv.index("--target") + 1])
(target / "mediapipe" / "python" / "solutions").mkdir(parents=True)
for name in ("mediapipe", "mediapipe/python", "mediapipe/python/solutions"):
    (target / name / "__init__.py").write_text("")
(target / "mediapipe/python/solutions/pose.py").write_text("class Pose:\\n    def __init__(self, **options): pass\\n")
with (target.parent / "calls").open("a") as calls:
    calls.write(" ".join(sys.argv[1:]) + "\\n")
mode = (target.parent / "mode").read_text() if (target.parent / "mode").exists() else ""
if mode == "slow": time.sleep(60)
if mode == "fails":
    print("WARNING: retrying", file=sys.stderr)
    print("ERROR: No matching distribution found for mediapipe==0.10.21", file=sys.stderr)
    sys.exit(1)
if mode == "broken":
    (target / "mediapipe/python/solutions/pose.py").write_text("raise ImportError('GLIBC is too old')\\n")
"""


def standing_body() -> np.ndarray:
    """(33, 6) landmarks of somebody who stands, in the middle of the picture, all seen."""
    heights = {"nose": -0.6, "shoulder": -0.45, "elbow": -0.2, "wrist": 0.0, "hip": 0.0, "knee": 0.4, "ankle": 0.8}
    points = np.zeros((33, 6), np.float32)
    for joint, name in enumerate(MEDIAPIPE_33.joints):
        side = 0.2 if name.startswith("left") else -0.2 if name.startswith("right") else 0.0
        height = next((value for part, value in heights.items() if part in name), 0.85 if "foot" in name else -0.6)
        points[joint] = [0.5 + side, 0.5 + height / 2.5, side, height, 0.1 * ("foot" in name), 0.9]
    return points


def stand_in(folder: Path, fault: str = "", at: int = 3, body: np.ndarray | None = None) -> list[str]:
    """The command of the process; it goes wrong in this way at that picture."""
    (folder / "child.py").write_text(CHILD)
    np.save(folder / "body.npy", standing_body() if body is None else body)
    return [sys.executable, str(folder / "child.py"), str(folder / "body.npy"), fault, str(at)]


def pip(folder: Path) -> list[str]:
    """The command that installs; a file "mode" beside its target says how it goes wrong."""
    (folder / "pip.py").write_text(PIP)
    return [sys.executable, str(folder / "pip.py")]
