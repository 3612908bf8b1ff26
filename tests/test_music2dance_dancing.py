"""Dancing with Music2Dance: parts on disk, feet, temperature, the dance that music sounds like; weights given away.

All networks but the shipped ones are untrained, with answers planted in their last layers.
"""

import json
import shutil
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from typer.testing import Result

import harmolab
from harmolab import Audio, BeatTrack, Motion, Skeleton, load_motion, synthetic_clip
from harmolab.body.kinematics import resample_motion
from harmolab.body.skeletons import foot_joints
from harmolab.cli import app
from harmolab.cli.dancers import OTHER_DANCE, dance_in_words
from harmolab.clips import tracked_sound
from harmolab.data.recordings import TANG_23
from harmolab.readers.audio import load_audio
from harmolab.systems import AttributeClassifier, AttributeParams, load
from harmolab.systems.music2dance import music_features
from harmolab.systems.music2dance.codes import PositionCode, RotationCode, check_same_channels
from harmolab.systems.music2dance.feet import FootModel, FootParams
from harmolab.systems.music2dance.generate import FEET, Danced, Feet, corrected, correlated_draws, dance_positions
from harmolab.systems.music2dance.networks import DanceNetwork
from harmolab.systems.music2dance.params import MOST_TEMPERATURE
from harmolab.systems.music2dance.system import Music2Dance, drawn_with
from harmolab.systems.training.about import read_about
from harmolab.systems.training.feet import foot_contacts
from harmolab.systems.training.runs import PoseBank, load_poses
from harmolab.systems.training.weights import save_weights
from study.cells import notebook_cells
from tests.builders import called, cases, done, planted_dance, refused, still, write_song
from tests.tiny_music2dance import TINY as SMALL
from tools.ship import ENDING_SECONDS
from tools.ship import ship_music2dance as ship

DANCES = ("cha-cha", "waltz")
CLASSES = {"rumba": 0.25, "waltz": 0.5, "cha-cha": 0.15, "tango": 0.1}  # planted: what every song sounds like
WORDS = "The music sounds like a waltz (0.50; rumba 0.25, cha-cha 0.15, tango 0.10)."
RATE = 22050.0
TINY = replace(SMALL, temperature=0.1)
CODES: dict[str, Any] = {"positions": PositionCode, "rotations": RotationCode}


@cache
def danced() -> Motion:
    """Twelve seconds of a synthetic cha-cha at the network's rate."""
    return resample_motion(planted_dance(seconds=12.0).motion, TINY.fps)


@cache
def coded(representation: str) -> tuple[PositionCode | RotationCode, np.ndarray, np.ndarray]:
    """Code of the cha-cha's motion, its channels and its contacts."""
    motion, code = danced(), CODES[representation].of([danced()])
    return code, code.encode(motion), foot_contacts(motion.positions, motion.fps, motion.skeleton)


def foot_model(representation: str, moved: Mapping[int, float] | None = None) -> FootModel:
    """A model whose increments are constant: for each lower-body channel in `moved` so much, in its own unit."""
    code, values, _ = coded(representation)
    torch.manual_seed(1)
    model = FootModel(FootParams(channels=4), code)
    model.motion_scale.set(torch.tensor(values.mean(axis=0)).float(), torch.tensor(values.std(axis=0)).float())
    with torch.no_grad():
        for channel, change in (moved or {}).items():
            model.layers[-1].bias[model.lower.index(channel)] = change / float(model.motion_scale.std[channel])
    return model.eval()


def classifier(shares: Mapping[str, float] = CLASSES, **sizes: Any) -> AttributeClassifier:
    """A classifier that gives these probabilities to whatever it hears."""
    torch.manual_seed(2)
    model = AttributeClassifier(AttributeParams(channels=(2, 3), hidden=4, **sizes), list(shares))
    with torch.no_grad():
        model.verdict.weight.zero_()
        model.verdict.bias.copy_(torch.tensor(list(shares.values())).log())
    return model.eval()


def system(representation: str = "positions", **parts: Any) -> Music2Dance:
    """A tiny network that hardly leaves the movement it starts from."""
    code, values, contacts = coded(representation)
    torch.manual_seed(0)
    network = DanceNetwork(replace(TINY, representation=representation), code, DANCES).eval()
    with torch.no_grad():
        network.body.head.layer.weight.mul_(0.1)
    network.motion_scale.set(torch.tensor(values.mean(axis=0)).float(), torch.tensor(values.std(axis=0)).float())
    bank = PoseBank(np.stack([np.column_stack([values, contacts])[:25]] * 2), DANCES)
    return Music2Dance(network, bank, {"trained": "never"}, **parts)


def sound(seconds: float = 3.0) -> Audio:
    """A click every half second."""
    samples = 0.01 * np.random.default_rng(0).standard_normal(round(seconds * RATE))
    for moment in np.arange(0.1, seconds, 0.5):
        samples[round(moment * RATE) :][:400] = 0.5
    return Audio(samples, RATE)


# Parts on disk


def test_both_parts_come_back_from_their_folders(tmp_path: Path):
    code, values, contacts = coded("positions")
    feet = foot_model("positions", {lower_height(code): 0.1})
    feet.meta = {"source": "planted"}
    system(attributes=classifier(), feet=feet).save(tmp_path / "run")
    assert (tmp_path / "run" / "attributes" / "model.safetensors").is_file()
    assert read_about(tmp_path / "run" / "feet")["meta"] == {"source": "planted"}
    for place in ("run", "run/model.safetensors"):
        again = load(tmp_path / place)
        assert isinstance(again, Music2Dance) and again.attributes is not None and again.feet is not None
        assert again.attributes.classes == tuple(CLASSES)
        assert again.feet.meta == {"source": "planted"} and again.meta == {"trained": "never"}
        np.testing.assert_array_equal(again.feet.correct(values, contacts), feet.correct(values, contacts))


def lower_height(code: PositionCode | RotationCode) -> int:
    """The channel of the root's height, which the foot model may move."""
    return 3 if isinstance(code, RotationCode) else 3 * code.skeleton.parents.index(-1) + 1


def test_weights_alone_have_neither_part(tmp_path: Path):
    system().save(tmp_path)
    (tmp_path / "feet").mkdir()  # a training that has just begun
    (tmp_path / "feet" / "history.csv").write_text("epoch\n")
    again = load(tmp_path)
    assert isinstance(again, Music2Dance) and again.attributes is None and again.feet is None


def edited(**changes: Any) -> Callable[[Path], None]:
    """A change of settings in the description."""

    def edit(folder: Path) -> None:
        about = json.loads((folder / "model.json").read_text())
        about["build"].update({name: value for name, value in changes.items() if name in about["build"]})
        about["build"]["params"].update({name: value for name, value in changes.items() if name not in about["build"]})
        (folder / "model.json").write_text(json.dumps(about))

    return edit


def cut(folder: Path) -> None:
    file = folder / "model.safetensors"
    file.write_bytes(file.read_bytes()[:-100])


def replaced(file: Path, old: str, new: str) -> None:
    file.write_text(file.read_text().replace(old, new))


def exchanged(folder: Path) -> None:
    """The other part's files."""
    other = folder.with_name({"feet": "attributes", "attributes": "feet"}[folder.name])
    shutil.copytree(other, folder, dirs_exist_ok=True)


ANY_PART: dict[str, Callable[[Path], object]] = {
    "cut": cut,
    "no description": lambda folder: (folder / "model.json").unlink(),
    "no numbers": lambda folder: (folder / "model.safetensors").unlink(),
    "no meta": lambda folder: replaced(folder / "model.json", '"meta": {}', '"meta": [1]'),
    "of the other part": exchanged,
    "a text as channels": edited(channels="many"),
}
OF_ATTRIBUTES = {
    "hidden": edited(hidden=10**9),
    "more hidden than numbers": edited(hidden=60_000),
    "no class": edited(classes=[]),
    "one class twice": edited(classes=["waltz"] * 4),
    "a name without end": edited(classes=["a", "b", "c", "d" * 10**6]),
    "windows all over each other": edited(hop=1e-6),
    "a rate without end": edited(rate=1e9),
    "a rate of nothing": edited(rate=1e-9),
    "windows of years": edited(window=1e9, hop=1e9),
}
OF_FEET = {
    "layers": edited(channels=10**9),
    "dilations": edited(dilations=[1, 65_536, 9]),
    "too many layers": edited(dilations=[1] * 1000),
    "no code": edited(code={"kind": "dreams"}),
}
FAULTS = [
    *((part, name, damage) for part in ("attributes", "feet") for name, damage in ANY_PART.items()),
    *(("attributes", name, damage) for name, damage in OF_ATTRIBUTES.items()),
    *(("feet", name, damage) for name, damage in OF_FEET.items()),
]


@pytest.fixture(scope="module")
def whole_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run with both parts."""
    folder = tmp_path_factory.mktemp("m2d") / "run"
    system(attributes=classifier(), feet=foot_model("positions")).save(folder)
    return folder


@pytest.mark.parametrize(("part", "name", "damage"), FAULTS, ids=[f"{part}: {name}" for part, name, _ in FAULTS])
def test_what_is_wrong_with_a_part_is_said_with_its_file(
    part: str, name: str, damage: Callable[[Path], None], whole_run: Path, tmp_path: Path
):
    run = shutil.copytree(whole_run, tmp_path / "run")
    damage(run / part)
    with pytest.raises((ValueError, FileNotFoundError)) as caught:
        load(run)
    text = str(caught.value)
    assert text.startswith(f"{run / part / 'model'}") and len(text) < len(str(run)) + 600


@cases(
    "mine, fault",
    ("rotations", "takes motion as rotations; the generator dances positions"),
    ("positions of 23", r"takes another skeleton \(23 joints\) than the generator's \(21 joints\)"),
    ("other names", r"takes another skeleton \(21 joints\)"),
)
def test_a_foot_model_of_another_code_is_refused(mine: str, fault: str, whole_run: Path, tmp_path: Path):
    own = coded("positions")[0].skeleton
    other = Skeleton((*own.joints[:-1], f"{own.joints[-1]} of another"), own.parents)
    codes = {
        "rotations": coded("rotations")[0],
        "positions of 23": PositionCode(TANG_23, np.full(23, 0.2)),
        "other names": PositionCode(other, np.full(21, 0.2)),
    }
    model = FootModel(FootParams(channels=4), codes[mine])
    refused(fault, system, feet=model)
    run = shutil.copytree(whole_run, tmp_path / "run")
    save_weights(run / "feet" / "model", model)
    refused(rf"feet/model\.json: {fault}", load, run)


def test_rotations_from_another_mean_pose_or_without_end_effectors_are_another_code():
    code = coded("rotations")[0]
    assert isinstance(code, RotationCode)
    check_same_channels(replace(code, means=code.means + 0.001), code)
    for other in (replace(code, means=code.means + 0.1), replace(code, end_effectors=False)):
        refused("train it on the recordings of the generator", check_same_channels, other, code)


# Feet


@pytest.mark.parametrize("representation", CODES)
def test_the_foot_model_changes_only_the_lower_body(representation: str):
    code, values, contacts = coded(representation)
    model = foot_model(representation)
    with torch.no_grad():
        model.layers[-1].weight.normal_()  # every increment is something else
    changed = corrected(model, Danced(values, contacts), TINY.fps)
    places = [channel for channel in range(code.n_motion) if channel not in model.lower]
    if isinstance(code, RotationCode):
        places = [channel for channel in places if channel < 43]  # end effectors are set by the rotations
    np.testing.assert_array_equal(changed[:, places], values[:, places])
    moves = np.abs(changed - values)[:, model.lower].max(axis=0)
    assert (moves[np.array(values.std(axis=0))[model.lower] > 1e-3] > 1e-3).all()


def test_increments_are_in_the_units_of_the_channels():
    code, values, contacts = coded("positions")
    channel = lower_height(code)
    changed = corrected(foot_model("positions", {channel: 0.07}), Danced(values, contacts), TINY.fps)
    np.testing.assert_allclose((changed - values)[:, channel], 0.07, atol=1e-6)
    np.testing.assert_array_equal(np.delete(changed - values, channel, axis=1), 0.0)


def test_the_model_sees_feet_where_the_rotations_put_them():
    code, values, contacts = coded("rotations")
    assert isinstance(code, RotationCode)
    model = foot_model("rotations")
    with torch.no_grad():
        model.layers[-1].weight.normal_()
    wrong = values.copy()
    wrong[:, 43:] += 1.0  # the network predicts all end effectors a metre off
    one, other = (corrected(model, Danced(each, contacts), TINY.fps) for each in (values, wrong))
    np.testing.assert_array_equal(one, other)
    np.testing.assert_allclose(one[:, 43:], code.refreshed(values, TINY.fps)[:, 43:], atol=1e-9)


@pytest.mark.parametrize("representation", CODES)
def test_a_model_without_increments_leaves_the_dance_as_it_is(representation: str):
    dancer = system(representation, feet=foot_model(representation))
    raw, by_model = (dancer.generate(sound(), feet=feet).positions for feet in ("none", "model"))
    np.testing.assert_array_equal(by_model, raw)


def test_a_moved_toe_moves_nothing_else_and_stays_on_the_floor():
    code, *_ = coded("positions")
    toe = next(joint for joint, name in enumerate(code.skeleton.joints) if name == "toe L")
    dancer = system(feet=foot_model("positions", {3 * toe + 1: -0.05}))
    raw, by_model = (dancer.generate(sound(), feet=feet).positions for feet in ("none", "model"))
    others = [joint for joint in range(len(code.skeleton.joints)) if joint != toe]
    np.testing.assert_allclose(by_model[:, others][..., [0, 2]], raw[:, others][..., [0, 2]], atol=1e-6)
    lift = (by_model - raw)[:, others, 1]
    np.testing.assert_allclose(lift, lift[:, :1].repeat(len(others), axis=1), atol=1e-6)  # `on_floor` alone
    assert ((by_model - raw)[:, toe, 1] < lift[:, 0] - 0.01).all()
    assert by_model[..., 1].min() == pytest.approx(0.0, abs=1e-9)


def test_planted_feet_carry_the_dance_where_the_network_says_so():
    dancer = system()
    code, values, contacts = coded("positions")
    afloat = values.copy()
    afloat[:, 1 : 3 * len(code.skeleton.joints) : 3] += 0.1 * np.sin(np.arange(len(values)) / 9)[:, None]
    soles = [joint for foot in foot_joints(code.skeleton) for joint in foot]

    def soles_of(stands: np.ndarray, feet: Feet) -> np.ndarray:
        return dance_positions(dancer.generator, Danced(afloat, stands), feet)[:, soles]

    free, planted = soles_of(contacts, "none"), soles_of(contacts, "planted")
    wrong = soles_of(1.0 - contacts, "planted")
    assert free[..., 1].min(axis=1).max() > 0.15 and planted[..., 1].min(axis=1).max() < 0.02
    assert np.abs(wrong - planted).max() > 0.05


@cases(
    "options, fault",
    ({"feet": "glued"}, "feet must be planted or model or none, got 'glued'"),
    ({"feet": "model"}, "no foot model; train one: harmolab train DATA --system feet --out RUN/feet"),
    ({"feet": "model", "plant_feet": False}, "exclude each other"),
    ({"temperature": -0.1}, "temperature must be from 0 to 4, got -0.1"),
    ({"temperature": 4.1}, "temperature must be from 0 to 4, got 4.1"),
    ({"temperature": float("nan")}, "temperature must be from 0 to 4, got nan"),
    ({"temperature": float("inf")}, "temperature must be from 0 to 4, got inf"),
)
def test_options_out_of_range_are_refused(options: dict[str, Any], fault: str):
    refused(fault, system().generate, sound(), **options)


def test_a_foot_model_whose_numbers_overflow_is_no_dance():
    model = foot_model("positions")
    with torch.no_grad():
        for layer in (0, 1, -1):
            model.layers[layer].weight.fill_(3e38)
    refused("the foot model gives no finite dance", system(feet=model).generate, sound(), feet="model")


def test_without_chance_all_seeds_dance_alike_and_with_it_they_differ():
    dancer, before = system(), danced()
    still_ones, livelier = (
        [dancer.generate(sound(), seed=seed, initial=before, dance="waltz", temperature=share) for seed in (1, 2)]
        for share in (0.0, MOST_TEMPERATURE)
    )
    np.testing.assert_array_equal(still_ones[0].positions, still_ones[1].positions)
    assert np.abs(livelier[0].positions - livelier[1].positions).max() > 0.01


@pytest.mark.parametrize("memory", [1.0, 5.0, 20.0])
def test_lasting_draws_keep_their_spread_and_fade_as_they_say(memory: float):
    draws = correlated_draws((400_000, 2), memory, np.random.default_rng(0))
    np.testing.assert_allclose(draws.std(axis=0), 1.0, atol=0.03)
    for apart in (1, round(memory), round(3 * memory)):
        assert (draws[apart:] * draws[:-apart]).mean() == pytest.approx(np.exp(-apart / memory), abs=0.03)
    assert draws[0].tolist() == correlated_draws((1, 2), memory, np.random.default_rng(0))[0].tolist()


def test_draws_without_memory_are_those_of_equation_12():
    draws, rng = correlated_draws((3, 4), 0.0, np.random.default_rng(1)), np.random.default_rng(1)
    np.testing.assert_array_equal(draws, [rng.standard_normal(4, dtype=np.float32) for _ in range(3)])


def test_lasting_draws_move_the_body_further():
    before, dancer = danced(), system()
    moved = []
    for memory in (0.0, 0.4):
        network = drawn_with(dancer.generator, temperature=1.0, draw_memory=memory, smoothing=0.0)
        motion = Music2Dance(network, dancer.poses).generate(sound(), seed=1, initial=before, dance="waltz")
        moved.append(motion.positions.std(axis=0).mean())
    assert moved[1] > 1.2 * moved[0]


def test_weights_of_before_there_was_a_draw_memory_dance_as_they_did():
    description = system().generator.description()
    del description["params"]["draw_memory"]
    assert DanceNetwork.built(description, system().generator.state_dict()).params.draw_memory == 0


# Odd songs and movements


SONGS = {
    "three frames": sound(0.13),
    "silence": Audio(np.zeros(round(4 * RATE)), RATE),
    "a hum": Audio(0.1 * np.sin(np.arange(round(4 * RATE)) / 20), RATE),
    "shorter than a window": sound(1.9),
}


@pytest.mark.parametrize("representation", CODES)
@pytest.mark.parametrize("name", SONGS)
def test_odd_songs_get_a_dance_as_long_as_they_are(name: str, representation: str):
    audio = SONGS[name]
    dancer = system(representation, feet=foot_model(representation))
    for feet in FEET:
        motion = dancer.generate(audio, feet=feet)
        assert motion.n_frames == int(audio.duration * TINY.fps + 1e-6)
        assert np.isfinite(motion.positions).all() and np.abs(motion.positions).max() < 3
        assert motion.positions[..., 1].min() > -1e-3


@cases(
    "representation, initial, fault",
    ("positions", still(30, fps=25.0), r"initial has other joints \(2\) than the network \(21\); retarget it"),
    ("rotations", still(30, fps=25.0), "initial has no joint for pelvis, torso, neck, head"),
    ("positions", still(30, fps=25.0, axes=2), "initial must be a motion in three dimensions, got 2"),
)
def test_a_movement_of_another_body_is_refused(representation: str, initial: Motion, fault: str):
    refused(fault, system(representation).generate, sound(), initial=initial)


@pytest.mark.parametrize("representation", CODES)
def test_two_frames_are_enough_to_go_on_from(representation: str):
    before = Motion(danced().positions[:2], TINY.fps, danced().skeleton)
    motion = system(representation).generate(sound(1.0), initial=before)
    assert motion.n_frames == 25 and np.abs(motion.positions).max() < 3


# The dance that music sounds like


@pytest.mark.parametrize("rate", [10.0, 5.0])
def test_the_classifier_hears_the_song_without_a_prior_at_its_own_rate(rate: float, monkeypatch: pytest.MonkeyPatch):
    model = classifier(rate=rate)
    music: list[np.ndarray] = []
    monkeypatch.setattr(model, "probabilities", lambda heard: music.append(heard) or np.array([0.1, 0.2, 0.3, 0.4]))
    asked: list[tuple[Any, ...]] = []
    beats = BeatTrack([0.5, 1.5], [1.0, 1.0], 100.0, 3.0)
    monkeypatch.setattr(music_features, "audio_beats", lambda *args, **more: asked.append((*args, more)) or beats)
    audio = sound()
    assert list(system(attributes=model).dance_probabilities(audio)) == ["tango", "cha-cha", "waltz", "rumba"]
    assert asked == [(audio, {})]  # no tempo, no dance
    assert music[0].shape == (3 * rate, 15)
    assert music[0][:, 1].sum() == pytest.approx(2.0)  # the two beats


def test_a_long_song_is_heard_part_by_part_to_the_same_result():
    torch.manual_seed(3)
    model = AttributeClassifier(AttributeParams(channels=(2, 3), hidden=4, window=4.0, hop=0.2), DANCES).eval()
    music = np.random.default_rng(0).random((400, 15)).astype(np.float32)
    parts = model.window_probabilities(music)
    assert len(parts) == 181
    for row in (0, 63, 64, 180):
        start = min(2 * row, 360)
        np.testing.assert_allclose(parts[row], model.window_probabilities(music[start : start + 40])[0], atol=1e-6)


def test_silence_and_weights_without_a_classifier_sound_like_no_dance():
    refused("this music is silent", system(attributes=classifier()).dance_probabilities, SONGS["silence"])
    refused("harmolab train DATA --system attributes --out RUN/attributes", system().dance_probabilities, sound())


def test_a_classifier_whose_numbers_overflow_is_not_believed():
    model = classifier()
    with torch.no_grad():
        model.verdict.bias.fill_(torch.inf)
    refused("no finite probabilities", system(attributes=model).dance_probabilities, sound())


@cases(
    "shares, words",
    ({"waltz": 0.62, "cha-cha": 0.2, "rumba": 0.18}, "a waltz (0.62; cha-cha 0.20, rumba 0.18)"),
    ({"waltz": 1.0}, "a waltz (1.00)"),
    ({"smooth": 0.7, "fast": 0.3}, "'smooth' (0.70; fast 0.30)"),
    (dict(zip("abcde", (0.4, 0.3, 0.1, 0.1, 0.1), strict=True)), "'a' (0.40; b 0.30, c 0.10, d 0.10, ...)"),
)
def test_the_answer_in_words(shares: dict[str, float], words: str):
    assert dance_in_words(shares) == f"the music sounds like {words}"


# Command line


@pytest.fixture(scope="module")
def song(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Six seconds of a synthetic cha-cha."""
    return write_song(tmp_path_factory.mktemp("music") / "song.wav", planted_dance())


def dance(song: Path, run: Path, out: Path, *options: object) -> Result:
    """The command, for two seconds of the song."""
    return done(app, "dance", song, "--weights", run, "--seconds", 2, "--out", out, *options)


def one_line(folder: Path, *arguments: object) -> str:
    """The only line of the error that this dance ends in; nothing was written into the folder."""
    result = called(app, "dance", *arguments, "--out", folder / "dance.npz")
    assert result.exit_code == 2, result.output
    assert len(result.stderr.splitlines()) == 1 and result.stderr.startswith("harmolab: ")
    assert list(folder.iterdir()) == []
    return result.stderr.strip()


def test_an_empty_dance_asks_the_classifier_and_dances_what_it_says(song: Path, whole_run: Path, tmp_path: Path):
    assert WORDS in dance(song, whole_run, tmp_path / "asked.npz", "--dance", "").stdout
    assert "sounds like" not in dance(song, whole_run, tmp_path / "told.npz", "--dance", "waltz").output
    asked, named = (load_motion(tmp_path / f"{name}.npz").positions for name in ("asked", "told"))
    np.testing.assert_array_equal(asked, named)
    dance(song, whole_run, tmp_path / "other.npz", "--dance", "cha-cha")
    assert np.abs(load_motion(tmp_path / "other.npz").positions - asked).max() > 1e-6


def test_json_and_the_page_have_the_answer(song: Path, whole_run: Path, tmp_path: Path):
    (report,) = json.loads(dance(song, whole_run, tmp_path / "dance.html", "--dance", "", "--json").stdout)
    assert WORDS in (tmp_path / "dance.html").read_text("utf-8")
    assert report["dance_probabilities"] == pytest.approx(CLASSES, abs=1e-6)
    assert next(iter(report["dance_probabilities"])) == "waltz"
    assert f"{report['remarks'][0]}." == WORDS.replace("The", "the")


def test_no_dance_at_all_is_drawn_by_the_seed_as_before(song: Path, whole_run: Path, tmp_path: Path):
    (report,) = json.loads(dance(song, whole_run, tmp_path / "dance.npz", "--json", "--seed", 1).stdout)
    assert report["dance_probabilities"] is None and [each[:9] for each in report["remarks"]] == ["danced at"]
    expected = load(whole_run).generate(tracked_sound(song, load_audio(song, sample_rate=None)), seconds=2.0, seed=1)
    np.testing.assert_allclose(load_motion(tmp_path / "dance.npz").positions, expected.positions, atol=1e-6)


def test_a_dance_that_was_not_learnt_is_said_to_be_another(song: Path, tmp_path: Path):
    system(attributes=classifier({"rumba": 0.75, "waltz": 0.25})).save(tmp_path / "run")
    result = dance(song, tmp_path / "run", tmp_path / "dance.npz", "--dance", "")
    assert "The music sounds like a rumba (0.75; waltz 0.25)." in result.stdout
    assert f"{OTHER_DANCE[0].upper()}{OTHER_DANCE[1:]}." in result.stdout
    dance(song, tmp_path / "run", tmp_path / "untold.npz")
    one, other = (load_motion(tmp_path / name).positions for name in ("dance.npz", "untold.npz"))
    np.testing.assert_array_equal(one, other)


def test_feet_and_temperature_reach_the_network(song: Path, whole_run: Path, tmp_path: Path):
    asked = {name: ("--feet", name) for name in ("planted", "model", "none")}
    asked |= {"usual": (), "free": ("--no-plant-feet",), "lively": ("--temperature", 2)}
    for name, options in asked.items():
        dance(song, whole_run, tmp_path / f"{name}.npz", *options)
    motions = {name: load_motion(tmp_path / f"{name}.npz").positions for name in asked}
    np.testing.assert_array_equal(motions["usual"], motions["planted"])
    np.testing.assert_array_equal(motions["none"], motions["free"])
    np.testing.assert_array_equal(motions["none"], motions["model"])  # its increments are 0
    assert np.abs(motions["usual"] - motions["none"]).max() > 1e-4
    assert np.abs(motions["usual"] - motions["lively"]).max() > 1e-3


@cases(
    "options, fault",
    (("--temperature=-1",), "temperature must be from 0 to 4, got -1"),
    (("--temperature", "nan"), "--temperature must be a finite number, got nan"),
)
def test_faulty_options_are_one_line(options: tuple[str, ...], fault: str, song: Path, whole_run: Path, tmp_path: Path):
    assert fault in one_line(tmp_path, song, "--weights", whole_run, "--seconds", 2, *options)


@cases("dancer, option, value", ("harmogan", "--feet", "model"), ("choreographer", "--temperature", 0.5))
def test_other_systems_refuse_both_in_one_sentence(dancer: str, option: str, value: object, song: Path, tmp_path: Path):
    error = one_line(tmp_path, song, "--system", dancer, option, value)
    assert error == f"harmolab: {option} is no option of this system"


@pytest.mark.slow
def test_an_empty_dance_is_nothing_new_for_other_systems(song: Path, tmp_path: Path):
    for name, options in {"empty": ("--dance", ""), "none": ()}.items():
        arguments = ("--system", "harmogan", "--seconds", 2, "--seed", 0, "--out", tmp_path / f"{name}.npz")
        assert "sounds like" not in done(app, "dance", song, *arguments, *options).output
    one, other = (load_motion(tmp_path / f"{name}.npz").positions for name in ("empty", "none"))
    np.testing.assert_array_equal(one, other)


SHIPPED = Path(harmolab.__file__).parent / "systems" / "music2dance" / "weights"


@pytest.fixture(scope="module")
def given_away(whole_run: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("weights")
    ship(whole_run, folder, per_dance=2)
    return folder


def test_all_that_a_run_has_is_in_it_in_half_the_size(whole_run: Path, given_away: Path):
    one, other = Music2Dance.load(whole_run), Music2Dance.load(given_away)
    assert other.meta == {"trained": "never"} and other.feet is not None and other.attributes is not None
    assert other.generator.params == one.generator.params
    for name in ("model", "attributes/model"):
        sizes = [(folder / f"{name}.safetensors").stat().st_size for folder in (given_away, whole_run)]
        assert sizes[0] < 0.7 * sizes[1]


def test_no_recorded_movement_is_in_it(whole_run: Path, given_away: Path):
    recorded, own = load_poses(whole_run / "model"), load_poses(given_away / "model")
    assert own.dances == ("cha-cha", "cha-cha", "waltz", "waltz") and own.poses.shape == (4, *recorded.poses.shape[1:])
    assert np.abs(own.poses[:, None] - recorded.poses[None]).max(axis=(2, 3)).min() > 0.01


def test_a_dance_begins_with_a_movement_of_the_dance_and_lasts(given_away: Path):
    clip = synthetic_clip("waltz", seconds=ENDING_SECONDS / 4, seed=3)
    motion = Music2Dance.load(given_away).generate(clip.audio, clip.beats, dance="waltz", seed=1)
    assert motion.duration == pytest.approx(ENDING_SECONDS / 4, abs=0.05) and np.isfinite(motion.positions).all()


def test_a_run_without_movements_cannot_be_given_away(whole_run: Path, tmp_path: Path):
    Music2Dance(Music2Dance.load(whole_run).generator).save(tmp_path / "bare")
    refused("no bank of movements", ship, tmp_path / "bare", tmp_path / "out")


def test_shipped_weights_are_small():
    sizes = [path.stat().st_size for path in SHIPPED.rglob("*.safetensors")]
    assert len(sizes) == 4 and max(sizes) < 2e6
    assert (SHIPPED / "MODEL_CARD.md").is_file()


@pytest.mark.parametrize("dance", ["cha-cha", "rumba", "tango", "waltz"])
def test_the_shipped_network_dances_for_half_a_minute_without_rest_or_shaking(dance: str):
    clip = synthetic_clip(dance, seconds=30.0, seed=77)
    motion = Music2Dance.load(SHIPPED).generate(clip.audio, clip.beats, dance=dance, seed=1)
    measures = notebook_cells("16_music2dance").endurance(motion)
    assert measures["slowest 10 s"] > 0.12 and measures["still"] <= 0.1 and measures["jerk"] < 150
    assert measures["bones"] < 1e-3 and measures["lowest joint"] > -1e-3
