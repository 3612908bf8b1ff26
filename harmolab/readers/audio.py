"""Sound files to Audio (WAV, FLAC, OGG and MP3, through libsndfile), M4A and the sound of videos through PyAV.

The header decides first, but is not believed: reading stops at the length that was asked for, whatever the header
says, and a span is sought, not read through.
"""

import io
import itertools
import math
import sys
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple

import av
import numpy as np
import soundfile
import soxr
from numpy.typing import NDArray

from harmolab.files import WRITTEN_BY, PathLike, atomic_write, named_faults, reading
from harmolab.readers.video import READ_TAGS, is_video, opened_container, tagged_seconds
from harmolab.types import Audio

FORMATS = ("WAV", "WAVEX", "RF64", "FLAC", "OGG", "MP3")
MIN_RATE, MAX_RATE, MAX_CHANNELS = 1000, 768_000, 64
# The densest thing there is, digital silence in FLAC, packs some 5,000 samples into a byte.
MAX_FRAMES_PER_BYTE = 10_000
MAX_SAMPLES = 2**29  # an hour at 149 kHz; silence at a higher rate makes gigabytes of a small file
MAX_AMPLITUDE = 1e10
_NOT_TOLD = 2**63 - 1  # number of samples that libsndfile gives where a header has none
MOST_PADDING = 1.0  # seconds at both ends of an MP3 that are no part of the sound
_WHAT = "WAV, FLAC, OGG, MP3 or M4A sound; convert it to one of these"
_BLOCK_VALUES = 2**18
_OGG_PAGE, _FIRST_PAGE = 65_307, 2  # bytes at most; the flag of a stream's first page
_SAVE_ANEW = "save it as a new one in a sound editor"
_TURNED = bytes(int(f"{byte:08b}"[::-1], 2) for byte in range(256))  # bits in the other order


class AudioInfo(NamedTuple):
    """Content of the header of a sound file: hertz, seconds, channels, and the name of the format."""

    sample_rate: int
    seconds: float
    channels: int
    format: str


def audio_info(path: PathLike) -> AudioInfo:
    """The header of a sound file; no sample is read.

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file.
    """
    if Path(path).suffix.lower() == ".m4a":  # in the container of mp4, which libsndfile does not read
        with _sound_stream(path) as (container, stream):
            seconds, channels = (container.duration or 0) / av.time_base, stream.codec_context.layout.nb_channels
            return AudioInfo(stream.codec_context.sample_rate, seconds, channels, "M4A")
    with reading(path, _WHAT, max_bytes=None) as file, soundfile.SoundFile(_name(file)) as sound:
        _check_header(sound, file.stat().st_size)
        return AudioInfo(sound.samplerate, sound.frames / sound.samplerate, sound.channels, sound.format)


def load_audio(
    path: PathLike,
    *,
    start: float = 0.0,
    duration: float | None = None,
    sample_rate: float | None = 22050.0,
    max_seconds: float = 3600.0,
) -> Audio:
    """The sound in a file, or a part of it, mixed to one channel: wav, flac, ogg, mp3 or m4a.

    `load_sound` also takes videos.

    Parameters
    ----------
    path : str or path
    start : float, seconds
        Where the part begins.
    duration : float or None, seconds
        Length of the part. None: to the end. A part that reaches beyond the end stops there.
    sample_rate : float or None, hertz
        The sound is resampled to this rate (soxr, high quality). None keeps the file's rate.
    max_seconds : float
        A longer part, or one of more than 2^29 samples, is an error, before any sample is read. Of an M4A the whole
        file counts, and is read for that.

    Returns
    -------
    Audio in single precision

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file. A file that is cut off, or holds more than its header says, is an error. With `duration`,
        what is there can still be read, but for an M4A, which is always read whole.

    Examples
    --------
    >>> audio = load_audio("song.mp3", start=10.0, duration=30.0)  # doctest: +SKIP
    """
    if Path(path).suffix.lower() == ".m4a":
        with named_faults(path):
            audio = _span(path, start, duration, None, max_seconds)
            return audio if sample_rate is None else resampled(audio, sample_rate)
    with reading(path, _WHAT, max_bytes=None) as file:
        if duration is None:
            _check_whole(file)
        with soundfile.SoundFile(_name(file)) as sound:
            _check_header(sound, file.stat().st_size)
            first, count = _span_frames(sound.frames, sound.samplerate, start, duration, max_seconds)
            audio = Audio(_mono(sound, first, count), sound.samplerate)
            if duration is None and sound.format in ("MP3", "FLAC"):
                _check_rest(file, sound)
        return audio if sample_rate is None else resampled(audio, sample_rate)


def _name(file: Path) -> str | bytes:
    """The name of a file for libsndfile: bytes, in any encoding; not on Windows, which takes no UTF-8 in bytes."""
    return str(file) if sys.platform == "win32" else bytes(file)


def _check_header(sound: soundfile.SoundFile, size: int) -> None:
    """ValueError unless the header describes sound that can exist."""
    if sound.format not in FORMATS:
        raise ValueError(f"is a {sound.format} file; only WAV, FLAC, OGG and MP3 are read")
    if not MIN_RATE <= sound.samplerate <= MAX_RATE:
        raise ValueError(f"has a sample rate of {sound.samplerate} Hz; {MIN_RATE} to {MAX_RATE} Hz can be sound")
    if not 1 <= sound.channels <= MAX_CHANNELS:
        raise ValueError(f"has {sound.channels} channels; 1 to {MAX_CHANNELS} are read")
    if sound.frames <= 0:
        raise ValueError("holds no samples")
    if sound.frames == _NOT_TOLD:
        raise ValueError("does not tell its length, as a FLAC from a pipe; convert it: ffmpeg -i piped.flac whole.flac")
    if sound.frames > MAX_FRAMES_PER_BYTE * size:
        raise ValueError(f"claims {sound.frames} samples in {size} bytes: its header is damaged")


def _check_whole(path: Path) -> None:
    """ValueError when a WAV or OGG file is cut off, or a page of an OGG damaged, which libsndfile does not tell."""
    size = path.stat().st_size
    with path.open("rb") as stream:
        head = stream.read(12)
        if head[:4] == b"OggS":
            stream.seek(0)
            _check_pages(stream)
    promised = int.from_bytes(head[4:8], "little") + 8 if head[:4] == b"RIFF" and head[8:] == b"WAVE" else 0
    # Programs that write to a pipe do not know the length and put a huge number there.
    if promised < 0x7FFFF000 and promised - size > max(1024, promised // 100):
        raise ValueError(f"is cut off: {size} of {promised} bytes are there")


def _check_rest(path: Path, sound: soundfile.SoundFile) -> None:
    """ValueError when more sound is in the file than its header says, which libsndfile leaves unread."""
    with suppress(av.FFmpegError), av.open(f"file:{path}", format=sound.format.lower(), **READ_TAGS) as container:
        stream, stated = container.streams.audio[0], sound.frames / sound.samplerate
        held = float(sum(packet.duration or 0 for packet in container.demux(stream)) * stream.time_base)
        if held > stated + MOST_PADDING:
            raise ValueError(
                f"says that it lasts {stated:.1f} s, and holds {held:.1f} s of sound: its begin is damaged, or it was "
                f"joined of several; get the file again, or {_SAVE_ANEW}"
            )


def _check_pages(stream: BinaryIO) -> None:
    """ValueError unless each OGG page is whole: without a damaged one, a second of sound, the rest comes too early.

    Nor may one stream follow another, of which libsndfile reads the first alone.
    """
    begun = False
    while (head := stream.read(27))[:4] == b"OggS":
        is_first = bool(int.from_bytes(head[5:6]) & _FIRST_PAGE)
        if begun and is_first:
            raise ValueError(f"was joined of several sounds, of which one would be read; {_SAVE_ANEW}")
        begun |= not is_first
        lengths = stream.read(head[-1])
        page = head[:22] + bytes(4) + head[26:] + lengths + stream.read(sum(lengths))
        if len(page) < 27 + head[-1] + sum(lengths):
            raise ValueError("is cut off: it ends in the middle of a page")
        if ogg_checksum(page) != head[22:26]:
            raise ValueError("is damaged: a page of it fails its check sum; get the file again")
    if b"OggS" in head + stream.read(_OGG_PAGE):
        raise ValueError("is damaged: between its pages lies something else; get the file again")


def ogg_checksum(page: bytes) -> bytes:
    """The checksum of an Ogg page, 4 bytes: zlib's over turned bits, without what that adds at both ends."""
    return (zlib.crc32(page.translate(_TURNED), 0xFFFFFFFF) ^ 0xFFFFFFFF).to_bytes(4).translate(_TURNED)


def _span_frames(frames: int, rate: int, start: float, duration: float | None, max_seconds: float) -> tuple[int, int]:
    """First sample frame and number of frames of the span asked for."""
    if not (math.isfinite(start) and start >= 0):
        raise ValueError(f"start must be 0 or more seconds, got {start}")
    if duration is not None and not (math.isfinite(duration) and duration > 0):
        raise ValueError(f"duration must be a positive number of seconds, got {duration}")
    first = round(start * rate)
    if first >= frames:
        raise ValueError(f"has {frames / rate:.2f} s of sound, none from {start:g} s on")
    count = frames - first if duration is None else min(frames - first, max(1, round(duration * rate)))
    max_seconds = min(max_seconds, MAX_SAMPLES / rate)
    if count > max_seconds * rate:
        raise ValueError(
            f"would give {count / rate:.0f} s of sound at {rate} Hz, more than max_seconds={max_seconds:g}; "
            "read a part with start and duration"
        )
    return first, count


def _mono(sound: soundfile.SoundFile, first: int, count: int) -> NDArray[Any]:
    """`count` frames from `first`, mixed to one channel."""
    if first:
        sound.seek(first)
    parts = []
    for block in _blocks(sound, count):
        # Written so that NaN fails it too.
        if not (np.abs(block) < MAX_AMPLITUDE).all():
            raise ValueError(f"holds NaN, infinity or amplitudes over {MAX_AMPLITUDE:g} (full scale is 1)")
        parts.append(_mixed(block))
    lost = count - sum(map(len, parts))
    if lost > 0.1 * sound.samplerate or lost == count:
        raise ValueError(
            f"ends {lost / sound.samplerate:.2f} s before its header says (damaged or cut off); "
            "get the whole file, or save the part that is there as a new file in a sound editor"
        )
    return np.concatenate(parts)


def _mixed(block: NDArray[Any]) -> NDArray[Any]:
    """The mean of the channels (frames, channels), or the first where they cancel: one may be another's inverse."""
    mean = block.mean(axis=1)
    # By power, not by the largest sample: a lossy coder leaves noise of what cancels, and some of its samples are high.
    return block[:, 0] if mean.var() < 0.01 * block[:, 0].var() else mean


def _blocks(sound: soundfile.SoundFile, count: int) -> Iterator[NDArray[Any]]:
    """Up to `count` frames as blocks (frames, channels), until the file has no more."""
    step = max(1, _BLOCK_VALUES // sound.channels)
    # Each read ends in a seek, and an MP3 decoder has to find its way again after each: read that in one go.
    whole = sound.read(count, dtype="float32", always_2d=True) if sound.format == "MP3" else None
    for start in range(0, count, step):
        size = min(step, count - start)
        block = sound.read(size, dtype="float32", always_2d=True) if whole is None else whole[start : start + size]
        if not len(block):
            return
        yield block


def wav_bytes(audio: Audio) -> bytes:
    """The content of a WAV file of 16 bits; sound above full scale is turned down as a whole."""
    file = io.BytesIO()
    loudest = max(1.0, float(np.abs(audio.samples).max()))
    with soundfile.SoundFile(file, "w", round(audio.sample_rate), 1, "PCM_16", format="WAV") as sound:
        sound.comment = WRITTEN_BY
        sound.write(audio.samples / loudest)
    return file.getvalue()


def save_audio(path: PathLike, audio: Audio) -> None:
    """Write a sound as `wav_bytes`, whole or not at all."""
    with atomic_write(path) as part:
        part.write_bytes(wav_bytes(audio))


def resampled(audio: Audio, sample_rate: float) -> Audio:
    """The sound at another sample rate R, ceil(S * R / sample_rate) samples of it, as librosa.load gives them."""
    if sample_rate == audio.sample_rate:
        return audio
    count = math.ceil(audio.samples.size * _possible_rate(sample_rate) / audio.sample_rate)
    samples = soxr.resample(audio.samples, audio.sample_rate, sample_rate, quality="HQ")[:count]
    return Audio(np.pad(samples, (0, count - samples.size)), sample_rate)


def _possible_rate(sample_rate: float) -> float:
    """`sample_rate` itself; ValueError where no sound has it."""
    if not MIN_RATE <= sample_rate <= MAX_RATE:
        raise ValueError(f"sample_rate must lie between {MIN_RATE} and {MAX_RATE} Hz, got {sample_rate}")
    return sample_rate


# The sound of video files, through PyAV; and the sound of any file that has one

GAP = 0.05  # seconds between two blocks of sound that are silence; less is rounding of their time stamps
MAX_LATE = 60.0  # seconds that the sound may start behind the pictures
SILENT = 1e-3  # of full scale, which no sample of a silent track exceeds


def load_sound(
    path: PathLike, *, start: float = 0.0, duration: float | None = None, sample_rate: float | None = 22050.0
) -> Audio:
    """The sound in a sound file or in a video, or a part of it, mixed to one channel.

    Parameters and errors are those of `load_audio`; a video is read whole, as an M4A is.
    """
    read = _span if is_video(path) else load_audio
    return read(path, start=start, duration=duration, sample_rate=sample_rate)


def _span(
    path: PathLike, start: float, duration: float | None, sample_rate: float | None, max_seconds: float = 3600.0
) -> Audio:
    """A span of the sound of a video, or of a file in such a container."""
    sound = video_sound(path, sample_rate=sample_rate, max_seconds=max_seconds)
    with named_faults(path):
        _span_frames(sound.samples.size, round(sound.sample_rate), start, duration, max_seconds)
        return sound.span(start, sound.duration - start if duration is None else duration)


def video_sound(path: PathLike, *, sample_rate: float | None = 22050.0, max_seconds: float = 3600.0) -> Audio:
    """The sound of a video, mixed to one channel; it starts with the file, so that it fits `video_frames`.

    Of several tracks, as programs that record a screen write them, the first that is not silent counts.

    Parameters
    ----------
    path : str or path
    sample_rate : float or None, hertz
        Resampled to this rate, in whole hertz. None keeps the file's rate.
    max_seconds : float
        More than this, or than MAX_SAMPLES of all channels, is an error.

    Returns
    -------
    Audio with float32 samples; silence where the sound starts later than the file

    Raises
    ------
    FileNotFoundError, ValueError
        Both name the file; a video without sound is an error.
    """
    tracks = _tracks(path, sample_rate, max_seconds)
    first = next(tracks)
    return next((sound for sound in itertools.chain([first], tracks) if np.abs(sound.samples).max() > SILENT), first)


def _tracks(path: PathLike, sample_rate: float | None, max_seconds: float) -> Iterator[Audio]:
    """The sound of each track of a video, one after the other."""
    number, count = 0, 1
    while number < count:
        with _sound_stream(path, number) as (container, stream):
            rate = round(stream.codec_context.sample_rate if sample_rate is None else _possible_rate(sample_rate))
            pieces = list(_pieces(container, stream, rate, max_seconds))
            if not any(map(len, pieces)):
                raise ValueError("holds no samples of sound")
            number, count = number + 1, len(container.streams.audio)
        yield Audio(_mixed(np.concatenate(pieces)), rate)


@contextmanager
def _sound_stream(path: PathLike, number: int = 0) -> Iterator[tuple[Any, Any]]:
    """The container and a stream of its sound, of a rate that can be read."""
    with opened_container(Path(path)) as container:
        if not container.streams.audio:
            raise ValueError("holds no sound; name the music's own file, before the film or in its place")
        stream = container.streams.audio[number]
        if stream.codec_context is None or not MIN_RATE <= stream.codec_context.sample_rate <= MAX_RATE:
            raise ValueError(f"holds sound that cannot be read; {MIN_RATE} to {MAX_RATE} Hz can be sound")
        yield container, stream


def _pieces(container: Any, stream: Any, rate: int, max_seconds: float) -> Iterator[NDArray[Any]]:
    """Blocks (samples, channels) from the start of the file on; silence first, or the beginning cut, where the sound
    starts apart.

    Silence, too, where sound is missing between two blocks, as players give it. It goes again where the blocks after it
    are in time: then none was missing, and one block came late, as where a browser records.
    """
    layout = stream.codec_context.layout
    resampler, channels = av.AudioResampler(format="flt", layout=layout, rate=rate), layout.nb_channels
    skip, count, due, put, max_seconds = None, 0, None, 0.0, min(max_seconds, MAX_SAMPLES / channels / rate)
    for block in itertools.chain(container.decode(stream), [None]):  # None empties the resampler
        if skip is None:
            late = (block.time or 0.0) - (container.start_time or 0) / av.time_base if block is not None else 0.0
            if not (math.isfinite(late) and abs(late) <= MAX_LATE):
                raise ValueError(f"starts its sound {late:.0f} s from its pictures; its time stamps are damaged")
            skip, count = max(0, -round(late * rate)), max(0, round(late * rate))
            yield np.zeros((count, channels), np.float32)
        gap = 0.0 if block is None or block.time is None or due is None else block.time - due
        taken = min(max(-gap, 0.0), put)  # seconds of the silence that was put in
        skip, put = skip + round(taken * rate), put + (gap if gap > GAP else -taken)
        frames = resampler.resample(None if gap > GAP else block)
        parts = [frame.to_ndarray().reshape(-1, channels) for frame in frames]
        if gap > GAP:
            resampler = av.AudioResampler(format="flt", layout=layout, rate=rate)
            parts.append(np.zeros((round(min(gap, max_seconds + 1) * rate), channels), np.float32))
            parts += [frame.to_ndarray().reshape(-1, channels) for frame in resampler.resample(block)]
        if block is not None and block.time is not None:
            due = (block.time if due is None or gap > GAP else due - taken) + block.samples / block.sample_rate
        for part in parts:
            samples, skip = part[skip:], max(0, skip - len(part))
            count += len(samples)
            if count > max_seconds * rate:
                raise ValueError(f"has more than {max_seconds:g} s of sound; cut it into parts")
            yield samples
    # An AVI tells no duration of sound without coding: its frames are samples.
    stated = tagged_seconds(stream) or float(stream.frames and (stream.duration or stream.frames) * stream.time_base)
    if count < (0.95 * stated - 1) * rate:
        raise ValueError(f"is cut off or damaged: {count / rate:.1f} of {stated:.1f} s of sound are there")
