"""The paper's equations 1 to 32, one test each, with answers worked out by hand from the printed formula.

Where the formula leaves room, the reading of the paper mode is tested; docs/readings.md lists the others.
"""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from harmolab import score as scoring
from harmolab.beats import salience
from harmolab.beats.audio import audio_beats, onset_envelope
from harmolab.beats.flow import impact_envelope, local_peaks
from harmolab.beats.meter import strong_beats
from harmolab.beats.visual import visual_beats
from harmolab.body.kinematics import direction_spread, joint_speed, step_signs, turning_points
from harmolab.params import HarmonyParams
from harmolab.soft_score import SoftHarmony
from harmolab.systems.harmogan import losses
from harmolab.systems.harmogan.params import TrainParams
from harmolab.systems.training.loop import total_loss
from harmolab.systems.training.units import initial_poses, temporal_index
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_clip
from tests.builders import along_x, track

EQUATIONS: dict[int, Callable[..., object]] = {
    1: score_clip, 2: onset_envelope, 3: audio_beats, 4: impact_envelope, 5: local_peaks, 6: score_clip,
    7: joint_speed, 8: step_signs, 9: turning_points, 10: scoring.score_harmony, 11: salience.audio_mask,
    12: salience.strength_steps, 13: salience.visual_mask, 14: scoring.score_harmony, 15: scoring.position_matrix,
    16: scoring.interval_matrix, 17: scoring.nearest_intervals, 18: scoring.hit_mask, 19: scoring.hitting_score,
    20: scoring.f_score, 21: scoring.harmony_from_hits, 22: strong_beats, 23: initial_poses, 24: losses.kl_loss,
    25: losses.charbonnier_mse, 26: losses.feature_loss, 27: losses.harmony_loss, 28: losses.adversarial_value,
    29: losses.discriminator_loss, 30: losses.discriminator_loss, 31: losses.generator_gan_loss, 32: total_loss,
}  # fmt: skip

CONVENTIONS = Path(__file__).resolve().parents[1] / "docs" / "conventions.md"
EVERY_BEAT = HarmonyParams(audio_threshold=0.0, visual_threshold=None, fps=None, reaction_delay=0.1)
HOP_SECONDS = 512 / 22050


def one_stop() -> Motion:
    """A joint that goes 3, 1, 0, 2, 3 steps in 0.5 s: its speed turns once, at 0.3 s."""
    return along_x([0, 3, 4, 4, 6, 9], fps=10.0)


@pytest.fixture(autouse=True)
def no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HARMOLAB_CACHE", "off")


def test_equation_01_harmony_is_one_number_of_music_and_motion():
    # Music beats at 0.3 (met by the stop) and 0.5 s: N = 2, M = 1, h_s = 1, beta = 2: h = 5 * 1 / (2 * 4 + 1).
    clip = Clip("one stop", Audio(np.zeros(600), 1000), one_stop(), beats=BeatTrack([0.3, 0.5], [1.0, 1.0], 10.0, 0.6))
    assert score_clip(clip, EVERY_BEAT).harmony == pytest.approx(5 / 9)


def test_equation_02_amplitude_of_the_spectrum_rises_at_sounds(click_track: Callable[..., Audio]):
    envelope, rate = onset_envelope(click_track(60, seconds=4.0))
    times = np.arange(envelope.size) / rate
    for click in (1.0, 2.0, 3.0):
        near = np.abs(times - click) < 0.4
        assert abs(times[near][envelope[near].argmax()] - click) <= 1.5 * HOP_SECONDS
    assert envelope[np.abs(times % 1.0 - 0.5) < 0.3].max() < 1e-3 * envelope.max()


def test_equation_03_music_beats_are_peaks_of_the_amplitude(click_track: Callable[..., Audio]):
    audio = click_track(120, seconds=8.0)
    beats, (envelope, rate) = audio_beats(audio), onset_envelope(audio)
    assert np.abs(beats.times - 0.5 * np.round(beats.times / 0.5)).max() <= 1.5 * HOP_SECONDS
    assert len(beats) >= 13
    # A beat lies 1.3 samples of the envelope before the peak that it is heard by.
    frames = np.round(beats.times * rate + 1.3).astype(int)[:, None]
    np.testing.assert_allclose(beats.strengths, envelope[frames + np.array([-1, 0, 1])].max(axis=1))
    assert beats.strengths[beats.times == 0].tolist() == [0.0]  # it has no before that its onset could rise above
    beside = envelope[np.clip(frames[1:] + np.array([-4, 4]), 0, envelope.size - 1)]
    assert (beats.strengths[1:, None] > beside).all()


def test_equation_04_motion_trend_compares_the_picture_with_the_one_before():
    # Flow in eight directions: to the right it stops after frame 4, to the left it starts there. Only the stop counts.
    flow = np.zeros((8, 8))
    flow[:, 0] = [0, 0, 2, 2, 2, 0, 0, 0]
    flow[:, 4] = [0, 0, 0, 0, 0, 3, 3, 3]
    np.testing.assert_allclose(impact_envelope(flow), [0, 0, 0, 0, 2, 0, 0, 0])
    # The same from a skeleton, as motion SD: one limb turns back (1 - cos = 2), the other goes on (0): SD 1.
    limbs = np.stack([[0, 1, 2, 1, 0], [0, 1, 2, 3, 4]], axis=1)[:, :, None] * np.array([1.0, 0.0, 0.0])
    np.testing.assert_allclose(direction_spread(limbs), [0, 0, 0, 1, 0])


def test_equation_05_visual_beats_exceed_everything_around_them():
    trend = np.array([0.0, 1.0, 0.0, 0.5, 0.6, 0.5, 0.0])
    for threshold, expected in ((0.2, [1]), (0.05, [1, 4])):  # 1.0 - 0.0 > 0.2, but 0.6 - 0.5 is not
        peaks = local_peaks(trend, radius_frames=1, threshold=threshold, reading="literal")
        np.testing.assert_array_equal(peaks, expected)


def test_equation_06_harmony_aligns_the_beats_of_both_sides():
    music = BeatTrack([0.1, 0.3, 0.5], [1.0, 1.0, 1.0], 10.0, 0.6)
    clip = Clip("one stop", Audio(np.zeros(600), 1000), one_stop())
    score = score_clip(clip, EVERY_BEAT, tracker=lambda audio: music)
    aligned = scoring.score_harmony(music, visual_beats(one_stop(), params=EVERY_BEAT), params=EVERY_BEAT)
    assert score.harmony == aligned.harmony == pytest.approx(5 / 13)  # N = 3, M = 1, one hit


def test_equation_07_joint_velocity_sum():
    # From frame 0 to 1 one joint moves by (3, 4, 0), the other by (0, 0, 2): 5 + 2. Then only the first, by (1, 0, 0).
    positions = np.array([[[0, 0, 0], [0, 0, 0]], [[3, 4, 0], [0, 0, 2]], [[4, 4, 0], [0, 0, 2]]], dtype=float)
    np.testing.assert_allclose(joint_speed(positions), [7, 7, 1])


def test_equation_08_sign_of_the_change_of_speed():
    # Steps +2, -1, 0, +3; the tie takes the sign before it.
    np.testing.assert_array_equal(step_signs(np.array([1.0, 3.0, 2.0, 2.0, 5.0])), [1, -1, -1, 1])


def test_equation_09_visual_beats_are_where_the_sign_changes():
    # d(1) d(2) = 1 * -1 at frame 1; d(3) d(4) = -1 * 1 at frame 3, the end of the tie.
    np.testing.assert_array_equal(turning_points(np.array([1.0, 3.0, 2.0, 2.0, 5.0])), [1, 3])


def test_equation_10_only_attentional_beats_are_aligned():
    # SD(s_a) = 0.45 drops the third music beat; R = 4, 4, 0.1 with SD 1.95 drops the third visual beat.
    music, motion = track([1.0, 2.0, 3.0], [1.0, 1.0, 0.05]), track([1.0, 2.0, 3.0], [1.0, 5.0, 4.9])
    masked = scoring.score_harmony(music, motion, params=replace(EVERY_BEAT, audio_threshold=1.0, visual_threshold=1.0))
    assert (masked.n_audio, masked.n_visual, masked.harmony) == (2, 2, pytest.approx(5 * 2 / (2 * 4 + 2)))
    unmasked = scoring.score_harmony(music, motion, params=EVERY_BEAT)
    assert (unmasked.n_audio, unmasked.n_visual, unmasked.harmony) == (3, 3, pytest.approx(5 * 2.05 / (3 * 4 + 3)))


def test_equation_11_audio_mask_keeps_beats_above_the_spread_of_strengths():
    # Mean 2, SD 1 (population): 3 > 1 * 1, 1 is not; 1 > 0.9 * 1 is.
    strengths = np.array([1.0, 3.0, 1.0, 3.0])
    np.testing.assert_array_equal(salience.audio_mask(strengths, 1.0), [False, True, False, True])
    np.testing.assert_array_equal(salience.audio_mask(strengths, 0.9), [True, True, True, True])


def test_equation_12_peak_to_valley_difference():
    # |5 - 1|, |3 - 5|, |9 - 3|; the first takes the second's.
    np.testing.assert_array_equal(salience.strength_steps(np.array([1.0, 5.0, 3.0, 9.0])), [4, 4, 2, 6])


def test_equation_13_visual_mask_keeps_beats_whose_difference_exceeds_the_spread():
    # R = 4, 4, 2, 6, SD over 4, 2, 6 = sqrt(8 / 3) = 1.633: 1.5 SD = 2.45 drops only the third beat.
    np.testing.assert_array_equal(salience.visual_mask(np.array([1.0, 5.0, 3.0, 9.0]), 1.5), [True, True, False, True])


def test_equation_14_harmony_is_the_f_score_of_both_sides():
    # Two of four music beats of strength 1 hit, three visual beats: h_a = 2/4, h_v = 2/3.
    score = scoring.score_harmony(track([1.0, 2.0, 3.0, 4.0]), track([1.0, 2.0, 7.0]), params=EVERY_BEAT)
    assert (score.audio_harmony, score.visual_harmony) == (pytest.approx(1 / 2), pytest.approx(2 / 3))
    # 5 * (1/2) * (2/3) / (4 * 2/3 + 1/2) = (5/3) / (19/6) = 10/19.
    assert score.harmony == pytest.approx(10 / 19)


def test_equation_15_visual_positions_repeated_for_every_music_beat():
    np.testing.assert_array_equal(scoring.position_matrix(np.array([1.0, 5.0]), 3), [[1, 5], [1, 5], [1, 5]])


def test_equation_16_distance_of_every_pair_of_beats():
    intervals = scoring.interval_matrix(np.array([1.0, 4.0]), np.array([2.0, 3.5, 9.0]))
    np.testing.assert_array_equal(intervals, [[1, 2.5, 8], [2, 0.5, 5]])


def test_equation_17_distance_to_the_nearest_visual_beat():
    np.testing.assert_array_equal(scoring.nearest_intervals(np.array([1.0, 4.0]), np.array([2.0, 3.5, 9.0])), [1, 0.5])


def test_equation_18_a_beat_is_hit_up_to_and_including_the_delay():
    assert scoring.hit_mask([1.0, 2.0, 3.0], [1.25, 2.26], delay=0.25).tolist() == [True, False, False]


def test_equation_19_hitting_score_sums_the_strengths_of_hits():
    assert scoring.hitting_score(np.array([True, False, True]), np.array([0.5, 1.0, 0.25])) == 0.75


def test_equation_20_weighted_harmonic_mean_of_both_sides():
    # 5 * 0.75 * 0.3 / (4 * 0.3 + 0.75) = 1.125 / 1.95.
    assert scoring.f_score(0.75, 0.3, 2.0) == pytest.approx(1.125 / 1.95)
    assert np.isnan([scoring.f_score(np.nan, 0.3, 2.0), scoring.above_chance(0.5, np.nan)]).all()  # not 0: unknown


def test_equation_21_harmony_from_the_hitting_score_at_fixed_numbers_of_beats():
    # The same numbers: h_s = 3, N = 4, M = 10: 5 * 3 / (4 * 4 + 10) = 15 / 26 = 1.125 / 1.95.
    assert scoring.harmony_from_hits(3.0, 4, 10, 2.0) == pytest.approx(15 / 26)
    assert scoring.f_score(3 / 4, 3 / 10, 2.0) == pytest.approx(15 / 26)
    # Lemma 3.1 holds at fixed N and M only: the same h_s with other numbers is another h.
    assert scoring.harmony_from_hits(3.0, 4, 4, 2.0) == pytest.approx(15 / 20)


def test_equation_22_a_strong_beat_is_stronger_than_the_one_before():
    np.testing.assert_array_equal(strong_beats(np.array([2.0, 3.0, 3.0, 1.0, 2.0])), [False, True, False, False, True])


def test_equation_23_initial_poses_are_the_last_meter_and_then_its_mean():
    motion = np.array([[2.0], [4.0], [9.0], [30.0], [50.0]])
    # sum V TI / sum TI = (2 + 4 + 9) / 3 = 5; the current meter, 30 and 50, does not show.
    np.testing.assert_allclose(initial_poses(motion, temporal_index(5, 3)), [[2.0], [4.0], [9.0], [5.0], [5.0]])


def test_equation_24_divergence_of_the_distributions_of_flat_poses():
    # Two joints, 0.1 m and 0.2 m off, as Gaussians of 0.1 m: 0.01 / 0.02 = 0.5 and 0.04 / 0.02 = 2 nats; mean 1.25.
    target = torch.rand(1, 3, 2, 2)
    flat = target + torch.tensor([[0.1, 0.0], [0.0, -0.2]])
    assert losses.kl_loss(flat, target, torch.ones(1, 3)).item() == pytest.approx(1.25, rel=1e-4)


def test_equation_25_prior_frames_count_half_in_the_charbonnier_loss():
    # Both frames are (3, 4) away; the first is of the last meter: W = 1/2 and 1. sqrt(12.5 + 1) + sqrt(25 + 1).
    target = torch.zeros(1, 3, 2)
    motion, index, mask = target + torch.tensor([3.0, 4.0]), torch.tensor([[1.0, 0, 0]]), torch.tensor([[1.0, 1, 0]])
    assert losses.charbonnier_mse(motion, target, index, mask, epsilon=1.0).item() == pytest.approx(13.5**0.5 + 26**0.5)


def test_equation_26_distance_of_features_added_up_over_time():
    # Two channels, two moments: mean of 1 and 49 is 25, sqrt(25 + 144) = 13; equal features leave epsilon = 12.
    maps = torch.tensor([[[1.0, 3.0], [7.0, 2.0]]])
    targets = torch.tensor([[[0.0, 3.0], [0.0, 2.0]]])
    assert losses.feature_loss([maps], [targets], epsilon=12.0).item() == pytest.approx(13 + 12)


def test_equation_27_hits_are_rewarded_and_wrong_counts_punished():
    # Two of four music beats hit by three visual beats: -2 + sqrt|3 - 4| as printed.
    hard = scoring.score_harmony(track([1.0, 2.0, 3.0, 4.0]), track([1.0, 2.0, 7.0]), params=EVERY_BEAT)
    assert losses.literal_harmony_loss(hard) == pytest.approx(-2 + 1)
    # Relaxed, |M - N|^2 = 15: (15 + 1)^(1/4) - 1 = 1.
    zero, counts = torch.zeros(1), (torch.tensor([4.0 + 15**0.5]), torch.tensor([4.0]))
    soft = SoftHarmony(zero, torch.tensor([2.0]), zero, zero, zero, *counts)
    assert losses.harmony_loss(soft).item() == pytest.approx(-2 + 1)


def test_equation_28_value_that_the_discriminator_raises():
    # D = 3/4 and 1/2 on real, 1/4 and 1/2 on generated motion.
    real, fake = torch.tensor([np.log(3.0), 0.0]), torch.tensor([-np.log(3.0), 0.0])
    expected = (np.log(0.75) + np.log(0.5)) / 2 + (np.log(1 - 0.25) + np.log(1 - 0.5)) / 2
    assert losses.adversarial_value(real, fake).item() == pytest.approx(expected)


def test_equation_29_cross_domain_discriminator_maximises():
    # D_cd = 0.8 for the recorded pair (logit ln 4), 0.2 for the generated one: minimised is -(ln 0.8 + ln(1 - 0.2)).
    logit = torch.tensor([np.log(4.0)])
    assert losses.discriminator_loss(logit, -logit).item() == pytest.approx(-2 * np.log(0.8))
    assert losses.discriminator_loss(-logit, logit).item() == pytest.approx(-2 * np.log(0.2))


def test_equation_30_spatial_temporal_discriminator_maximises():
    # D_st = 0.5 for recorded, 0.9 for generated motion (logit ln 9): -(ln 0.5 + ln 0.1); its gradient pulls both apart.
    real, fake = torch.zeros(1, requires_grad=True), torch.tensor([np.log(9.0)], requires_grad=True)
    loss = losses.discriminator_loss(real, fake)
    loss.backward()
    assert loss.item() == pytest.approx(-np.log(0.5) - np.log(0.1))
    assert (real.grad.item(), fake.grad.item()) == (pytest.approx(-0.5), pytest.approx(0.9))


def test_equation_31_generator_wants_to_be_believed_by_both():
    # D_cd = 3/4, D_st = 1/4.
    loss = losses.generator_gan_loss(torch.tensor([np.log(3.0)]), torch.tensor([-np.log(3.0)]))
    assert loss.item() == pytest.approx(-np.log(0.75) - np.log(0.25))


def test_the_cross_domain_discriminator_may_have_no_say_in_equation_31():
    logits = torch.tensor([np.log(3.0)]), torch.tensor([-np.log(3.0)])
    assert losses.generator_gan_loss(*logits, cross_domain_weight=0.0).item() == pytest.approx(-np.log(0.25))
    assert losses.generator_gan_loss(None, logits[1]).item() == pytest.approx(-np.log(0.25))


def test_equation_32_weighted_sum_with_the_weights_of_section_5():
    paper = TrainParams.paper()
    weights = {name: getattr(paper, f"{name}_weight") for name in ("kl", "mse", "feature", "harmony", "gan")}
    terms = {name: torch.tensor(value) for name, value in zip(weights, (2.0, 3.0, 4.0, 5.0, 6.0), strict=True)}
    assert total_loss(terms, weights).item() == pytest.approx(0.0001 * 2 + 0.001 * (3 + 4 + 6) + 1 * 5)


# The table


def numbers_in(docstring: str) -> set[int]:
    """Equation numbers a docstring names: "Eq. 2-3", "Eq. 10, 14-21"."""
    found: set[int] = set()
    for listed in re.findall(r"Eq\. ([\d, -]*\d)", docstring):
        for first, last in re.findall(r"(\d+)(?:-(\d+))?", listed):
            found |= set(range(int(first), int(last or first) + 1))
    return found


def table_rows() -> dict[int, list[str]]:
    """Rows of the table of equations in docs/conventions.md: number -> the other cells."""
    rows = {}
    for line in CONVENTIONS.read_text("utf-8").splitlines():
        cells = [cell.strip() for cell in line.strip("|").split(" | ")]
        if re.fullmatch(r"\|? ?\d+", cells[0]):
            rows[int(cells[0].strip("| "))] = cells[1:]
    return rows


def test_every_equation_has_one_function():
    assert sorted(EQUATIONS) == list(range(1, 33))
    assert all(callable(function) for function in EQUATIONS.values())


def test_every_equation_has_a_test():
    names = [name[: len("test_equation_00")] for name in globals() if name.startswith("test_equation_")]
    assert sorted(names) == [f"test_equation_{number:02d}" for number in EQUATIONS]


def test_the_docstring_of_its_function_names_the_equation():
    documented = {number: numbers_in(function.__doc__ or "") for number, function in EQUATIONS.items()}
    assert [number for number, named in documented.items() if number not in named] == []


def test_every_equation_has_its_row_in_the_conventions():
    rows, wrong = table_rows(), []
    for number, function in EQUATIONS.items():
        symbol, code, test = rows.get(number, ["", "", ""])
        name = f"`{function.__module__.removeprefix('harmolab.')}.{function.__name__}`"
        if not symbol or name not in code or f"`test_equation_{number:02d}`" not in test:
            wrong.append((number, name))
    assert wrong == []
