"""The sound is where the mark is, and the pose is that of the moment, from the first second to the last."""

from collections.abc import Callable
from pathlib import Path

import av
import numpy as np
import pytest

from harmolab.lab.render.scene import render_dance
from harmolab.readers.video import write_video
from harmolab.score import score_harmony
from harmolab.types import Audio, BeatTrack, Motion

RATE, FPS, SECONDS = 22050, 30.0, 60.0


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
@pytest.mark.parametrize("name", ["x.mp4", "x.webm"])
def test_a_minute_of_video_keeps_sound_mark_and_pose_together(
    swinging_arm: Callable[..., Motion], tmp_path: Path, name: str
) -> None:
    beats = np.arange(0.4, SECONDS - 0.5, 0.613)
    motion = swinging_arm(0.7, FPS, seconds=SECONDS)
    samples = np.zeros(round(SECONDS * RATE))
    click = np.hanning(round(0.02 * RATE)) * np.sin(2 * np.pi * 1500 * np.arange(round(0.02 * RATE)) / RATE)
    for beat in beats:
        samples[round(beat * RATE) : round(beat * RATE) + click.size] = click
    track = BeatTrack(beats, np.ones(beats.size), 100.0, SECONDS)
    score = score_harmony(track, BeatTrack([], [], 100.0, SECONDS))  # no mark but the music's lights up
    drawn = list(render_dance(motion, height=120, fps=FPS, score=score))
    write_video(tmp_path / name, drawn, FPS, audio=Audio(samples, RATE))

    sound, rate = sounding(tmp_path / name)
    for beat in beats:
        around = sound[round((beat - 0.1) * rate) : round((beat + 0.2) * rate)] ** 2
        middle = beat - 0.1 + (around * np.arange(around.size)).sum() / around.sum() / rate
        assert middle == pytest.approx(beat + 0.01, abs=0.003), beat  # the click is 20 ms long

    with av.open(str(tmp_path / name)) as container:
        shown = [(frame.time, frame.to_ndarray(format="rgb24")) for frame in container.decode(video=0)]
    assert len(shown) == len(drawn) == SECONDS * FPS
    lit = np.array([picture[8:10, 8:10, 0].mean() < 128 for _, picture in shown])  # the middle of the disc is blue
    times = np.array([time for time, _ in shown])
    starts = times[1:][lit[1:] & ~lit[:-1]]
    assert starts.size == beats.size
    assert (np.abs(starts - beats) <= 1 / FPS + 1e-6).all()
    change = {i: _difference(drawn[i - 1], drawn[i + 1]) for i in range(10, len(shown) - 10, 7)}
    moving = [i for i in change if change[i] > 0.5 * max(change.values())]  # not where the arm turns back
    assert len(moving) > 20 and moving[-1] > 0.9 * len(shown)
    for index in moving:
        early = _frames_early(shown[index][1], *drawn[index - 1 : index + 2])
        assert abs(early) < 0.5 and times[index] == pytest.approx(index / FPS, abs=0.5 / FPS), index


def _frames_early(shown: np.ndarray, before: np.ndarray, drawn: np.ndarray, after: np.ndarray) -> float:
    """How many frames early the shown pose is (late: below 0), by the share of the step between frames it has made.

    Coding blurs the whole picture evenly, which a plain difference would mistake for another pose.
    """
    step = (after.astype(float) - before) / 2
    return float(((shown.astype(float) - drawn) * step).sum() / (step**2).sum())


def _difference(one: np.ndarray, other: np.ndarray) -> float:
    """Mean absolute difference of two pictures."""
    return float(np.abs(one.astype(float) - other.astype(float)).mean())


def test_a_pose_of_the_frame_before_or_after_is_noticed(swinging_arm: Callable[..., Motion]) -> None:
    drawn = list(render_dance(swinging_arm(0.7, FPS, seconds=1.0), height=120, fps=FPS))
    early = [_frames_early(drawn[place], *drawn[20:23]) for place in (20, 21, 22)]
    assert early[0] < -0.5 < early[1] == 0 < 0.5 < early[2]
