"""The synthetic music and dance hold what they claim: every number here was planted or is anatomy."""

import itertools
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from threading import Thread
from typing import Any

import librosa
import mir_eval
import numpy as np
import pytest
import scipy.stats
from scipy.ndimage import gaussian_filter1d

from harmolab.data.recordings import find_recordings, load_recording
from harmolab.data.synthetic import DANCER, figure_names, planted_clip, synthetic_clip, synthetic_motion, write_corpus
from harmolab.data.synthetic.beats import ClipSettings, beat_grid, movement_ends
from harmolab.data.synthetic.dancer import ARM_POSES, FEET, FIGURES, HEADING, MANNERS, POSE_SIZE, joint_positions
from harmolab.data.synthetic.music import GROOVES, synthetic_music
from harmolab.params import DANCES
from harmolab.readers.motion import save_motion
from tests.builders import bone_lengths, cases, refused

EVERY_DANCE = pytest.mark.parametrize("dance", list(DANCES))
JOINT = {name: place for place, name in enumerate(DANCER.joints)}


def joint_speeds(motion):
    """(T - 1, J) metres per second."""
    return np.linalg.norm(np.diff(motion.positions, axis=0), axis=-1) * motion.fps


def speed_valleys(motion, *, smoothing=0.02):
    """Seconds at which the smoothed sum of the joint speeds is lowest."""
    speed = gaussian_filter1d(joint_speeds(motion).sum(axis=1), smoothing * motion.fps)
    middle = speed[1:-1]
    return (np.flatnonzero((middle <= speed[:-2]) & (middle < speed[2:])) + 1.5) / motion.fps


def distance_to_nearest(times, others):
    return np.abs(np.asarray(times)[:, None] - np.asarray(others)[None]).min(axis=1)


def raw_ends(**liberties):
    """Grid and movement ends of a long rumba at a fixed tempo."""
    settings = ClipSettings("rumba", seconds=600.0, tempo=120.0, seed=3, **liberties)
    grid = beat_grid(settings)
    return grid, movement_ends(grid, settings)


# Music


@EVERY_DANCE
def test_onset_strength_peaks_at_planted_beats(dance: str):
    music = synthetic_music(dance, seconds=12.0, seed=5)
    envelope = librosa.onset.onset_strength(y=music.audio.samples, sr=22050)
    seconds = librosa.times_like(envelope, sr=22050)
    for beat in music.beats.times[(music.beats.times > 0.1) & (music.beats.times < 11.8)]:
        near = envelope[np.abs(seconds - beat) < 0.06].max()
        assert near > max(4 * np.median(envelope), 0.3 * np.quantile(envelope, 0.99))


@pytest.mark.slow
@EVERY_DANCE
def test_beat_tracker_finds_planted_beats(dance: str):
    low, high = DANCES[dance].tempo
    for seed in (1, 2):
        music = synthetic_music(dance, seconds=30.0, seed=seed)
        with np.errstate(divide="ignore"):  # the prior is zero outside its range
            tempo = {"start_bpm": (low + high) / 2, "prior": scipy.stats.uniform(low, high - low)}
            _, beats = librosa.beat.beat_track(y=music.audio.samples, sr=22050, units="time", trim=False, **tempo)
        assert mir_eval.beat.f_measure(music.beats.times, beats, f_measure_threshold=0.07) >= 0.9


@EVERY_DANCE
def test_tempo_and_bar_are_those_of_the_dance(dance: str):
    for seed in range(20):
        grid = beat_grid(ClipSettings(dance, seconds=20.0, seed=seed))
        low, high = DANCES[dance].tempo
        assert low <= 60 / np.diff(grid.times).mean() <= high
        assert grid.meter == DANCES[dance].meter
        assert set(np.diff(np.flatnonzero(grid.positions == 0))) == {grid.meter}


def test_drift_is_the_relative_rise_of_tempo():
    music = synthetic_music("tango", seconds=10.0, seed=0, tempo=125.0)  # without drift it is kept exactly
    np.testing.assert_allclose(np.diff(music.beats.times), 0.48, atol=1e-9)
    grid = beat_grid(ClipSettings("tango", seconds=100.0, seed=0, tempo=120.0, drift=0.2))
    tempo = np.interp([0.0, 50.0, 100.0], grid.times[1:], 60 / np.diff(grid.times))
    np.testing.assert_allclose(tempo, [108.0, 120.0, 132.0], rtol=0.01)
    assert grid.tempo(100.0) == pytest.approx(120.0, rel=1e-3)


@EVERY_DANCE
def test_downbeat_carries_the_strongest_accent(dance: str):
    music = synthetic_music(dance, seconds=20.0, seed=1)
    down = np.isin(music.beats.times, music.downbeat_times)
    assert music.beats.strengths[down].min() > music.beats.strengths[~down].max()


def test_low_drum_is_louder_on_the_downbeats_of_a_waltz():
    music = synthetic_music("waltz", seconds=30.0, seed=1)
    spectrum = np.abs(librosa.stft(music.audio.samples, n_fft=1024, hop_length=256))
    low = spectrum[librosa.fft_frequencies(sr=22050, n_fft=1024) < 180].sum(axis=0)
    loudness = np.array([low[round(time * 22050 / 256) :][:8].max() for time in music.beats.times[:-1]])
    down = np.isin(music.beats.times[:-1], music.downbeat_times)
    assert loudness[down].mean() > 1.3 * loudness[~down].mean()


def test_music_has_tones_lows_and_highs_does_not_clip_and_rises_from_silence_at_both_cuts():
    samples = synthetic_music("cha-cha", seconds=10.0, seed=2).audio.samples
    assert max(np.abs(samples[:5]).max(), np.abs(samples[-5:]).max()) < 1e-3
    assert np.abs(samples).max() == pytest.approx(0.9)
    assert librosa.feature.spectral_flatness(y=samples).mean() < 0.01  # noise is near 1, a tone near 0
    power = np.abs(np.fft.rfft(samples)) ** 2
    pitch = np.fft.rfftfreq(samples.size, 1 / 22050)
    shares = [power[(pitch >= low) & (pitch < high)].sum() / power.sum() for low, high in ((30, 200), (200, 2000))]
    assert min(shares) > 0.03
    assert power[pitch > 4000].sum() / power.sum() > 1e-5


def test_every_pattern_of_a_groove_fits_its_bar():
    for dance, groove in GROOVES.items():
        for pattern in (groove.bass, groove.chords, *groove.drums.values()):
            assert len(pattern) % DANCES[dance].meter == 0
        assert len(groove.swell) == DANCES[dance].meter


# Movement


@EVERY_DANCE
def test_joint_speed_is_lowest_at_planted_movement_ends(dance: str):
    distances = []
    for seed in range(3):
        planted = planted_clip(ClipSettings(dance, seed=seed))
        times = planted.visual_beat_times
        distances.extend(distance_to_nearest(times[(times > 0.1) & (times < 5.85)], speed_valleys(planted.clip.motion)))
    assert np.mean(np.array(distances) <= 0.025) >= 0.95
    assert np.median(distances) <= 0.015


@EVERY_DANCE
def test_movement_is_fast_between_the_beats_and_slow_on_them(dance: str):
    planted = planted_clip(ClipSettings(dance, fps=120.0, seed=3))
    speed = joint_speeds(planted.clip.motion).sum(axis=1)
    seconds = (np.arange(speed.size) + 0.5) / 120
    ends = planted.visual_beat_times
    between = np.interp((ends[1:] + ends[:-1]) / 2, seconds, speed)
    assert np.median(np.interp(ends, seconds, speed)) < 0.25 * np.median(between)


def test_without_liberties_movements_end_exactly_on_the_music_beats():
    planted = planted_clip(ClipSettings("samba", seed=1))
    np.testing.assert_allclose(planted.visual_beat_times, planted.clip.beats.times, atol=1e-12)


@EVERY_DANCE
def test_bones_keep_their_length(dance: str):
    assert np.ptp(bone_lengths(synthetic_clip(dance, seed=8, jitter=0.05, redundancy=0.2).motion), axis=0).max() < 1e-9


@EVERY_DANCE
def test_feet_stay_on_or_above_the_floor_and_nobody_moves_faster_than_ten_metres_a_second(dance: str):
    for seed in range(2):
        motion = synthetic_clip(dance, seed=seed, jitter=0.03, seconds=12.0).motion
        assert motion.positions[..., 1].min() > -1e-9
        assert joint_speeds(motion).max() < 10
        assert 0.2 < joint_speeds(motion).mean() < 2


def test_standing_foot_does_not_skate():
    speed = joint_speeds(synthetic_clip("rumba", seed=2, seconds=20.0).motion)
    # One foot bears the weight while the other steps, so at any time one ankle is nearly still.
    slower = np.minimum(speed[:, JOINT["ankle L"]], speed[:, JOINT["ankle R"]])
    assert np.quantile(slower, 0.95) < 0.6
    assert np.median(slower) < 0.1


def test_body_has_the_proportions_of_an_adult():
    standing = np.zeros((1, POSE_SIZE))
    standing[0, FEET[0].start], standing[0, FEET[1].start] = 0.09, -0.09
    places = joint_positions(standing, np.zeros((1, 2)), 1.7)[0]
    joints = dict(zip(DANCER.joints, places, strict=True))
    height = {name: place[1] for name, place in joints.items()}
    heights = {"head": (1.50, 1.65), "shoulder": (1.33, 1.45), "hip": (0.83, 0.95), "knee": (0.42, 0.53)}
    for name, (low, high) in (heights | {"ankle": (0.05, 0.10)}).items():
        assert low < height[f"{name} L"] < high, name
    assert height["heel L"] == pytest.approx(0) == height["toe L"]
    bones = {DANCER.joints[end]: np.linalg.norm(places[end] - places[up]) for up, end in DANCER.bones}
    lengths = {"elbow L": (0.27, 0.36), "forearm L": (0.22, 0.29), "knee R": (0.38, 0.46), "ankle R": (0.38, 0.46)}
    for name, (low, high) in lengths.items():
        assert low < bones[name] < high, name
    assert 0.21 < np.linalg.norm(joints["heel R"] - joints["toe R"]) < 0.28
    assert 0.38 < np.linalg.norm(joints["shoulder L"] - joints["shoulder R"]) < 0.48


def test_dancers_differ_in_stature_like_adults():
    lengths = []
    for seed in range(15):
        first = synthetic_clip(seed=seed, seconds=0.5).motion.positions[0]
        lengths.append(np.linalg.norm(first[JOINT["knee L"]] - first[JOINT["hip L"]]) / 0.245)
    assert 1.55 - 1e-9 <= min(lengths) <= max(lengths) <= 1.9 + 1e-9
    assert np.mean(lengths) == pytest.approx(1.7, abs=0.04)


def test_mirrored_pose_gives_the_mirrored_body():
    pose = np.random.default_rng(1).normal(0, 0.2, (1, POSE_SIZE))
    pose[0, HEADING], pose[0, 0] = 0.0, 0.0
    pose[0, 9:14] = np.radians(ARM_POSES["side"])
    pose[0, 14:19] = np.radians(ARM_POSES["chest"])
    for foot, x in ((0, 0.1), (1, -0.12)):
        pose[0, FEET[foot]] = [x, 0.05 * foot, 0.1, 0.2]
    mirrored = pose.copy()
    mirrored[0, [4, 5, 7, 8]] *= -1  # pelvis, twist and lean of the chest, gaze
    mirrored[0, 9:14], mirrored[0, 14:19] = pose[0, 14:19], pose[0, 9:14]
    mirrored[0, FEET[0]], mirrored[0, FEET[1]] = pose[0, FEET[1]], pose[0, FEET[0]]
    for foot in FEET:
        mirrored[0, foot] *= [-1, 1, -1, 1]
    body, image = (joint_positions(each, np.zeros((1, 2)), 1.7)[0] for each in (pose, mirrored))
    alike = ("shoulder", "elbow", "hip", "knee", "ankle", "heel", "toe", "head")
    for left, right in (("forearm", "wrist"), *zip(alike, alike, strict=True)):
        np.testing.assert_allclose(image[JOINT[f"{right} R"]], body[JOINT[f"{left} L"]] * [-1, 1, 1], atol=1e-12)


def test_knees_bend_forward_and_left_is_left():
    for seed in range(2):
        joints = dict(zip(DANCER.joints, np.moveaxis(synthetic_clip(seed=seed).motion.positions, 1, 0), strict=True))
        left = joints["hip L"] - joints["hip R"]
        front = np.cross(left, [0.0, 1.0, 0.0])
        front /= np.linalg.norm(front, axis=-1, keepdims=True)
        for side in "LR":
            toes = joints[f"toe {side}"] - joints[f"heel {side}"]
            assert np.mean((toes * front).sum(-1) > 0) > 0.98
            middle = (joints[f"hip {side}"] + joints[f"ankle {side}"]) / 2
            assert ((joints[f"knee {side}"] - middle) * (front + toes)).sum(-1).min() > -1e-3
        shoulders = joints["shoulder L"] - joints["shoulder R"]
        assert (shoulders * left).sum(-1).min() > 0


def test_dancer_travels_and_turns_but_stays_on_the_stage():
    motion = synthetic_clip("waltz", seed=1, seconds=60.0, fps=30.0).motion
    assert 1.0 < np.hypot(*motion.positions[:, JOINT["torso"]][:, [0, 2]].T).max() < 6.0
    across = motion.positions[:, JOINT["hip L"]] - motion.positions[:, JOINT["hip R"]]
    assert np.ptp(np.unwrap(np.arctan2(-across[:, 2], across[:, 0]))) > np.pi


@EVERY_DANCE
def test_vocabulary_has_eight_figures_of_two_bars(dance: str):
    assert len(figure_names(dance)) >= 8
    for steps in FIGURES[dance].values():
        assert len(steps.split()) == 2 * DANCES[dance].meter
        assert all(step[0] in "fbocxkt-" and set(step[1:]) <= {"<", ">"} for step in steps.split())
    assert len(MANNERS[dance].rise) == len(MANNERS[dance].heels) == DANCES[dance].meter


# Time: frame rates, seeds


@pytest.mark.parametrize("fps", [15.0, 20.0, 30.0, 120.0])
def test_another_frame_rate_is_the_same_dance(fps: float):
    liberties = {"jitter": 0.03, "redundancy": 0.2, "omission": 0.1}
    reference, other = (synthetic_clip("jive", fps=rate, seed=6, **liberties).motion.positions for rate in (60.0, fps))
    np.testing.assert_allclose(other[:: max(1, round(fps / 60))], reference[:: max(1, round(60 / fps))], atol=1e-12)


def test_same_seed_is_the_same_clip_and_another_seed_is_not():
    one, again, other = (synthetic_clip("tango", seed=seed, noise=0.01) for seed in (4, 4, 5))
    np.testing.assert_array_equal(one.motion.positions, again.motion.positions)
    np.testing.assert_array_equal(one.audio.samples, again.audio.samples)
    assert not np.array_equal(one.audio.samples, other.audio.samples)
    assert np.abs(one.motion.positions - other.motion.positions).max() > 0.1


def test_clips_start_anywhere_in_the_bar():
    firsts = [beat_grid(ClipSettings("tango", seconds=6.0, seed=seed, tempo=120.0)) for seed in range(200)]
    phases = [grid.times[(grid.positions == 0) & (grid.times >= 0)][0] for grid in firsts]
    assert scipy.stats.kstest(phases, "uniform", args=(0, 2.0)).pvalue > 0.01  # a bar lasts two seconds


def test_motion_follows_beats_that_are_given():
    beats = np.array([0.3, 0.9, 1.4, 2.1, 2.6, 3.1])
    motion = synthetic_motion(beats, [0.9], seconds=4.0, fps=60.0, seed=2, dance="rumba")
    assert distance_to_nearest(beats, speed_valleys(motion)).max() <= 0.03


# The dancer's liberties and the sensor


def test_lateness_shifts_every_movement_end_and_jitter_is_their_standard_deviation():
    grid, ends = raw_ends(lateness=0.12, jitter=0.05)
    errors = ends.times - grid.times
    assert errors.std() == pytest.approx(0.05, rel=0.08)
    assert errors.mean() == pytest.approx(0.12, abs=0.01)


def test_omission_and_redundancy_are_the_shares_of_beats_without_an_end_and_of_intervals_with_an_extra_one():
    grid, ends = raw_ends(omission=0.3, redundancy=0.25)
    extra, kept = ends.times[ends.beats < 0], ends.times[ends.beats >= 0]
    assert 1 - kept.size / grid.times.size == pytest.approx(0.3, abs=0.05)
    assert distance_to_nearest(kept, grid.times).max() < 1e-12
    assert extra.size / grid.times.size == pytest.approx(0.25, abs=0.05)
    assert distance_to_nearest(extra, grid.times).min() > 0.15  # half a second from beat to beat


def test_liberties_do_not_disturb_each_other():
    _, jittered = raw_ends(jitter=0.05)
    _, both = raw_ends(jitter=0.05, omission=0.3, redundancy=0.2)
    assert np.isin(both.times[both.beats >= 0], jittered.times).all()


def test_omitted_beats_and_extra_ends_are_seen_in_the_joint_speed():
    plain, fewer, more = (
        planted_clip(ClipSettings("rumba", seconds=60.0, seed=2, tempo=90.0, omission=omission, redundancy=redundancy))
        for omission, redundancy in ((0.0, 0.0), (0.5, 0.0), (0.0, 0.5))
    )
    counts = [len(speed_valleys(planted.clip.motion)) for planted in (plain, fewer, more)]
    assert counts[0] == pytest.approx(90, abs=6)
    assert counts[1] == pytest.approx(len(fewer.visual_beat_times), rel=0.25)
    assert counts[2] == pytest.approx(len(more.visual_beat_times), rel=0.1)


def test_dancer_who_omits_every_beat_hardly_moves():
    assert joint_speeds(synthetic_clip(seed=1, omission=1.0).motion).max() < 0.2


def test_noise_has_the_standard_deviation_asked_for_on_every_joint_and_axis():
    clean, noisy = (synthetic_clip(seed=1, seconds=20.0, noise=noise).motion.positions for noise in (0.0, 0.01))
    difference = noisy - clean
    np.testing.assert_allclose(difference.std(axis=0), 0.01, rtol=0.12)
    assert abs(np.corrcoef(difference[:-1].ravel(), difference[1:].ravel())[0, 1]) < 0.02


@cases(
    "settings, message",
    ({"dance": "polka"}, "unknown dance 'polka'; the seven are cha-cha, jive, quickstep, rumba, samba, tango, waltz"),
    ({"fps": 0.0}, "fps must be positive"),
    ({"fps": float("nan")}, "fps must be positive"),
    ({"seconds": -1.0}, "seconds must be positive"),
    ({"seconds": 0.01}, "less than two frames"),
    ({"omission": 1.5}, "omission is a share"),
    ({"redundancy": -0.1}, "redundancy is a share"),
    ({"jitter": -0.1}, "jitter must be within"),
    ({"lateness": 60.0}, "lateness must be within"),
    ({"noise": -0.01}, "noise is in metres"),
    ({"tempo": 0.0}, "tempo must be within"),
    ({"drift": 3.0}, "drift is a share"),
    ({"sample_rate": 100}, "sample_rate must be"),
    ({"seed": -1}, "seed must be a whole number"),
    ({"figures": ("waltz box",)}, "figures must name some of cha-cha basic"),
    ({"figures": ()}, "figures must name some of cha-cha basic"),
)
def test_setting_out_of_range_is_refused_by_name(settings: dict, message: str):
    refused(message, synthetic_clip, **settings)


def test_settings_that_the_beats_or_a_corpus_decide_are_refused(tmp_path: Path):
    for name in ("tempo", "drift", "sample_rate"):
        message = f"{name} is no setting of a motion to given beats"
        refused(message, synthetic_motion, [1.0, 2.0], seconds=3.0, **{name: 100})
    for name in ("dance", "figures"):
        refused(f"{name} is no setting of a corpus", write_corpus, tmp_path / "out", **{name: "waltz"})


@pytest.mark.parametrize("beats", [[1.0], [1.0, 0.5], [1.0, float("nan")], [[1.0, 2.0]]])
def test_motion_needs_increasing_beats(beats: list):
    refused("increasing times in seconds", synthetic_motion, beats, seconds=3.0, fps=30.0, seed=0)


# The corpus on disk


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Fourteen short clips."""
    return write_corpus(tmp_path_factory.mktemp("corpus") / "out", clips=14, seconds=3.0, fps=30.0, jitter=0.02, seed=5)


def test_corpus_is_read_by_the_ordinary_loaders_and_holds_the_truth(corpus: Path):
    recordings = find_recordings(corpus)
    names = [f"clip_{number:04d}_{dance}" for number, dance in enumerate([*DANCES, *DANCES], start=1)]
    assert [folder.name for folder in recordings.folders] == names  # dances take turns
    assert not recordings.problems
    first = load_recording(recordings.folders[0])
    recorded = json.loads((recordings.folders[0] / "beats.json").read_text())["settings"]
    del recorded["generator"]
    planted = planted_clip(ClipSettings(**{**recorded, "figures": tuple(recorded["figures"])}))
    np.testing.assert_allclose(first.clip.motion.positions, planted.clip.motion.positions, atol=1e-6)
    np.testing.assert_allclose(first.clip.audio.samples, planted.clip.audio.samples, atol=1e-4)
    np.testing.assert_allclose(first.annotation.times, planted.clip.beats.times, atol=1e-6)
    assert (first.clip.dance, first.annotation.source) == ("cha-cha", "synthetic")


def test_annotation_records_every_control_and_the_planted_movement_ends(corpus: Path):
    content = json.loads((corpus / "clip_0007_waltz" / "beats.json").read_text())
    assert (content["settings"]["jitter"], content["settings"]["seed"]) == (0.02, content["seed"])
    assert (content["meter"], content["dance"], content["motion_offset_s"]) == (3, "waltz", 0.0)
    assert set(content["downbeats_s"]) <= set(content["beats_s"])
    assert 0 < np.max(distance_to_nearest(content["visual_beats_s"][1:-1], content["beats_s"])) < 0.1
    assert [unit["figure"] in figure_names("waltz") for unit in content["units"]] == [True] * len(content["units"])
    for dance in DANCES:
        contents = [json.loads((one / "beats.json").read_text()) for one in corpus.glob(f"clip_*_{dance}")]
        first, second = (set(content["settings"]["figures"]) for content in contents)
        assert not first & second, "the next clip of a dance shares no figure"


def test_stopped_run_goes_on_where_it_was(tmp_path: Path):
    def stop_after_three(clips: Iterable[object], _: str) -> Iterator[object]:
        yield from itertools.islice(clips, 3)
        raise KeyboardInterrupt

    out = tmp_path / "out"
    with pytest.raises(KeyboardInterrupt):
        write_corpus(out, clips=5, seconds=1.0, progress=stop_after_three)
    (out / ".writing_clip_0004_rumba_x").mkdir()  # what a killed run leaves
    (out / "clip_0002_jive" / "motion.npz").unlink()  # a folder that is not whole
    before = {name: (out / name / "audio.wav").stat().st_mtime_ns for name in ("clip_0001_cha-cha", "clip_0002_jive")}
    labels: list[tuple[str, int]] = []

    def watch(clips: Iterable[object], label: str) -> Iterable[object]:
        labels.append((label, len(list(clips))))
        return clips

    write_corpus(out, clips=5, seconds=1.0, progress=watch)
    after = {name: (out / name / "audio.wav").stat().st_mtime_ns for name in before}
    assert [name for name in after if after[name] != before[name]] == ["clip_0002_jive"]
    assert labels == [("making clips", 5)]
    assert [path.name for path in out.iterdir() if path.name.startswith(".")] == []


def test_of_two_that_write_one_corpus_the_second_waits_and_none_loses_a_clip(tmp_path: Path, monkeypatch):
    second = Thread(target=write_corpus, args=(tmp_path,), kwargs={"clips": 2, "seconds": 1.0})

    def save(path: Path, *args: Any, **options: Any) -> None:
        if second.ident is None:  # the first is in the middle of a clip
            second.start()
            second.join(0.5)
        save_motion(path, *args, **options)

    monkeypatch.setattr("harmolab.data.synthetic.clips.save_motion", save)
    write_corpus(tmp_path, clips=2, seconds=1.0)
    second.join()
    assert [len(list(folder.iterdir())) for folder in find_recordings(tmp_path).folders] == [3, 3]


def test_other_settings_rewrite_the_clips(tmp_path: Path):
    write_corpus(tmp_path, clips=2, seconds=1.0, fps=30.0)
    write_corpus(tmp_path, clips=2, seconds=1.0, fps=60.0)
    assert load_recording(tmp_path / "clip_0002_jive").clip.motion.fps == 60


def test_same_corpus_twice_is_equal_to_the_byte(tmp_path: Path):
    one, two = (write_corpus(tmp_path / name, clips=2, seconds=1.0) for name in ("one", "two"))
    for part in ("corpus.json", "clip_0001_cha-cha/audio.wav", "clip_0001_cha-cha/beats.json"):
        assert (one / part).read_bytes() == (two / part).read_bytes()


def test_foreign_folders_files_and_a_larger_corpus_are_left_alone(tmp_path: Path):
    write_corpus(tmp_path, clips=2, seconds=1.0)
    refused("clip_0002_jive, which is not among the clips asked for", write_corpus, tmp_path, clips=1, seconds=1.0)
    (tmp_path / "clip_0001_cha-cha" / "notes.txt").write_text("mine")
    refused(r"holds notes\.txt", write_corpus, tmp_path, clips=2, seconds=2.0)
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    refused(r"holds thesis\.txt, which no synthetic corpus wrote", write_corpus, tmp_path / "mine", clips=1)
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.txt"]


def test_bad_setting_makes_no_folder(tmp_path: Path):
    refused("omission is a share", write_corpus, tmp_path / "out", clips=1, omission=2.0)
    refused("clips must be a whole number", write_corpus, tmp_path / "out", clips=0)
    assert not (tmp_path / "out").exists()
