"""Sound files: every format, spans, rates, and the errors of damaged ones."""

import struct
from pathlib import Path

import numpy as np
import pytest
import soundfile

from harmolab.readers.audio import audio_info, load_audio
from tests.builders import cases, refused

RATE = 8000


def ramp(seconds: float = 1.0, rate: int = RATE) -> np.ndarray:
    """Samples that rise from 0 to 0.5, so that a sample tells where it comes from."""
    return np.linspace(0, 0.5, round(seconds * rate), endpoint=False)


def sine(hertz: float, rate: int, seconds: float = 1.0) -> np.ndarray:
    return 0.5 * np.sin(2 * np.pi * hertz * np.arange(round(seconds * rate)) / rate)


def wav_header(*, rate: int = RATE, channels: int = 1, data_bytes: int = 0, riff_bytes: int | None = None) -> bytes:
    format = struct.pack("<HHIIHH", 1, channels, rate, rate * channels * 2, channels * 2, 16)
    body = b"WAVEfmt " + struct.pack("<I", 16) + format + b"data" + struct.pack("<I", data_bytes)
    return b"RIFF" + struct.pack("<I", len(body) + data_bytes if riff_bytes is None else riff_bytes) + body


@pytest.mark.parametrize(("suffix", "tolerance"), [("wav", 1e-4), ("flac", 1e-4), ("ogg", 0.03), ("mp3", 0.03)])
def test_tone_comes_back_from_every_format(tmp_path: Path, suffix: str, tolerance: float):
    path = tmp_path / f"tone.{suffix}"
    tone = sine(440, 16000)
    soundfile.write(path, tone, 16000)
    audio = load_audio(path, sample_rate=None)
    assert (audio.sample_rate, audio.samples.dtype) == (16000, np.float32)
    np.testing.assert_allclose(audio.samples[1000:15000], tone[1000:15000], atol=tolerance)


def test_stereo_becomes_the_mean_of_its_channels(tmp_path: Path):
    soundfile.write(tmp_path / "two.wav", np.stack([np.full(100, 0.5), np.full(100, -0.25)], axis=1), RATE)
    np.testing.assert_allclose(load_audio(tmp_path / "two.wav", sample_rate=None).samples, 0.125, atol=1e-4)


def test_header_tells_rate_seconds_channels_and_format(tmp_path: Path):
    soundfile.write(tmp_path / "two.flac", np.zeros((12000, 2)), RATE)
    assert audio_info(tmp_path / "two.flac") == (8000, 1.5, 2, "FLAC")


def test_span_is_cut_at_the_sample(tmp_path: Path):
    soundfile.write(tmp_path / "ramp.wav", ramp(), RATE, subtype="FLOAT")
    audio = load_audio(tmp_path / "ramp.wav", start=0.25, duration=0.5, sample_rate=None)
    np.testing.assert_allclose(audio.samples, ramp()[2000:6000], atol=1e-7)


def test_span_behind_the_end_stops_at_the_end(tmp_path: Path):
    soundfile.write(tmp_path / "ramp.wav", ramp(), RATE)
    assert load_audio(tmp_path / "ramp.wav", start=0.75, duration=10, sample_rate=None).duration == 0.25


def test_default_rate_is_22050_and_keeps_pitch_and_length(tmp_path: Path):
    soundfile.write(tmp_path / "tone.wav", sine(1000, 44100), 44100)
    audio = load_audio(tmp_path / "tone.wav")
    assert (audio.sample_rate, audio.samples.size) == (22050, 22050)
    np.testing.assert_allclose(audio.samples[500:-500], sine(1000, 22050)[500:-500], atol=1e-3)


def test_resampled_length_is_rounded_up_as_librosa_does(tmp_path: Path):
    soundfile.write(tmp_path / "short.wav", ramp(1001 / RATE), RATE)
    assert load_audio(tmp_path / "short.wav").samples.size == 2760  # 1001 * 22050 / 8000 = 2759.006


def test_long_file_is_refused_from_its_header_and_a_part_is_proposed(tmp_path: Path):
    soundfile.write(tmp_path / "long.flac", np.zeros(12 * RATE), RATE)
    with pytest.raises(ValueError, match=r"long\.flac: would give 12 s .* max_seconds=10; read a part with start"):
        load_audio(tmp_path / "long.flac", max_seconds=10)
    assert load_audio(tmp_path / "long.flac", start=1, duration=10, max_seconds=10, sample_rate=None).duration == 10


def test_ten_hours_are_refused_by_default_without_being_read(tmp_path: Path):
    path = tmp_path / "night.wav"
    size = 10 * 3600 * RATE * 2
    with path.open("wb") as stream:
        stream.write(wav_header(data_bytes=size))
        stream.truncate(44 + size)  # a file with a hole: no room on the disk
    refused(r"night\.wav: would give 36000 s of sound", load_audio, path)
    assert load_audio(path, start=30000, duration=2, sample_rate=None).duration == 2


def test_part_of_a_file_longer_than_memory_is_read_by_seeking(tmp_path: Path):
    path = tmp_path / "far.wav"
    with path.open("wb") as stream:
        stream.write(wav_header(data_bytes=2_000_000_000))
        stream.seek(44 + 900_000_000 * 2)
        stream.write(np.full(100, 16384, "<i2").tobytes())
        stream.truncate(44 + 2_000_000_000)
    audio = load_audio(path, start=900_000_000 / RATE, duration=100 / RATE, sample_rate=None)
    np.testing.assert_allclose(audio.samples, 0.5, atol=1e-4)


@cases(
    "content, fault",
    (b"", "the file is empty"),
    (b"not sound at all, but text", "cannot be read as WAV, FLAC, OGG or MP3"),
    (wav_header(), "holds no samples"),
    (wav_header(rate=0, data_bytes=200) + bytes(200), "sample rate|cannot be read"),
    (wav_header(rate=4_000_000, data_bytes=200) + bytes(200), "sample rate of 4000000 Hz"),
    (wav_header(channels=0, data_bytes=200) + bytes(200), "channels|cannot be read"),
    (wav_header(channels=200, data_bytes=4000) + bytes(4000), "has 200 channels"),
    (wav_header(data_bytes=100_000) + bytes(20_000), "is cut off: 20044 of 100044 bytes"),
)
def test_damaged_sound_is_refused_with_its_fault(tmp_path: Path, content: bytes, fault: str):
    path = tmp_path / "bad.wav"
    path.write_bytes(content)
    refused(rf"bad\.wav: .*({fault})", load_audio, path)


def test_wav_from_a_pipe_with_unknown_length_is_read_to_its_end(tmp_path: Path):
    path = tmp_path / "piped.wav"
    path.write_bytes(wav_header(data_bytes=0xFFFFFFFF, riff_bytes=0xFFFFFFFF) + np.full(400, 8192, "<i2").tobytes())
    np.testing.assert_allclose(load_audio(path, sample_rate=None).samples, np.full(400, 0.25), atol=1e-4)


@pytest.mark.parametrize("suffix", ["flac", "ogg", "mp3"])
def test_half_of_a_packed_file_is_refused_but_what_is_there_can_be_read(tmp_path: Path, suffix: str):
    path = tmp_path / f"cut.{suffix}"
    soundfile.write(path, np.random.default_rng(1).uniform(-0.5, 0.5, 4 * 16000), 16000)
    whole = load_audio(path, sample_rate=None)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    refused(rf"cut\.{suffix}: .*(cut off|lost sync)", load_audio, path)
    part = load_audio(path, duration=0.5, sample_rate=None)
    np.testing.assert_allclose(part.samples, whole.samples[:8000], atol=1e-6)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_sample_that_is_no_sound_is_refused(tmp_path: Path, value: float):
    samples = ramp()
    samples[4321] = value
    soundfile.write(tmp_path / "bad.wav", samples, RATE, subtype="FLOAT")
    refused(r"bad\.wav: holds NaN, infinity or amplitudes", load_audio, tmp_path / "bad.wav")


@cases(
    "options, fault",
    ({"start": -1.0}, "start must be 0 or more"),
    ({"start": 1.0}, r"has 1\.00 s of sound, none from 1 s on"),
    ({"start": float("nan")}, "start must be 0 or more"),
    ({"duration": 0.0}, "duration must be a positive"),
    ({"sample_rate": 0.0}, "sample_rate must lie between"),
)
def test_impossible_span_is_refused(tmp_path: Path, options: dict[str, float], fault: str):
    soundfile.write(tmp_path / "ramp.wav", ramp(), RATE)
    refused(rf"ramp\.wav: .*{fault}", load_audio, tmp_path / "ramp.wav", **options)


def test_other_sound_format_is_refused_by_name(tmp_path: Path):
    soundfile.write(tmp_path / "tone.aiff", ramp(), RATE)
    refused(r"tone\.aiff: is a AIFF file", load_audio, tmp_path / "tone.aiff")


def test_missing_file_folder_and_pipe_are_told_apart(tmp_path: Path):
    with pytest.raises(FileNotFoundError, match=r"none\.wav: no such file"):
        load_audio(tmp_path / "none.wav")
    refused("is a folder", audio_info, tmp_path)
    refused("is a device or a pipe", load_audio, "/dev/zero")


@pytest.mark.data
def test_span_of_a_recording_equals_the_same_span_of_the_whole(data_root: Path):
    path = data_root / "tang2018" / "DANCE_C_2" / "audio.mp3"
    whole = load_audio(path)
    part = load_audio(path, start=20.0, duration=6.0)
    np.testing.assert_allclose(part.samples, whole.samples[441000:573300], atol=1e-5)


@pytest.mark.data
@cases(
    "name, seconds",
    ("extra/librosa/147793__setuniman__sweet-waltz-0i-22mi.ogg", 49.2),
    ("extra/madmom/sample.wav", 2.8),
    ("extra/ballroom/Waltz/Media-105901.wav", 31.79),
    ("tang2018/DANCE_C_2/audio.mp3", 84.24),
)
def test_recording_has_its_known_length(data_root: Path, name: str, seconds: float):
    assert audio_info(data_root / name).seconds == pytest.approx(seconds, abs=0.01)
    assert load_audio(data_root / name).duration == pytest.approx(seconds, abs=0.01)
