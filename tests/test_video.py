"""Video files: what comes out is what the screen would show, and hostile files give one clear error."""

import wave
from collections.abc import Iterator
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import soundfile

from harmolab.files import WRITTEN_BY
from harmolab.readers.audio import load_sound, video_sound
from harmolab.readers.video import video_frames, write_video
from harmolab.types import Audio
from tests.builders import cases, refused

HEIGHT, WIDTH = 48, 64


def grey_levels(count: int, step: int = 4) -> list[np.ndarray]:
    """Frame i is all of grey level 20 + step * i, so that its mean tells its number."""
    return [np.full((HEIGHT, WIDTH), 20 + step * i, np.uint8) for i in range(count)]


def numbers(frames: Iterator[np.ndarray] | object, step: int = 4) -> list[int]:
    """Which of the `grey_levels` each frame is."""
    return [round((float(frame.mean()) - 20) / step) for frame in frames]  # type: ignore[attr-defined]


def write_at(path: Path, times: list[float], *, audio_seconds: float = 0.0) -> None:
    """A video whose i-th picture, of grey level 20 + 4 i, is shown from times[i] on; with silence from 0 on."""
    with av.open(str(path), "w") as container:
        stream = container.add_stream("libx264", rate=1000, options={"crf": "10", "bf": "0"})
        stream.height, stream.width, stream.pix_fmt = HEIGHT, WIDTH, "yuv420p"
        if audio_seconds:
            sound = container.add_stream("aac", rate=48000, layout="mono")
            for _ in range(round(audio_seconds * 48000 / 1024)):
                block = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
                block.sample_rate = 48000
                container.mux(sound.encode(block))
            container.mux(sound.encode(None))
        for frame, time in zip(grey_levels(len(times), 4 if len(times) <= 58 else 0), times, strict=True):
            picture = av.VideoFrame.from_ndarray(frame, format="gray")
            picture.pts = round(time * 1000)
            container.mux(stream.encode(picture))
        container.mux(stream.encode(None))


@pytest.fixture
def sample(tmp_path: Path) -> Path:
    """A sound file of 30 frames at 25 fps."""
    path = tmp_path / "sample.mp4"
    write_video(path, grey_levels(30), 25.0)
    return path


@cases("name, fps", *(("v.mp4", fps) for fps in (15.0, 23.976, 25.0, 29.97, 60.0, 120.0)), ("v.webm", 29.97))
def test_every_frame_comes_back_once_and_in_order(tmp_path: Path, name: str, fps: float) -> None:
    write_video(tmp_path / name, grey_levels(50), fps)
    video = video_frames(tmp_path / name)
    assert video.fps == pytest.approx(fps, rel=1e-4 if name == "v.mp4" else 1e-3)
    assert numbers(video) == list(range(50))


def test_a_tag_that_is_no_utf_8_is_no_reason_to_refuse_a_video(sample: Path) -> None:
    content = sample.read_bytes()
    assert WRITTEN_BY.encode() in content, "the tag that this test breaks"
    sample.write_bytes(content.replace(WRITTEN_BY.encode(), b"\xff" * len(WRITTEN_BY)))
    assert numbers(video_frames(sample)) == list(range(30))


@pytest.mark.parametrize("name", ["v.mp4", "v.webm"])
def test_colours_come_back_and_the_file_says_how_they_are_coded(tmp_path: Path, name: str) -> None:
    write_video(tmp_path / name, [np.full((48, 64, 3), (230, 159, 0), np.uint8)] * 3, 25.0)
    back = next(iter(video_frames(tmp_path / name, colour=True)))
    np.testing.assert_allclose(back.mean(axis=(0, 1)), (230, 159, 0), atol=4)
    with av.open(str(tmp_path / name)) as container:
        context = container.streams.video[0].codec_context
        assert (context.colorspace, context.color_range) == (5, 1)  # BT.601, 16 to 235


@pytest.mark.parametrize("name", ["v.mp4", "v.webm"])
@pytest.mark.parametrize("start", [0.0, 0.4])
def test_sound_of_a_video_is_where_it_was(tmp_path: Path, name: str, start: float) -> None:
    samples = np.zeros(22050)
    samples[round((start + 0.1) * 22050) :][:220] = 0.8
    write_video(tmp_path / name, grey_levels(30), 30.0, audio=Audio(samples, 22050))
    sound = video_sound(tmp_path / name)
    assert (sound.sample_rate, sound.duration) == (22050, pytest.approx(1.0, abs=0.05))
    assert np.flatnonzero(np.abs(sound.samples) > 0.4)[0] / 22050 == pytest.approx(start + 0.1, abs=0.003)


@pytest.mark.parametrize("name", ["v.mp4", "v.wav"])
def test_a_span_of_the_sound_of_a_video_is_that_of_a_sound_file(tmp_path: Path, name: str) -> None:
    samples = np.zeros(22050)
    samples[11025:][:220] = 0.8
    soundfile.write(tmp_path / "v.wav", samples, 22050)
    write_video(tmp_path / "v.mp4", grey_levels(30), 30.0, audio=Audio(samples, 22050))
    sound = load_sound(tmp_path / name, start=0.3, duration=0.4)
    assert sound.duration == pytest.approx(0.4)
    assert np.flatnonzero(np.abs(sound.samples) > 0.4)[0] / 22050 == pytest.approx(0.2, abs=0.003)
    refused(rf"{name}: has 1.* s of sound, none from 5 s on", load_sound, tmp_path / name, start=5.0)


def test_video_without_sound_says_so_and_too_much_is_refused(sample: Path, tmp_path: Path) -> None:
    refused(r"sample\.mp4: holds no sound; name the music's own file", video_sound, sample)
    write_video(tmp_path / "v.mp4", grey_levels(30), 30.0, audio=Audio(np.zeros(22050), 22050))
    refused(r"v\.mp4: has more than 0.5 s of sound", video_sound, tmp_path / "v.mp4", max_seconds=0.5)
    with pytest.raises(FileNotFoundError, match=r"none\.mp4: no such file"):
        video_sound(tmp_path / "none.mp4")


def test_a_video_can_be_read_twice(sample: Path) -> None:
    video = video_frames(sample)
    assert numbers(video) == numbers(video) == list(range(30))


def test_colour_comes_back_as_its_brightness(tmp_path: Path) -> None:
    frames = [np.full((48, 64, 3), (255, 0, 0), np.uint8)] * 3
    write_video(tmp_path / "v.mp4", frames, 25.0)
    assert next(iter(video_frames(tmp_path / "v.mp4"))).mean() == pytest.approx(76, abs=3)  # 0.299 * 255


def test_frames_shrink_to_the_height_in_their_proportions(tmp_path: Path) -> None:
    write_video(tmp_path / "v.mp4", [np.zeros((480, 640), np.uint8)] * 2, 25.0)
    video = video_frames(tmp_path / "v.mp4", height=120)
    assert (video.height, video.width) == (120, 160)
    assert {(frame.shape, frame.dtype.name) for frame in video} == {((120, 160), "uint8")}


def test_frames_are_never_enlarged(sample: Path) -> None:
    video = video_frames(sample, height=240)
    assert (video.height, video.width) == (HEIGHT, WIDTH)


def test_odd_sides_become_even(tmp_path: Path) -> None:
    write_video(tmp_path / "v.mp4", [np.zeros((51, 75), np.uint8)] * 2, 25.0)
    video = video_frames(tmp_path / "v.mp4")
    assert (video.height, video.width) == (52, 76)


def test_a_video_of_variable_rate_shows_each_picture_for_its_time(tmp_path: Path) -> None:
    # Half a second at 40 pictures a second, half a second at 10, then 40 again: 25 a second on average.
    times = [*(i / 40 for i in range(20)), *(0.5 + i / 10 for i in range(5)), *(1 + i / 40 for i in range(20))]
    write_at(tmp_path / "v.mp4", times)
    video = video_frames(tmp_path / "v.mp4")
    shown = np.array(times)[numbers(video)]
    due = np.arange(len(shown)) / video.fps
    still_shown = np.array([max(time for time in times if time <= moment + 0.5 / video.fps) for moment in due])
    assert video.fps == pytest.approx(45 / 1.5, rel=0.05)
    assert (np.abs(shown - still_shown) <= 0.5 / video.fps + 1e-6).all()
    assert (np.diff(shown) >= 0).all()


def test_a_picture_track_that_starts_late_holds_its_first_picture_from_the_start_of_the_file(tmp_path: Path) -> None:
    write_at(tmp_path / "v.mp4", [0.4 + i / 25 for i in range(20)], audio_seconds=1.2)
    video = video_frames(tmp_path / "v.mp4")
    shown = numbers(video)
    assert shown[round(0.2 * video.fps)] == 0
    assert shown[round(1.0 * video.fps)] in (14, 15)  # picture 15 is due 0.6 s after the first


def test_a_recording_that_states_a_thousand_frames_a_second_comes_at_its_true_rate(tmp_path: Path) -> None:
    write_at(tmp_path / "v.mkv", [i / 25 for i in range(50)])
    video = video_frames(tmp_path / "v.mkv")
    assert video.fps == pytest.approx(25.0)
    assert numbers(video) == list(range(50))


def test_time_stamps_rounded_to_milliseconds_neither_repeat_nor_drop_frames(tmp_path: Path) -> None:
    write_at(tmp_path / "v.mkv", [round(i / 29.97, 3) for i in range(50)])
    assert numbers(video_frames(tmp_path / "v.mkv")) == list(range(50))


def test_a_video_filmed_on_its_side_comes_upright(tmp_path: Path) -> None:
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
    assert (video.height, video.width) == (64, 48)
    frame = next(iter(video))
    assert frame[:30, 26:].mean() > 240  # now at the top right
    assert frame[:30, :22].mean() < 15
    assert frame[34:].mean() < 15


def test_sound_is_written_beside_the_pictures(tmp_path: Path) -> None:
    tone = Audio(np.sin(2 * np.pi * 440 * np.arange(22050) / 22050), 22050)
    write_video(tmp_path / "v.mp4", grey_levels(25), 25.0, audio=tone)
    with av.open(str(tmp_path / "v.mp4")) as container:
        samples = np.concatenate([block.to_ndarray()[0] for block in container.decode(audio=0)])
        rate = container.streams.audio[0].rate
    assert len(samples) / rate == pytest.approx(1.0, abs=0.1)
    assert np.argmax(np.abs(np.fft.rfft(samples[: rate // 2]))) * 2 == pytest.approx(440, abs=4)
    assert numbers(video_frames(tmp_path / "v.mp4")) == list(range(25))


def test_a_failed_write_leaves_the_old_file_and_nothing_else(sample: Path) -> None:
    before = sample.read_bytes()
    frames = [*grey_levels(5), np.zeros((10, 10), np.uint8)]
    refused(r"sample.mp4: frame 5 of shape \(10, 10\) is too small", write_video, sample, frames, 25.0)
    assert sample.read_bytes() == before
    assert list(sample.parent.iterdir()) == [sample]


@cases(
    "name, frames, fps, message",
    ("v.avi", grey_levels(2), 25.0, "v.avi: video is written as .mp4 or .webm"),
    ("v.mp4", [], 25.0, "v.mp4: a video needs at least one frame"),
    ("v.mp4", grey_levels(2), 0.0, "v.mp4: fps must lie between 1 and 1000, got 0"),
    ("v.mp4", grey_levels(2), float("nan"), "v.mp4: fps must lie between"),
    ("v.mp4", [np.zeros((48, 64))], 25.0, "v.mp4: frame 0 must be .* of uint8"),
    ("v.mp4", [*grey_levels(1), np.zeros((64, 64), np.uint8)], 25.0, "v.mp4: frame 1 has shape"),
)
def test_what_cannot_be_written_is_refused_with_the_reason(
    tmp_path: Path, name: str, frames: list[np.ndarray], fps: float, message: str
) -> None:
    refused(message, write_video, tmp_path / name, frames, fps)
    assert list(tmp_path.iterdir()) == []


def test_a_missing_file_is_not_found(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"none\.mp4: no such file"):
        video_frames(tmp_path / "none.mp4")


def test_a_video_cut_off_in_the_middle_says_how_much_is_there(sample: Path) -> None:
    write_video(sample, np.random.default_rng(0).integers(0, 255, (30, HEIGHT, WIDTH)).astype(np.uint8), 25.0)
    sample.write_bytes(sample.read_bytes()[: sample.stat().st_size // 2])
    video = video_frames(sample)
    refused(r"sample\.mp4: (is cut off or damaged: \d+ of 30 frames|cannot be read)", list, video)


def test_a_video_without_its_index_cannot_be_read(sample: Path) -> None:
    sample.write_bytes(sample.read_bytes()[:300])
    refused(r"sample\.mp4: (cannot be read as video|holds no video)", video_frames, sample)


def test_more_frames_than_allowed_are_refused_at_once(sample: Path) -> None:
    refused(r"sample\.mp4: has 30 frames, more than max_frames=20", video_frames, sample, max_frames=20)


def test_frames_beyond_the_limit_are_refused_where_the_header_says_nothing(tmp_path: Path) -> None:
    write_at(tmp_path / "v.mkv", [i / 25 for i in range(30)])
    video = video_frames(tmp_path / "v.mkv", max_frames=20)
    refused(r"v\.mkv: has more than max_frames=20", list, video)


def test_a_long_hole_in_time_is_refused_and_not_filled(tmp_path: Path) -> None:
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
        sound = container.add_stream("aac", rate=48000, layout="mono")
        block = av.AudioFrame.from_ndarray(np.zeros((1, 1024), np.float32), format="fltp", layout="mono")
        block.sample_rate = 48000
        container.mux([*sound.encode(block), *sound.encode(None)])


@cases(
    "name, make",
    ("empty.mp4", lambda path: path.write_bytes(b"")),
    ("text.mp4", lambda path: path.write_text("not a video\n" * 200)),
    ("text.txt", lambda path: path.write_text("not a video\n" * 200)),
    ("zeros.mp4", lambda path: path.write_bytes(bytes(5000))),
    ("folder.mp4", lambda path: path.mkdir()),
    ("picture.png", lambda path: cv2.imwrite(str(path), np.zeros((50, 50), np.uint8))),
    ("sound.wav", _silence),
    ("sound.mp4", _audio_only),
    ("huge.gif", _huge_gif),
    ("playlist.mp4", lambda path: path.write_text("#EXTM3U\n#EXTINF:1,\nsample.mp4\n#EXT-X-ENDLIST\n")),
    ("concat.txt", lambda path: path.write_text("ffconcat version 1.0\nfile sample.mp4\n")),
)
def test_what_is_no_video_is_refused_by_name(tmp_path: Path, sample: Path, name: str, make: object) -> None:
    make(tmp_path / name)  # type: ignore[operator]
    refused(name, video_frames, tmp_path / name)


def test_a_height_too_small_is_refused(sample: Path) -> None:
    refused("height must be at least 16 pixels, got 4", video_frames, sample, height=4)


def mutated(data: bytes, rng: np.random.Generator) -> bytes:
    """`data` cut, with bytes changed, taken out or put in."""
    changed = bytearray(data)
    place = int(rng.integers(len(data)))
    kind = rng.integers(5)
    if kind == 0:
        return data[: place + 1]
    if kind == 1:
        del changed[place : place + int(rng.integers(1, 200))]
    elif kind == 2:
        changed[place:place] = rng.bytes(int(rng.integers(1, 64)))
    elif kind == 3:  # the header, with numbers that are too large
        place = int(rng.integers(1500))
        changed[place : place + 4] = bytes([255, 255, 255, 255]) if rng.random() < 0.5 else bytes([0, 1, 134, 160])
    else:
        for place in rng.integers(len(data), size=int(rng.integers(1, 20))):
            changed[place] = int(rng.integers(256))
    return bytes(changed)


@pytest.mark.parametrize("ending", ["mp4", *(pytest.param(name, marks=pytest.mark.slow) for name in ("mkv", "avi"))])
def test_damaged_files_give_frames_or_one_error_that_names_them(
    tmp_path: Path, rng: np.random.Generator, ending: str
) -> None:
    write_at(tmp_path / f"whole.{ending}", [i / 25 for i in range(25)])
    data, path = (tmp_path / f"whole.{ending}").read_bytes(), tmp_path / f"damaged.{ending}"
    for _ in range(75):
        path.write_bytes(mutated(data, rng))
        try:
            for frame in video_frames(path, max_frames=5000):
                assert (frame.dtype, frame.ndim) == (np.uint8, 2)
        except ValueError as error:
            assert str(error).startswith(str(path))


@pytest.mark.parametrize("ending", ["mp4", "webm"])
def test_damaged_files_give_sound_or_one_error_that_names_them(
    tmp_path: Path, rng: np.random.Generator, ending: str
) -> None:
    tone = Audio(np.sin(np.arange(22050) / 5), 22050)
    write_video(tmp_path / f"whole.{ending}", grey_levels(25), 25.0, audio=tone)
    data, path = (tmp_path / f"whole.{ending}").read_bytes(), tmp_path / f"damaged.{ending}"
    for _ in range(50):
        path.write_bytes(mutated(data, rng))
        try:
            assert np.isfinite(video_sound(path, max_seconds=100).samples).all()
        except ValueError as error:
            assert str(error).startswith(str(path))


@pytest.mark.data
@cases("name, fps, width, seconds", ("d2mgan_motivation_gt.mp4", 30, 427, 4.9), ("gendance_case1.mp4", 30, 180, 20))
def test_a_recorded_video_is_read_whole(data_root: Path, name: str, fps: float, width: int, seconds: float) -> None:
    path = data_root / "extra" / "video" / name
    if not path.exists():
        pytest.skip(f"{path} is not there")
    video = video_frames(path)
    assert (video.fps, video.height, video.width) == (fps, 240, width)
    assert sum(1 for _ in video) / video.fps == pytest.approx(seconds, abs=0.05)
