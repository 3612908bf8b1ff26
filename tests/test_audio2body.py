"""Audio to Body Dynamics: the 28 numbers, the space of the points, the delay, the network, its training."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soxr
import torch

from harmolab.musician.cleaning import Reference
from harmolab.musician.networks import SoundToPoints, predicted_points, synthesize_performance
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.sequences import (
    PlayedSequence,
    PlayedSet,
    PlayedSplit,
    PlayedWindows,
    PointSpace,
    check_pieces,
    continued,
    frames_of,
    later,
    steps_of,
)
from harmolab.musician.sound_features import (
    frame_mfcc,
    normalised_loudness,
    note_features,
    slopes,
    sound_features,
    tone_strengths,
)
from harmolab.musician.train import errors, mean_pose_errors, terms, train_audio2body, windows_passed
from harmolab.readers.player_points import HANDS_12
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.layers import parameter_count
from harmolab.systems.training.weights import load_weights, save_weights
from harmolab.types import Audio, Notes
from tests.builders import refused

RATE = 44100
NOWHERE = Reference((), np.zeros((0, 2)))
TINY = replace(Audio2BodyParams.tables("piano"), hidden=8, components=3, epochs=3, batch=4, sequence=24, rate=1e-2)


def noise(seconds: float, seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(0, 0.1, round(seconds * RATE))


# The sound


def test_a_click_is_in_the_frame_of_its_time_within_an_hour() -> None:
    rng = np.random.default_rng(1)
    samples = np.zeros(3600 * RATE, np.float32)
    numbers = np.sort(rng.choice(24 * 3600 // 8, 100, replace=False)) * 8 + 3
    times = (numbers + rng.uniform(0.02, 0.98, 100)) / 24
    samples[np.round(times * RATE).astype(int)] = 1.0
    loudness = frame_mfcc(samples, Audio2BodyParams(), 24 * 3600)[:, 13]
    assert np.flatnonzero(loudness > loudness.min() + 1).tolist() == np.floor(times * 24).astype(int).tolist()


@pytest.mark.parametrize(("delta", "width"), [(True, 28), (False, 27)])
def test_there_are_28_numbers_or_27_without_the_derivative_of_energy(delta: bool, width: int) -> None:
    params = replace(Audio2BodyParams(), energy_delta=delta)
    values = sound_features(Audio(noise(2.0), RATE), params, 48)
    assert values.shape == (48, width)
    assert params.n_sound == width
    whole = sound_features(Audio(noise(2.0), RATE), Audio2BodyParams(), 48)
    np.testing.assert_array_equal(values, whole[:, :width])


@pytest.mark.parametrize("rate", [44100, 48000, 96000])
def test_features_are_the_same_at_other_sample_rates(rate: int) -> None:
    low = soxr.resample(soxr.resample(noise(8.0, 3), 44100, 28000, quality="VHQ"), 28000, 96000, quality="VHQ")
    features = [
        sound_features(Audio(soxr.resample(low, 96000, at, quality="VHQ"), at), Audio2BodyParams(), 192, cached=False)
        for at in (44100, rate)
    ]
    inner = slice(3, -3)
    assert (np.abs(features[0] - features[1])[inner].max(axis=0) <= 0.05 * features[0][inner].std(axis=0)).all()


def test_loudness_is_normalised_over_the_recording_and_silence_stays() -> None:
    loud = normalised_loudness(Audio(noise(1.0) * 7, RATE))
    np.testing.assert_allclose(loud, normalised_loudness(Audio(noise(1.0), RATE)), rtol=1e-5)
    assert np.square(loud).mean() == pytest.approx(1.0, rel=1e-4)
    assert not normalised_loudness(Audio(np.zeros(100), RATE)).any()
    assert np.isfinite(sound_features(Audio(np.zeros(RATE), RATE), Audio2BodyParams(), 24)).all()


def test_slopes_are_those_of_lines_through_five_frames() -> None:
    line = 3.0 * np.arange(20.0)[:, None]
    np.testing.assert_allclose(slopes(line)[2:-2], 3.0, rtol=1e-6)
    curve = np.random.default_rng(2).normal(size=(9, 1))
    fitted = [np.polyfit(np.arange(-2, 3), curve[place - 2 : place + 3, 0], 1)[0] for place in range(2, 7)]
    np.testing.assert_allclose(slopes(curve)[2:-2, 0], fitted, rtol=1e-5)


@pytest.mark.parametrize(("pitch", "tone"), [(60, 0), (69, 9), (83, 11)])
def test_a_tone_is_heard_as_its_semitone(pitch: int, tone: int) -> None:
    sine = np.sin(2 * np.pi * 440 * 2 ** ((pitch - 69) / 12) * np.arange(2 * RATE) / RATE).astype(np.float32)
    params = (Audio2BodyParams(tones=tones) for tones in ("chroma", "semitones"))
    chroma, semitones = (tone_strengths(sine, each, 48) for each in params)
    assert chroma.shape == (48, 12)
    assert set(chroma[4:-4].argmax(axis=1)) == {tone}
    assert set(semitones[4:-4].argmax(axis=1)) == {pitch - 36}


def test_notes_are_their_keys() -> None:
    values = note_features(Notes([0.0, 0.5], [0.25, 1.0], [60, 21], [0.5, 1.0]), 24.0, 24)
    assert values.shape == (24, 88)
    np.testing.assert_array_equal(values[:, 39], [1.0] + [0.5] * 5 + [0.0] * 18)
    np.testing.assert_array_equal(values[:, 0], [0.0] * 12 + [2.0] + [1.0] * 11)
    assert values.sum() == pytest.approx(values[:, [0, 39]].sum())


# The space


def test_components_and_points_go_to_and_fro() -> None:
    frames = np.random.default_rng(0).normal(size=(200, 10)) @ np.random.default_rng(1).normal(size=(10, 10))
    space = PointSpace.fit(frames, 10)
    np.testing.assert_allclose(space.decode(space.encode(frames)), frames, atol=1e-10)
    np.testing.assert_allclose(space.basis @ space.basis.T, np.eye(10), atol=1e-10)
    assert (space.basis[np.arange(10), np.abs(space.basis).argmax(axis=1)] > 0).all()
    assert space.encode(frames).std(axis=0).max() == pytest.approx(1.0)
    assert len(set(space.sizes)) == 1
    np.testing.assert_allclose(PointSpace.fit(frames, 4, even_scale=False).encode(frames).std(axis=0), 1.0)


def test_a_share_of_the_variance_gives_the_number_of_components() -> None:
    frames = np.random.default_rng(0).normal(size=(5000, 4)) * np.sqrt([90.0, 6.0, 3.0, 1.0])
    assert [len(PointSpace.fit(frames, share).basis) for share in (0.5, 0.9, 0.95, 0.999)] == [1, 2, 2, 4]
    refused("two frames", PointSpace.fit, frames[:1], 2)


@pytest.mark.parametrize("upsample", [1, 2, 4, 6])
@pytest.mark.parametrize("delay", [0, 2, 5])
def test_steps_and_delay_go_to_and_fro(upsample: int, delay: int) -> None:
    frames = np.random.default_rng(0).normal(size=(17, 3))
    steps = steps_of(frames, upsample)
    assert len(steps) == upsample * 16 + 1
    moved = later(steps, delay)
    assert len(moved) == len(continued(steps, delay))
    np.testing.assert_allclose(frames_of(moved, upsample, delay), frames, atol=1e-10)
    impulse = np.zeros((9, 1))
    impulse[4] = 1.0
    assert np.flatnonzero(later(impulse, delay)[:, 0]).tolist() == [4 + delay]


# The network


def test_the_network_has_the_paper_s_size() -> None:
    network = SoundToPoints(Audio2BodyParams.tables(), HANDS_12, "piano", 15, NOWHERE)
    assert parameter_count(network) == 187_015
    assert torch.equal(network.lstm.bias_ih_l0[200:400], torch.ones(200))
    assert Audio2BodyParams.tables().delay_steps == 2
    assert Audio2BodyParams.section_4().delay_steps == 5


def played(count: int = 4, *, seed: int = 0, params: Audio2BodyParams = TINY) -> PlayedSet:
    """Points that follow the sound: each moves with one of its channels."""
    rng = np.random.default_rng(seed)
    sequences = []
    for number in range(count):
        sound = np.cumsum(rng.normal(size=(60, params.n_sound)), axis=0).astype(np.float32)
        points = 100 + 10 * np.tile(sound[:, :1], (1, 24)) + rng.normal(size=(60, 24))
        accepted = np.ones(60, bool)
        accepted[10:13] = False
        sequences.append(PlayedSequence(f"piece {number}", f"{number}", sound, points, accepted, accepted))
    return PlayedSet(tuple(sequences), HANDS_12, "piano", params, NOWHERE, "synthetic")


SPLIT = PlayedSplit(("piece 0", "piece 1", "piece 2"), (), ("piece 3",))


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("runs") / "run"
    train_audio2body(played(), SPLIT, TrainOptions(folder))
    return folder


def test_rejected_frames_have_no_gradient() -> None:
    data = played()
    space = PointSpace.fit(np.concatenate([each.points for each in data.sequences]), 3)
    windows = PlayedWindows.of(data.sequences, space, TINY)
    components = torch.zeros_like(windows.target, requires_grad=True)
    terms(components, windows, "squared")["error"].backward()
    assert components.grad is not None
    assert not components.grad[windows.mask == 0].any()
    assert components.grad[windows.mask > 0].any()
    assert windows.mask[0, : TINY.delay_steps].tolist() == [0.0, 0.0]


def test_a_batch_and_one_recording_agree(run: Path) -> None:
    network = load_weights(run, SoundToPoints)
    sound = torch.randn(5, 40, 28, generator=torch.Generator().manual_seed(0))
    with torch.no_grad():
        together, _ = network(sound)
    for number in range(5):
        alone = network.predicted(sound[number].numpy())
        np.testing.assert_allclose(together[number].numpy(), alone, atol=1e-6)


def test_windows_in_a_row_are_one_pass() -> None:
    network = SoundToPoints(replace(TINY, carry=3), HANDS_12, "piano", 3, NOWHERE).eval()
    sound = torch.randn(2, 72, 28)
    np.testing.assert_allclose(
        windows_passed(network, sound).detach().numpy(), network(sound)[0].detach().numpy(), atol=1e-6
    )


def test_training_learns_and_keeps_the_errors_of_all_sides(run: Path) -> None:
    data = played(params=replace(TINY, epochs=60))
    folder = run.parent / "longer"
    network = train_audio2body(data, SPLIT, TrainOptions(folder))
    test = [data.sequences[3]]
    assert errors(network, test).full < 0.7 * mean_pose_errors(network, test).full
    assert errors(network, test).projected <= errors(network, test).full
    from harmolab.systems.training.about import read_about

    stored = read_about(folder)["meta"]["errors"]
    assert set(stored) == {"train", "validation", "test", "mean pose"}
    assert stored["test"]["full"] == pytest.approx(errors(network, test).full, rel=1e-5)


def test_a_piece_on_two_sides_is_refused() -> None:
    data = played()
    doubled = replace(data.sequences[3], piece="0")
    refused("its piece is trained on in 'piece 0'", check_pieces, [*data.sequences[:3], doubled], SPLIT)
    refused("two sides", PlayedSplit, ("a",), (), ("a",))
    refused("no performance here", check_pieces, data.sequences[:2], SPLIT)


def test_weights_come_back_the_same(run: Path, tmp_path: Path) -> None:
    network, sound = load_weights(run, SoundToPoints), played().sequences[0].sound
    save_weights(tmp_path / "again", network)
    np.testing.assert_array_equal(
        predicted_points(load_weights(tmp_path / "again", SoundToPoints), sound), predicted_points(network, sound)
    )


def test_a_performance_is_as_long_as_its_sound(run: Path) -> None:
    network = load_weights(run, SoundToPoints)
    audio = Audio(noise(3.0), RATE)
    whole = synthesize_performance(network, audio)
    assert (whole.n_frames, whole.fps, whole.skeleton) == (72, 24.0, HANDS_12)
    part = synthesize_performance(network, audio, start=1.0, seconds=1.0)
    np.testing.assert_allclose(part.positions, whole.positions[24:48], atol=2.0)
    refused("within the recording", synthesize_performance, network, audio, start=3.5)
    refused("two frames", synthesize_performance, network, audio, seconds=0.05)


@pytest.mark.parametrize(
    ("field", "value", "message"),
    [
        ("hears", "smell", "hears must be sound or notes"), ("components", 2.5, "whole number"),
        ("dropout", 1.0, "shares"), ("fps", 1e4, "fps must be 240 at most"), ("carry", 0, "carry must be positive"),
    ],
)  # fmt: skip
def test_settings_that_cannot_be_are_named(field: str, value: object, message: str) -> None:
    refused(message, replace, Audio2BodyParams(), **{field: value})
