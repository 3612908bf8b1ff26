"""Dances of any length: on the music's beats, without a jump, each meter from the end of the last."""

import itertools

import numpy as np
import pytest
import torch
from torch import Tensor

import harmolab
import harmolab.systems
from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import Skeleton
from harmolab.metrics.quality import foot_skating
from harmolab.systems.harmogan.networks import Generator, GeneratorOutput
from harmolab.systems.harmogan.params import ModelParams
from harmolab.systems.training.dancing import synthesize_dance
from harmolab.systems.training.features import FeatureParams
from harmolab.systems.training.feet import on_floor, planted_feet
from harmolab.systems.training.motion_code import FADE, bone_lengths, continued, encode_motion
from harmolab.systems.training.runs import PoseBank
from harmolab.systems.training.units import filled_beats, meter_frames
from harmolab.types import Audio, BeatTrack, Clip, Motion
from tests.builders import cases, planted_dance, refused

FPS = 15.0
FEATURES = FeatureParams(n_mfcc=2, beat_channels=True)
SKELETON = Skeleton(("hip", "toe L", "toe R", "head"), (-1, 0, 0, 0))
REST = np.array([[0.0, 1.0, 0.0], [0.2, 0.0, 0.0], [-0.2, 0.0, 0.0], [0.0, 1.6, 0.0]])
C = 15
TINY = ModelParams(hidden=8, layers=1, pose_features=8, discriminator=4)


def beat_track(period: float = 0.5, seconds: float = 30.0, first: float = 0.2) -> BeatTrack:
    times = np.arange(first, seconds, period)
    return BeatTrack(times, np.ones(times.size), 100.0, seconds)


def noise(seconds: float = 30.0) -> Audio:
    return Audio(np.random.default_rng(0).normal(0, 0.1, round(seconds * 8000)), 8000)


def rest_code(**joints: float) -> np.ndarray:
    """The code of the dancer standing still."""
    return np.concatenate([REST.ravel(), np.zeros(3)])


class Planted(Generator):
    """A generator whose output is `answer(number of the call, audio, initial)`; keeps what it was given."""

    def __init__(self, answer: object) -> None:
        lengths = torch.tensor(np.linalg.norm(REST - REST[0], axis=1))
        super().__init__(TINY, FEATURES.n_audio, SKELETON, lengths, fps=FPS, features=FEATURES)
        self.answer, self.given = answer, []

    def forward(self, audio: Tensor, initial: Tensor) -> GeneratorOutput:
        made = self.answer(len(self.given), audio[0].numpy(), initial[0].numpy())
        self.given.append((audio[0].numpy(), initial[0].numpy()))
        return GeneratorOutput(torch.tensor(made[None], dtype=torch.float32), torch.zeros(1))


AT_REST = PoseBank(rest_code()[None, None], ("",))


def nodding(_: int, audio: np.ndarray, initial: np.ndarray) -> np.ndarray:
    """The head goes forward and back with the cosine of the beat position, at a constant distance from the hip."""
    code = np.tile(rest_code(), (len(audio), 1))
    angle = 0.3 * audio[:, -1]
    code[:, 10], code[:, 11] = 1.0 + 0.6 * np.cos(angle), 0.6 * np.sin(angle)
    return code


def stepping(call: int, audio: np.ndarray, initial: np.ndarray) -> np.ndarray:
    """Every meter the head leans to another side: 0.4 m from one meter to the next."""
    code = np.tile(rest_code(), (len(audio), 1))
    side = 0.2 * (-1) ** call
    code[:, 9], code[:, 10] = side, 1.0 + np.sqrt(0.36 - side**2)
    return code


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_dance()


@pytest.fixture(scope="module")
def untrained(clip: Clip) -> Generator:
    """A small generator with random weights and the statistics of one recording."""
    torch.manual_seed(0)
    motion = resample_motion(clip.motion, FPS)
    lengths = torch.tensor(bone_lengths(motion.positions, motion.skeleton))
    generator = Generator(TINY, FEATURES.n_audio, motion.skeleton, lengths, fps=FPS, features=FEATURES)
    code = torch.tensor(encode_motion(motion.positions, FPS, motion.skeleton))
    generator.motion_scale.set(code.mean(dim=0), code.std(dim=0))
    return generator


@pytest.fixture(scope="module")
def movements(clip: Clip) -> PoseBank:
    """Three pieces of one recording."""
    motion = resample_motion(clip.motion, FPS)
    code = encode_motion(motion.positions, FPS, motion.skeleton)
    return PoseBank(np.stack([code[first : first + 30] for first in (0, 20, 40)]), ("", "", ""))


# The whole dance


@pytest.mark.parametrize("start", [0.0, 7.3])
def test_what_the_generator_does_on_the_beat_is_on_the_beat_of_the_song(start: float):
    track = beat_track(0.8)
    motion = synthesize_dance(Planted(nodding), noise(), beats=track, start=start, seconds=12.0, poses=AT_REST)
    position = (start + np.arange(motion.n_frames) / FPS - 0.2) / 0.8
    forward = 0.6 * np.sin(0.3 * np.cos(2 * np.pi * position))
    # The first half second still fades from the movement that the dance starts from.
    np.testing.assert_allclose(motion.positions[10:, 3, 2], forward[10:], atol=0.02)


def test_dance_is_as_long_as_asked_for_and_ends_with_the_music():
    generator, track, poses = Planted(nodding), beat_track(), AT_REST
    assert synthesize_dance(generator, noise(), beats=track, poses=poses, seconds=4.0).n_frames == 60
    assert synthesize_dance(generator, noise(), beats=track, poses=poses).n_frames == 450
    last = synthesize_dance(generator, noise(), beats=track, poses=poses, start=28.0, seconds=60.0)
    assert (last.n_frames, last.fps, last.skeleton) == (30, FPS, SKELETON)


def test_each_meter_is_generated_from_what_was_danced_in_the_beats_before():
    generator = Planted(stepping)
    synthesize_dance(generator, noise(), beats=beat_track(), seconds=12.0, poses=AT_REST)
    assert len(generator.given) >= 5
    sides = []
    for _, initial in generator.given[1:]:
        prior = initial[:, 9] != initial[-1, 9]  # elsewhere it is the mean of the beats before (Eq. 23)
        assert 25 <= prior.sum() <= 35  # four beats of half a second
        np.testing.assert_allclose(initial[-1], initial[prior].mean(axis=0), atol=1e-5)
        sides.append(float(initial[prior][-1, 9]))
    np.testing.assert_allclose(sides, [0.2 * (-1) ** call for call in range(len(sides))], atol=0.01)


def test_no_joint_jumps_where_meters_meet():
    motion = synthesize_dance(Planted(stepping), noise(), beats=beat_track(), seconds=12.0, poses=AT_REST)
    steps = np.linalg.norm(np.diff(motion.positions, axis=0), axis=2).max(axis=1)
    assert np.ptp(motion.positions[:, 3, 0]) > 0.35  # the head does change sides,
    assert steps.max() < 0.17  # but takes several frames for the 0.4 m
    assert np.abs(np.diff(motion.positions, n=2, axis=0)).max() < 0.12


def test_bones_keep_the_generators_lengths_also_where_meters_meet():
    motion = synthesize_dance(Planted(stepping), noise(), beats=beat_track(), seconds=12.0, poses=AT_REST)
    lengths = np.linalg.norm(motion.positions[:, 1:] - motion.positions[:, :1], axis=2)
    np.testing.assert_allclose(
        lengths, np.tile(np.linalg.norm(REST - REST[0], axis=1)[1:], (len(lengths), 1)), rtol=1e-3
    )


def test_path_of_the_root_goes_on_over_all_meters():
    def walking(_: int, audio: np.ndarray, initial: np.ndarray) -> np.ndarray:
        code = np.tile(rest_code(), (len(audio), 1))
        code[:, -2] = 0.5  # metres per second forward
        return code

    start = PoseBank(np.tile(walking(0, np.zeros((4, 5)), np.zeros((4, C)))[:1], (1, 4, 1)), ("",))
    motion = synthesize_dance(
        Planted(walking), noise(), beats=beat_track(), seconds=10.0, poses=start, plant_feet=False
    )
    np.testing.assert_allclose(motion.positions[:, 0, 2], 0.5 * np.arange(150) / FPS, atol=0.02)
    np.testing.assert_allclose(motion.positions[:, 0, 0], 0.0, atol=1e-6)


def test_same_seed_gives_the_same_dance_and_another_seed_another(untrained: Generator, clip: Clip, movements: PoseBank):
    dances = [
        synthesize_dance(untrained, clip.audio, beats=clip.beats, seconds=3.0, seed=seed, poses=movements).positions
        for seed in (0, 0, 1, 2, 3)
    ]
    np.testing.assert_array_equal(dances[0], dances[1])
    assert len({dance.tobytes() for dance in dances}) == 3  # one for each movement it may start from


def test_untrained_generator_dances_on_the_floor_in_one_piece(untrained: Generator, clip: Clip, movements: PoseBank):
    motion = synthesize_dance(untrained, clip.audio, beats=clip.beats, poses=movements)
    assert motion.n_frames == int(clip.audio.duration * FPS)
    assert motion.positions[..., 1].min() == pytest.approx(0.0, abs=1e-9)
    assert np.linalg.norm(np.diff(motion.positions, axis=0), axis=2).max() * FPS < 5.0


def test_without_movements_every_seed_starts_from_the_mean_pose():
    generator = Planted(lambda call, audio, initial: initial)
    still = [synthesize_dance(generator, noise(5.0), beats=beat_track(), seed=seed).positions for seed in (0, 1)]
    np.testing.assert_array_equal(still[0], still[1])


def test_dance_starts_from_a_movement_of_the_dance_that_is_named():
    sides = [stepping(call, np.zeros((5, 5)), np.zeros((5, C))) for call in (0, 1)]
    bank = PoseBank(np.stack(sides), ("waltz", "flamenco"))
    generator = Planted(lambda call, audio, initial: initial)
    for name, side in (("waltz", 0.2), ("flamenco", -0.2)):
        for seed in range(4):
            motion = synthesize_dance(generator, noise(5.0), beats=beat_track(), poses=bank, dance=name, seed=seed)
            np.testing.assert_allclose(motion.positions[:, 3, 0], side, atol=1e-3)


@pytest.mark.parametrize("times", [[], [2.0]])
def test_music_without_beats_is_danced_to_as_well(times: list[float]):
    track = BeatTrack(times, np.ones(len(times)), 100.0, 8.0)
    generator = Planted(stepping)
    assert synthesize_dance(generator, noise(8.0), beats=track, poses=AT_REST).n_frames == 120
    assert 3 <= len(generator.given) <= 6  # meters of four to six half seconds


def test_beats_are_tracked_when_none_are_given():
    clip = harmolab.synthetic_clip("waltz", seed=3)
    generator = Planted(nodding)
    motion = synthesize_dance(generator, clip.audio, dance="waltz", poses=AT_REST)
    tracked = harmolab.audio_beats(clip.audio, tempo="waltz")
    again = synthesize_dance(generator, clip.audio, beats=tracked, poses=AT_REST)
    np.testing.assert_array_equal(motion.positions, again.positions)


@pytest.mark.parametrize("start", [0.0, 0.9, 1.7, 2.6])
@pytest.mark.parametrize("length", [0.6, 4.0])
def test_dance_goes_on_from_where_a_motion_ended(start: float, length: float, untrained: Generator, clip: Clip):
    # Also where a meter is under way when the dance begins.
    before = resample_motion(clip.motion, FPS).span(1.0, length)
    dance = synthesize_dance(
        untrained, clip.audio, beats=clip.beats, start=start, seconds=2.0, initial=before, plant_feet=False
    )
    codes = [encode_motion(motion.positions, FPS, motion.skeleton) for motion in (before, dance)]
    joints = [code[:, :-3].reshape(len(code), -1, 3)[..., [0, 2]] for code in codes]  # the floor may shift heights
    farthest = np.abs(np.diff(joints[0], axis=0)).max()  # that a joint goes from one frame to the next
    assert np.abs(joints[1][0] - joints[0][-1]).max() < farthest
    assert np.abs(joints[1][-1] - joints[0][-1]).max() > farthest  # it does not stay there


def test_generator_is_left_in_the_mode_it_was_in(untrained: Generator, clip: Clip):
    for training in (True, False):
        untrained.train(training)
        synthesize_dance(untrained, clip.audio, beats=clip.beats, seconds=1.0)
        assert untrained.training is training
    untrained.eval()


@cases(
    "options, fault",
    ({"start": 40.0}, r"start must lie within the music \(0 to 30.00 s\), got 40 s"),
    ({"start": -1.0}, "start must lie within the music"),
    ({"start": float("nan")}, "start must lie within the music"),
    ({"seconds": 0.0}, "seconds must be positive, got 0"),
    ({"seconds": float("nan")}, "seconds must be positive"),
    ({"start": 29.99}, "less than two frames"),
    ({"dance": "polka"}, "unknown dance 'polka'; known: cha-cha, jive"),
    (
        {"poses": PoseBank(np.zeros((1, 3, 7)), ("",))},
        r"poses must be motion codes \(K, T0, 15\), got shape \(1, 3, 7\)",
    ),
)
def test_what_cannot_be_danced_is_refused_by_name(options: dict[str, object], fault: str):
    refused(fault, synthesize_dance, Planted(nodding), noise(), **{"beats": beat_track(), "poses": AT_REST} | options)


def test_generator_that_does_not_know_its_features_is_refused():
    generator = Generator(TINY, 5, SKELETON, torch.tensor(np.linalg.norm(REST - REST[0], axis=1)), fps=FPS)
    refused("does not say which audio features it hears", synthesize_dance, generator, noise(), beats=beat_track())


def test_the_door_of_systems_offers_it_by_name():
    assert harmolab.systems.synthesize_dance is synthesize_dance


# Beats and meters


def test_beats_are_added_before_and_after_by_the_median_interval():
    times, strengths = filled_beats(BeatTrack([2.0, 2.5, 3.0], [1.0, 4.0, 2.0], 100.0, 9.0), 1.2, 4.1, before=2)
    np.testing.assert_allclose(times, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5])
    np.testing.assert_allclose(strengths, [2, 2, 2, 2, 1, 4, 2, 2, 2, 2])


def test_break_in_the_music_is_filled_with_beats():
    times, strengths = filled_beats(BeatTrack([1.0, 1.5, 2.0, 4.0, 4.5], [3.0] * 5, 100.0, 9.0), 1.0, 4.4, before=0)
    np.testing.assert_allclose(times, [1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5])
    np.testing.assert_allclose(strengths, 3.0)


def test_meters_cover_the_dance_without_gaps_and_have_beats_before_them():
    meters = meter_frames(beat_track(), FEATURES, start=3.1, n_frames=200, fps=FPS)
    assert meters[0].meter <= 0 < meters[0].end
    assert meters[-1].meter < 200 <= meters[-1].end
    for meter, following in itertools.pairwise(meters):
        assert following.meter == meter.end
    for meter in meters:
        assert 4 * 7 <= meter.end - meter.meter <= 6 * 8  # four to six beats of 7.5 frames
        assert meter.meter - meter.begin == pytest.approx((8 - round((meter.end - meter.meter) / 7.5)) * 7.5, abs=1.01)


def test_accents_decide_where_meters_begin():
    # Strong where a beat is stronger than the one before: 5/4 as 3 + 2, from the beat at 1.0 s on.
    strengths = np.tile([3.0, 1.0, 1.0, 2.0, 1.0], 8)
    track = BeatTrack(1.0 + 0.4 * np.arange(40), strengths, 100.0, 20.0)
    meters = meter_frames(track, FEATURES, start=5.0, n_frames=100, fps=FPS)
    # Frames floor((1.0 + 0.4 * 5 k - 5.0) * 15)
    assert [meter.meter for meter in meters] == [0, 30, 60, 90]


# Borders


def test_piece_goes_on_in_place_and_velocity_and_keeps_its_own_course_later():
    past = np.linspace(0, 1, 11)[:, None]  # 0.1 a frame
    joined = continued(past, np.full((60, 1), 5.0), 60.0)
    assert np.abs(np.diff(np.concatenate([past, joined]), axis=0)).max() < 0.5
    first, second = joined[0, 0] - past[-1, 0], past[-1, 0] - past[-2, 0]
    assert first == pytest.approx(second, abs=0.13)
    assert joined[-1, 0] == pytest.approx(5.0, abs=0.01)


def test_a_tenth_of_a_difference_is_left_after_the_fade():
    joined = continued(np.zeros((2, 1)), np.ones((200, 1)), 400.0)
    assert 1 - joined[round(FADE * 400) - 1, 0] == pytest.approx(0.1, abs=0.002)


def test_piece_that_fits_is_left_alone():
    curve = np.arange(20.0)[:, None] * np.array([1.0, -0.5])
    np.testing.assert_allclose(continued(curve[:9], curve[9:], 15.0), curve[9:], atol=1e-12)
    np.testing.assert_allclose(continued(curve[:1], curve[1:2] * 0 + curve[:1], 15.0), curve[:1], atol=1e-12)


# Floor and feet


def standing(frames: int = 150) -> np.ndarray:
    return np.tile(REST, (frames, 1, 1))


def test_slow_floating_is_taken_away():
    frames = np.arange(150)
    floating = standing() + np.array([0, 1.0, 0]) * (0.3 + 0.1 * np.sin(2 * np.pi * frames / 150))[:, None, None]
    grounded = on_floor(floating, FPS)
    assert grounded[..., 1].min() == pytest.approx(0.0, abs=1e-12)
    assert grounded[:, 1, 1].max() < 0.06


def test_jump_stays_a_jump():
    up = np.zeros(150)
    up[70:79] = 0.4 * np.sin(np.pi * np.arange(1, 10) / 10)
    jumping = standing() + np.array([0, 1.0, 0]) * up[:, None, None] + np.array([0, 0.5, 0])
    np.testing.assert_allclose(on_floor(jumping, FPS)[:, 1, 1], up, atol=1e-9)


def test_feet_that_carry_stop_sliding():
    sliding = standing()
    sliding[..., 0] += 0.3 * np.arange(150)[:, None] / FPS  # a statue on wheels: 0.3 m/s
    planted = planted_feet(sliding, FPS, SKELETON)
    assert foot_skating(Motion(sliding, FPS, SKELETON)) == pytest.approx(0.3)
    assert foot_skating(Motion(planted, FPS, SKELETON)) < 0.03


def test_walk_on_planted_feet_is_hardly_changed():
    # Each foot in turn stands for half a second while the other swings 0.6 m forward, 0.1 m above the floor.
    walk, half = standing(), 8
    for frame in range(1, 150):
        step, phase = divmod(frame, half)
        share = (phase + 1) / half
        swing, stand = (1, 2) if step % 2 else (2, 1)
        walk[frame, stand] = walk[frame - 1, stand] * [1, 0, 1]
        walk[frame, swing] = walk[frame - 1, swing] * [1, 0, 1] + [0, 0.1 * np.sin(np.pi * share), 0.6 / half]
        walk[frame, 0, 2] = walk[frame, [1, 2], 2].mean()
    planted = planted_feet(walk, FPS, SKELETON)
    moved = np.linalg.norm(planted[-1, 0] - planted[0, 0])
    assert moved == pytest.approx(np.linalg.norm(walk[-1, 0] - walk[0, 0]), rel=0.1)


def test_planting_moves_the_body_as_one_and_leaves_footless_skeletons_alone():
    sliding = standing() + np.random.default_rng(0).normal(0, 0.05, (150, 4, 3))
    planted = planted_feet(sliding, FPS, SKELETON)
    np.testing.assert_allclose(np.diff(planted, axis=1), np.diff(sliding, axis=1), atol=1e-12)
    np.testing.assert_array_equal(planted[..., 1], sliding[..., 1])
    nameless = Skeleton(("a", "b", "c", "d"), SKELETON.parents)
    np.testing.assert_array_equal(planted_feet(sliding, FPS, nameless), sliding)
