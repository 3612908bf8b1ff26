"""Reads the points of a c3d file in a process of its own: `python c3d_child.py PATH`, arrays as `.npz` on its output.

The library that reads c3d runs without end on some damaged files. A process can be stopped; a call cannot.
Nothing of harmolab is imported here, so that the process begins at once.
"""

import io
import sys
from contextlib import suppress
from typing import Any

import numpy as np

OUTPUTS = ("ANGLES", "FORCES", "MOMENTS", "POWERS", "SCALARS")  # what a model adds to the markers, in other units
MEMORY = 4 * 2**30  # bytes, where the system can hold a process to it


def points(path: str) -> dict[str, Any]:
    """Points (3, J, T), residuals (J, T), rate, unit, labels, and the vertical axis of the screen, of a c3d file."""
    import ezc3d

    content = ezc3d.c3d(path)
    about = content["parameters"]["POINT"]
    names = sorted(about, key=len)
    labels = [label for name in names if name.startswith("LABELS") for label in about[name]["value"]]
    outputs = [label for name in names if name.rstrip("0123456789") in OUTPUTS for label in about[name]["value"]]
    words = {name: about[name]["value"] if name in about else [] for name in ("UNITS", "Y_SCREEN")}
    return {
        "points": content["data"]["points"][:3],
        "residuals": content["data"]["meta_points"]["residuals"][0],
        "rate": np.ravel(about["RATE"]["value"])[:1],
        "labels": np.array([str(label) for label in labels], str),
        "outputs": np.char.strip(np.array(outputs, str)),
        **{name.lower(): np.array("".join(map(str, value[:1]))) for name, value in words.items()},
    }


def main() -> None:
    """Write the arrays of the file named on the command line."""
    with suppress(ImportError, ValueError, OSError):  # not on every system
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    stream = io.BytesIO()
    np.savez(stream, **points(sys.argv[1]))
    sys.stdout.buffer.write(stream.getvalue())


if __name__ == "__main__":
    main()
