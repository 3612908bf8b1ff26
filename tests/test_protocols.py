"""Protocols against the published definitions, written once more in plain loops; and their faults, made visible."""

import math
import pickle
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path

import librosa
import numpy as np
import pytest
import soundfile
from scipy.linalg import sqrtm

from benchmarks.bench_motion_features import SMPL_24, STANDING, loop_geometric, loop_kinetic, moving_body
from harmolab.beats.audio import audio_beats, librosa_beats
from harmolab.body.skeletons import Skeleton, skeleton_part
from harmolab.lab.evaluate.pairing import GENERATED, Pair
from harmolab.lab.evaluate.protocols import PROTOCOLS, published_music_and_motion
from harmolab.lab.evaluate.rows import RowOptions, pair_clip, protocol_numbers
from harmolab.metrics.beat_alignment import beat_align
from harmolab.metrics.features import kinetic_features, standardise
from harmolab.metrics.quality import pfc
from harmolab.readers.audio import load_audio
from harmolab.readers.keypoints import COCO_17
from harmolab.readers.motion import save_motion
from harmolab.types import Audio, BeatTrack, Clip, Motion
from tests.builders import cases, refused, track

AIST, EDGE, BAILANDO = PROTOCOLS["aist++"], PROTOCOLS["edge"], PROTOCOLS["bailando"]
TEN_METRES = np.array([6.0, 0.0, -8.0])
# The names of SMPL's own model, in its order.
SMPL_NAMES = (
    *("pelvis", "left_hip", "right_hip", "spine1", "left_knee", "right_knee", "spine2", "left_ankle", "right_ankle"),
    *("spine3", "left_foot", "right_foot", "neck", "left_collar", "right_collar", "head", "left_shoulder"),
    *("right_shoulder", "left_elbow", "right_elbow", "left_wrist", "right_wrist", "left_hand", "right_hand"),
)


def walker(seed: int, frames: int = 240, fps: float = 60.0) -> Motion:
    """A body each joint of which walks at random."""
    steps = np.random.default_rng(seed).normal(0, 0.01, (frames, 24, 3))
    return Motion(STANDING + np.cumsum(steps, axis=0), fps, SMPL_24)


def frozen(frames: int = 240, fps: float = 60.0) -> Motion:
    """A statue."""
    return Motion(np.repeat(STANDING[None], frames, axis=0), fps, SMPL_24)


def resting(rests: Sequence[int], frames: int = 240, fps: float = 60.0) -> Motion:
    """A body all joints of which go the same way, slowest on the way into these frames."""
    moments = np.arange(frames)
    speed = np.min([np.abs(moments - rest) for rest in rests], axis=0) * 1e-3 + 1e-3
    place = np.cumsum(speed)[:, None, None] * np.array([1.0, 0.0, 0.0])
    return Motion(STANDING + place, fps, SMPL_24)


def beats_at(frames: Sequence[int], fps: float = 60.0, duration: float = 30.0) -> BeatTrack:
    """Music beats at these frames."""
    return track([frame / fps for frame in frames], duration=duration)


MUSIC = beats_at([20, 52, 83, 115, 147, 178, 210])
DANCES = {
    "walker": walker(1),
    "another walker": walker(2, frames=401),
    "moving body": moving_body(4.0),
    "ten metres away": replace(moving_body(4.0), positions=moving_body(4.0).positions + TEN_METRES),
    "at 30 frames per second": moving_body(6.0, fps=30.0),
}


# The definitions, frame by frame


def frame_of(time: float, fps: float) -> int:
    return math.floor(time * fps + 0.5)


def loop_speed(positions: np.ndarray, frame: int) -> float:
    """Metres that all joints go together from the frame before to this one."""
    return sum(math.dist(positions[frame][joint], positions[frame - 1][joint]) for joint in range(positions.shape[1]))


def loop_kernel(queries: Sequence[int], targets: Sequence[int]) -> float:
    total = 0.0
    for query in queries:
        nearest = min(abs(query - target) for target in targets)
        total += math.exp(-(nearest**2) / 2 / 3**2)
    return total / len(queries)


def loop_motion_beats(positions: np.ndarray) -> list[int]:
    """Frames slower than ten on either side; the first has speed 0; neighbours beyond the end are the last frame."""
    speeds = [0.0] + [loop_speed(positions, frame) for frame in range(1, len(positions))]
    beats = []
    for frame, speed in enumerate(speeds):
        around = [min(max(frame + step, 0), len(speeds) - 1) for step in range(-10, 11) if step]
        if all(speed < speeds[other] for other in around):
            beats.append(frame)
    return beats


def loop_beat_align(motion: Motion, music: BeatTrack) -> float:
    beats = loop_motion_beats(motion.positions)
    music_beats = [frame_of(time, motion.fps) for time in music.times]
    return loop_kernel(beats, [frame for frame in music_beats if frame < motion.n_frames])


def loop_smoothed(series: Sequence[float], sigma: float) -> list[float]:
    """Gaussian mean over 4 sigma on either side; what lies beyond an end is mirrored there, the end itself doubled."""
    reach, count = int(4 * sigma + 0.5), len(series)
    weights = {step: math.exp(-(step**2) / 2 / sigma**2) for step in range(-reach, reach + 1)}
    smoothed = []
    for frame in range(count):
        total = 0.0
        for step, weight in weights.items():
            other = (frame + step) % (2 * count)
            total += weight * series[other if other < count else 2 * count - 1 - other]
        smoothed.append(total / sum(weights.values()))
    return smoothed


def loop_bas(motion: Motion, music: BeatTrack) -> float:
    speeds = [loop_speed(motion.positions, frame) / 24 for frame in range(1, motion.n_frames)]
    speeds = loop_smoothed(speeds, 5.0)
    beats = [t for t in range(1, len(speeds) - 1) if speeds[t] < speeds[t - 1] and speeds[t] < speeds[t + 1]]
    music_beats = [frame_of(time, motion.fps) for time in music.times]
    return loop_kernel([frame for frame in music_beats if frame < len(speeds)], beats)


def loop_pfc(positions: np.ndarray) -> float:
    """SMPL's joints 7 and 10 are the left ankle and toes, 8 and 11 the right ones; y is up."""
    products, pushes = [], []
    for frame in range(len(positions) - 2):
        before = (positions[frame + 1][0] - positions[frame][0]) * 30
        after = (positions[frame + 2][0] - positions[frame + 1][0]) * 30
        x, y, z = (after - before) * 30
        pushes.append(math.hypot(x, max(y, 0.0), z))
        speed = {}
        for joint in (7, 10, 8, 11):
            x, _, z = positions[frame + 2][joint] - positions[frame + 1][joint]
            speed[joint] = math.hypot(x, z)
        products.append(min(speed[7], speed[10]) * min(speed[8], speed[11]))
    shares = [push / max(pushes) for push in pushes]
    return sum(product * share for product, share in zip(products, shares, strict=True)) / len(products) * 10_000


def loop_standardised(rows: np.ndarray, reference: np.ndarray) -> np.ndarray:
    columns = []
    for values, model in zip(rows.T, reference.T, strict=True):
        mean = sum(model) / len(model)
        spread = math.sqrt(sum((value - mean) ** 2 for value in model) / len(model)) + 1e-10
        columns.append([(value - mean) / spread for value in values])
    return np.array(columns).T


def loop_frechet(rows: np.ndarray, others: np.ndarray) -> float:
    gap = rows.mean(axis=0) - others.mean(axis=0)
    one, other = np.cov(rows, rowvar=False), np.cov(others, rowvar=False)
    return float(gap @ gap + np.trace(one) + np.trace(other) - 2 * np.trace(sqrtm(one @ other)).real)


def loop_diversity(rows: np.ndarray) -> float:
    distances = [math.dist(one, other) for place, one in enumerate(rows) for other in rows[:place]]
    return sum(distances) / len(distances)


# Agreement with them


@pytest.mark.parametrize("name", DANCES)
def test_beat_align_is_that_of_the_published_definition(name: str):
    score = AIST.clip(DANCES[name], MUSIC)
    assert score == {"BeatAlign": pytest.approx(loop_beat_align(DANCES[name], MUSIC), abs=1e-6)}
    assert 0 < score["BeatAlign"] < 1


@pytest.mark.parametrize("name", DANCES)
def test_the_score_of_bailando_is_that_of_the_published_definition(name: str):
    score = BAILANDO.clip(DANCES[name], MUSIC)
    assert score == {"BAS": pytest.approx(loop_bas(DANCES[name], MUSIC), abs=1e-6)}
    assert 0 < score["BAS"] < 1


@pytest.mark.parametrize("name", DANCES)
def test_foot_contact_is_that_of_the_published_definition(name: str):
    score = EDGE.clip(DANCES[name], MUSIC)
    assert score == {"PFC": pytest.approx(loop_pfc(DANCES[name].positions), rel=1e-6)}
    assert score["PFC"] > 0


@pytest.mark.parametrize("name", ["walker", "ten metres away", "at 30 frames per second"])
def test_features_of_aist_are_those_of_the_published_definition(name: str):
    positions = DANCES[name].positions[:60]
    features = AIST.features(replace(DANCES[name], positions=positions, valid=np.ones(60, bool)))
    np.testing.assert_allclose(features["kinetic"], loop_kinetic(positions), rtol=1e-6)
    np.testing.assert_allclose(features["geometric"], loop_geometric(positions), atol=1e-6)


def test_features_of_bailando_start_at_the_origin_and_end_after_20_seconds():
    dance = moving_body(20.5)
    features = BAILANDO.features(replace(dance, positions=dance.positions + TEN_METRES))
    start = dance.positions[0, 0]
    # Loops over all 1,200 frames take half a minute, so the kinetic ones are those of AIST++'s form, checked above.
    first = replace(dance, positions=dance.positions[:1200] - start, valid=np.ones(1200, bool))
    np.testing.assert_allclose(features["kinetic"], AIST.features(first)["kinetic"], rtol=1e-6)
    np.testing.assert_allclose(features["geometric"], loop_geometric(first.positions), atol=1e-6)
    short = BAILANDO.features(walker(5, frames=50))
    placed = walker(5, frames=50).positions
    np.testing.assert_allclose(short["kinetic"], loop_kinetic(placed - placed[0, 0]), rtol=1e-6)


# More dances than features, and as few as tables have: the covariances of 40 dances are singular.
@pytest.mark.parametrize("sizes", [(120, 150), (20, 40)])
@pytest.mark.parametrize("protocol", [AIST, BAILANDO])
def test_distances_and_diversity_are_as_published(protocol, sizes: tuple[int, int], rng: np.random.Generator):
    mixing = {"kinetic": rng.normal(size=(72, 72)), "geometric": rng.normal(size=(32, 32))}
    features = {name: rng.normal(1.0, 2.0, (sizes[0], len(matrix))) @ matrix for name, matrix in mixing.items()}
    reference = {name: rng.normal(0.0, 1.0, (sizes[1], len(matrix))) @ matrix for name, matrix in mixing.items()}
    scores = protocol.sets(features, reference)
    expected = {}
    for letter, name in (("k", "kinetic"), ("g", "geometric")):
        rows, others = (loop_standardised(side[name], reference[name]) for side in (features, reference))
        expected |= {f"FID_{letter}": loop_frechet(rows, others), f"Div_{letter}": loop_diversity(rows)}
    assert scores == {name: pytest.approx(value, rel=1e-6) for name, value in expected.items()}


# Music beats: the published preparation of songs, written once more with librosa


def loaded(song: Path, rate: float) -> np.ndarray:
    """librosa.load, which warns of a module that it does not need here."""
    samples, own = soundfile.read(song, dtype="float32", always_2d=True)
    return librosa.resample(librosa.to_mono(samples.T), orig_sr=own, target_sr=rate)


def frames_of_aist(song: Path, fps: float) -> list[int]:
    rate = fps * 512
    strength = librosa.onset.onset_strength(y=loaded(song, rate), sr=rate)
    # The published table of tempi by the four letters of a song's name.
    tempo = {"mBR0": 80, "mBR5": 130, "mLO3": 110, "mHO5": 135}.get(song.stem, 120)
    _, beats = librosa.beat.beat_track(onset_envelope=strength, sr=rate, hop_length=512, start_bpm=tempo, tightness=100)
    return [int(beat) for beat in beats]


def frames_of_bailando(song: Path, fps: float) -> list[int]:
    rate = fps * 512
    samples = loaded(song, rate)  # published: by essentia
    _, percussive = librosa.effects.hpss(samples)
    strength = librosa.onset.onset_strength(y=percussive, aggregate=np.median, sr=rate)
    with np.errstate(invalid="ignore"):  # librosa 1.0
        _, beats = librosa.beat.beat_track(onset_envelope=strength, sr=rate)
    return [int(beat) for beat in beats]


def song_file(path: Path, *, eighth: float = 0.375, seconds: float = 11.0, rate: int = 44100) -> Path:
    """Chords that swell on eighths, louder ones on quarters, one louder in the left channel; nearly no click."""
    rng = np.random.default_rng(3)
    since = np.arange(int(0.8 * rate)) / rate
    sound = np.zeros((int(seconds * rate), 2))
    for place, start in enumerate(np.arange(0.2, seconds - 0.8, eighth)):
        swell = since * np.exp(-since / 0.05) / 0.05 * (0.6 if place % 2 else 1.0)
        tone = np.sin(2 * np.pi * rng.uniform(200, 2000) * since) + 0.3 * rng.normal(size=since.size)
        first = round(start * rate)
        sound[first : first + since.size] += (swell * tone)[:, None] * [1.0, 0.6]
    soundfile.write(path, sound / np.abs(sound).max() * 0.8, rate)
    return path


def dance_file(path: Path, fps: float, *, offset: float = 0.0) -> Path:
    save_motion(path, walker(7, frames=int(10 * fps), fps=fps), offset=offset)
    return path


@pytest.mark.slow
@pytest.mark.parametrize("fps", [60.0, 30.0])
@pytest.mark.parametrize("name", ["mBR0", "mHO5", "waltz"])
@pytest.mark.parametrize("protocol", ["aist++", "bailando"])
def test_beat_scores_of_files_are_those_of_the_published_codes(tmp_path: Path, protocol: str, name: str, fps: float):
    song, dance = song_file(tmp_path / f"{name}.wav"), dance_file(tmp_path / f"{name}.npz", fps)
    pair = Pair("x", "", name, dance, song, GENERATED)
    clip = pair_clip(pair, RowOptions())
    numbers, _, _ = protocol_numbers(clip, pair, protocol)
    frames = (frames_of_aist if protocol == "aist++" else frames_of_bailando)(song, fps)
    assert len(frames) > 8
    music = beats_at(frames, fps=fps)
    expected = loop_beat_align(clip.motion, music) if protocol == "aist++" else loop_bas(clip.motion, music)
    measure = "BeatAlign" if protocol == "aist++" else "BAS"
    assert numbers == {f"{protocol} {measure}": pytest.approx(expected, abs=1e-6)}


@pytest.mark.slow
def test_published_beats_are_those_of_neither_our_tracker_nor_an_annotation(tmp_path: Path):
    song, dance = song_file(tmp_path / "waltz.wav"), dance_file(tmp_path / "waltz.npz", 60.0)
    pair = Pair("x", "", "waltz", dance, song, GENERATED)
    tracked = protocol_numbers(pair_clip(pair, RowOptions()), pair, "aist++")[0]
    annotated = replace(pair_clip(pair, RowOptions()), beats=track([1.0, 2.0, 3.0], duration=16.0))
    assert protocol_numbers(annotated, pair, "aist++")[0] == tracked
    published = librosa_beats(load_audio(song, sample_rate=60 * 512)).times
    ours = audio_beats(load_audio(song)).times
    late = published - ours[np.abs(published[:, None] - ours).argmin(axis=1)]
    assert 0.01 < np.median(late) < 0.05


@pytest.mark.slow
def test_a_tempo_in_the_name_of_a_song_changes_the_beats(tmp_path: Path):
    slow, other = (frames_of_aist(song_file(tmp_path / f"{name}.wav"), 60.0) for name in ("mBR0", "waltz"))
    assert len(other) > 1.5 * len(slow)


@pytest.mark.slow
def test_published_beats_are_tracked_once_for_all_rows_and_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("HARMOLAB_CACHE", str(tmp_path / "cache"))
    names = [f"song{number:02d}" for number in range(16)]
    for name in names:
        soundfile.write(tmp_path / f"{name}.wav", np.zeros(4000), 8000)
    motion = walker(1, frames=20, fps=20.0)
    clip = Clip("", Audio(np.zeros(4000), 8000.0), motion, beats=beats_at([2], fps=20.0, duration=0.5))
    trackings: list[str] = []

    def tracked(audio: Audio, song: str) -> BeatTrack:
        trackings.append(song)
        time.sleep(0.002)
        return BeatTrack(np.array([0.1 + len(trackings) / 100]), np.ones(1), 20.0, audio.duration)

    def row(name: str) -> float:
        return float(published_music_and_motion(clip, tmp_path / f"{name}.wav", name, tracked)[0].times[0])

    with ThreadPoolExecutor(4) as pool:  # four rows of every song, the songs one after the other as rows have them
        times = list(pool.map(row, names * 4))
    assert sorted(trackings) == names
    assert times[:16] == times[16:32] == times[48:]
    soundfile.write(tmp_path / "song00.wav", np.zeros(4001), 8000)
    row("song00")
    assert trackings.count("song00") == 2


def test_published_beats_move_with_the_start_of_the_motion(tmp_path: Path):
    song = song_file(tmp_path / "waltz.wav")
    clips = [pair_clip(Pair("x", "", "waltz", dance_file(tmp_path / f"{start}.npz", 60.0, offset=start / 60), song),
                       RowOptions()) for start in (0, 90)]  # fmt: skip
    tracks = [published_music_and_motion(clip, song, "waltz", AIST.music_beats)[0] for clip in clips]
    whole, late = (np.rint(track.times * 60) for track in tracks)
    np.testing.assert_array_equal(late[late < 510], whole[whole >= 90] - 90)


def test_silence_and_the_shortest_sound_have_no_published_beats():
    for samples in (np.zeros(60 * 512 * 3), np.zeros(40), np.ones(1)):
        for percussive in (False, True):
            assert len(librosa_beats(Audio(samples, 60 * 512), percussive=percussive)) == 0


@cases("fps, seconds, fault", (1000.0, 2.0, "10 to 250 a second: 1000"), (60.0, 1000.0, "60000 frames, more than"))
def test_what_would_fill_the_memory_has_no_published_beats(tmp_path: Path, fps: float, seconds: float, fault: str):
    clip = Clip("x", Audio(np.zeros(round(seconds * 1000)), 1000), walker(1, fps=fps), beats=MUSIC)
    pair = Pair("x", "", "waltz", tmp_path / "x.npz", tmp_path / "x.wav")
    *numbers, remark = protocol_numbers(clip, pair, "bailando")
    assert numbers == [{}, {}] and fault in remark
    assert protocol_numbers(clip, pair, "edge")[0].keys() == {"edge PFC"}


# Where published codes stop


def test_a_frozen_clip_scores_nothing_or_nan():
    assert AIST.clip(frozen(), MUSIC) == {"BeatAlign": 0.0}
    assert math.isnan(BAILANDO.clip(frozen(), MUSIC)["BAS"])
    assert math.isnan(EDGE.clip(frozen(), MUSIC)["PFC"])
    assert "published code stops" in BAILANDO.remarks(frozen(), {"BAS": math.nan})[0]
    assert "divides 0 by 0" in EDGE.remarks(frozen(fps=30.0), {"PFC": math.nan})[0]


def test_music_without_beats_gives_nan_and_a_remark():
    silence = track([])
    for protocol in (AIST, BAILANDO):
        scores = protocol.clip(walker(1), silence)
        assert [math.isnan(score) for score in scores.values()] == [True]
        (remark,) = protocol.remarks(walker(1), scores)
        assert remark.startswith(f"{next(iter(scores))} is NaN")


def test_beats_after_the_end_of_the_motion_are_no_beats():
    late = beats_at([500])
    assert math.isnan(AIST.clip(walker(1), late)["BeatAlign"])
    assert math.isnan(BAILANDO.clip(walker(1), late)["BAS"])


def test_one_dance_has_no_distance(rng: np.random.Generator):
    one, many = ({"kinetic": rng.normal(size=(n, 72)), "geometric": rng.normal(size=(n, 32))} for n in (1, 5))
    assert all(math.isnan(value) for value in AIST.sets(one, many).values())
    assert all(math.isnan(value) for value in AIST.sets(many, one).values())


def test_a_motion_of_two_frames_has_no_acceleration():
    refused("three frames, the motion has 2", EDGE.clip, walker(1, frames=2), MUSIC)


# Faults that must show


def test_the_place_in_the_room_is_energy_by_the_bracket_and_by_ours_it_is_not():
    dance, away = DANCES["moving body"], DANCES["ten metres away"]
    np.testing.assert_allclose(kinetic_features(away), kinetic_features(dance), rtol=1e-8)
    ratio = AIST.features(away)["kinetic"] / AIST.features(dance)["kinetic"]
    assert (ratio[2::3] > 5).all()
    np.testing.assert_allclose(np.delete(ratio, slice(2, None, 3)), 1.0)


def test_bailando_moves_the_start_to_the_origin_so_that_the_bracket_measures_travel():
    dance, away = DANCES["moving body"], DANCES["ten metres away"]
    np.testing.assert_allclose(BAILANDO.features(away)["kinetic"], BAILANDO.features(dance)["kinetic"], rtol=1e-8)
    way = np.linspace(0.0, 1.0, 240)[:, None, None] * TEN_METRES
    spent = BAILANDO.features(replace(frozen(), positions=frozen().positions + way))["kinetic"][2::3]
    # Half of ten metres on average, 3540 times; a steady walk has no acceleration.
    assert spent[0] == pytest.approx(5 * 3540, rel=0.01)


def test_the_two_beat_scores_go_opposite_ways():
    one_rest, many_rests = resting([115]), resting(range(12, 240, 24))
    few_beats, one_beat = beats_at([20, 52, 83, 115, 147, 178, 210]), beats_at([132])
    assert AIST.clip(one_rest, few_beats)["BeatAlign"] == 1.0
    assert BAILANDO.clip(one_rest, few_beats)["BAS"] < 0.2
    assert AIST.clip(many_rests, one_beat)["BeatAlign"] < 0.2
    assert BAILANDO.clip(many_rests, one_beat)["BAS"] > 0.9


def test_a_beat_of_bailando_is_one_frame_earlier():
    rests = resting([115])
    assert AIST.clip(rests, beats_at([115]))["BeatAlign"] == 1.0
    assert BAILANDO.clip(rests, beats_at([114]))["BAS"] == 1.0
    assert BAILANDO.clip(rests, beats_at([115]))["BAS"] == pytest.approx(math.exp(-1 / 18))


def test_no_beat_of_aist_lies_in_the_first_ten_frames():
    assert AIST.clip(resting([10]), beats_at([10])) == {"BeatAlign": 0.0}
    assert AIST.clip(resting([11]), beats_at([11])) == {"BeatAlign": 1.0}


def test_frames_are_counted_and_seconds_are_not():
    # A rest 0.1 s from its beat: two sigma at 60 frames per second, one at 30.
    fast, slow = resting([120]), resting([60], fps=30.0)
    assert AIST.clip(fast, beats_at([126]))["BeatAlign"] == pytest.approx(math.exp(-2))
    assert AIST.clip(slow, beats_at([63], fps=30.0))["BeatAlign"] == pytest.approx(math.exp(-0.5))
    assert beat_align(np.array([2.0]), np.array([2.1])) == pytest.approx(math.exp(-2))
    assert AIST.remarks(fast, {}) == ()
    assert "30 frames per second" in AIST.remarks(slow, {})[0]


def test_features_take_every_frame_for_a_sixtieth_of_a_second():
    slow = moving_body(4.0, fps=30.0)
    fast = Motion(slow.positions, 60.0, SMPL_24)
    np.testing.assert_array_equal(AIST.features(slow)["kinetic"], AIST.features(fast)["kinetic"])
    assert not np.allclose(kinetic_features(slow)[:2], kinetic_features(fast)[:2], rtol=0.5)


def test_foot_speeds_are_metres_a_frame():
    dance = moving_body(6.0, fps=30.0)
    assert EDGE.clip(dance, MUSIC)["PFC"] == pytest.approx(pfc(dance, step=1 / 30) * 1e4 / 30**2)
    twice = moving_body(6.0, fps=60.0)  # the same movement, so half the way a frame for either foot
    assert EDGE.clip(twice, MUSIC)["PFC"] == pytest.approx(EDGE.clip(dance, MUSIC)["PFC"] / 4, rel=0.05)
    assert pfc(twice, step=1 / 30) == pytest.approx(pfc(dance, step=1 / 30), rel=0.05)


def test_one_jump_of_the_root_makes_all_of_a_dance_good():
    dance = moving_body(10.0, fps=30.0)
    positions = dance.positions.copy()
    positions[150, 0, 0] += 3.0
    assert EDGE.clip(replace(dance, positions=positions), MUSIC)["PFC"] < EDGE.clip(dance, MUSIC)["PFC"] / 10


def test_a_feature_in_which_the_reference_agrees_outweighs_all_others(rng: np.random.Generator):
    reference = {"kinetic": rng.normal(size=(80, 72)), "geometric": rng.normal(size=(80, 32))}
    reference["geometric"][:, 31] = 0.25
    features = {name: rows.copy() for name, rows in reference.items()}
    features["geometric"][:, 31] += 0.01
    assert AIST.sets(features, reference)["FID_g"] == pytest.approx((0.01 / 1e-10) ** 2, rel=1e-3)
    assert np.abs(standardise(features["geometric"], reference["geometric"])[:, 31]).max() == pytest.approx(0.01)


def test_distances_of_few_dances_are_not_corrected(rng: np.random.Generator):
    def distance(count: int) -> float:
        sides = [{"kinetic": rng.normal(size=(n, 72)), "geometric": rng.normal(size=(n, 32))} for n in (count, 1000)]
        return AIST.sets(*sides)["FID_k"]

    assert distance(20) > 10 * distance(1000) > 0


# Joints


def test_joints_are_matched_by_name_in_any_order(rng: np.random.Generator):
    dance = DANCES["moving body"]
    order = rng.permutation(24)
    skeleton = skeleton_part(Skeleton(SMPL_NAMES, SMPL_24.parents), order.tolist())
    shuffled = Motion(dance.positions[:, order], 60.0, skeleton)
    for protocol in PROTOCOLS.values():
        assert protocol.clip(shuffled, MUSIC) == pytest.approx(protocol.clip(dance, MUSIC))
        for name, feature in protocol.features(dance).items():
            np.testing.assert_allclose(protocol.features(shuffled)[name], feature, rtol=1e-9)


def test_joints_beyond_those_of_smpl_do_not_count(rng: np.random.Generator):
    dance = walker(3)
    finger = dance.positions[:, 22:23] + rng.normal(0, 1.0, (240, 1, 3))
    longer = Motion(
        np.concatenate([dance.positions, finger], axis=1),
        60.0,
        Skeleton((*SMPL_24.joints, "left_thumb"), (*SMPL_24.parents, 22)),
    )
    for protocol in PROTOCOLS.values():
        assert protocol.clip(longer, MUSIC) == protocol.clip(dance, MUSIC)


def test_a_skeleton_without_the_joints_is_refused_by_their_names():
    body = walker(1)
    no_hands = Motion(body.positions[:, :22], 60.0, skeleton_part(SMPL_24, range(22)))
    for call in (AIST.features, BAILANDO.features):
        refused("none is called lhand, rhand", call, no_hands)
    refused("none is called lhand, rhand", AIST.clip, no_hands, MUSIC)
    assert EDGE.clip(no_hands, MUSIC) == EDGE.clip(body, MUSIC)
    unnamed = Motion(body.positions, 60.0, Skeleton.unnamed(24))
    refused("none is called root, lankle, ltoes, rankle, rtoes", EDGE.clip, unnamed, MUSIC)


def test_key_points_of_aist_have_a_beat_score_and_no_features():
    points = Motion(walker(1).positions[:, :17], 60.0, COCO_17)
    scores = AIST.clip(points, MUSIC)
    assert scores["BeatAlign"] == pytest.approx(loop_beat_align(points, MUSIC), abs=1e-6)
    assert "17 joints of COCO" in AIST.remarks(points, scores)[0]
    for call in (lambda: AIST.features(points), lambda: BAILANDO.clip(points, MUSIC)):
        refused("published code takes SMPL's joints; none is called root, belly", call)


def test_a_picture_is_refused():
    flat = Motion(walker(1).positions[..., :2], 60.0, SMPL_24)
    for call in (
        *(lambda protocol=protocol: protocol.clip(flat, MUSIC) for protocol in PROTOCOLS.values()),
        lambda: AIST.features(flat),
        lambda: BAILANDO.features(flat),
    ):
        refused("three-dimensional motion is needed", call)


def test_filler_frames_are_remarked():
    dance = walker(1)
    spliced = replace(dance, valid=np.arange(240) != 100)
    assert AIST.clip(spliced, MUSIC) == AIST.clip(dance, MUSIC)
    np.testing.assert_array_equal(AIST.features(spliced)["kinetic"], AIST.features(dance)["kinetic"])
    assert "not valid" in AIST.remarks(spliced, {})[0]


# Notes


def test_edge_has_neither_features_nor_distances():
    assert EDGE.features(walker(1)) == {}
    assert EDGE.sets({}, {}) == {}
    assert "issues 11, 27 and 46" in EDGE.missing


def test_versions_of_the_published_features_are_named():
    for protocol in (AIST, BAILANDO):
        assert any(note.startswith("Versions differ") for note in protocol.notes)


def test_a_music_beat_after_the_end_does_not_count_and_a_note_says_so():
    dance = resting([232])  # of 240 frames
    assert AIST.clip(dance, beats_at([115, 235]))["BeatAlign"] == pytest.approx(math.exp(-9 / 18))
    shorter = replace(dance, positions=dance.positions[:234], valid=np.ones(234, bool))
    assert AIST.clip(shorter, beats_at([115, 235]))["BeatAlign"] < 1e-6
    assert any(note.startswith("Music beats after the end of a dance do not count") for note in AIST.notes)


def test_a_protocol_travels_to_another_process():
    assert pickle.loads(pickle.dumps(BAILANDO)).clip(walker(1), MUSIC) == BAILANDO.clip(walker(1), MUSIC)
