"""Frames to a moving picture that a README shows, as GIF, through PyAV."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from fractions import Fraction
from pathlib import Path
from typing import cast

import av
import numpy as np

from harmolab.io.files import WRITTEN_BY, PathLike, atomic_write
from harmolab.io.video import MAX_FPS, MIN_FPS, Frame, check_frame

COLOURS = 64  # of the palette, chosen for what moves
COMMENT, END = b"\x21\xfe", b"\x3b"  # a GIF's comment begins with the first and the file ends with the second


def write_gif(path: PathLike, frames: Iterable[Frame], fps: float) -> None:
    """Write frames as a GIF that repeats without end; it has no sound. The file appears whole or not at all.

    Parameters
    ----------
    path : str or path that ends in .gif
    frames : iterable of (H, W, 3) RGB uint8 arrays, all of one shape; they are held in memory together
    fps : float, hertz; GIF counts hundredths of a second, so 10, 12.5, 20 and 25 are kept exactly

    Raises
    ------
    ValueError
        For no frame, a frame that is no picture or of another size, or an fps that cannot be; names the file.
    """
    path = Path(path)
    if not MIN_FPS <= fps <= MAX_FPS:
        raise ValueError(f"{path}: fps must lie between {MIN_FPS:g} and {MAX_FPS:g}, got {fps}")
    pictures = iter(frames)
    first = next(pictures, None)
    if first is None:
        raise ValueError(f"{path}: a moving picture needs at least one frame, got none")
    check_frame(path, first, 0)
    rate = Fraction(fps).limit_denominator(1000)
    with atomic_write(path) as part:
        with av.open(f"file:{part}", "w", format="gif", options={"loop": "0"}) as container:
            stream = container.add_stream("gif", rate=rate)
            stream.height, stream.width = first.shape[:2]
            stream.pix_fmt = "pal8"
            for picture in _with_palette(path, itertools.chain([first], pictures), first.shape, rate):
                container.mux(stream.encode(picture))
            container.mux(stream.encode(None))
        content, words = part.read_bytes().removesuffix(END), WRITTEN_BY.encode()
        part.write_bytes(content + COMMENT + bytes([len(words)]) + words + b"\0" + END)


def _with_palette(
    path: Path, frames: Iterable[Frame], shape: tuple[int, ...], rate: Fraction
) -> Iterator[av.VideoFrame]:
    """The frames in the colours of one palette, which is chosen when all are known."""
    graph = av.filter.Graph()
    source = graph.add_buffer(width=shape[1], height=shape[0], format=av.VideoFormat("rgb24"), time_base=1 / rate)
    split, sink = graph.add("split"), graph.add("buffersink")
    palette = graph.add("palettegen", f"max_colors={COLOURS}:stats_mode=diff")
    use = graph.add("paletteuse", "dither=none:diff_mode=rectangle")
    source.link_to(split)
    split.link_to(use, 0, 0)
    split.link_to(palette, 1, 0)
    palette.link_to(use, 0, 1)
    use.link_to(sink)
    graph.configure()
    for index, frame in enumerate(frames):
        if frame.shape != shape:
            raise ValueError(f"{path}: frame {index} has shape {frame.shape}, the first has {shape}")
        picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
        picture.pts, picture.time_base = index, 1 / rate
        source.push(picture)
    source.push(None)
    while True:
        try:
            yield cast(av.VideoFrame, sink.pull())
        except (av.EOFError, av.BlockingIOError):
            return
