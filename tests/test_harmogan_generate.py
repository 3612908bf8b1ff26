"""Dances of any length: on the music's beats, without a jump, each meter from the end of the last."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from torch import Tensor

import harmolab
from harmolab import Audio, BeatTrack, Clip, Motion, Skeleton, foot_skating
from harmolab.body.kinematics import resample_motion
from harmolab.systems import FeatureParams, ModelParams, synthesize_dance
from harmolab.systems.choreographer.banks import shipped_bank
from harmolab.systems.harmogan.networks import Generator, GeneratorOutput
from harmolab.systems.harmogan.system import HarmoGAN, corrected, song_corrections
from harmolab.systems.training.feet import on_floor, planted_feet
from harmolab.systems.training.motion_code import FADE, bone_lengths, coded, continued
from harmolab.systems.training.requests import DanceRequest
from harmolab.systems.training.runs import PoseBank
from harmolab.systems.training.units import filled_beats, meter_frames
from tests.builders import cases, missing, planted_dance, refused
from tools.ship import ship_harmogan as ship

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


def resting(frames: int) -> np.ndarray:
    """The code of the dancer standing still, (T, C)."""
    return np.tile(np.concatenate([REST.ravel(), np.zeros(3)]), (frames, 1))


def danced(generator: Generator, **options: object) -> Motion:
    """The dance to noise and beats every half second, from rest."""
    given = {"beats": beat_track(), "seconds": 12.0, "poses": AT_REST} | options
    return synthesize_dance(generator, given.pop("audio", noise()), **given)


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


AT_REST = PoseBank(resting(1)[None], ("",))


def nodding(_: int, audio: np.ndarray, initial: np.ndarray) -> np.ndarray:
    """The head goes forward and back with the cosine of the beat position, at a constant distance from the hip."""
    code = resting(len(audio))
    angle = 0.3 * audio[:, -1]
    code[:, 10], code[:, 11] = 1.0 + 0.6 * np.cos(angle), 0.6 * np.sin(angle)
    return code


def stepping(call: int, audio: np.ndarray, initial: np.ndarray) -> np.ndarray:
    """Every meter the head leans to another side: 0.4 m from one meter to the next."""
    code = resting(len(audio))
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
    lengths = torch.tensor(bone_lengths(clip.motion.positions, clip.motion.skeleton))
    generator = Generator(TINY, FEATURES.n_audio, clip.motion.skeleton, lengths, fps=FPS, features=FEATURES)
    code = torch.tensor(coded(clip.motion, FPS))
    generator.motion_scale.set(code.mean(dim=0), code.std(dim=0))
    return generator


@pytest.fixture(scope="module")
def movements(clip: Clip) -> PoseBank:
    """Three pieces of one recording."""
    code = coded(clip.motion, FPS)
    return PoseBank(np.stack([code[first : first + 30] for first in (0, 20, 40)]), ("", "waltz", "rumba"))


# The whole dance


@pytest.mark.parametrize("start", [0.0, 7.3])
def test_what_the_generator_does_on_the_beat_is_on_the_beat_of_the_song(start: float):
    motion = danced(Planted(nodding), beats=beat_track(0.8), start=start)
    position = (start + np.arange(motion.n_frames) / FPS - 0.2) / 0.8
    forward = 0.6 * np.sin(0.3 * np.cos(2 * np.pi * position))
    # The first half second still fades from the movement that the dance starts from.
    np.testing.assert_allclose(motion.positions[10:, 3, 2], forward[10:], atol=0.02)


def test_each_meter_is_generated_from_what_was_danced_in_the_beats_before():
    generator, sides = Planted(stepping), []
    danced(generator)
    assert len(generator.given) >= 5
    for _, initial in generator.given[1:]:
        prior = initial[:, 9] != initial[-1, 9]  # elsewhere it is the mean of the beats before (Eq. 23)
        assert 25 <= prior.sum() <= 35  # four beats of half a second
        np.testing.assert_allclose(initial[-1], initial[prior].mean(axis=0), atol=1e-5)
        sides.append(float(initial[prior][-1, 9]))
    np.testing.assert_allclose(sides, [0.2 * (-1) ** call for call in range(len(sides))], atol=0.01)


def test_no_joint_jumps_and_bones_keep_their_lengths_where_meters_meet():
    motion = danced(Planted(stepping))
    lengths = np.linalg.norm(motion.positions[:, 1:] - motion.positions[:, :1], axis=2)
    np.testing.assert_allclose(lengths, np.broadcast_to([np.hypot(0.2, 1), np.hypot(0.2, 1), 0.6], (180, 3)), rtol=1e-3)
    steps = np.linalg.norm(np.diff(motion.positions, axis=0), axis=2).max(axis=1)
    assert np.ptp(motion.positions[:, 3, 0]) > 0.35  # the head does change sides,
    assert steps.max() < 0.17  # but takes several frames for the 0.4 m
    assert np.abs(np.diff(motion.positions, n=2, axis=0)).max() < 0.12


def test_path_of_the_root_goes_on_over_all_meters():
    def walking(_: int, audio: np.ndarray, initial: np.ndarray) -> np.ndarray:
        code = resting(len(audio))
        code[:, -2] = 0.5  # metres per second forward
        return code

    start = PoseBank(walking(0, np.zeros((4, 5)), np.zeros((4, C)))[None], ("",))
    motion = danced(Planted(walking), seconds=10.0, poses=start, plant_feet=False)
    np.testing.assert_allclose(motion.positions[:, 0, 2], 0.5 * np.arange(150) / FPS, atol=0.02)
    np.testing.assert_allclose(motion.positions[:, 0, 0], 0.0, atol=1e-6)


def test_same_seed_gives_the_same_dance_and_another_seed_another(untrained: Generator, clip: Clip, movements: PoseBank):
    options = {"beats": clip.beats, "seconds": 3.0, "poses": movements}
    dances = [synthesize_dance(untrained, clip.audio, seed=seed, **options).positions for seed in (0, 0, 1, 2, 3)]
    np.testing.assert_array_equal(dances[0], dances[1])
    assert len({dance.tobytes() for dance in dances}) == 3  # one for each movement it may start from
    assert dances[0][..., 1].min() == pytest.approx(0.0, abs=1e-9)  # on the floor


def test_without_movements_every_seed_starts_from_the_mean_pose():
    generator = Planted(lambda call, audio, initial: initial)
    still = [danced(generator, seconds=5.0, poses=None, seed=seed).positions for seed in (0, 1)]
    np.testing.assert_array_equal(still[0], still[1])


def test_dance_starts_from_a_movement_of_the_dance_that_is_named():
    sides = [stepping(call, np.zeros((5, 5)), np.zeros((5, C))) for call in (0, 1)]
    bank = PoseBank(np.stack(sides), ("waltz", "flamenco"))
    generator = Planted(lambda call, audio, initial: initial)
    for name, side in (("waltz", 0.2), ("flamenco", -0.2)):
        for seed in range(4):
            motion = danced(generator, seconds=5.0, poses=bank, dance=name, seed=seed)
            np.testing.assert_allclose(motion.positions[:, 3, 0], side, atol=1e-3)


@pytest.mark.parametrize("times", [[], [2.0]])
def test_music_without_beats_is_danced_to_as_well(times: list[float]):
    track = BeatTrack(times, np.ones(len(times)), 100.0, 8.0)
    generator = Planted(stepping)
    assert danced(generator, audio=noise(8.0), beats=track).n_frames == 120
    assert 3 <= len(generator.given) <= 6  # meters of four to six half seconds


def test_beats_are_tracked_when_none_are_given():
    clip, generator = harmolab.synthetic_clip("waltz", seed=3), Planted(nodding)
    motion = danced(generator, audio=clip.audio, beats=None, dance="waltz")
    again = danced(generator, audio=clip.audio, beats=harmolab.audio_beats(clip.audio, tempo="waltz"))
    np.testing.assert_array_equal(motion.positions, again.positions)


@pytest.mark.parametrize("start", [0.0, 0.9, 1.7, 2.6])
@pytest.mark.parametrize("length", [0.6, 4.0])
def test_dance_goes_on_from_where_a_motion_ended(start: float, length: float, untrained: Generator, clip: Clip):
    # Also where a meter is under way when the dance begins.
    before = resample_motion(clip.motion, FPS).span(1.0, length)
    options = {"start": start, "seconds": 2.0, "initial": before, "plant_feet": False}
    dance = synthesize_dance(untrained, clip.audio, beats=clip.beats, **options)
    codes = [coded(motion, FPS) for motion in (before, dance)]
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
    ({"start": float("nan")}, "start must lie within the music"),
    ({"seconds": 0.0}, "seconds must be positive, got 0"),
    ({"seconds": float("nan")}, "seconds must be positive"),
    ({"start": 29.99}, "less than two frames"),
    ({"dance": "polka"}, "unknown dance 'polka'; known: cha-cha, jive"),
    ({"poses": PoseBank(np.zeros((1, 3, 7)), ("",))}, r"poses must be .* \(K, T0, 15\), got shape \(1, 3, 7\)"),
)
def test_what_cannot_be_danced_is_refused_by_name(options: dict[str, object], fault: str):
    refused(fault, danced, Planted(nodding), **options)


def test_generator_that_does_not_know_its_features_is_refused():
    generator = Generator(TINY, 5, SKELETON, torch.tensor(np.linalg.norm(REST - REST[0], axis=1)), fps=FPS)
    refused("does not say which audio features it hears", danced, generator)


# Beats and meters


def test_beats_are_added_before_after_and_in_breaks_by_the_median_interval():
    times, strengths = filled_beats(BeatTrack([2.0, 2.5, 3.0], [1.0, 4.0, 2.0], 100.0, 9.0), 1.2, 4.1, before=2)
    np.testing.assert_allclose(times, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0, 4.5])
    np.testing.assert_allclose(strengths, [2, 2, 2, 2, 1, 4, 2, 2, 2, 2])
    broken = BeatTrack([1.0, 1.5, 2.0, 4.0, 4.5], [3.0] * 5, 100.0, 9.0)
    np.testing.assert_allclose(filled_beats(broken, 1.0, 4.4, before=0), [1 + 0.5 * np.arange(8), 8 * [3.0]])


def test_meters_cover_the_dance_without_gaps_and_have_beats_before_them():
    meters = meter_frames(beat_track(), FEATURES, start=3.1, n_frames=200, fps=FPS)
    assert meters[0].meter <= 0 < meters[0].end
    assert meters[-1].meter < 200 <= meters[-1].end
    assert [meter.meter for meter in meters[1:]] == [meter.end for meter in meters[:-1]]
    for meter in meters:
        assert 4 * 7 <= meter.end - meter.meter <= 6 * 8  # four to six beats of 7.5 frames
        assert meter.meter - meter.begin == pytest.approx((8 - round((meter.end - meter.meter) / 7.5)) * 7.5, abs=1.01)


def test_accents_decide_where_meters_begin():
    # Strong where a beat is stronger than the one before: 5/4 as 3 + 2, from the beat at 1.0 s on.
    track = BeatTrack(1.0 + 0.4 * np.arange(40), np.tile([3.0, 1.0, 1.0, 2.0, 1.0], 8), 100.0, 20.0)
    # Frames floor((1.0 + 0.4 * 5 k - 5.0) * 15)
    assert [meter.meter for meter in meter_frames(track, FEATURES, start=5.0, n_frames=100, fps=FPS)] == [0, 30, 60, 90]


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


STANDING = np.tile(REST, (150, 1, 1))


def test_slow_floating_is_taken_away():
    frames = np.arange(150)
    floating = STANDING + np.array([0, 1.0, 0]) * (0.3 + 0.1 * np.sin(2 * np.pi * frames / 150))[:, None, None]
    grounded = on_floor(floating, FPS)
    assert grounded[..., 1].min() == pytest.approx(0.0, abs=1e-12)
    assert grounded[:, 1, 1].max() < 0.06


def test_jump_stays_a_jump():
    up = np.zeros(150)
    up[70:79] = 0.4 * np.sin(np.pi * np.arange(1, 10) / 10)
    jumping = STANDING + np.array([0, 1.0, 0]) * up[:, None, None] + np.array([0, 0.5, 0])
    np.testing.assert_allclose(on_floor(jumping, FPS)[:, 1, 1], up, atol=1e-9)


def test_feet_that_carry_stop_sliding():
    sliding = STANDING.copy()
    sliding[..., 0] += 0.3 * np.arange(150)[:, None] / FPS  # a statue on wheels: 0.3 m/s
    planted = planted_feet(sliding, FPS, SKELETON)
    assert foot_skating(Motion(sliding, FPS, SKELETON)) == pytest.approx(0.3)
    assert foot_skating(Motion(planted, FPS, SKELETON)) < 0.03


def test_walk_on_planted_feet_is_hardly_changed():
    # Each foot in turn stands for half a second while the other swings 0.6 m forward, 0.1 m above the floor.
    walk, half = STANDING.copy(), 8
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
    sliding = STANDING + np.random.default_rng(0).normal(0, 0.05, (150, 4, 3))
    planted = planted_feet(sliding, FPS, SKELETON)
    np.testing.assert_allclose(np.diff(planted, axis=1), np.diff(sliding, axis=1), atol=1e-12)
    np.testing.assert_array_equal(planted[..., 1], sliding[..., 1])
    np.testing.assert_array_equal(planted_feet(sliding, FPS, Skeleton(("a", "b", "c", "d"), SKELETON.parents)), sliding)


# A sketch that is corrected


BEATS = FeatureParams(n_mfcc=2, beat_channels=True, bar_channels=True)
PUPPETS = shipped_bank("puppet")


class Lifting(Generator):
    """A bounded generator of the puppets' body whose only correction is a rise of the trunk with the beat position."""

    def __init__(self) -> None:
        sizes = replace(TINY, bounded=True)
        lengths = torch.tensor(bone_lengths(PUPPETS.takes[0].motion.positions, PUPPETS.skeleton))
        super().__init__(sizes, BEATS.n_audio, PUPPETS.skeleton, lengths, fps=FPS, features=BEATS)
        self.given: list[int] = []

    def corrections(self, audio: Tensor, initial: Tensor) -> Tensor:
        self.given.append(audio.shape[1])
        raw = torch.zeros(*initial.shape)
        raw[..., 3 * self.skeleton.parents.index(-1) + 1] = 0.1 * audio[..., 4]  # cosine of the beat position
        return raw


def test_corrections_of_a_song_have_no_seams_and_are_those_of_its_own_beats():
    request = DanceRequest(noise(), beat_track(0.55), 1.3, 20.0)
    rise = song_corrections(Lifting(), np.zeros((300, 3 * len(PUPPETS.skeleton.joints) + 3), np.float32), request)
    moments = 1.3 + np.arange(300) / FPS
    column = 3 * PUPPETS.skeleton.parents.index(-1) + 1
    np.testing.assert_allclose(rise[:, column], 0.1 * np.cos(2 * np.pi * (moments - 0.2) / 0.55), atol=1e-6)
    assert not rise[:, column + 1].any()


def test_units_of_a_song_are_eight_beats_six_apart():
    generator, request = Lifting(), DanceRequest(noise(), beat_track(), 0.2)
    song_corrections(generator, np.zeros((300, generator.n_motion), np.float32), request)
    assert generator.given[:3] == [52, 60, 60]  # of 7.5 frames a beat; the first begins half a second before the dance


def test_a_sketch_without_corrections_stays_as_it_is_and_with_them_keeps_near():
    system = HarmoGAN(Lifting(), sketches=PUPPETS)
    request = {"audio": noise(), "beats": beat_track(), "seconds": 12.0, "seed": 3, "plant_feet": False}
    sketch, lifted = PUPPETS.generate(**request), system.generate(**request)
    system.generator.corrections = lambda audio, initial: torch.zeros_like(initial)
    same = system.generate(**request)
    assert lifted.fps == sketch.fps and lifted.n_frames == sketch.n_frames
    np.testing.assert_allclose(same.positions, sketch.positions, atol=3e-3)  # it is put on the floor a second time
    assert 0.01 < np.abs(lifted.positions - same.positions).max() < 0.1


def test_a_corrected_dance_says_what_its_sketch_is_made_of_and_where_it_is_held():
    system, silent = HarmoGAN(Lifting(), sketches=PUPPETS), noise(20.0).samples.copy()
    silent[8 * 8000 : 12 * 8000] = 0.0
    request = DanceRequest(Audio(silent, 8000), beat_track(seconds=20.0), 0.0, 18.0, 2)
    sketch, made = PUPPETS.composed(request), system.choreograph(request.audio, request.beats, seconds=18.0, seed=2)
    assert (made.pieces, made.form) == (sketch.pieces, sketch.form) and "silence 0:08-0:12" in made.form
    np.testing.assert_array_equal(made.held, sketch.held)
    assert made.held.sum() > 3 * made.motion.fps
    np.testing.assert_array_equal(made.motion.positions, system.respond(request).positions)
    assert not np.array_equal(made.motion.positions, sketch.motion.positions)
    refused("corrects no sketch", HarmoGAN(Planted(nodding)).choreograph, request.audio)


def test_a_sketch_of_other_joints_is_refused():
    request = DanceRequest(noise(), beat_track())
    refused("initial has other joints", corrected, Planted(nodding), PUPPETS.takes[0].motion, request)


def test_shipped_weights_name_the_bank_that_they_correct(tmp_path: Path):
    bank = shipped_bank("salsa")
    lengths = torch.tensor(bone_lengths(bank.takes[0].motion.positions, bank.skeleton))
    generator = Generator(replace(TINY, bounded=True), BEATS.n_audio, bank.skeleton, lengths, fps=FPS, features=BEATS)
    HarmoGAN(generator, meta={"note": "kept"}, sketches=bank).save(tmp_path / "run")
    for out in ("one", "two"):
        ship(tmp_path / "run", tmp_path / out)
    assert {path.name for path in (tmp_path / "one").iterdir()} == {"model.json", "model.safetensors"}
    assert (tmp_path / "one/model.safetensors").read_bytes() == (tmp_path / "two/model.safetensors").read_bytes()
    again = HarmoGAN.load(tmp_path / "one")
    assert again.meta == {"note": "kept", "sketches": "salsa"} and again.sketches.takes[0].name == bank.takes[0].name
    assert again.limits == bank.limits and again.generator.params.bounded


def test_recordings_of_others_and_an_incomplete_run_are_not_shipped(tmp_path: Path):
    missing("model", ship, tmp_path, tmp_path / "out")
    generator = Generator(replace(TINY, bounded=True), 5, PUPPETS.skeleton, Lifting().bone_lengths, fps=FPS)
    HarmoGAN(generator, sketches=PUPPETS).save(tmp_path / "run")
    refused("sketches are of recordings that are not ours", ship, tmp_path / "run", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    for file in ("model.json", "model.safetensors"):
        assert HarmoGAN.load(tmp_path / "run" / file).sketches.takes[0].name == PUPPETS.takes[0].name
    (tmp_path / "run/sketches").rename(tmp_path / "moved")
    missing("run/sketches: no such movement to correct; copy it", HarmoGAN.load, tmp_path / "run")
