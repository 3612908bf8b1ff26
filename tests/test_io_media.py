"""Sound files, videos and beat annotations: every format, spans and rates, and one clear error for damaged ones."""

import json
import struct
import wave
from collections.abc import Callable, Iterable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import patch

import av
import cv2
import numpy as np
import pytest
import soundfile
from av.video.reformatter import VideoReformatter

from harmolab.files import WRITTEN_BY
from harmolab.lab.render.scene import render_dance
from harmolab.readers import audio, beats
from harmolab.readers.audio import audio_info, load_audio, load_sound, resampled, video_sound
from harmolab.readers.beats import BeatAnnotation, Unit, load_annotation, load_beats, save_beats
from harmolab.readers.video import video_frames, write_video
from harmolab.score import score_harmony
from harmolab.types import Audio, BeatTrack, Motion
from tests.builders import cases, missing, refused, track
from tests.phone_videos import write_sound
from tests.test_hostile import mutated

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
    path, tone = tmp_path / f"tone.{suffix}", sine(440, 16000)
    soundfile.write(path, tone, 16000)
    sound = load_audio(path, sample_rate=None)
    assert (sound.sample_rate, sound.samples.dtype) == (16000, np.float32)
    np.testing.assert_allclose(sound.samples[1000:15000], tone[1000:15000], atol=tolerance)


def test_m4a_of_a_phone_is_read_at_its_time_whole_or_in_part_and_a_damaged_one_is_named(tmp_path: Path):
    path, noise = tmp_path / "memo.m4a", np.random.default_rng(1).normal(0.0, 0.1, 48000)
    with av.open(str(path), "w", format="ipod") as container:
        write_sound(container, Audio(noise, 48000))
    assert audio_info(path) == (48000, pytest.approx(1.0, abs=0.05), 1, "M4A")
    whole = load_audio(path, sample_rate=None).samples
    assert np.correlate(noise[2900:45100], whole[3000:45000], "valid").argmax() == 100
    assert (load_audio(path, start=0.25, duration=0.5, sample_rate=None).samples == whole[12000:36000]).all()
    assert (load_audio(path).samples == resampled(load_audio(path, sample_rate=None), 22050.0).samples).all()
    for wrong in ({"start": -1.0}, {"duration": 0.0}, {"sample_rate": 0.0}, {"sample_rate": 10.0}):
        refused(rf"memo\.m4a: {next(iter(wrong))} must", load_audio, path, **wrong)
    path.write_bytes(b"no sound" * 99)
    for read in (load_audio, audio_info):
        refused("memo.m4a: cannot be read as sound", read, path)


def test_stereo_becomes_the_mean_of_its_channels_and_its_header_tells_their_number(tmp_path: Path):
    soundfile.write(tmp_path / "two.flac", np.stack([np.full(12000, 0.5), np.full(12000, -0.25)], axis=1), RATE)
    np.testing.assert_allclose(load_audio(tmp_path / "two.flac", sample_rate=None).samples, 0.125, atol=1e-4)
    assert audio_info(tmp_path / "two.flac") == (8000, 1.5, 2, "FLAC")


@cases("left_over", 0.0, 0.2 * (np.arange(RATE) == 4000), 0.02)  # a high sample, as of a lossy coder; a constant
def test_channels_that_cancel_each_other_are_not_mixed(tmp_path: Path, left_over: float | np.ndarray):
    soundfile.write(tmp_path / "two.wav", np.stack([ramp(), left_over - ramp()], axis=1), RATE, subtype="FLOAT")
    np.testing.assert_allclose(load_audio(tmp_path / "two.wav", sample_rate=None).samples, ramp(), atol=1e-7)


def test_channels_of_a_video_that_cancel_each_other_are_not_mixed(tmp_path: Path):
    with av.open(str(tmp_path / "two.mkv"), "w") as container:
        stream = container.add_stream("pcm_f32le", rate=RATE, layout="stereo")
        block = av.AudioFrame.from_ndarray(np.float32([ramp(), -ramp()]).T.reshape(1, -1), "flt", "stereo")
        block.sample_rate, block.pts = RATE, 0
        container.mux([*stream.encode(block), *stream.encode(None)])
    np.testing.assert_allclose(video_sound(tmp_path / "two.mkv", sample_rate=None).samples, ramp(), atol=1e-6)


@cases("levels, taken", ((0.0, 0.5), 1), ((0.0, 0.0, 0.5), 2), ((0.25, 0.5), 0), ((0.0, 0.0), 0))
def test_of_several_sound_tracks_of_a_video_the_first_that_is_not_silent_counts(
    tmp_path: Path, levels: tuple[float, ...], taken: int
):
    with av.open(str(tmp_path / "game_and_microphone.mkv"), "w") as container:
        streams = [container.add_stream("pcm_f32le", rate=RATE, layout="mono") for _ in levels]
        for stream, level in zip(streams, levels, strict=True):
            block = av.AudioFrame.from_ndarray(np.float32([level * ramp()]), "flt", "mono")
            block.sample_rate, block.pts = RATE, 0
            container.mux([*stream.encode(block), *stream.encode(None)])
    sound = load_sound(tmp_path / "game_and_microphone.mkv", sample_rate=None)
    np.testing.assert_allclose(sound.samples, levels[taken] * ramp(), atol=1e-6)


def test_on_windows_libsndfile_gets_a_name_as_text(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Of bytes it knows the old code page there, in which a letter beyond ASCII is another than in UTF-8."""

    class OfText(soundfile.SoundFile):
        def __init__(self, name: str) -> None:
            super().__init__(name.encode())

    path = tmp_path / "Zoë 春.wav"
    soundfile.write(path, ramp(), RATE)
    monkeypatch.setattr(audio, "sys", SimpleNamespace(platform="win32"), raising=False)
    monkeypatch.setattr(soundfile, "SoundFile", OfText)
    assert (audio_info(path).seconds, load_audio(path).duration) == (1.0, 1.0)


def test_span_is_cut_at_the_sample_and_stops_at_the_end(tmp_path: Path):
    soundfile.write(tmp_path / "ramp.wav", ramp(), RATE, subtype="FLOAT")
    audio = load_audio(tmp_path / "ramp.wav", start=0.25, duration=0.5, sample_rate=None)
    np.testing.assert_allclose(audio.samples, ramp()[2000:6000], atol=1e-7)
    assert load_audio(tmp_path / "ramp.wav", start=0.75, duration=10, sample_rate=None).duration == 0.25


def test_default_rate_is_22050_and_keeps_pitch_and_length(tmp_path: Path):
    soundfile.write(tmp_path / "tone.wav", sine(1000, 44100), 44100)
    audio = load_audio(tmp_path / "tone.wav")
    assert (audio.sample_rate, audio.samples.size) == (22050, 22050)
    np.testing.assert_allclose(audio.samples[500:-500], sine(1000, 22050)[500:-500], atol=1e-3)


def test_resampled_length_is_rounded_up_as_librosa_does(tmp_path: Path):
    soundfile.write(tmp_path / "short.wav", ramp(1001 / RATE), RATE)
    assert load_audio(tmp_path / "short.wav").samples.size == 2760  # 1001 * 22050 / 8000 = 2759.006


def test_of_more_sound_than_allowed_a_part_is_read_by_seeking(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path, size = tmp_path / "night.wav", 34 * 3600 * RATE * 2
    with path.open("wb") as stream:
        stream.write(wav_header(data_bytes=size))
        stream.seek(44 + 900_000_000 * 2)
        stream.write(np.full(100, 16384, "<i2").tobytes())
        stream.truncate(44 + size)  # a file with a hole: no room on the disk
    refused("would give 12 s .* max_seconds=10;", load_audio, path, duration=12, max_seconds=10)
    refused(r"night\.wav: would give 122400 s .* max_seconds=3600; read a part with start", load_audio, path)
    far = load_audio(path, start=900_000_000 / RATE, duration=100 / RATE, max_seconds=10, sample_rate=None)
    np.testing.assert_allclose(far.samples, 0.5, atol=1e-4)
    monkeypatch.setattr(audio, "MAX_SAMPLES", 80)
    refused("would give 0 s of sound at 8000 Hz, more than max_seconds=0.01;", load_audio, path, duration=81 / RATE)


@cases(
    "content, fault",
    (b"", "the file is empty"),
    (b"not sound at all, but text", "cannot be read as WAV, FLAC, OGG, MP3 or M4A sound; convert it"),
    (wav_header(), "holds no samples"),
    (b"\xff\xf3\x80\xc4" + bytes(16), r"cannot be read as WAV, .* \(damaged or cut off\)"),
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
    whole = load_audio(path, sample_rate=None).samples
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    refused(rf"cut\.{suffix}: .*(cut off|lost sync)", load_audio, path)
    np.testing.assert_allclose(load_audio(path, duration=0.5, sample_rate=None).samples, whole[:8000], atol=1e-6)


def test_a_flac_from_a_pipe_is_refused_with_what_mends_it(tmp_path: Path):
    soundfile.write(tmp_path / "piped.flac", ramp(), RATE)
    whole = (tmp_path / "piped.flac").read_bytes()
    (tmp_path / "piped.flac").write_bytes(whole[:21] + bytes([whole[21] & 0xF0]) + bytes(4) + whole[26:])  # no length
    refused(r"piped\.flac: does not tell its length, .*: ffmpeg -i piped", load_audio, tmp_path / "piped.flac")


@pytest.mark.parametrize("suffix", ["flac", "mp3"])
def test_a_packed_file_that_says_less_than_it_holds_is_refused(tmp_path: Path, suffix: str):
    path = tmp_path / f"two.{suffix}"
    soundfile.write(path, np.random.default_rng(1).uniform(-0.5, 0.5, 4 * 16000), 16000)
    path.write_bytes(2 * path.read_bytes())
    refused(rf"two\.{suffix}: says that it lasts 4\.0 s, and holds [78]\.\d s of sound: its begin", load_audio, path)


def test_an_ogg_with_a_damaged_page_is_refused_since_the_sound_after_it_would_come_too_early(tmp_path: Path):
    path = tmp_path / "damaged.ogg"
    soundfile.write(path, np.random.default_rng(1).uniform(-0.5, 0.5, 4 * 16000), 16000)
    whole = path.read_bytes()
    last = whole.rfind(b"OggS")
    path.write_bytes(whole[: last - 9] + bytes([whole[last - 9] ^ 1]) + whole[last - 8 :])
    refused(r"damaged\.ogg: is damaged: a page of it fails its check sum", load_audio, path)
    path.write_bytes(whole[:last] + b"more" + whole[last:])
    refused(r"damaged\.ogg: is damaged: between its pages lies something else", load_audio, path)
    path.write_bytes(whole * 2)
    refused(r"damaged\.ogg: was joined of several sounds, of which one would be read; save it", load_audio, path)


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e30])
def test_sample_that_is_no_sound_is_refused(tmp_path: Path, value: float):
    soundfile.write(tmp_path / "bad.wav", np.where(np.arange(RATE) == 4321, value, ramp()), RATE, subtype="FLOAT")
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


def test_another_format_a_missing_file_a_folder_and_a_pipe_are_told_apart(tmp_path: Path):
    soundfile.write(tmp_path / "tone.aiff", ramp(), RATE)
    refused(r"tone\.aiff: is a AIFF file", load_audio, tmp_path / "tone.aiff")
    missing(r"none\.wav: no such file", load_audio, tmp_path / "none.wav")
    refused("is a folder", audio_info, tmp_path)
    refused("is a device or a pipe", load_audio, "/dev/zero")
    with patch.object(Path, "stat", side_effect=PermissionError(13, "Permission denied")):
        refused(r"closed\.wav: Permission denied$", load_audio, tmp_path / "closed.wav")


@pytest.mark.data
def test_span_of_a_recording_equals_the_same_span_of_the_whole(data_root: Path):
    path = data_root / "tang2018" / "DANCE_C_2" / "audio.mp3"
    whole, part = load_audio(path), load_audio(path, start=20.0, duration=6.0)
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


# Beat annotations

UNIT = {"name": "W-3-1", "start_s": 0.5, "end_s": 2.0, "beats": 3, "figure": "W-3"}
WALTZ = {
    "beats_s": [0.5, 1.0, 1.5, 2.0], "downbeats_s": [0.5, 2.0], "meter": 3, "bpm": 120.0, "dance": "waltz",
    "source": "synthetic", "seed": 1, "motion_offset_s": 0.25, "units": [UNIT],
}  # fmt: skip


def write(folder: Path, name: str, content: object) -> Path:
    (folder / name).write_text(content if isinstance(content, str) else json.dumps(content), errors="surrogateescape")
    return folder / name


def test_beats_file_gives_times_bars_and_tempo(tmp_path: Path):
    notes = load_annotation(write(tmp_path, "song.beats", "# by hand\n0.5 1\n1.0\t2\n\n1.5 3\n2.0 1\n2.5 2\n"))
    np.testing.assert_array_equal(notes.times, [0.5, 1.0, 1.5, 2.0, 2.5])
    np.testing.assert_array_equal(notes.downbeats, [0.5, 2.0])
    assert (notes.meter, notes.bpm) == (3, 120.0)


def test_track_has_equal_strengths_and_ends_one_beat_after_the_last_or_where_that_is_told(tmp_path: Path):
    path = write(tmp_path, "song.txt", "0.5\n1.0\n1.5\n")
    np.testing.assert_array_equal(load_beats(path).strengths, [1, 1, 1])
    assert (load_beats(path).duration, load_beats(path, duration=30.0).duration) == (2.0, 30.0)
    refused(r"song\.txt: beat times reach 1.5 in a clip of 1 s; were these frames", load_beats, path, duration=1.0)


@cases("text", "time,strength\n0.5,2\n1.0,0\n", "0.5;2\n1.0;0\n", "0.5\t2\n1.0\t0\n", "0.5, 2\r\n1.0, 0")
def test_second_column_of_a_table_is_the_strength(tmp_path: Path, text: str):
    beats = load_beats(write(tmp_path, "song.csv", text))
    np.testing.assert_array_equal(beats.times, [0.5, 1.0])
    np.testing.assert_array_equal(beats.strengths, [2.0, 0.0])


@cases(
    "text, places, strengths",
    ("1.0 1\n1.5 2\n2.0 3\n2.5 1\n", [0, 1, 2, 0], [1, 1, 1, 1]),
    ("1.0 3\n1.5 4\n2.0 1\n2.5 2\n3.0 3\n", [2, 3, 0, 1, 2], [1, 1, 1, 1, 1]),
    ("1.0 1\n1.5 2\n2.0 1\n2.5 2\n", None, [1, 2, 1, 2]),
    ("1.0 1\n1.5 2\n2.0 4\n2.5 1\n3.0 2\n", None, [1, 2, 4, 1, 2]),
    ("1.0 1.0\n1.5 1.5\n2.0 2.0\n", None, [1, 1, 1]),
    ("1.0\t1.0\t1\n1.5\t1.5\tsecond, weak\n2.0\t2.0\t\n", None, [1, 1, 1]),
    ("time\n1.0\t1.0\tbar 1\n1.5\n2.0\t2.0\t\n", None, [1, 1, 1]),
    ("0.500000000,New Point\n1.0,New Point\n1.5,\n2.0,1\n", None, [1, 1, 1, 1]),
    ("0.5,120.19 bpm\n1.0,120.19 bpm\n1.5,\n", None, [1, 1, 1]),
    ('0.5,"120.19 bpm"\n1.0,"117.45 bpm"\n1.5\n', None, [1, 1, 1]),
    ("0.5\t60 bpm\n1.5\t60 bpm\n2.5\t\n", None, [1, 1, 1]),
    ("0.5,1\n1.0,2\n1.52,3\n2.0,4\n", None, [1, 1, 1, 1]),
    ('"TIME","LABEL"\n0.5,"1"\n1.0,"2"\n1.5,"3"\n2.0,"1"\n', [0, 1, 2, 0], [1, 1, 1, 1]),
    ("0.5,1.2\n1.0,1.3\n1.5,2.1\n2.0,2.2\n", [1, 2, 0, 1], [1, 1, 1, 1]),
    ("0.5,1.9\n1.0,2.1\n", None, [1.9, 2.1]),
    ("time_s,is_downbeat\n0.5,0\n1.0,1\n1.5,0\n2.0,0\n2.5,1\n", [2, 0, 1, 2, 0], [1, 1, 1, 1, 1]),
    ids=[
        *(
            "madmom",
            "from the third beat",
            "strong and weak",
            "strengths that skip",
            "Audacity",
            "with a text",
            "mixed",
        ),
        *(
            "Sonic Visualiser",
            "QM's beats",
            "QM's beats in quotes",
            "QM's beats in tabs",
            "beats counted",
            "in quotes",
            "bar and place",
            "no bars",
            "1 where a bar begins",
        ),
    ],
)
def test_second_column_of_other_programs_is_no_strength(tmp_path: Path, text: str, places, strengths: list[float]):
    for name in ("song.txt", "song.csv"):
        beats = load_beats(write(tmp_path, name, text))
        np.testing.assert_array_equal(beats.strengths, strengths)
        assert (beats.bar_places is None) if places is None else (list(beats.bar_places) == places)


@cases(
    "text, times",
    ("time\n0,250\n0,750\n1,250\n", [0.25, 0.75, 1.25]),
    ("0,250\n1,280\n2,310\n", [0.25, 1.28, 2.31]),
    ("0,500000\t0,500000\tbar 1\n2,500000\t2,500000\tbar 2\n", [0.5, 2.5]),
    ("0,250000\t0,250000\n1,280000\t1,280000\n", [0.25, 1.28]),
    ("0,5\n1,0\n1,5\n", [0.5, 1.0, 1.5]),
    ("1,1\n2,5\n3,1\n", [1.0, 2.0, 3.0]),
    ("0,250\n1.5\n", None),
    ids=["two a second", "slow", "Audacity", "labels without a text", "one digit", "strengths", "mixed"],
)
def test_a_comma_may_be_that_of_a_decimal(tmp_path: Path, text: str, times: list[float] | None):
    path = write(tmp_path, "song.txt", text)
    if times is None:
        refused(r"song\.txt: line 2 has 1 columns, the first has 2", load_beats, path)
    else:
        np.testing.assert_array_equal(load_beats(path).times, times)


def test_json_gives_everything_that_was_written_down_and_beats_alone_are_enough(tmp_path: Path):
    bare = load_annotation(write(tmp_path, "beats.json", {"beats_s": [1.0, 2.0], "downbeats_s": None}))
    assert (bare.downbeats, bare.meter, bare.bpm, bare.dance, bare.units) == (None, None, None, "", ())
    notes = load_annotation(write(tmp_path, "beats.json", WALTZ))
    np.testing.assert_array_equal(notes.times, WALTZ["beats_s"])
    np.testing.assert_array_equal(notes.downbeats, [0.5, 2.0])
    assert (notes.meter, notes.bpm, notes.dance, notes.source, notes.offset) == (3, 120.0, "waltz", "synthetic", 0.25)
    assert notes.units == (Unit("W-3-1", 0.5, 2.0, 3, "W-3"),)


def test_json_of_other_programs_has_beats_and_downbeats_which_tell_the_meter(tmp_path: Path):
    written = {"path": "song.mp3", "bpm": 120, "beats": [0.5, 1.0, 1.5, 2.0, 2.5], "downbeats": [1.0, 2.5]}
    notes = load_annotation(write(tmp_path, "song.json", written | {"beat_positions": [3, 1, 2, 3, 1], "segments": []}))
    np.testing.assert_array_equal(notes.times, written["beats"])
    assert (notes.bpm, notes.meter, list(notes.bar_places())) == (120, 3, [2, 0, 1, 2, 0])
    places = [2, 0, 1, 2, 0, 1, 0, 1, 2, 0]  # with a bar of two beats, and downbeats beyond both ends
    beats, ones = 0.5 + 0.5 * np.arange(10), [0.2, *(0.5 + 0.5 * np.flatnonzero(np.equal(places, 0))), 6.5]
    notes = load_annotation(write(tmp_path, "song.json", {"beats": beats.tolist(), "downbeats": ones, "meter": 3}))
    assert list(notes.bar_places()) == places


def test_beats_in_frames_or_milliseconds_are_refused_but_not_slow_music_in_whole_seconds(tmp_path: Path):
    for times in ([12, 24, 37, 50], [500, 1000, 1500, 2000], [12.5, 25.0, 37.5, 50.0, 62.5]):
        path = write(tmp_path, "song.txt", "\n".join(map(str, times)))
        refused(r"song\.txt: beat times lie .* apart; were these frames or milliseconds", load_beats, path)
    assert len(load_beats(write(tmp_path, "song.txt", "1\n2\n3\n4\n5\n"))) == 5


def test_lines_of_a_beats_file_are_counted_before_they_are_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(beats, "_are_decimal_commas", None)
    refused("100001 lines of numbers", load_beats, write(tmp_path, "song.beats", "0.5\n" * 100_001))


@cases(
    "name, content, fault",
    ("song.beats", "", "the file is empty"),
    ("song.beats", "# silence\n", "holds no beats"),
    ("song.txt", "\udcff\udcfe0", "no text in UTF-8: if it is text, save it in that encoding"),
    ("song.beats", "0.5 1\n0.4 2\n", r"increase strictly, but 0\.4 follows 0\.5"),
    ("song.beats", "0.5 1\n0.5 2\n", "drop doubles"),
    ("song.beats", "-0.5 1\n0.5 2\n", r"start at -0\.5 s"),
    ("song.beats", "0.5 1\n1.0 nan\n", "line 2: 'nan' is not a number"),
    ("song.beats", "0.5 1\n1.0 x\n", "line 2: 'x' is not a number"),
    ("song.beats", "0.5 1\n1.0\n", "line 2 has 1 columns, the first has 2"),
    ("song.beats", "0.5 1.5\n1.0 2\n", "place in its bar"),
    ("song.beats", "time place\n1.0 2\n", "line 1: 'time' is not a number"),
    ("song.csv", "0.5,1,7\n", "has 3 columns"),
    ("song.csv", "0.5,-1\n", "strengths must not be negative"),
    ("song.csv", "0.5,0.8\n1.0,O.8\n1.5,0.4\n", "line 2: 'O.8' is not a number"),
    ("song.csv", ",time\n0,0.5\n1,1.25\n2,2\n3,2.75\n", "second column that rises as times and counts do"),
    ("song.csv", "time,is_downbeat\n0.5,True\n1.0,False\n", "line 2: 'True' is not a number"),
    ("song.csv", ",0\n0,0.5\n1,1.25\n2,2\n3,2.75\n", "second column that rises as times and counts do"),
    ("song.txt", "0.5\t0.6\n1.25\t1.35\n2\t2.1\n2.75\t2.85\n", "write the time of each beat, alone"),
    ("song.txt", "0.5 1\n1.25 1\n2 2\n2.75 2\n", "no strengths"),
    ("song.csv", "\n\n", "holds no beats; a line for each"),
    ("song.txt", "hello\n", "holds no beats; a line for each"),
    ("song.doc", "0.5\n", r"no beat annotation that is known; \.beats"),
    ("beats.json", "{", "cannot be read as a beat annotation"),
    ("beats.json", "[1, 2]", "has no 'beats_s'"),
    ("beats.json", {"beats_s": [[1, 2]]}, r"shape \(any\), got \(1, 2\)"),
    ("beats.json", {"beats_s": [1, None]}, "NaN or infinity"),
    ("beats.json", {"beats_s": [1, {}]}, "must be numbers"),
    ("beats.json", {"beats_s": [], "dance": "waltz"}, "holds no beats: 'beats_s' is empty"),
    ("beats.json", {"beats_s": None}, "holds no beats: 'beats_s' is empty"),
    ("beats.json", WALTZ | {"meter": "three"}, "'meter' must be a number"),
    ("beats.json", WALTZ | {"bpm": -3}, "bpm must be positive"),
    ("beats.json", WALTZ | {"units": [{"name": "W-1"}]}, "'start_s' must be a number"),
    ("beats.json", WALTZ | {"units": [UNIT | {"end_s": 0.5}]}, "must end after it starts"),
)
def test_damaged_annotation_is_refused_with_its_fault(tmp_path: Path, name: str, content: object, fault: str):
    refused(rf"{name}: .*{fault}", load_beats, write(tmp_path, name, content))


def test_beats_that_were_written_are_read_again(tmp_path: Path):
    path = tmp_path / "song.beats"
    save_beats(path, track([0.5, 1.0, 1.5, 2.0], bar_places=[2, 0, 1, 2]), comment="by\nhand")
    assert path.read_text() == "# written by harmolab: by hand\n0.5000 3\n1.0000 1\n1.5000 2\n2.0000 3\n"
    save_beats(path, replace(track([0.25, 1.0]), quality=0.9, fit=0.5))
    assert not load_beats(path).is_sure and load_beats(path).fit == 0.5  # they are no better for being in a file
    save_beats(path, BeatTrack([1.0, 1.99996], [1, 1], 100.0, 1.99996))
    assert load_beats(path, duration=1.99996).times[1] == 1.9999  # 2.0000 would lie beyond the song
    save_beats(path, track([0.25, 1.0]))
    assert path.read_text() == "# written by harmolab\n0.2500\n1.0000\n"
    assert (load_annotation(path).meter, load_annotation(path).downbeats) == (None, None)


def test_beats_are_written_under_a_name_that_says_so_and_where_there_are_some(tmp_path: Path):
    refused(r"song\.wav: beats are written as \.beats", save_beats, tmp_path / "song.wav", track([0.5, 1.0]))
    refused(r"song.beats: there are no beats to write", save_beats, tmp_path / "song.beats", track([]))
    for times in ([1.00001, 1.00003], [0.0, 10.0, 20.0, 30.0]):
        refused("song.beats: beat times", save_beats, tmp_path / "song.beats", track(times, duration=40.0))
    assert list(tmp_path.iterdir()) == []


def test_annotation_cannot_be_changed():
    refused("read-only", BeatAnnotation([0.5, 1.0]).times.__setitem__, 0, 3.0)


@pytest.mark.data
@pytest.mark.parametrize(
    ("name", "beats", "meter", "bpm"),
    [("Media-105901", 40, 3, 84), ("Media-104309", 90, 3, 180), ("Albums-Cafe_Paradiso-05", 63, 4, 125)],
)
def test_ballroom_annotation_has_its_meter_and_tempo(data_root: Path, name: str, beats: int, meter: int, bpm: float):
    notes = load_annotation(data_root / "extra" / "ballroom" / "annotations" / f"{name}.beats")
    assert (notes.times.size, notes.meter) == (beats, meter)
    assert notes.bpm == pytest.approx(bpm, abs=1)


@pytest.mark.data
def test_annotations_of_other_tools_are_read(data_root: Path):
    assert len(load_beats(data_root / "extra" / "madmom" / "sample.dbn_beat_tracker.txt")) == 8
    for path in sorted((data_root / "extra" / "mir_eval_beat").glob("*.txt")):
        assert 280 <= len(load_beats(path)) <= 640


@pytest.mark.data
def test_beat_locked_annotations_name_units_that_cover_whole_beats(data_root: Path):
    for path in sorted((data_root / "beatlocked").glob("*/beats.json")):
        notes = load_annotation(path)
        for unit in notes.units:
            beats = np.count_nonzero((notes.times > unit.start - 0.01) & (notes.times < unit.end - 0.01))
            assert beats == unit.beats, f"{path}: {unit}"


# Videos

HEIGHT, WIDTH = 48, 64


def grey_levels(count: int, step: int = 4) -> list[np.ndarray]:
    """Frame i is all of grey level 20 + step * i, so that its mean tells its number."""
    return [np.full((HEIGHT, WIDTH), 20 + step * i, np.uint8) for i in range(count)]


def numbers(frames: Iterable[np.ndarray], step: int = 4) -> list[int]:
    """Which of the `grey_levels` each frame is."""
    return [round((float(frame.mean()) - 20) / step) for frame in frames]


def write_at(path: Path, times: list[float], *, audio_seconds: float = 0.0) -> None:
    """A video whose i-th picture, of grey level 20 + 4 i, is shown from times[i] on; with silence from 0 on."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=1000, options={"crf": "10", "bf": "0"})
        stream.height, stream.width, stream.pix_fmt = HEIGHT, WIDTH, "yuv420p"
        if audio_seconds:
            write_silence(container, round(audio_seconds * 48000 / 1024))
        for frame, time in zip(grey_levels(len(times), 4 if len(times) <= 58 else 0), times, strict=True):
            picture = av.VideoFrame.from_ndarray(frame, format="gray")
            picture.pts = round(time * 1000)
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))


def write_silence(container: av.container.OutputContainer, blocks: int) -> None:
    sound = container.add_stream("aac", rate=48000, layout="mono")
    for _ in range(blocks):
        block = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        block.sample_rate = 48000
        container.mux(sound.encode(block))
    container.mux(sound.encode(None))


@pytest.fixture
def sample(tmp_path: Path) -> Path:
    """A video of 30 frames at 25 fps."""
    path = tmp_path / "sample.mp4"
    write_video(path, grey_levels(30), 25.0)
    return path


@pytest.mark.slow
@cases("name, fps", *(("v.mp4", fps) for fps in (15.0, 23.976, 29.97, 120.0, np.float32(30.0))), ("v.webm", 29.97))
def test_every_frame_comes_back_once_and_in_order_whenever_it_is_read(tmp_path: Path, name: str, fps: float):
    write_video(tmp_path / name, grey_levels(50), fps)
    video = video_frames(tmp_path / name)
    assert video.fps == pytest.approx(fps, rel=1e-4 if name == "v.mp4" else 1e-3)
    assert numbers(video) == numbers(video) == list(range(50))


def test_a_tag_that_is_no_utf_8_is_no_reason_to_refuse_a_video(sample: Path):
    content = sample.read_bytes()
    assert WRITTEN_BY.encode() in content, "the tag that this test breaks"
    sample.write_bytes(content.replace(WRITTEN_BY.encode(), b"\xff" * len(WRITTEN_BY)))
    assert numbers(video_frames(sample)) == list(range(30))


@pytest.mark.parametrize("name", ["v.mp4", "v.webm"])
def test_colours_come_back_and_the_file_says_how_they_are_coded(tmp_path: Path, name: str):
    write_video(tmp_path / name, [np.full((48, 64, 3), (230, 159, 0), np.uint8)] * 3, 25.0)
    colour, grey = (next(iter(video_frames(tmp_path / name, colour=one))) for one in (True, False))
    np.testing.assert_allclose(colour.mean(axis=(0, 1)), (230, 159, 0), atol=4)
    assert grey.mean() == pytest.approx(0.299 * 230 + 0.587 * 159, abs=3)
    with av.open(str(tmp_path / name)) as container:
        context = container.streams.video[0].codec_context
        assert (context.colorspace, context.color_range) == (5, 1)  # BT.601, 16 to 235


def pulse(seconds: float) -> Audio:
    """A second of silence with a pulse of 10 ms there."""
    return Audio(0.8 * ((np.arange(22050) - round(seconds * 22050)) // 220 == 0), 22050)


def pulse_time(sound: Audio) -> float:
    return float(np.flatnonzero(np.abs(sound.samples) > 0.4)[0]) / sound.sample_rate


@pytest.mark.parametrize("name", ["v.mp4", "v.webm"])
@pytest.mark.parametrize("start", [0.1, 0.5])
def test_sound_of_a_video_is_where_it_was(tmp_path: Path, name: str, start: float):
    write_video(tmp_path / name, grey_levels(30), 30.0, audio=pulse(start))
    sound = video_sound(tmp_path / name)
    assert (sound.sample_rate, sound.duration) == (22050, pytest.approx(1.0, abs=0.05))
    assert pulse_time(sound) == pytest.approx(start, abs=0.003)
    assert numbers(video_frames(tmp_path / name)) == list(range(30))


def test_sound_and_pictures_of_an_mp4_lie_beside_each_other_so_that_it_plays_as_it_loads(tmp_path: Path):
    write_video(tmp_path / "v.mp4", grey_levels(300, 0), 10.0, audio=Audio(np.tile(pulse(0.5).samples, 30), 22050))
    with av.open(str(tmp_path / "v.mp4")) as container:
        packets = sorted((one for one in container.demux() if one.dts is not None), key=lambda packet: packet.pos)
    times = np.array([float(packet.dts * packet.time_base) for packet in packets])
    assert times[0] <= 0.1 and np.diff(times).min() > -1.0  # dts of the first pictures lie a little before 0


@cases("name, kind", ("v.MTS", "mpegts"), ("v.m2ts", "mpegts"), ("v.3gp", "3gp"), ("v.flv", "flv"))
def test_films_of_cameras_and_old_phones_are_videos_with_sound(tmp_path: Path, name: str, kind: str):
    write_video(tmp_path / "v.mp4", grey_levels(30), 30.0, audio=pulse(0.5))
    with av.open(str(tmp_path / "v.mp4")) as film, av.open(str(tmp_path / name), "w", format=kind) as copy:
        streams = [copy.add_stream_from_template(stream) for stream in film.streams]
        for packet in film.demux():
            if packet.dts is not None:
                packet.stream = streams[packet.stream.index]
                copy.mux(packet)
    assert pulse_time(load_sound(tmp_path / name)) == pytest.approx(0.5, abs=1 / 30)
    assert video_frames(tmp_path / name).fps == pytest.approx(30.0)


def test_sound_without_coding_in_an_avi_of_an_older_camera_is_read_and_half_of_it_refused(tmp_path: Path):
    path, samples = tmp_path / "v.avi", np.int16([32767 * pulse(0.5).samples])
    with av.open(str(path), "w") as container:
        picture, stream = container.add_stream("mjpeg", rate=20), container.add_stream("pcm_s16le", rate=22050)
        picture.width, picture.height, picture.pix_fmt, stream.layout = 64, 48, "yuvj420p", "mono"
        for number, part in enumerate(np.split(np.tile(samples, 6)[:, : 120 * 1102], 120, axis=1)):
            container.mux(picture.encode(av.VideoFrame.from_ndarray(np.zeros((48, 64, 3), np.uint8), "rgb24")))
            block = av.AudioFrame.from_ndarray(part, "s16", "mono")
            block.sample_rate, block.pts, block.time_base = 22050, 1102 * number, Fraction(1, 22050)
            container.mux(stream.encode(block))
        container.mux([*picture.encode(None), *stream.encode(None)])
    assert (load_sound(path).duration, pulse_time(load_sound(path))) == pytest.approx((6.0, 0.5), abs=0.01)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])
    refused(r"v\.avi: is cut off or damaged: 2\.9 of 6\.0 s", load_sound, path)


@pytest.mark.parametrize("name", ["v.mp4", "v.wav"])
def test_a_span_of_the_sound_of_a_video_is_that_of_a_sound_file(tmp_path: Path, name: str):
    soundfile.write(tmp_path / "v.wav", pulse(0.5).samples, 22050)
    write_video(tmp_path / "v.mp4", grey_levels(30), 30.0, audio=pulse(0.5))
    sound = load_sound(tmp_path / name, start=0.3, duration=0.4)
    assert (sound.duration, pulse_time(sound)) == (pytest.approx(0.4), pytest.approx(0.2, abs=0.003))
    refused(rf"{name}: has 1.* s of sound, none from 5 s on", load_sound, tmp_path / name, start=5.0)


def test_video_without_sound_says_so_and_too_much_is_refused(sample: Path, tmp_path: Path, monkeypatch):
    refused(r"sample\.mp4: holds no sound; name the music's own file", video_sound, sample)
    write_video(tmp_path / "v.mp4", grey_levels(30), 30.0, audio=pulse(0.5))
    refused(r"v\.mp4: has more than 0.5 s of sound", video_sound, tmp_path / "v.mp4", max_seconds=0.5)
    monkeypatch.setattr(audio, "MAX_SAMPLES", 2205)
    refused(r"v\.mp4: has more than 0.1 s of sound", video_sound, tmp_path / "v.mp4")
    with av.open(str(tmp_path / "v.mkv"), "w") as container:
        container.add_stream("pcm_s16le", rate=RATE)
        pictures = container.add_stream("mpeg4", rate=25)
        container.mux([*pictures.encode(av.VideoFrame(640, 480)), *pictures.encode(None)])
    refused(r"v\.mkv: holds no samples of sound", video_sound, tmp_path / "v.mkv")
    for read in (video_sound, video_frames):
        missing(r"none\.mp4: no such file", read, tmp_path / "none.mp4")


@cases(
    "size, height, expected",
    ((480, 640), 120, (120, 160)),  # shrunk in their proportions
    ((48, 64), 240, (48, 64)),  # never enlarged
    ((51, 75), 240, (52, 76)),  # odd sides become even
)
def test_frames_have_the_height_that_was_asked_for_or_their_own(
    tmp_path: Path, size: tuple[int, int], height: int, expected: tuple[int, int]
):
    write_video(tmp_path / "v.mp4", [np.zeros(size, np.uint8)] * 2, 25.0)
    video = video_frames(tmp_path / "v.mp4", height=height)
    assert (video.height, video.width) == expected
    assert {(frame.shape, frame.dtype.name) for frame in video} == {(expected, "uint8")}


def test_a_video_of_variable_rate_shows_each_picture_for_its_time(tmp_path: Path):
    # Half a second at 40 pictures a second, half a second at 10, then 40 again: 25 a second on average.
    times = [*(i / 40 for i in range(20)), *(0.5 + i / 10 for i in range(5)), *(1 + i / 40 for i in range(20))]
    write_at(tmp_path / "v.mp4", times)
    video = video_frames(tmp_path / "v.mp4")
    shown = np.array(times)[numbers(video)]
    due = np.arange(len(shown)) / video.fps
    still_shown = np.array([max(time for time in times if time <= moment + 0.5 / video.fps) for moment in due])
    assert video.fps == pytest.approx(45 / 1.5, rel=0.05)
    assert (np.abs(shown - still_shown) <= 0.5 / video.fps + 1e-6).all() and (np.diff(shown) >= 0).all()


def test_frames_at_some_places_are_those_of_the_whole_video(tmp_path: Path):
    write_at(tmp_path / "v.mp4", [*(i / 40 for i in range(20)), *(0.5 + i / 10 for i in range(5)), 1.0, 1.025])
    video = video_frames(tmp_path / "v.mp4", colour=True)
    frames = list(video)
    for places in ({0, 2, 14, 15, 16, len(frames) - 1}, {3}, {len(frames)}, ()):
        pictures = dict(video.at(places))
        assert [*pictures] == sorted(place for place in places if place < len(frames))
        assert all(np.array_equal(picture, frames[place]) for place, picture in pictures.items())


def test_a_picture_track_that_starts_late_holds_its_first_picture_from_the_start_of_the_file(tmp_path: Path):
    write_at(tmp_path / "v.mp4", [0.4 + i / 25 for i in range(20)], audio_seconds=1.2)
    video = video_frames(tmp_path / "v.mp4")
    shown = numbers(video)
    assert shown[round(0.2 * video.fps)] == 0
    assert shown[round(1.0 * video.fps)] in (14, 15)  # picture 15 is due 0.6 s after the first


@cases("rate, begin", (25.0, 0), (29.97, 0), (25.0, 20))  # one that was cut out keeps its time stamps
def test_a_recording_of_a_thousand_stated_frames_comes_at_its_true_rate_whole(tmp_path: Path, rate: float, begin: int):
    write_at(tmp_path / "v.mkv", [round(begin + i / rate, 3) for i in range(50)])  # time stamps of whole milliseconds
    video = video_frames(tmp_path / "v.mkv")
    assert (video.fps, numbers(video)) == (pytest.approx(rate, rel=1e-3), list(range(50)))


def test_a_video_filmed_on_its_side_comes_upright(tmp_path: Path):
    path = tmp_path / "v.mp4"
    scene = np.zeros((48, 64), np.uint8)
    scene[:24, :32] = 255  # bright at the top left
    write_video(path, [scene] * 3, 25.0)
    data = bytearray(path.read_bytes())
    matrix = data.index(b"tkhd") + 4 + 40
    a_quarter_turn_right = np.array([0, 0x10000, 0, -0x10000, 0, 0, 48 * 0x10000, 0, 0x40000000], ">i4")
    data[matrix : matrix + 36] = a_quarter_turn_right.tobytes()
    path.write_bytes(data)
    video = video_frames(path)
    frame = next(iter(video))
    assert frame.shape == (video.height, video.width) == (64, 48)
    assert frame[:30, 26:].mean() > 240  # now at the top right
    assert frame[:30, :22].mean() < 15 > frame[34:].mean()


def test_a_failed_write_leaves_the_old_file_and_nothing_else(sample: Path):
    before = sample.read_bytes()
    frames = [*grey_levels(5), np.zeros((10, 10), np.uint8)]
    refused(r"sample.mp4: frame 5 of shape \(10, 10\) is too small", write_video, sample, frames, 25.0)
    assert sample.read_bytes() == before
    assert list(sample.parent.iterdir()) == [sample]


@cases(
    "name, frames, fps, message",
    ("v.avi", grey_levels(2), 25.0, "v.avi: video is written as .mp4 or .webm"),
    ("v.mp4", [], 25.0, "v.mp4: a video needs at least one frame"),
    *(("v.mp4", grey_levels(2), n, f"fps must lie between 1 and 1000, got {n:g}") for n in (0.0, float("nan"))),
    ("v.mp4", [np.zeros((48, 64))], 25.0, "v.mp4: frame 0 must be .* of uint8"),
    ("v.mp4", [*grey_levels(1), np.zeros((64, 64), np.uint8)], 25.0, "v.mp4: frame 1 has shape"),
)
def test_what_cannot_be_written_is_refused_with_the_reason(
    tmp_path: Path, name: str, frames: list[np.ndarray], fps: float, message: str
):
    refused(message, write_video, tmp_path / name, frames, fps)
    assert list(tmp_path.iterdir()) == []


def test_a_video_cut_without_new_coding_is_whole_though_it_keeps_hidden_frames(sample: Path, tmp_path: Path):
    write_video(sample, np.random.default_rng(0).integers(0, 255, (60, HEIGHT, WIDTH)).astype(np.uint8), 30.0)
    cut = tmp_path / "cut.mp4"
    with av.open(sample) as source, av.open(cut, "w") as target:
        stream = source.streams.video[0]
        copied = target.add_stream_from_template(stream)
        for packet in source.demux(stream):
            if packet.dts is not None:  # a second earlier, which hides half of what follows the only key frame
                packet.pts, packet.dts = (time - round(1 / stream.time_base) for time in (packet.pts, packet.dts))
                packet.stream = copied
                target.mux(packet)
    with av.open(cut) as container:
        assert container.streams.video[0].frames == 60
    assert len(list(video_frames(cut))) == 30


def test_a_video_cut_off_says_how_much_is_there_and_without_its_index_that_it_cannot_be_read(sample: Path):
    write_video(sample, np.random.default_rng(0).integers(0, 255, (30, HEIGHT, WIDTH)).astype(np.uint8), 25.0)
    content = sample.read_bytes()
    sample.write_bytes(content[: len(content) // 2])
    refused(r"sample\.mp4: (is cut off or damaged: \d+ of 30 frames|cannot be read)", list, video_frames(sample))
    sample.write_bytes(content[:300])
    refused(r"sample\.mp4: (cannot be read as video|holds no video)", video_frames, sample)
    webm = sample.with_suffix(".webm")
    write_video(webm, grey_levels(100, 1), 25.0, audio=Audio(np.random.default_rng(0).uniform(-0.5, 0.5, 80000), 20000))
    webm.write_bytes(webm.read_bytes()[: webm.stat().st_size // 2])
    refused(r"sample\.webm: is cut off or damaged: \d+ of 100 frames", list, video_frames(webm))
    refused(r"sample\.webm: is cut off or damaged: .* of 4\.0 s of sound are there", video_sound, webm)


def test_more_frames_than_allowed_are_refused_at_once_or_where_the_limit_is_reached(
    sample: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setattr("harmolab.readers.video.MAX_FRAMES", 20)
    refused(r"sample\.mp4: has 30 frames, more than 20; cut it", video_frames, sample)
    write_at(tmp_path / "v.mkv", [i / 25 for i in range(30)])  # whose header says nothing
    refused(r"v\.mkv: has more than 20 frames; cut it", list, video_frames(tmp_path / "v.mkv"))
    refused("height must be at least 16 pixels, got 4", video_frames, sample, height=4)


def test_a_long_hole_in_time_is_refused_and_not_filled(tmp_path: Path):
    write_at(tmp_path / "v.mkv", [*(i / 25 for i in range(250)), 100.0])
    refused(r"v\.mkv: shows no new picture between 10.0 and 100.0 s", list, video_frames(tmp_path / "v.mkv"))


def _silence(path: Path) -> None:
    with wave.open(str(path), "wb") as sound:
        sound.setparams((1, 2, 8000, 0, "NONE", ""))
        sound.writeframes(bytes(16000))


def _huge_gif(path: Path) -> None:
    size = (65535).to_bytes(2, "little") * 2
    path.write_bytes(b"GIF89a" + size + b"\x80\0\0" + bytes(6) + b"," + bytes(4) + size + b"\0\x02\x02D\x01\0;")


def _audio_only(path: Path) -> None:
    with av.open(str(path), "w") as container:
        write_silence(container, 1)


@cases(
    "name, make",
    ("empty.mp4", lambda path: path.write_bytes(b"")),
    ("text.mp4", lambda path: path.write_text("not a video\n" * 200)),
    ("zeros.mp4", lambda path: path.write_bytes(bytes(5000))),
    ("folder.mp4", lambda path: path.mkdir()),
    ("picture.png", lambda path: cv2.imwrite(str(path), np.zeros((50, 50), np.uint8))),
    *(("sound.wav", _silence), ("sound.mp4", _audio_only), ("huge.gif", _huge_gif)),
    ("playlist.mp4", lambda path: path.write_text("#EXTM3U\n#EXTINF:1,\nsample.mp4\n#EXT-X-ENDLIST\n")),
    ("concat.txt", lambda path: path.write_text("ffconcat version 1.0\nfile sample.mp4\n")),
)
def test_what_is_no_video_is_refused_by_name(tmp_path: Path, sample: Path, name: str, make: Callable[[Path], object]):
    make(tmp_path / name)
    refused(name, video_frames, tmp_path / name)


def check_frames(path: Path) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("harmolab.readers.video.MAX_FRAMES", 5000)
        assert {(frame.dtype.name, frame.ndim) for frame in video_frames(path)} == {("uint8", 2)}


def check_sound(path: Path) -> None:
    assert np.isfinite(video_sound(path, max_seconds=100).samples).all()


@cases(
    "ending, check",
    *(pytest.param(name, check_frames, marks=pytest.mark.slow) for name in ("mkv", "avi")),
    *(("mp4", check_frames), ("mp4", check_sound), ("webm", check_sound)),
)
def test_damaged_files_give_frames_and_sound_or_one_error_that_names_them(
    tmp_path: Path, rng: np.random.Generator, ending: str, check: Callable[[Path], None]
):
    whole, path = tmp_path / f"whole.{ending}", tmp_path / f"damaged.{ending}"
    if check is check_frames:
        write_at(whole, [i / 25 for i in range(25)])
    else:
        write_video(whole, grey_levels(25), 25.0, audio=Audio(np.sin(np.arange(22050) / 5), 22050))
    data = whole.read_bytes()
    for _ in range(60):
        path.write_bytes(mutated(data, rng))
        try:
            check(path)
        except ValueError as error:
            assert str(error).startswith(str(path))


@pytest.mark.data
@cases("name, fps, width, seconds", ("d2mgan_motivation_gt.mp4", 30, 427, 4.9), ("gendance_case1.mp4", 30, 180, 20))
def test_a_recorded_video_is_read_whole(data_root: Path, name: str, fps: float, width: int, seconds: float):
    path = data_root / "extra" / "video" / name
    if not path.exists():
        pytest.skip(f"{path} is not there")
    video = video_frames(path)
    assert (video.fps, video.height, video.width) == (fps, 240, width)
    assert sum(1 for _ in video) / video.fps == pytest.approx(seconds, abs=0.05)


# The sound is where the mark is, and the pose is that of the moment, from the first second to the last

FPS, SECONDS = 30.0, 60.0


def sounding(path: Path) -> tuple[np.ndarray, int]:
    """The sound of a video on its own time line: silence where the stream starts late, cut where it starts early."""
    with av.open(str(path)) as container:
        stream = container.streams.audio[0]
        pieces = [(frame.time, frame.to_ndarray()) for frame in container.decode(stream)]
        rate = stream.codec_context.sample_rate
    sound = np.zeros(round((SECONDS + 1) * rate))
    for time, piece in pieces:
        first, samples = round(time * rate), piece.mean(axis=0)
        samples = samples[max(-first, 0) :]
        sound[max(first, 0) : max(first, 0) + samples.size] = samples[: sound.size - max(first, 0)]
    return sound, rate


@pytest.mark.slow
def test_a_minute_of_video_keeps_sound_mark_and_pose_together(swinging_arm: Callable[..., Motion], tmp_path: Path):
    beats = np.arange(0.4, SECONDS - 0.5, 0.613)
    samples = np.zeros(round(SECONDS * 22050))
    click = np.hanning(441) * np.sin(2 * np.pi * 1500 * np.arange(441) / 22050)  # 20 ms
    for beat in beats:
        samples[round(beat * 22050) :][:441] = click
    score = score_harmony(track(beats, duration=SECONDS), track([], duration=SECONDS))  # the music's marks light up
    drawn = list(render_dance(swinging_arm(0.7, FPS, seconds=SECONDS), height=120, fps=FPS, score=score))
    change = {i: np.abs(drawn[i - 1].astype(float) - drawn[i + 1]).mean() for i in range(10, len(drawn) - 10, 7)}
    moving = [i for i in change if change[i] > 0.5 * max(change.values())]  # not where the arm turns back
    assert len(moving) > 20 and moving[-1] > 0.9 * len(drawn) == 0.9 * SECONDS * FPS
    scaler = VideoReformatter()
    for name in ("x.mp4", "x.webm"):
        write_video(tmp_path / name, drawn, FPS, audio=Audio(samples, 22050))
        sound, rate = sounding(tmp_path / name)
        for beat in beats:
            around = sound[round((beat - 0.1) * rate) : round((beat + 0.2) * rate)] ** 2
            middle = beat - 0.1 + (around * np.arange(around.size)).sum() / around.sum() / rate
            assert middle == pytest.approx(beat + 0.01, abs=0.003), (name, beat)
        with av.open(str(tmp_path / name)) as container:
            pictures = ((frame.time, scaler.reformat(frame, format="rgb24")) for frame in container.decode(video=0))
            shown = [(time, picture.to_ndarray()) for time, picture in pictures]
        assert len(shown) == len(drawn)
        lit = np.array([picture[8:10, 8:10, 0].mean() < 128 for _, picture in shown])  # the middle of the disc is blue
        times = np.array([time for time, _ in shown])
        np.testing.assert_allclose(times[1:][lit[1:] & ~lit[:-1]], beats, atol=0.5 / FPS + 6e-4, rtol=0)  # WebM has ms
        for index in moving:
            early = _frames_early(shown[index][1], *drawn[index - 1 : index + 2])
            assert abs(early) < 0.5 and times[index] == pytest.approx(index / FPS, abs=0.5 / FPS), (name, index)


def _frames_early(shown: np.ndarray, before: np.ndarray, drawn: np.ndarray, after: np.ndarray) -> float:
    """How many frames early the shown pose is (late: below 0), by the share of the step between frames it has made.

    Coding blurs the whole picture evenly, which a plain difference would mistake for another pose.
    """
    step = (after.astype(float) - before) / 2
    return float(((shown.astype(float) - drawn) * step).sum() / (step**2).sum())


def test_a_pose_of_the_frame_before_or_after_is_noticed(swinging_arm: Callable[..., Motion]):
    drawn = list(render_dance(swinging_arm(0.7, FPS, seconds=1.0), height=120, fps=FPS))
    early = [_frames_early(drawn[place], *drawn[20:23]) for place in (20, 21, 22)]
    assert early[0] < -0.5 < early[1] == 0 < 0.5 < early[2]


@cases("bars", [4] * 5 + [2] + [4] * 5, [4, 3] * 6, [4] * 5 + [5, 4], ids=["a bar of two", "four and three", "of five"])
def test_places_that_a_file_names_stay_as_they_are(tmp_path: Path, bars: list[int]):
    places = [place for count in bars for place in range(count)]
    lines = [f"{0.5 * number:.2f} {place + 1}" for number, place in enumerate(places)]
    assert load_annotation(write(tmp_path, "song.beats", "\n".join(lines))).meter == 4  # as most bars, or the longer
    for kept in (lines, lines[:10] + lines[11:]):  # whole, and with a beat that was missed
        found = load_beats(write(tmp_path, "song.beats", "\n".join(kept))).bar_places
        assert [f"{place + 1}" for place in found] == [line.split()[1] for line in kept]


@cases("suffix", ".mkv", ".mp4")
def test_a_gap_in_the_sound_of_a_video_is_silence_of_its_length(tmp_path: Path, suffix: str):
    click = np.zeros((1, 1024), np.float32)
    click[0, 0] = 0.9
    with av.open(str(tmp_path / f"gap{suffix}"), "w") as container:
        stream = container.add_stream("aac", rate=48000, layout="mono")
        for number in (*range(100), *range(170, 250)):  # some 1.5 s are missing
            frame = av.AudioFrame.from_ndarray(click if number % 10 == 0 else 0 * click, "fltp", "mono")
            frame.sample_rate, frame.pts, frame.time_base = 48000, 1024 * number, Fraction(1, 48000)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    sound = video_sound(tmp_path / f"gap{suffix}", sample_rate=48000)
    assert sound.duration == pytest.approx(250 * 1024 / 48000, abs=0.06)
    late = np.abs(sound.samples[(165 * 1024) :])
    first = 165 * 1024 + int(np.argmax(late > 0.2 * late.max()))
    assert first / 48000 == pytest.approx(170 * 1024 / 48000, abs=0.03)


@cases("suffix", ".mkv", ".webm", ".mp4")
def test_a_block_of_sound_that_comes_late_does_not_delay_the_rest(tmp_path: Path, suffix: str):
    size, last = 960, -1000  # blocks of 20 ms
    click = np.zeros((1, size), np.float32)
    click[0, :200] = 0.9 * np.sin(np.arange(200))
    with av.open(str(tmp_path / f"late{suffix}"), "w") as container:
        stream = container.add_stream("libopus", rate=48000, layout="mono")
        for number in range(250):
            frame = av.AudioFrame.from_ndarray(click if number % 50 == 25 else 0 * click, "flt", "mono")
            frame.sample_rate, frame.pts, frame.time_base = 48000, size * number, Fraction(1, 48000)
            for packet in stream.encode(frame):  # one comes .3 s late, and those after it as soon as they can
                packet.pts = packet.dts = last = max(packet.pts + 14400 * (number == 60), last + 48)
                container.mux(packet)
        container.mux(stream.encode(None))
    sound = video_sound(tmp_path / f"late{suffix}", sample_rate=48000)
    assert sound.duration == pytest.approx(5.0, abs=0.03)
    for second in (2, 3, 4):
        around = np.abs(sound.samples[48000 * second : 48000 * (second + 1)])
        assert np.argmax(around > 0.2) / 48000 == pytest.approx(0.5, abs=0.02)
