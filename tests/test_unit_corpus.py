"""Sequences cut into meter units with the beats before them, and corpora read as sets of units."""

import json
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import soundfile

from harmolab import Audio, Clip, Motion, Recording, load_motion, meter_units, save_motion, write_corpus
from harmolab.body.kinematics import resample_motion
from harmolab.readers.beats import BeatAnnotation, Unit
from harmolab.systems.training.features import FeatureParams, audio_features
from harmolab.systems.training.motion_code import encode_motion
from harmolab.systems.training.network_system import noticed_split
from harmolab.systems.training.splits import split_units
from harmolab.systems.training.units import DanceUnit, cut_recording, grouped_units, load_units, meter_spans
from tests.builders import cases, metronome, refused

PARAMS = FeatureParams(fps=10.0, n_mfcc=4)
# Accents of two 4/4 meters, as in the tests of Eq. 22.
BAR = [3.0, 1.0, 2.0, 1.0]


@pytest.fixture
def danced(swinging_arm: Callable[..., Motion], click_track: Callable[..., Audio]) -> Callable[..., Recording]:
    """`danced()`: an arm that swings at 20 fps from second 2 on; beats every half second are written down.

    The music is silent then, so that all beats are equal and no accents make a meter. Without annotation it clicks.
    """

    def build(*, seconds: float = 12.0, offset: float = 2.0, annotated: bool = True, valid=None, units=()) -> Recording:
        motion = swinging_arm(1.0, 20.0, seconds=seconds)
        if valid is not None:
            motion = replace(motion, valid=valid(np.arange(motion.n_frames) / motion.fps))
        audio = Audio(np.zeros(16 * 22050), 22050.0) if annotated else click_track(120, seconds=16.0)
        annotation = BeatAnnotation(np.arange(0, 16, 0.5), units=units, meter=4)
        clip = Clip("arm", audio, motion, offset, beats=annotation.track(16.0), dance="cha-cha")
        return Recording(clip, annotation if annotated else None, Path("corpus/arm"))

    return build


def recording_units(recording: Recording, params: FeatureParams, *, step: int | None = None) -> list[DanceUnit]:
    """The units of one recording, whose motion groups are found in it alone."""
    cut = cut_recording(recording, params, step=step)
    return list(grouped_units([cut], params, [], [])[0].units) if cut.units else []


# Meter spans


@pytest.mark.parametrize("n_beats", [5, 6, 7, 9, 10, 11, 12, 13, 30, 101])
def test_a_track_is_tiled_by_four_to_six_beats(n_beats: int):
    for seed in range(5):
        spans = meter_spans(metronome(np.random.default_rng(seed).random(n_beats)), PARAMS)
        assert [first for first, _ in spans] == [0, *np.cumsum([count for _, count in spans])[:-1]]
        assert sum(count for _, count in spans) == n_beats - 1
        assert {count for _, count in spans} <= {4, 5, 6}


def test_meter_units_stay_where_they_are():
    # 5 weak beats, two meters, 5 weak beats: 0 + 5 + 4 + 4 + 5.
    music = metronome([5.0, 4.0, 3.0, 2.0, 1.0, *BAR, *BAR, 4.0, 3.0, 2.0, 1.0, 0.5, 0.4])
    assert [unit.start for unit in meter_units(music)][:2] == [2.5, 4.5]
    assert meter_spans(music, PARAMS)[:3] == [(0, 5), (5, 4), (9, 4)]


def test_a_gap_too_short_for_a_meter_joins_a_neighbour():
    # One beat, a meter of four, one more beat: neither gap can stand alone.
    music = metronome([2.0, *BAR, 9.0, 8.0])
    assert [unit.start for unit in meter_units(music)] == [0.5]
    assert meter_spans(music, PARAMS) == [(0, 6)]


@cases("n_beats, spans", (0, []), (1, []), (2, [(0, 1)]), (4, [(0, 3)]), (5, [(0, 4)]), (8, [(0, 7)]))
def test_few_beats_make_one_span_or_none(n_beats: int, spans: list[tuple[int, int]]):
    assert meter_spans(metronome(np.ones(n_beats)), PARAMS) == spans
    assert meter_spans(metronome(np.ones(8)), FeatureParams(unit_beats=7)) == [(0, 4), (4, 3)]  # where units are short


# Units of a sequence


def test_a_unit_is_a_meter_and_the_beats_that_fill_it_up(danced: Callable[..., Recording]):
    units = recording_units(danced(), PARAMS)
    # 25 beats fall into the motion (2.0 to 14.0 s): six meters of four, the first of which has nothing before it.
    assert [unit.name.rpartition(":")[2] for unit in units] == ["0+4+4", "4+4+4", "8+4+4", "12+4+4", "16+4+4"]
    assert [(unit.start, unit.end) for unit in units] == [(2, 6), (4, 8), (6, 10), (8, 12), (10, 14)]
    assert {(unit.n_frames, unit.n_prior) for unit in units} == {(40, 20)}
    np.testing.assert_allclose([unit.beats for unit in units], np.tile(np.arange(8) * 0.5, (5, 1)))
    about = {(unit.dance, unit.sequence, unit.fps, unit.extra) for unit in units}
    assert about == {("cha-cha", "corpus/arm", 10.0, False)}


def test_a_unit_holds_the_motion_code_and_the_music_of_its_time(danced: Callable[..., Recording]):
    sequence = danced(annotated=False)
    unit = recording_units(sequence, PARAMS)[-1]
    motion = resample_motion(sequence.clip.motion, PARAMS.fps)
    first = round((unit.start - 2.0) * 10)
    code = encode_motion(motion.positions, 10.0, motion.skeleton)
    np.testing.assert_array_equal(unit.motion, code[first : first + unit.n_frames])
    heard = audio_features(sequence.clip.audio, sequence.clip.beats, unit.start + np.arange(unit.n_frames) / 10, PARAMS)
    np.testing.assert_allclose(unit.audio, heard, rtol=1e-5, atol=1e-4)


def test_without_annotation_beats_are_tracked(danced: Callable[..., Recording]):
    units = recording_units(danced(annotated=False), PARAMS)
    assert len(units) >= 3
    for unit in units:
        np.testing.assert_allclose(np.diff(unit.beats), 0.5, atol=0.06)
        assert (unit.strengths > 0).all()


def test_beats_between_frames_fall_to_the_frame_before(danced: Callable[..., Recording]):
    # Frames at 2.03, 2.13 ...: the beat at 2.5 is .07 s after its frame, and half a frame of grace admits that at 2.0.
    units = recording_units(danced(offset=2.03), PARAMS)
    assert [round(unit.start, 6) for unit in units[:2]] == [2.03, 3.93]
    np.testing.assert_allclose(units[0].beats[:3], [0.0, 0.47, 0.97])
    np.testing.assert_allclose(units[1].beats[:2], [0.07, 0.57])


@pytest.mark.parametrize(("offset", "seconds"), [(2.0, 12.0), (2.03, 11.9), (0.26, 7.77), (3.01, 12.98)])
def test_units_lie_within_motion_and_music(danced: Callable[..., Recording], offset: float, seconds: float):
    sequence = danced(offset=offset, seconds=seconds)
    units = recording_units(sequence, PARAMS, step=1)
    assert units
    meters = [unit for unit in units if not unit.extra]
    assert [one.meter_start for one in meters[1:]] == pytest.approx([one.end for one in meters[:-1]])
    for unit in units:
        assert offset - 1e-9 <= unit.start < unit.end <= offset + sequence.clip.motion.duration + 1e-9
        assert 0 <= unit.beats.min() <= unit.beats.max() < unit.n_frames / unit.fps
        assert (np.diff(unit.index) <= 0).all()


def test_a_motion_too_short_for_a_unit_has_none(danced: Callable[..., Recording]):
    assert recording_units(danced(seconds=3.9), PARAMS, step=1) == []


def test_additional_units_start_at_every_step_th_beat(danced: Callable[..., Recording]):
    units = recording_units(danced(), PARAMS, step=2)
    extras = [unit for unit in units if unit.extra]
    # Starts 0, 2 ... 16 leave eight beats and the one that ends them; 0, 4 ... 16 are there already.
    assert [unit.name.rpartition(":")[2] for unit in extras] == ["2+4+4", "6+4+4", "10+4+4", "14+4+4"]
    assert [unit.name for unit in units if not unit.extra] == [unit.name for unit in recording_units(danced(), PARAMS)]


def test_units_with_more_than_a_tenth_of_filler_are_left_out(danced: Callable[..., Recording]):
    # A splice of .3 s costs four or five frames of forty.
    spliced = recording_units(danced(valid=lambda time: (time < 3.0) | (time > 3.25)), PARAMS)
    assert [unit.start for unit in spliced] == [2.0, 4.0, 6.0, 8.0, 10.0]
    # One of .6 s from 5.0 to 5.6 s of audio time costs the two units that hold it.
    broken = recording_units(danced(valid=lambda time: (time < 3.0) | (time > 3.6)), PARAMS)
    assert [unit.start for unit in broken] == [6.0, 8.0, 10.0]


def test_beats_far_apart_make_no_unit(danced: Callable[..., Recording]):
    sequence = danced()
    clip = replace(sequence.clip, motion=replace(sequence.clip.motion, fps=0.5), offset=0.0)
    clip = replace(clip, audio=Audio(np.zeros(8000 * 100), 8000.0))
    slow = BeatAnnotation(np.arange(13) * 7.3)  # a unit of eight would take 58 s
    assert recording_units(replace(sequence, clip=clip, annotation=slow), FeatureParams(fps=0.5, n_mfcc=4)) == []


def test_a_unit_names_the_figures_that_it_and_its_meter_touch(danced: Callable[..., Recording]):
    figures = [Unit("a", 2.0, 4.0, 4, "box"), Unit("b", 4.0, 7.0, 6, "turn"), Unit("c", 7.0, 14.0, 14, "walk")]
    units = recording_units(danced(units=tuple(figures)), PARAMS)
    assert [sorted(unit.groups) for unit in units[:3]] == [["box", "turn"], ["turn", "walk"], ["turn", "walk"]]
    assert [sorted(unit.meter_groups) for unit in units[:3]] == [["turn"], ["turn", "walk"], ["walk"]]


def test_what_cannot_be_cut_is_refused(danced: Callable[..., Recording]):
    sequence = danced()
    refused("step must be a positive number of beats, got 0", cut_recording, sequence, PARAMS, step=0)
    flat = replace(sequence.clip.motion, positions=sequence.clip.motion.positions[..., :2])
    in_a_picture = replace(sequence, clip=replace(sequence.clip, motion=flat))
    refused("corpus/arm: needs a motion in three dimensions", cut_recording, in_a_picture, PARAMS)


# Corpora


@pytest.fixture(scope="module")
def synthetic(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Two clips of each of seven dances."""
    return write_corpus(tmp_path_factory.mktemp("data") / "synthetic", clips=14, seconds=12.0)


def test_a_synthetic_corpus_is_a_set_of_units_that_can_be_split(synthetic: Path):
    units = load_units(synthetic, FeatureParams(), step=2)
    counts = (len({unit.sequence for unit in units.units}), len({unit.dance for unit in units.units}))
    assert (*counts, units.source, units.notes) == (14, 7, "synthetic", ())
    assert all(unit.groups and unit.meter_groups <= unit.groups for unit in units.units)
    waltzes = [unit.groups for unit in units.units if unit.dance == "waltz"]
    assert {group.partition(" ")[0] for groups in waltzes for group in groups} == {"waltz"}
    assert units.units[0].motion.shape[1] == 3 * 21 + 3
    assert all(unit.beats.size == 8 for unit in units.units)
    # The thigh, from hip to knee, is a quarter of the stature.
    assert 0.35 < units.bone_lengths[units.skeleton.joints.index("knee L")] < 0.5
    split = split_units(units)
    assert min(len(split.train), len(split.validation), len(split.test)) >= 5
    assert len({unit.dance for unit in split.test.units}) >= 4


def test_overlapping_roots_are_read_once(synthetic: Path, tmp_path: Path):
    clip = sorted(synthetic.glob("clip_*"))[0]
    units = load_units([clip, clip.parent / clip.name, str(clip)], PARAMS)
    assert {unit.sequence for unit in units.units} == {f"synthetic/{clip.name}"}


def test_progress_sees_every_sequence(synthetic: Path):
    seen = []
    clips = sorted(synthetic.glob("clip_*"))[:2]
    load_units(clips, PARAMS, progress=lambda items, label: seen.append((label, [*items])) or seen[0][1])
    ((label, items),) = seen
    assert (label, [item.name for item in items]) == ("reading sequences", ["clip_0001_cha-cha", "clip_0002_jive"])


def copied(synthetic: Path, folder: Path) -> Path:
    """The first synthetic clip as a sequence of another name."""
    return shutil.copytree(synthetic / "clip_0001_cha-cha", folder)


def test_two_recordings_of_one_name_are_refused(synthetic: Path, tmp_path: Path):
    roots = [copied(synthetic, tmp_path / day / "dances" / "one").parent for day in ("monday", "tuesday")]
    refused("tuesday/dances/one: is called dances/one, as .*monday/dances/one is; rename", load_units, roots, PARAMS)


def test_a_sequence_that_cannot_be_read_is_left_out_with_a_note(synthetic: Path, tmp_path: Path):
    copied(synthetic, tmp_path / "good")
    (copied(synthetic, tmp_path / "bad") / "motion.npz").write_bytes(b"no zip")
    (copied(synthetic, tmp_path / "mute") / "audio.wav").unlink()
    units = load_units(tmp_path, PARAMS)
    assert {unit.sequence for unit in units.units} == {f"{tmp_path.name}/good"}
    lines: list[str] = []
    refused("no unit is left for the", noticed_split, units, 0, 2, lines.append)
    assert lines == [f"left out: {line}" for line in units.notes]
    mute, bad = units.notes
    assert f"{tmp_path / 'mute'}: has no audio" in mute and str(tmp_path / "bad" / "motion.npz") in bad


def test_recordings_that_spoil_a_training_are_named_in_a_line_for_each_kind(synthetic: Path, tmp_path: Path):
    silent, still, wild = (copied(synthetic, tmp_path / name) for name in ("silent", "still", "wild"))
    soundfile.write(silent / "audio.wav", np.zeros(13 * 22050), 22050)
    danced = load_motion(still / "motion.npz")
    is_wild = np.arange(danced.n_frames)[:, None, None] == 50
    for folder, positions in ((still, 0 * danced.positions + danced.positions[0]), (wild, danced.positions + is_wild)):
        save_motion(folder / "motion.npz", replace(danced, positions=positions))
    lines: list[str] = []
    refused("no unit is left for the", noticed_split, load_units(tmp_path, PARAMS), 0, 2, lines.append)
    faults = {silent: "silent", still: "without movement", wild: "faster than 10 m/s"}
    assert [line.split(";")[0] for line in lines] == [f"trained on although {faults[at]}: {at}" for at in faults]


def test_where_nothing_can_be_read_the_reason_is_told(synthetic: Path, tmp_path: Path):
    (copied(synthetic, tmp_path / "bad") / "motion.npz").write_bytes(b"no zip")
    refused(r"no unit to train on below .*bad/motion\.npz", load_units, tmp_path, PARAMS)


def test_two_bodies_in_one_set_are_refused(synthetic: Path, tmp_path: Path, swinging_arm: Callable[..., Motion]):
    copied(synthetic, tmp_path / "a")
    save_motion(copied(synthetic, tmp_path / "b") / "motion.npz", swinging_arm(1.0, 60.0, seconds=12.0))
    refused(r"b: has another skeleton \(3 joints\) than .*a \(21 joints\)", load_units, tmp_path, PARAMS)


def test_tangs_fifth_tango_is_left_out_unless_its_beats_were_laid_anew(synthetic: Path, tmp_path: Path):
    annotated = copied(synthetic, tmp_path / "locked" / "DANCE_T_5")
    fast = copied(synthetic, tmp_path / "tang" / "DANCE_T_5")
    (fast / "beats.json").unlink()
    units = load_units([annotated, fast], PARAMS)
    assert {unit.sequence for unit in units.units} == {"locked/DANCE_T_5"}
    assert units.notes == (f"{fast}: left out, its motion is 2.2 times too fast",)


def test_copies_of_a_figure_without_annotation_take_its_group(synthetic: Path, tmp_path: Path):
    """The same dance twice: once called one figure, once nobody having written anything down."""
    copied(synthetic, tmp_path / "named" / "one")
    nameless = copied(synthetic, tmp_path / "nameless" / "one")
    content = json.loads((nameless / "beats.json").read_text())
    content["units"] = []
    (nameless / "beats.json").write_text(json.dumps(content))
    whole = content | {"units": [{"name": "all", "start_s": 0.0, "end_s": 12.0, "beats": 24, "figure": "all"}]}
    (tmp_path / "named" / "one" / "beats.json").write_text(json.dumps(whole))
    units = load_units([tmp_path / "named", tmp_path / "nameless"], PARAMS)
    assert {unit.sequence for unit in units.units} == {"named/one", "nameless/one"}
    assert {group for unit in units.units for group in unit.groups} == {"all"}


def test_recordings_that_overlap_take_one_group(synthetic: Path, tmp_path: Path):
    """A take nobody annotated, two parts of it, of which neither holds the other's middle, and another dance."""
    parts = {"whole": (0.0, 12.0), "late": (3.29, 12.0), "early": (0.0, 8.0)}
    for name, clip in (*((name, "clip_0001_cha-cha") for name in parts), ("other", "clip_0002_jive")):
        folder = shutil.copytree(synthetic / clip, tmp_path / name)
        first, last = parts.get(name, (0.0, 12.0))
        motion = load_motion(folder / "motion.npz").span(first, last - first)
        save_motion(folder / "motion.npz", motion)
        content = json.loads((folder / "beats.json").read_text()) | {"units": [], "motion_offset_s": first}
        (folder / "beats.json").write_text(json.dumps(content))
    for names, count in ((("late", "early"), 1), (("whole", "late", "early", "other"), 2)):
        units = load_units([tmp_path / name for name in names], PARAMS).units
        groups = {unit.sequence.partition("/")[2]: unit.groups for unit in units}
        assert groups.keys() == {*names} and len({*groups.values()}) == count


@pytest.mark.data
def test_beat_locked_recordings_split_fairly(data_root: Path):
    split = split_units(load_units(data_root / "beatlocked", FeatureParams(), step=2))
    assert len(split.test) >= 40
    assert {unit.dance for unit in split.test.units} == {"cha-cha", "rumba", "tango", "waltz"}
    assert len(split.train) >= 400


def test_a_recording_that_gives_no_unit_or_is_of_another_unit_of_length_is_named(tmp_path: Path):
    first, second = sorted(write_corpus(tmp_path, clips=2, seconds=12.0).glob("clip_*"))
    with np.load(second / "motion.npz") as file:
        content = dict(file)
    np.savez(second / "motion.npz", **(content | {name: content[name][:90] for name in ("positions", "valid")}))
    (note,) = load_units(tmp_path, PARAMS).notes
    assert note.startswith(f"{second}: no unit to learn from") and str(first) not in note
    np.savez(second / "motion.npz", **(content | {"positions": 100 * content["positions"]}))
    (note,) = load_units(tmp_path, PARAMS).notes
    assert note.startswith(f"{second}: the body extends over 1") and "other units?" in note
