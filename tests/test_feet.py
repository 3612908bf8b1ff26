"""Feet: the foot model and its trials; a foot put elsewhere, the knee follows, no bone changes."""

import itertools
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
import torch

from harmolab.body.skeletons import Skeleton, foot_joints
from harmolab.data.synthetic import write_corpus
from harmolab.metrics.quality import foot_skating
from harmolab.systems.music2dance import feet as foot_parts
from harmolab.systems.music2dance.codes import POINTS, MotionCode, PositionCode, RotationCode
from harmolab.systems.music2dance.generate import Danced
from harmolab.systems.music2dance.params import Music2DanceParams, SongParams
from harmolab.systems.music2dance.sequences import SequenceSet, Windows, load_sequences
from harmolab.systems.training.about import read_about
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.feet import Leg, find_leg, grounded, moved_feet, planted_feet, standing_dancer
from harmolab.systems.training.motion_code import bone_lengths, encode_motion
from harmolab.systems.training.splits import Split, split_units
from harmolab.systems.training.weights import load_weights
from harmolab.types import Clip, FloatArray, Motion
from study.cells import notebook_cells
from study.experiments.contests import Contest
from study.experiments.sliding import SlidWindows, slid_windows
from study.profile import RunProfile
from tests.builders import cases, planted_dance
from tests.test_music2dance_dancing import foot_model, sound, system

CELLS = notebook_cells("17_feet")
BOTH, CONVOLUTION, LSTM, UNTOUCHED = CELLS.BOTH, CELLS.CONVOLUTION, CELLS.LSTM, CELLS.UNTOUCHED
LEARNT, LOWER, SLIDING = CELLS.LEARNT, CELLS.LOWER, CELLS.SLIDING
ERROR, RECORDED = "MSE", "recorded"

FPS = 25.0
TINY = replace(Music2DanceParams.recommended(), window=2.0, clusters=3, song=SongParams(window=2.0, hop=1.0))
QUICK = foot_parts.FootParams(channels=16, epochs=12, batch_size=8)


@pytest.fixture(scope="module")
def danced() -> Motion:
    return planted_dance("rumba", fps=FPS, seed=4).motion


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    root = tmp_path_factory.mktemp("feet") / "dances"
    write_corpus(root, clips=14, seconds=12.0, seed=1)
    return root


@pytest.fixture(scope="module")
def split(sequences: SequenceSet) -> Split:
    return split_units(sequences.units)


@pytest.fixture(scope="module", params=["positions", "rotations"])
def sequences(corpus: Path, request: pytest.FixtureRequest) -> SequenceSet:
    return load_sequences([corpus], replace(TINY, representation=request.param))


def untrained(code: MotionCode, values: FloatArray, params: foot_parts.FootParams = QUICK) -> foot_parts.FootModel:
    """A model that knows the scale of its channels from values (T, C)."""
    model = foot_parts.FootModel(params, code).eval()
    spread = torch.from_numpy(values.std(axis=0)).float().clamp(min=1e-3)
    model.motion_scale.set(torch.from_numpy(values.mean(axis=0)).float(), spread)
    return model


def of_motion(model: foot_parts.FootModel, values: FloatArray, contacts: FloatArray | None = None) -> Windows:
    """A window of motion (T, C), without music."""
    motion = model.motion_scale(torch.from_numpy(values).float())[None]
    stands = torch.ones(1, len(values), 2) if contacts is None else torch.from_numpy(contacts).float()[None]
    nothing = torch.zeros(1)
    return Windows(motion, stands, nothing, nothing, nothing, torch.ones(1, len(values)))


def points(frames: int) -> FloatArray:
    """The twenty points on a line, standing still: (T, 20, 3)."""
    place = np.arange(len(POINTS.joints))[:, None] * np.array([0.1, 0.05, 0.0])
    return np.repeat(place[None], frames, axis=0)


def joint(name: str) -> int:
    return POINTS.joints.index(name)


# Measures


def slide(positions: FloatArray, contacts: FloatArray, counted: FloatArray | None = None) -> float:
    rest = np.ones(len(positions), bool) if counted is None else counted
    return CELLS.standing_slide(positions[None], contacts[None] > 0.5, rest[None], FPS, POINTS)


def test_a_foot_slides_as_fast_as_its_slowest_point_while_it_stands():
    positions, stands = points(11), np.tile([1.0, 0.0], (11, 1))
    positions[:, [joint("toe L"), joint("ankle L")], 0] += 0.02 * np.arange(11)[:, None]
    assert slide(positions, stands) == 0.0  # it turns on its heel
    positions[:, joint("heel L"), 2] += 0.01 * np.arange(11)
    assert slide(positions, stands) == pytest.approx(0.25)
    positions[:, [joint(f"{part} R") for part in ("toe", "heel", "ankle")], 0] += np.arange(11)[:, None]
    assert slide(positions, stands) == pytest.approx(0.25)  # the other foot is in the air


def test_steps_count_where_a_foot_stands_at_both_ends_and_the_frames_do():
    positions, stands = points(7), np.tile([1.0, 0.0], (7, 1))
    positions[3:, :, 0] += 0.04  # one step of 1 m/s
    assert slide(positions, stands) == pytest.approx(1 / 6)
    stands[3] = 0.0
    assert slide(positions, stands) == 0.0
    stands[3, 0] = 1.0
    assert slide(positions, stands, np.arange(7) != 2) == 0.0
    assert np.isnan(slide(positions, 0 * stands))


def test_distance_of_the_lower_body_is_seen_from_the_root_and_leaves_the_arms_out(danced: Motion):
    moved = danced.positions + np.array([1.0, 0.0, -2.0])
    names = danced.skeleton.joints
    moved[:, names.index("knee L")] += [0.0, 0.05, 0.0]
    moved[:, names.index("hand L")] += [0.0, 0.3, 0.0]
    away = CELLS.lower_body_distance(danced.positions, moved, FPS, danced.skeleton)
    np.testing.assert_allclose(away, 0.05 / 10, atol=1e-6)  # one of ten joints


def slid(code: MotionCode, values: FloatArray, model: foot_parts.FootModel) -> SlidWindows:
    """One window, of which the first half counts, and nothing slides."""
    rotations = isinstance(code, RotationCode)
    channels = model.lower[4:] if rotations else model.lower
    units = np.ones(len(channels)) if rotations else model.motion_scale.std[channels].double().numpy()
    stands = np.ones((1, len(values), 2))
    counted = np.arange(len(values))[None] < len(values) // 2
    return SlidWindows(code, FPS, values[None], values[None], stands > 0, stands, counted, channels, units)


@pytest.mark.parametrize("make", [PositionCode.of, RotationCode.of])
def test_the_error_is_of_the_lower_body_and_of_frames_that_count(danced: Motion, make: Callable[..., Any]):
    code = make([danced])
    values = code.encode(danced)
    windows = slid(code, values, untrained(code, values))
    changed = windows.recorded.copy()
    changed[:, 80:] += 5.0
    changed[..., sorted({*range(code.n_motion)} - {*windows.channels})] += 5.0
    assert windows.squared_error(changed) == 0.0
    changed[0, :, windows.channels[7]] += 0.1 * windows.units[7]
    assert windows.squared_error(changed) == pytest.approx(0.01 / len(windows.channels))


# Simulated sliding


def test_smoothing_keeps_what_is_constant_and_spreads_a_stroke_as_wide_as_it_says():
    values = torch.zeros(2, 81, 1)
    values[:, 40] = 1.0
    values[..., 0] += 3.0
    out = foot_parts.smoothed(values, torch.tensor([[1.0], [4.0]]))[..., 0] - 3.0
    frames = torch.arange(81.0) - 40
    torch.testing.assert_close((out * frames.square()).sum(dim=1).sqrt(), torch.tensor([1.0, 4.0]), atol=0.02, rtol=0)
    torch.testing.assert_close(out.sum(dim=1), torch.ones(2), atol=1e-4, rtol=0)


def test_one_seed_draws_one_sliding_and_a_tenth_of_the_contacts_are_wrong(danced: Motion):
    code = PositionCode.of([danced])
    values = np.tile(code.encode(danced), (8, 1))
    model = untrained(code, values)
    windows = of_motion(model, values)
    one, same, other = (foot_parts.simulated_sliding(model, windows, FPS, seed) for seed in (3, 3, 4))
    assert torch.equal(one[0], same[0]) and torch.equal(one[1], same[1]) and not torch.equal(one[0], other[0])
    assert float(one[1].mean()) == pytest.approx(0.9, abs=0.03)
    rest = sorted({*range(code.n_motion)} - {*model.lower})
    assert torch.equal(one[0][..., rest], windows.motion[..., rest])
    assert not torch.equal(one[0][..., model.lower], windows.motion[..., model.lower])


def test_feet_of_slid_rotations_are_where_the_rotations_put_them(danced: Motion):
    code = RotationCode.of([danced])
    values = code.encode(danced)
    model = untrained(code, values)
    motion, _ = foot_parts.simulated_sliding(model, of_motion(model, values), FPS, 1)
    out = (motion[0] * model.motion_scale.std + model.motion_scale.mean).double().numpy()
    np.testing.assert_allclose(out, code.refreshed(out, FPS), atol=1e-4)
    assert np.abs(out - code.refreshed(values, FPS))[:, model.feet].max() > 0.005


# The model


@pytest.mark.parametrize("kind", ["convolution", "lstm"])
@pytest.mark.parametrize("make", [PositionCode.of, RotationCode.of])
def test_a_model_begins_with_no_correction(danced: Motion, make: Callable[..., Any], kind: str):
    code = make([danced])
    values = code.encode(danced)
    model = untrained(code, values, replace(QUICK, kind=kind))
    np.testing.assert_allclose(model.correct(values, np.ones((len(values), 2))), values, atol=1e-4)


def test_a_foot_that_rolls_over_its_toe_costs_nothing_and_one_that_slides_its_speed(danced: Motion):
    code = PositionCode.of([danced])
    names = danced.skeleton.joints
    still = np.repeat(danced.positions[:1], 50, axis=0)
    rolling = still.copy()
    rolling[:, [names.index("heel L"), names.index("ankle L")], 2] += 0.002 * np.arange(50)[:, None]
    gliding = still + 0.008 * np.arange(50)[:, None, None] * np.array([0.0, 0.0, 1.0])
    model = untrained(code, code.encode(danced))

    def cost(positions: FloatArray) -> float:
        windows = of_motion(model, encode_motion(positions, FPS, danced.skeleton).astype(np.float64))
        return float(foot_parts.standing_speed(model, windows.motion, windows, FPS))

    assert [cost(still), cost(rolling)] == pytest.approx([0.0, 0.0], abs=1e-6)
    assert cost(gliding) == pytest.approx(0.2**2, rel=1e-3)


@pytest.mark.slow
def test_it_learns_what_slides(split: Split, sequences: SequenceSet, tmp_path: Path):
    foot_parts.train_feet(split, sequences, TrainOptions(tmp_path / "run"), QUICK)
    model = load_weights(tmp_path / "run", foot_parts.FootModel)
    learnt = slid_windows(split, sequences, side="train", most=16)
    assert learnt.squared_error(learnt.corrected(model)) < 0.97 * learnt.squared_error(learnt.slid)
    epochs = len((tmp_path / "run" / "history.csv").read_text().splitlines()) - 1
    updates = read_about(tmp_path / "run")["meta"]["updates"]
    assert epochs == QUICK.epochs and updates % epochs == 0 and updates >= epochs


@pytest.mark.slow
def test_held_out_windows_are_of_one_draw_and_count_frames_of_their_side_alone(split: Split, sequences: SequenceSet):
    sides = {side: slid_windows(split, sequences, side=side, most=8) for side in ("train", "validation", "test")}
    again = slid_windows(split, sequences, most=8)
    np.testing.assert_array_equal(again.slid, sides["test"].slid)
    np.testing.assert_array_equal(again.signals, sides["test"].signals)
    assert sides["test"].counted.any() and not sides["test"].counted.all()
    for windows in sides.values():
        row = CELLS.measured(windows, windows.recorded)
        assert row[ERROR] == 0.0 and row[LOWER] == 0.0
        assert CELLS.measured(windows, windows.slid)[SLIDING] > row[SLIDING]
    planted = CELLS.measured_planted(sides["test"], sides["test"].slid)
    assert planted[SLIDING] < CELLS.measured(sides["test"], sides["test"].slid)[SLIDING] and np.isnan(planted[ERROR])


# Table 2


def trial(feet: str, seed: int, error: float, sliding: float, code: str = "rotations") -> dict[str, Any]:
    about = {"corpus": "made up", "code": code, "feet": feet, "seed": seed, "parameters": 5 * bool(seed)}
    measures = {ERROR: error, LEARNT: error / 2, LOWER: 1.0, SLIDING: sliding}
    return {**about, "updates": 800 * bool(seed), **measures}


def test_the_table_has_means_over_trainings_beside_no_correction_and_the_recorded():
    rows = [trial(RECORDED, 0, 0.0, 5.0), trial(UNTOUCHED, 0, 0.02, 14.0)]
    rows += [trial(CONVOLUTION, seed, error, 18.0) for seed, error in ((1, 0.010), (2, 0.014), (3, 0.012))]
    rows += [trial(LSTM, 1, 0.03, 17.0), trial(BOTH, 1, np.nan, 9.0)]
    rows += [trial(each["feet"], each["seed"], 1.0, 1.0, "positions") for each in rows]
    table = CELLS.foot_table(pd.DataFrame(rows)).set_index(["code", "feet"])
    row = table.loc["rotations", CONVOLUTION]
    assert row[ERROR] == pytest.approx(0.012) and row["trainings"] == 3 and row["updates"] == 800
    # Student's t of two degrees of freedom, standard deviation .002
    assert row[f"{ERROR}, high"] - row[ERROR] == pytest.approx(4.3027 * 0.002 / np.sqrt(3), rel=1e-4)
    assert row["sliding before"] == 14.0 and row["sliding recorded"] == 5.0
    assert (row["unit of MSE"], table.loc["positions", CONVOLUTION]["unit of MSE"]) == ("rad²", "SD²")
    assert table.loc["rotations", UNTOUCHED]["trainings"] == 0 and table.loc["rotations", UNTOUCHED]["loss"] == ""
    assert table.loc["rotations", BOTH]["loss"] == row["loss"] == "MSE + 0.1 smooth"


def test_the_papers_numbers_stand_in_a_column_of_their_own_and_beside_rotations_alone():
    pairs = itertools.product((RECORDED, UNTOUCHED, CONVOLUTION, LSTM), ("rotations", "positions"))
    table = CELLS.foot_table(pd.DataFrame([trial(feet, 1, 0.5, 1.0, code) for feet, code in pairs]))
    printed = table.dropna(subset="MSE, paper (other data)").set_index(["code", "feet"])["MSE, paper (other data)"]
    assert printed.to_dict() == {("rotations", CONVOLUTION): 0.0010, ("rotations", LSTM): 0.0028}
    assert (table[ERROR] == 0.5).all()


# Dances


@pytest.fixture
def planted(danced: Motion) -> SimpleNamespace:
    """Cells with dancers that were never trained, a foot model without increments, and one dancer who was recorded."""
    clip = Clip("recorded", sound(), danced, dance="cha-cha")
    columns = ("val_contacts", "val_contacts_as_before", "val_contacts_majority")
    history = pd.DataFrame([(0.5, 0.9, 0.6), (0.8, 0.93, 0.63), (np.nan,) * 3], columns=columns)

    def run(*about: Any) -> Any:
        settings = next((each for each in about if isinstance(each, Music2DanceParams)), Music2DanceParams.paper())
        return SimpleNamespace(system=system(settings.representation), history=history)

    return notebook_cells(
        "17_feet", trained_dancer=run, ablated_dancers=lambda contest, name: [run(), run()], FROM=1.0,
        recorded_dancers=lambda contest: {"cha-cha": [clip]}, foot_model=lambda *about: (foot_model(about[2]), 0),
    )  # fmt: skip


CONTEST = Contest(RunProfile.quick(), "made up", "planted", (), (), 1)


@pytest.mark.slow
def test_dances_are_treated_in_three_ways_beside_the_recorded(planted: SimpleNamespace):
    table = planted.feet_of_dances(CONTEST).set_index(["dancer", "feet"])
    assert [*table.index.get_level_values("dancer").unique()] == ["recommended", "paper, calm", "paper"]
    for _, rows in table.groupby("dancer"):
        ways = rows.droplevel("dancer")
        assert [*ways.index] == ["recorded", "none", "model", "planted"] and [*ways["n"]] == [1, 2, 2, 2]
        # The foot model adds nothing, so nothing changes.
        same = [name for name in ways.columns if "moved" not in name]
        np.testing.assert_allclose(ways.loc["model", same], ways.loc["none", same], rtol=1e-4)
        assert ways.loc["none", "lower body moved (cm)"] == 0.0 == ways.loc["recorded", "lower body moved (cm)"]
        assert ways.loc["model", "lower body moved (cm)"] < 1e-3 < ways.loc["planted", "lower body moved (cm)"]


def test_contacts_stand_beside_the_frame_before_and_the_majority(planted: SimpleNamespace):
    table = planted.contact_table(CONTEST).set_index("dancer")
    assert table["predicted"].to_dict() == {"paper": 0.8, "recommended": 0.8}
    assert (table["as in the frame before"] == 0.93).all() and (table["majority"] == 0.63).all()
    assert (table["frames per second"] == 25.0).all()
    assert table["weight"].to_dict() == {"paper": 0.1, "recommended": 2.0}


def test_heights_are_those_of_the_toes_as_the_network_gives_them(danced: Motion):
    dancer = system("positions")
    values = dancer.coded(danced)[:, :-2]
    names = danced.skeleton.joints
    rising = values.copy()
    rising[:, 3 * names.index("toe L") + 1] = values[0, 3 * names.index("heel L") + 1]
    heights = [CELLS.bare_toes(dancer, Danced(each, np.ones((len(values), 2)))) for each in (values, rising)]
    np.testing.assert_allclose(heights[0][:, 1], 100 * danced.positions[:, names.index("toe R"), 1], atol=2)
    np.testing.assert_array_equal(heights[0][:, 1], heights[1][:, 1])
    assert np.abs(heights[0][:, 0] - heights[1][:, 0]).max() > 1


def test_curves_are_as_long_as_they_are_shown_and_of_the_same_moments(planted: SimpleNamespace):
    curves = planted.toe_curves(CONTEST, "cha-cha")
    danced = curves[curves["dancer"] != "recorded"].groupby("dancer", sort=False)
    assert danced["seconds"].agg([len, "min", "max"]).to_numpy().tolist() == [[200, 0.0, 199 / FPS]] * 2
    assert [*danced.groups] == ["with end effectors", "without end effectors"]
    assert curves[CELLS.TOES].notna().all(axis=None)
    ways = dict([*planted.foot_curves(CONTEST, "cha-cha").groupby("feet", sort=False)])
    assert [*ways] == ["no correction", "foot model", "planted feet, not learnt"]
    assert {(len(own), own["seconds"].min()) for own in ways.values()} == {(200, 0.0)}
    own, bare = (ways[name][CELLS.TOES] for name in ("foot model", "no correction"))
    np.testing.assert_allclose(own, bare, atol=1e-3)


@pytest.mark.slow
def test_variety_is_that_of_the_heights_and_chance_adds_to_it(planted: SimpleNamespace):
    table = planted.toe_variety(CONTEST).set_index(["dancer", "drawing"])
    assert [*table["n"]] == [4, 4, 4, 4, 1]
    for name in ("with end effectors", "without end effectors"):
        assert table.loc[(name, "all of the spread"), "SD (cm)"] > table.loc[(name, "a tenth of the spread"), "SD (cm)"]
    wave = 5.0 * np.sin(np.linspace(0, 20 * np.pi, 1001))[:, None] * [1.0, 0.0]
    numbers = CELLS.height_variety(wave)
    # Mean of a toe that waves and one that rests.
    assert numbers["SD (cm)"] == pytest.approx(5 / np.sqrt(2) / 2, rel=1e-2)
    assert numbers["range (cm)"] == pytest.approx(5 * np.sin(0.45 * np.pi), rel=1e-2)


def test_the_speed_of_a_foot_is_that_of_its_slowest_point():
    positions = points(9)
    positions[:, [joint(f"{part} R") for part in ("toe", "heel", "ankle")], 0] += 0.02 * np.arange(9)[:, None]
    positions[:, joint("heel R"), 0] += 0.02 * np.arange(9)
    speeds = CELLS.foot_speeds(Motion(positions, FPS, POINTS))
    np.testing.assert_allclose(speeds, np.tile([0.0, 0.5], (9, 1)), atol=1e-9)


# Legs


SLOW = 15.0  # frames a second
WALKER = Skeleton(
    ("torso", "head", *(f"{part} {side}" for side in "LR" for part in ("hip", "knee", "ankle", "toe"))),
    (-1, 0, 0, 2, 3, 4, 0, 6, 7, 8),
)
LEFT, RIGHT = Leg(2, 3, 4, (4, 5)), Leg(6, 7, 8, (8, 9))


def standing(frames: int = 90) -> np.ndarray:
    """A dancer at rest with knees a little bent forwards (+z); ankles 5 cm high."""
    leg, aside = np.array([[0, 0.9, 0], [0, 0.48, 0.08], [0, 0.05, 0], [0, 0.0, 0.15]]), np.array([0.1, 0, 0])
    return np.tile(np.concatenate([[[0, 1.0, 0], [0, 1.6, 0]], leg + aside, leg - aside]), (frames, 1, 1))


def test_legs_are_found_by_the_names_of_feet():
    assert [find_leg(WALKER, foot) for foot in foot_joints(WALKER)] == [LEFT, RIGHT]


@cases(
    "joints, parents",
    (("hip", "toe L"), (-1, 0)),  # no knee
    (("hip", "knee L", "toe L"), (-1, -1, 1)),  # no hip above the knee
    (("hip", "knee L", "heel L", "toe L"), (-1, 0, 1, 1)),  # which one is the ankle?
    (("hip", "knee L", "ankle L", "tail"), (-1, 0, 1, 1)),  # the knee carries something else
)
def test_what_is_no_leg_of_two_bones_is_none(joints: tuple[str, ...], parents: tuple[int, ...]):
    skeleton = Skeleton(joints, parents)
    assert find_leg(skeleton, foot_joints(skeleton)[0]) is None


def test_what_hangs_on_the_ankle_goes_with_it():
    assert find_leg(Skeleton(("hip", "knee L", "ankle L", "ball L", "toe L"), (-1, 0, 1, 2, 3)), (2,)).foot == (2, 3, 4)


def test_a_moved_foot_arrives_and_no_bone_changes():
    positions = standing(50)
    shift = np.random.default_rng(0).uniform([-0.05, 0.0, -0.05], [0.05, 0.1, 0.05], (50, 3))
    moved = moved_feet(positions, [LEFT], shift[:, None])
    np.testing.assert_allclose(moved[:, [4, 5]], positions[:, [4, 5]] + shift[:, None], atol=1e-9)
    bones = np.linalg.norm(moved - moved[:, list(WALKER.parents)], axis=2)[:, 1:]
    np.testing.assert_allclose(bones, np.tile(bone_lengths(positions, WALKER)[1:], (50, 1)), atol=1e-9)
    others = [joint for joint in range(10) if joint not in (3, 4, 5)]
    np.testing.assert_array_equal(moved[:, others], positions[:, others])
    assert (moved[:, 3, 2] > moved[:, 4, 2] - 0.1).all() and (moved[:, 3, 2] > 0).all()  # the knee stays in front


def test_a_foot_goes_no_further_than_the_leg_reaches():
    positions = standing(2)
    moved = moved_feet(positions, [LEFT], np.array([[[0.0, -3.0, 0.0]]] * 2))
    bones = bone_lengths(moved, WALKER)
    np.testing.assert_allclose(bones, bone_lengths(positions, WALKER), atol=1e-9)
    assert np.linalg.norm(moved[0, 4] - moved[0, 2]) == pytest.approx(0.99 * (bones[3] + bones[4]))


def test_a_straight_leg_bends_forwards():
    positions = standing(1)
    positions[:, 3, 2] = 0.0
    assert moved_feet(positions, [LEFT], np.array([[[0.0, 0.1, 0.0]]]))[0, 3, 2] > 0.1


def test_no_shift_changes_nothing():
    np.testing.assert_allclose(moved_feet(standing(3), [RIGHT], np.zeros((3, 1, 3))), standing(3), atol=0.01)


def swaying() -> np.ndarray:
    """The body goes 10 cm to and fro twice a second over feet that go with it, as a network makes it."""
    shift = 0.1 * np.sin(4 * np.pi * np.arange(90) / SLOW)
    return standing() + shift[:, None, None] * np.array([1.0, 0, 0])


def test_legs_hold_sliding_feet_back_while_the_body_dances_on():
    planted = planted_feet(swaying(), SLOW, WALKER)
    before, after = (foot_skating(Motion(each, SLOW, WALKER)) for each in (swaying(), planted))
    assert after < 0.25 * before
    np.testing.assert_allclose(*[np.diff(each[20:70, :2], axis=0) for each in (planted, swaying())], atol=1e-3)
    np.testing.assert_allclose(bone_lengths(planted, WALKER), bone_lengths(swaying(), WALKER), atol=1e-9)


def test_a_foot_in_the_air_goes_its_own_way():
    kicking = standing()
    lift = np.sin(2 * np.pi * np.arange(90) / 30).clip(min=0)
    kicking[:, [4, 5]] += 0.3 * lift[:, None, None] * np.array([0, 1.0, 1.0])
    kicking = moved_feet(standing(), [LEFT], (kicking[:, 4] - standing()[:, 4])[:, None])
    np.testing.assert_allclose(planted_feet(kicking, SLOW, WALKER), kicking, atol=0.03)


UP, ALONG, ASIDE = np.eye(3)[[1, 2, 0]]
BOTH_STAND, RIGHT_STANDS = np.ones((90, 2)), np.tile([0.0, 1.0], (90, 1))


def floating() -> np.ndarray:
    """A dancer at rest who bobs 10 cm to 20 cm over the floor and glides at 50 cm/s, as a network makes it."""
    seconds = np.arange(90)[:, None, None] / SLOW
    return standing() + (0.15 + 0.05 * np.sin(2 * np.pi * seconds / 3)) * UP + 0.5 * seconds * ASIDE


def lifted(height: float, aside: float = 0.0) -> np.ndarray:
    """A dancer at rest on the right foot; the left one is so high for all frames, and goes to and fro so far."""
    shift = height * UP + aside * np.sin(2 * np.pi * np.arange(90)[:, None] / SLOW / 2) * ALONG
    return moved_feet(standing(), [LEFT], shift[:, None])


def test_a_dancer_who_floats_and_glides_is_put_on_its_feet():
    put = standing_dancer(floating(), SLOW, WALKER, BOTH_STAND)
    lowest = put[:, [5, 9], 1]
    assert lowest.min() >= 0.0 and lowest.max() < 0.01
    assert foot_skating(Motion(put, SLOW, WALKER)) < 0.02
    before = grounded(floating(), SLOW, WALKER, plant_feet=True)
    assert before[:, [5, 9], 1].min(axis=1).max() > 0.05  # a floor of a second does not see the bob
    np.testing.assert_allclose(bone_lengths(put, WALKER), bone_lengths(standing(), WALKER), atol=1e-9)


def test_a_foot_in_the_air_stays_in_the_air():
    for contacts in (RIGHT_STANDS, 0 * RIGHT_STANDS):  # told, or seen from its height alone
        put = standing_dancer(lifted(0.3) + 0.1 * UP, SLOW, WALKER, contacts)
        np.testing.assert_allclose(put[:, [5, 9], 1], np.tile([0.3, 0.0], (90, 1)), atol=0.012)


def test_a_foot_that_drags_is_lifted_for_its_step_and_one_that_rests_is_not():
    put = standing_dancer(lifted(0.0, aside=0.25), SLOW, WALKER, RIGHT_STANDS)[20:70]
    speed = np.linalg.norm(np.gradient(put[:, 5], axis=0), axis=1) * SLOW
    assert put[speed > 0.7, 5, 1].min() > 0.04 and put[:, 5, 1].max() < 0.055
    assert put[:, 9, 1].max() < 0.002
    assert np.ptp(put[:, 9, [0, 2]], axis=0).max() < 0.02  # it stands while the other steps


@cases("told, carrying, other", ([1.0, 0.0], 5, 9), ([0.0, 1.0], 9, 5))
def test_the_foot_that_is_told_carries_the_body(told: list[float], carrying: int, other: int):
    apart = standing()
    apart[:, [4, 5]] += 0.3 * np.arange(90)[:, None, None] / SLOW * ALONG / 6  # one goes ahead by 30 cm in six seconds
    put = standing_dancer(apart, SLOW, WALKER, np.tile(told, (90, 1)))
    assert np.ptp(put[:, carrying, 2]) < 0.02 and np.ptp(put[:, other, 2]) > 0.1


def test_a_foot_that_turns_on_its_toe_holds_the_body_by_the_toe():
    turning = standing()
    angle = np.sin(3 * np.arange(90) / SLOW)
    circle = np.stack([np.sin(angle), 1 / 3 + 0 * angle, -np.cos(angle)], axis=1)
    turning[:, [4, 8]] = turning[:, [5, 9]] + 0.15 * circle[:, None]
    put = standing_dancer(turning, SLOW, WALKER, BOTH_STAND)
    assert np.ptp(put[:, [5, 9]], axis=0).max() < 0.03 < np.ptp(put[:, [4, 8]], axis=0).max()


def walk(lift: float) -> tuple[np.ndarray, np.ndarray]:
    """Steps of 30 cm, .6 s each, the feet in turn, one second at rest first; and which feet stand (T, 2)."""
    whole, part = np.divmod(np.clip((np.arange(180) - 25) / 15, 0, 8), 1)
    risen = np.where(whole % 2 == np.array([[0], [1]]), part**2 * (3 - 2 * part), 0.0)  # (2, T), of the foot that steps
    ahead = 0.3 * (np.stack([(whole + 1) // 2, whole // 2]) + risen)
    body = ahead.mean(axis=0)
    shifts = [
        (foot - body)[:, None] * ALONG + lift * np.sin(np.pi * up)[:, None] * UP
        for foot, up in zip(ahead, risen, strict=True)
    ]
    stand = standing(180) - np.isin(np.arange(10), (4, 5, 8, 9), invert=True)[:, None] * 0.05 * UP
    return moved_feet(stand, [LEFT, RIGHT], np.stack(shifts, axis=1)) + body[:, None, None] * ALONG, (risen == 0.0).T


def test_a_walk_on_the_spot_gets_its_way_back():
    truth, stands = walk(lift=0.08)
    spot = truth - truth[:, :1] * ALONG + 0.1 * np.sin(np.arange(180) / 8)[:, None, None] * UP
    put = standing_dancer(spot, FPS, WALKER, stands.astype(float))
    np.testing.assert_allclose(put[:, 0, 2], truth[:, 0, 2], atol=0.12)
    slides = np.linalg.norm(np.diff(put[:, [5, 9]], axis=0)[..., [0, 2]], axis=2) * FPS
    assert slides[stands[1:] & stands[:-1]].mean() < 0.015
    np.testing.assert_allclose(put[..., 1], truth[..., 1], atol=0.02)


def test_of_feet_on_the_floor_of_which_nothing_is_told_the_slower_carries():
    truth, stands = walk(lift=0.0)
    assert standing_dancer(truth, FPS, WALKER, 0.0 * stands)[-1, 0, 2] > 0.85 * truth[-1, 0, 2]


def test_a_straight_leg_whose_knee_trembles_bends_forwards_all_the_time():
    """The network's foot that steps is 20 cm below the one that carries, at the end of a straight leg."""
    turn = np.array([[0.0, 0, 1], [0, 1, 0], [-1, 0, 0]])  # who looks to -x
    legs = moved_feet(standing(), [RIGHT], np.tile(0.2 * UP, (90, 1, 1)))
    legs[:, 3, 2] = 0.03 * np.sin(np.arange(90))
    bent = standing_dancer(legs @ turn, SLOW, WALKER, RIGHT_STANDS) @ turn.T
    assert (bent[:, 3, 2] > 0.15).all() and np.abs(np.diff(bent[:, 3], axis=0)).max() < 0.05


def test_one_frame_is_put_on_the_floor():
    assert standing_dancer(standing(1) + UP, SLOW, WALKER, np.ones((1, 2)))[..., 1].min() == 0.0
