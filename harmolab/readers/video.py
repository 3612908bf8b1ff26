"""Video files to grey or colour frames at a constant rate, and frames to H.264, VP9 or GIF, through PyAV (no ffmpeg).

Nothing in a file is trusted: the picture size is checked before a picture is decoded, only formats that hold their own
pictures are opened (no playlists, no network), and reading stops at a number of frames.
"""

import itertools
import os
import re
from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from typing import Any, NamedTuple, cast

import av
import numpy as np
from av.video.reformatter import ColorRange, Colorspace, VideoReformatter
from numpy.typing import NDArray

from harmolab.files import WRITTEN_BY, PathLike, atomic_write, reading
from harmolab.types import Audio

Frame = NDArray[np.uint8]

SUFFIXES = (  # of cameras and old phones too
    ".3gp", ".avi", ".flv", ".m2ts", ".m4v", ".mkv", ".mov", ".mp4", ".mpeg", ".mpg", ".mts", ".ogv", ".webm", ".wmv",
)  # fmt: skip
FORMATS = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,mpeg,mpegts,flv,ogg,asf,gif,mxf,nut,ivf,h264,hevc,m4v,mpegvideo"
MAX_PIXELS = 2**26
SMALLEST_SIDE = 16  # pixels
MIN_FPS, MAX_FPS = 1.0, 1000.0
LIKELY_FPS = 130.0  # hertz; what states more is looked at more closely
MAX_FRAMES = 432_000  # four hours at 30 fps
MAX_GAP = 60.0  # seconds without a new picture
MAX_THREADS = 4
AUDIO_RATE = 48_000
# Up to 18 PyAV decodes a file's tags as it opens it, and fails at one that is not UTF-8; since 19 only when asked to.
READ_TAGS: dict[str, Any] = {"metadata_errors": "replace"} if int(av.__version__.partition(".")[0]) < 19 else {}


class _Coding(NamedTuple):
    """The coding of a kind of file: names of FFmpeg's coders, and options of the picture coder and of the file."""

    video: str
    sound: str
    options: dict[str, str]
    container: dict[str, str]


# One step less of motion search than the preset has: a quarter faster, files 6 % larger, the same likeness.
_X264 = {"crf": "20", "preset": "veryfast", "x264-params": "subme=1"}
CODINGS = {
    # Sound lies beside its pictures; without "max_interleave_delta" all but the last 10 s of it come before them.
    ".mp4": _Coding("libx264", "aac", _X264, {"movflags": "+faststart", "max_interleave_delta": "0"}),
    ".webm": _Coding(
        "libvpx-vp9", "libopus", {"deadline": "realtime", "cpu-used": "7", "crf": "30", "b": "0", "row-mt": "1"}, {}
    ),
}


def is_video(path: PathLike) -> bool:
    """True for a file that is a video by its suffix."""
    return Path(path).suffix.lower() in SUFFIXES


@dataclass(frozen=True)
class VideoFrames:
    """The frames of a video file. Every iteration reads the file anew, one frame at a time.

    Frame i is what the screen shows i / fps seconds after the file starts, to within one frame. So a video of variable
    rate comes at its average rate: a picture that stays longer is repeated, one that is gone before its time is left
    out. A picture track that starts later than the sound begins with its first picture held.

    Parameters
    ----------
    path : Path
    fps : float, hertz, the average rate
    height, width : int, pixels, of the frames, upright
    source_size : (int, int)
        Height and width of the file's own pictures, pixels, upright.
    colour : bool
        Whether the frames have three channels.
    """

    path: Path
    fps: float
    height: int
    width: int
    source_size: tuple[int, int]
    colour: bool = False

    def __iter__(self) -> Iterator[Frame]:
        """(H, W) or (H, W, 3) uint8 arrays; ValueError names the file when it turns out to be damaged or cut off."""
        scaler = VideoReformatter()
        for picture, count in self._pictures():
            yield from itertools.repeat(self._frame(picture, scaler), count)

    def at(self, places: Collection[int]) -> Iterator[tuple[int, Frame]]:
        """(number, frame) of the frames with these numbers, in order; reading stops at the last, errors as above."""
        scaler, index, last = VideoReformatter(), 0, max(places, default=-1)
        for picture, count in self._pictures() if places else ():
            yield from ((at, self._frame(picture, scaler)) for at in range(index, index + count) if at in places)
            index += count
            if index > last:
                return

    def _pictures(self) -> Iterator[tuple[av.VideoFrame, int]]:
        """The file's pictures that come out, each with the number of frames that it is shown for."""
        with _opened(self.path) as (container, stream):
            held: av.VideoFrame | None = None
            index = 0  # of the next frame to come out
            for seconds, picture in _timed(container, stream, self.fps):
                place = round(seconds * self.fps)
                if place >= MAX_FRAMES:
                    raise ValueError(f"has more than {MAX_FRAMES} frames; cut it into parts")
                if held is not None and place > index:
                    yield held, place - index
                    index = place
                held = picture
            if held is not None:
                yield held, 1

    def _frame(self, picture: av.VideoFrame, scaler: VideoReformatter) -> Frame:
        """A picture, small and upright; one scaler for all pictures of a file spares setting it up for each."""
        turns = _quarter_turns(picture)
        height, width = (self.width, self.height) if turns % 2 else (self.height, self.width)
        pixels = "rgb24" if self.colour else "gray"
        small = scaler.reformat(picture, height=height, width=width, format=pixels, interpolation="AREA").to_ndarray()
        return np.array(np.rot90(small, turns), dtype=np.uint8, order="C")


def frame_count(video: VideoFrames) -> int:
    """About how many pictures a video has, by what its file says; 0 where it does not."""
    with opened_container(video.path) as container:
        return max(0, round((container.duration or 0) / 1e6 * video.fps))


def video_frames(path: PathLike, *, height: int = 240, colour: bool = False) -> VideoFrames:
    """The frames of a video file, small and grey (for optical flow) or in colour (to be shown).

    Parameters
    ----------
    path : str or path
        MP4, MOV, MKV, WebM, AVI, MPEG, FLV, Ogg, WMV or GIF.
    height : int, pixels
        Of the frames that come out; the width follows. A smaller video keeps its size.
    colour : bool
        RGB frames (H, W, 3) in place of grey ones (H, W).

    Returns
    -------
    VideoFrames, to be iterated; its `fps` goes with the frames

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. Besides files that hold no video: one frame or none, a size or frame rate that cannot be;
        more than 432,000 frames, at once if the header says so, else when that frame is reached. A file that ends
        before its header says raises while it is read.

    Examples
    --------
    >>> from harmolab.beats.flow import flow_beats
    >>> video = video_frames("dance.mp4")  # doctest: +SKIP
    >>> flow_beats(video, video.fps)  # doctest: +SKIP
    """
    if height < SMALLEST_SIDE:
        raise ValueError(f"height must be at least {SMALLEST_SIDE} pixels, got {height}")
    fps = average_rate(Path(path))
    with _opened(Path(path)) as (container, stream):
        if stream.frames > MAX_FRAMES:
            raise ValueError(f"has {stream.frames} frames, more than {MAX_FRAMES}; cut it into parts")
        pictures = [picture for _, picture in itertools.islice(_timed(container, stream, fps), 2)]
        if len(pictures) < 2:
            raise ValueError(f"holds {len(pictures) or 'no'} frame, a video needs two or more; is it a picture?")
        small, own = (_upright(pictures[0], tallest) for tallest in (height, MAX_PIXELS))
        return VideoFrames(Path(path), fps, *small, own, colour)


@contextmanager
def opened_container(path: Path) -> Iterator[Any]:
    """A media file, open for reading; faults of FFmpeg become ValueError, and all errors name the file."""
    only = {"format_whitelist": FORMATS, "protocol_whitelist": "file"}
    what = "video" if is_video(path) else "sound"
    with reading(path, what, max_bytes=None) as file:
        try:
            with av.open(f"file:{file}", container_options=only, **READ_TAGS) as container:
                yield container
        except av.FFmpegError as error:
            fault = f"cannot be read as {what}: it is damaged or cut off, or another kind of file, such as a photo"
            raise ValueError(fault) from error


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """The container and its first stream of moving pictures, of a size that can be read and ready to decode."""
    with opened_container(path) as container:
        streams = [s for s in container.streams.video if not s.disposition & av.stream.Disposition.attached_pic]
        if not streams:
            raise ValueError("holds no video, only " + (", ".join(s.type for s in container.streams) or "nothing"))
        coding = streams[0].codec_context
        if coding is None:
            raise ValueError("holds video in an unknown coding")
        if min(coding.width, coding.height) < SMALLEST_SIDE or coding.width * coding.height > MAX_PIXELS:
            limits = f"sides from {SMALLEST_SIDE} and areas up to {MAX_PIXELS} pixels can be read"
            raise ValueError(f"states a picture of {coding.width} x {coding.height} pixels; {limits}")
        coding.options, coding.thread_type = {"max_pixels": str(MAX_PIXELS)}, "AUTO"
        coding.thread_count = min(MAX_THREADS, os.cpu_count() or 1)
        yield container, streams[0]


def average_rate(path: Path) -> float:
    """The average frame rate that a video states, or, where that is missing or unlikely, that its time stamps have."""
    with _opened(path) as (container, stream):
        rate = float(stream.average_rate or 0)
        # Browsers that record the screen state 1000 a second and write as many as come.
        if not MIN_FPS <= rate <= LIKELY_FPS:
            times = [packet.pts * packet.time_base for packet in container.demux(stream) if packet.pts is not None]
            span = float(max(times) - min(times)) if times else 0.0
            rate = (len(times) - 1) / span if span > 0 else rate
        if not MIN_FPS <= rate <= MAX_FPS:
            raise ValueError(f"has a frame rate of {rate:g}; {MIN_FPS:g} to {MAX_FPS:g} frames per second can be read")
        return rate


def first_picture(path: Path) -> float:
    """Seconds from the start of a video, where `video_sound` starts, to its first picture; 0 of sound alone."""
    with opened_container(path) as container:
        if not container.streams.video:
            return 0.0
    with _opened(path) as (container, stream):
        return next((late for late, _ in _timed(container, stream, fps=1000.0)), 0.0)  # to the millisecond


def _timed(container: Any, stream: Any, fps: float) -> Iterator[tuple[float, av.VideoFrame]]:
    """Decoded pictures, each with the seconds from the start of the file to its showing."""
    origin = (container.start_time or 0) / av.time_base
    first = last = size = None
    late, count = 0.0, 0
    for count, picture in enumerate(container.decode(stream), start=1):  # noqa: B007  # read after the loop
        seconds = picture.time if picture.time is not None else origin if last is None else last + 1 / fps
        shape = (picture.width, picture.height)
        if first is None or last is None:
            size, first, last = shape, seconds, seconds
            # Whole frames, so that the rounding of later time stamps cannot tip over.
            late = round(max(seconds - origin, 0.0) * fps) / fps
            if late > MAX_GAP:
                raise ValueError(f"shows its first picture after {late:.0f} s; its time stamps are damaged")
        if shape != size:
            raise ValueError(f"changes its size from {size} to {shape}; convert it to one size")
        if seconds - last > MAX_GAP:
            raise ValueError(f"shows no new picture between {last - origin:.1f} and {seconds - origin:.1f} s")
        last = max(last, seconds)
        yield last - first + late, picture
    stated = stream.frames
    if stream.duration and stream.time_base:  # a cut without new coding keeps hidden frames before its start
        stated = min(stated, round(float(stream.duration * stream.time_base) * fps))
    if seconds := tagged_seconds(stream):
        count, stated = round(((last or origin) - origin) * fps) + 1, round(seconds * fps)
    if count < 0.95 * stated - 2:
        raise ValueError(f"is cut off or damaged: {count} of {stated} frames are there")


def tagged_seconds(stream: Any) -> float:
    """Seconds from the start of a WebM or Matroska file to the end of a stream, by its tag; 0 without one."""
    parts = re.fullmatch(r"(\d+):(\d\d):(\d\d\.\d+)", stream.metadata.get("DURATION", ""))
    hours, minutes, seconds = map(float, parts.groups()) if parts else (0.0, 0.0, 0.0)
    begin = (stream.container.start_time or 0) / av.time_base  # the tag counts from 0, wherever the time stamps begin
    return max(3600 * hours + 60 * minutes + seconds - begin, 0.0)


def _upright(picture: av.VideoFrame, height: int) -> tuple[int, int]:
    """(height, width) of the small upright frame: `height` or less, in the proportions of the picture."""
    size = (picture.height, picture.width)[:: -1 if _quarter_turns(picture) % 2 else 1]
    share = min(1.0, height / size[0])
    return round(size[0] * share), max(SMALLEST_SIDE, round(size[1] * share))


def _quarter_turns(picture: av.VideoFrame) -> int:
    """Number of left turns by 90 degrees that bring a picture upright (a phone held on its side)."""
    return round(picture.rotation / 90) % 4


def write_video(
    path: PathLike, frames: Iterable[Frame], fps: float, *, audio: Audio | None = None, title: str = ""
) -> None:
    """Write frames to a video that browsers play; whole or not at all.

    Parameters
    ----------
    path : str or path
        Ends in `.mp4` (H.264 and AAC, plays everywhere) or `.webm` (VP9 and Opus, free codings).
    frames : iterable of (H, W) grey or (H, W, 3) RGB uint8 arrays, all of one shape
        Taken one by one, so that a long video needs little memory. An odd height or width is made even by repeating
        the last row or column, since the codings need that.
    fps : float, frames per second
    audio : Audio, optional
        Sound that starts with the first frame.
    title : str
        Title of the file, which players show.

    Raises
    ------
    ValueError
        For another ending, no frame, a frame that is no picture or of another size, an `fps` out of range, or sound
        that is no Audio.

    Examples
    --------
    >>> write_video("dancer.mp4", render_skeleton(motion), motion.fps, audio=audio)  # doctest: +SKIP
    """
    path = Path(path)
    coding = CODINGS.get(path.suffix.lower())
    if coding is None:
        raise ValueError(f"{path}: video is written as {' or '.join(CODINGS)}; choose a name that ends so")
    if not MIN_FPS <= fps <= MAX_FPS:
        raise ValueError(f"{path}: fps must lie between {MIN_FPS:g} and {MAX_FPS:g}, got {fps}")
    with (
        atomic_write(path) as part,
        av.open(f"file:{part}", "w", format=path.suffix[1:].lower(), container_options=coding.container) as container,
    ):
        container.metadata.update({"comment": WRITTEN_BY} | ({"title": title} if title else {}))
        _encode(container, coding, path, map(np.asarray, frames), Fraction(float(fps)).limit_denominator(10**5), audio)


def check_frame(path: Path, frame: Frame, number: int) -> None:
    """ValueError unless the frame is a picture that a video can hold."""
    if frame.dtype != np.uint8 or frame.ndim not in (2, 3) or frame.shape[2:] not in ((), (3,)):
        raise ValueError(f"{path}: frame {number} must be (H, W) or (H, W, 3) of uint8, got {frame.shape}")
    if min(frame.shape[:2]) < SMALLEST_SIDE or frame.shape[0] * frame.shape[1] > MAX_PIXELS:
        raise ValueError(f"{path}: frame {number} of shape {frame.shape} is too small or too large for a video")


def _encode(
    container: Any, coding: _Coding, path: Path, frames: Iterator[Frame], rate: Fraction, audio: Audio | None
) -> None:
    """The frames, each of the form of the first, with even sides; the errors name `path`."""
    first = next(frames, None)
    if first is None:
        raise ValueError(f"{path}: a video needs at least one frame, got none")
    check_frame(path, first, 0)
    odd = [(0, side % 2) for side in first.shape[:2]] + [(0, 0)] * (first.ndim - 2)
    video = container.add_stream(coding.video, rate=rate, options=coding.options)
    video.height, video.width, video.pix_fmt = *(side + side % 2 for side in first.shape[:2]), "yuv420p"
    # Said, so that players need not guess: many take other colours for large pictures.
    video.codec_context.colorspace, video.codec_context.color_range = Colorspace.ITU601, ColorRange.MPEG
    video.codec_context.thread_count = min(MAX_THREADS, os.cpu_count() or 1)
    sound = None if audio is None else container.add_stream(coding.sound, rate=AUDIO_RATE, layout="mono")
    if audio is not None:
        if not isinstance(audio, Audio):
            raise ValueError(f"audio must be a harmolab.Audio, got {type(audio).__name__}")
        # Sound first: the muxer keeps it until the pictures catch up, and coded sound is small.
        _encode_audio(container, sound, audio)
    for index, frame in enumerate(itertools.chain([first], frames)):
        if frame.shape != first.shape or frame.dtype != first.dtype:
            check_frame(path, frame, index)
            raise ValueError(f"{path}: frame {index} has shape {frame.shape}, the first has {first.shape}")
        even = np.pad(frame, odd, mode="edge") if any(map(any, odd)) else frame
        picture = av.VideoFrame.from_ndarray(even, format="gray" if frame.ndim == 2 else "rgb24")
        picture.pts, picture.time_base = index, 1 / rate
        container.mux(video.encode(picture))
    container.mux(video.encode(None))


def _encode_audio(container: Any, sound: Any, audio: Audio) -> None:
    samples = np.clip(audio.samples, -1, 1).astype(np.float32)[None]
    block = av.AudioFrame.from_ndarray(samples, format="fltp", layout="mono")
    block.sample_rate = round(audio.sample_rate)
    # Without times the file would not say that the coder starts with a block of silence: all sound 21 ms late.
    block.pts, block.time_base = 0, Fraction(1, block.sample_rate)
    sound.codec_context.open()
    context = sound.codec_context
    resampler = av.AudioResampler(context.format, "mono", AUDIO_RATE, frame_size=context.frame_size)
    for part in [*resampler.resample(block), *resampler.resample(None)]:
        container.mux(sound.encode(part))
    container.mux(sound.encode(None))


# Frames to GIF, the moving picture that a README shows

MAX_GIF_FPS = 50.0  # hertz: pictures that are to last a hundredth of a second or less, browsers show for a tenth
COLOURS = 64  # of the palette, chosen for what moves
COMMENT, END = b"\x21\xfe", b"\x3b"  # a GIF's comment begins with the first and the file ends with the second


def write_gif(path: PathLike, frames: Iterable[Frame], fps: float) -> None:
    """Write frames as a GIF that repeats without end; it has no sound. The file appears whole or not at all.

    Parameters
    ----------
    path : str or path that ends in .gif
    frames : iterable of (H, W, 3) RGB uint8 arrays, all of one shape; they are held in memory together
    fps : float, hertz, 50 at most; GIF counts hundredths of a second, so 10, 12.5, 20 and 25 are kept exactly

    Raises
    ------
    ValueError
        For no frame, a frame that is no picture or of another size, or an fps that cannot be; names the file.
    """
    path = Path(path)
    if not MIN_FPS <= fps <= MAX_GIF_FPS:
        raise ValueError(f"{path}: a gif has {MIN_FPS:g} to {MAX_GIF_FPS:g} pictures a second, got {fps:g}")
    pictures = map(np.asarray, frames)
    first = next(pictures, None)
    if first is None:
        raise ValueError(f"{path}: a moving picture needs at least one frame, got none")
    check_frame(path, first, 0)
    rate = Fraction(float(fps)).limit_denominator(1000)
    with atomic_write(path) as part:
        with av.open(f"file:{part}", "w", format="gif", options={"loop": "0"}) as container:
            stream = container.add_stream("gif", rate=rate)
            stream.height, stream.width = first.shape[:2]
            stream.pix_fmt = "pal8"
            for picture in _with_palette(path, itertools.chain([first], pictures), (*first.shape[:2], 3), rate):
                container.mux(stream.encode(picture))
            container.mux(stream.encode(None))
        content, words = part.read_bytes().removesuffix(END), WRITTEN_BY.encode()
        part.write_bytes(content + COMMENT + bytes([len(words)]) + words + b"\0" + END)


def _with_palette(path: Path, frames: Iterable[Frame], shape: Sequence[int], rate: Fraction) -> Iterator[av.VideoFrame]:
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
            raise ValueError(f"{path}: frame {index} has shape {frame.shape}; all must be {shape}")
        picture = av.VideoFrame.from_ndarray(np.ascontiguousarray(frame), format="rgb24")
        picture.pts, picture.time_base = index, 1 / rate
        source.push(picture)
    source.push(None)
    while True:
        try:
            yield cast(av.VideoFrame, sink.pull())
        except (av.EOFError, av.BlockingIOError):
            return
