"""The movement that comes with harmolab: what is in it, how a bank is made, what it says about where it comes from."""

import json
import subprocess
import sys
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from harmolab.beats.audio import music_beats
from harmolab.body.skeletons import turned
from harmolab.data.recordings import load_recording
from harmolab.data.synthetic import synthetic_motion
from harmolab.lab.evaluate.measured import later, rests_on_beat
from harmolab.metrics.likeness import LONGEST, LikenessLimits, likeness
from harmolab.systems.choreographer.banks import (
    FOLDER,
    STYLES,
    TAKES,
    danced_parts,
    dancing_span,
    puppets,
    shipped_bank,
    shipped_takes,
    write_bank,
)
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.types import Audio, BeatTrack, Motion
from tests.builders import metronome, refused
from tests.choreographies import measured

ROOT = Path(__file__).resolve().parents[1]


def dance(seed: int, *, seconds: float = 14.0) -> Motion:
    """Somebody who dances from the first second to the last."""
    beats = np.arange(0.3, seconds, 0.5)
    return synthetic_motion(beats, seconds=seconds, fps=30.0, seed=seed)


def with_standing(motion: Motion, before: float, after: float) -> Motion:
    """The motion with so many seconds of standing at its ends."""
    first, last = motion.positions[:1], motion.positions[-1:]
    parts = [first.repeat(round(before * motion.fps), 0), motion.positions, last.repeat(round(after * motion.fps), 0)]
    return replace(motion, positions=np.concatenate(parts), valid=None)


def test_standing_at_the_ends_is_no_dance() -> None:
    start, end = dancing_span(with_standing(dance(1), 3.0, 2.0))
    assert start == pytest.approx(3.0, abs=0.6)
    assert end == pytest.approx(17.0, abs=0.6)


def test_a_change_of_stance_before_the_dance_does_not_begin_it() -> None:
    standing = with_standing(dance(1), 6.0, 0.0)
    positions = standing.positions.copy()
    step = 0.2 * np.sin(np.linspace(0, np.pi, 15)) ** 2  # half a second, there and back
    positions[30:45, :, 0] += step[:, None]
    assert dancing_span(replace(standing, positions=positions))[0] == pytest.approx(6.0, abs=0.7)


def test_a_motion_that_never_dances_is_kept_whole() -> None:
    motion = with_standing(dance(1, seconds=2.0), 0.0, 0.0)
    still = replace(motion, positions=np.zeros_like(motion.positions))
    assert dancing_span(still) == (0.0, still.duration)


def test_holes_split_a_take_and_short_parts_are_left_out() -> None:
    motion = dance(2)
    parts = danced_parts("take", motion, [(5.0, 6.0)])
    assert [part.name for part in parts] == ["take, part 1", "take, part 2"]
    assert sum(part.motion.duration for part in parts) == pytest.approx(13.0, abs=1.2)
    assert [part.name for part in danced_parts("take", motion, [(1.5, 6.0)])] == ["take"]


def test_a_bank_comes_back_to_the_half_millimetre_with_limits_of_its_own(tmp_path: Path) -> None:
    takes = {f"take_{seed}": dance(seed) for seed in (1, 2)}
    bank = write_bank(takes, tmp_path / "bank", style="shuffle")
    back = Choreographer.load(tmp_path / "bank")
    assert [take.name for take in back.takes] == ["take_1", "take_2"]
    assert back.dances == ("shuffle",)
    for before, after in zip(bank.takes, back.takes, strict=True):
        assert np.abs(before.motion.positions - after.motion.positions).max() < 5e-4
    original = danced_parts("take_1", takes["take_1"])[0].motion.positions
    assert np.abs(np.diff(original - back.takes[0].motion.positions, axis=0)).max() <= 1e-3
    assert back.limits is not None
    assert back.limits.windows == 2
    assert likeness(bank.takes[0].motion, limits=back.limits).passed
    assert (tmp_path / "bank" / "model.npz").stat().st_size < 0.3 * takes["take_1"].positions.nbytes


@pytest.mark.parametrize(("style", "minutes", "kilobytes"), [("salsa", 5.3, 520), ("indian", 1.9, 210)])
def test_shipped_recordings_are_small_and_have_limits(style: str, minutes: float, kilobytes: int) -> None:
    bank = shipped_bank(style)
    assert sum(take.seconds for take in bank.takes) / 60 == pytest.approx(minutes, abs=0.1)
    assert {take.name.partition(",")[0] for take in bank.takes} == set(TAKES[style])
    assert sum(file.stat().st_size for file in (FOLDER / style).iterdir()) < 1024 * kilobytes
    assert bank.fps == 30.0
    assert bank.limits is not None
    assert False not in [likeness(take.motion, limits=bank.limits).passed for take in bank.takes]


def test_statue_fails_by_the_limits_of_the_salsa() -> None:
    bank = shipped_bank("salsa")
    take = bank.takes[0].motion
    statue = replace(take, positions=take.positions[:1].repeat(take.n_frames, axis=0))
    assert likeness(statue, limits=bank.limits).passed is False


def test_no_recording_but_those_of_the_notice_is_shipped() -> None:
    shipped = {path.relative_to(FOLDER).as_posix() for path in FOLDER.rglob("*") if path.suffix not in (".py", ".pyc")}
    files = {f"{style}/model.{suffix}" for style in TAKES for suffix in ("json", "npz")}
    assert {name for name in shipped if "__pycache__" not in name} == {"NOTICE", *TAKES, *files}
    for style in TAKES:
        about = json.loads((FOLDER / style / "model.json").read_text("utf-8"))
        assert all(take["name"].startswith("cmu") for take in about["build"]["takes"])


def test_notice_says_what_cmu_asks_for_and_goes_with_the_package() -> None:
    words = " ".join((FOLDER / "NOTICE").read_text("utf-8").split())
    assert "The data used in this project was obtained from mocap.cs.cmu.edu." in words
    assert "The database was created with funding from NSF EIA-0196217." in words
    for part in ("not be sold by itself", "Copyright (c) 2018 Yi_Zhou", "Not checked", "What was changed"):
        assert part in words
    project = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
    assert (FOLDER / "NOTICE").relative_to(ROOT).as_posix() in project["license-files"]
    assert "LicenseRef-CMU-Mocap" in project["license"]
    assert "banks/NOTICE" in (ROOT / "LICENSE").read_text("utf-8")


def test_puppets_know_their_bars_and_dance_any_dance() -> None:
    clips = puppets("waltz", clips=2, seconds=6.0)
    assert [clip.dance for clip in clips] == ["waltz", "waltz"]
    assert set(clips[0].beats.bar_places) == {0, 1, 2}
    assert Choreographer.of(clips).takes[0].meter == 3


def test_unknown_style_names_those_that_are_there() -> None:
    assert STYLES == ("salsa", "indian", "puppet")
    refused("unknown style 'polka'; there are salsa, indian, puppet", shipped_bank, "polka")


def song(bpm: float, seconds: float) -> tuple[Audio, BeatTrack]:
    """Music of which nothing but the beats is known."""
    beats = metronome(np.ones(int(seconds * bpm / 60)), period=60 / bpm, first=0.2, duration=seconds)
    return Audio(np.full(round(seconds * 1000), 1e-3), 1000.0), beats


def test_half_a_minute_of_salsa_is_a_dance_that_rests_on_the_beat() -> None:
    bank, (audio, beats) = shipped_bank(), song(100.0, 31.0)
    made = bank.choreograph(audio, beats, seconds=30.0, seed=0)
    judged = likeness(made.motion, limits=bank.limits)
    assert judged.passed, judged.verdict
    assert made.mean_seam_cm < 12
    assert rests_on_beat(made.motion, beats.span(0.0, 30.0)) > rests_on_beat(
        made.motion, beats.span(0.0, 30.0), late=0.5
    )


def test_same_seed_same_dance_and_another_song_another_dance() -> None:
    bank = shipped_bank()
    (audio, beats), other = song(100.0, 12.0), song(100.0, 12.0)[1]
    later_song = replace(other, times=other.times + 0.05)
    once, again, elsewhere = (bank.choreograph(audio, track, seed=3).motion for track in (beats, beats, later_song))
    np.testing.assert_array_equal(once.positions, again.positions)
    assert np.abs(once.positions - elsewhere.positions).max() > 0.1


def test_rests_are_told_from_half_a_beat_late(swinging_arm) -> None:
    motion = swinging_arm(1.0, 60.0, seconds=12.0)  # rests at 0.25, 0.75, ...
    music = metronome(np.ones(24), first=0.25, duration=12.0)
    assert rests_on_beat(motion, music) > 0.9
    assert rests_on_beat(motion, music, late=0.5) < 0
    np.testing.assert_allclose(later(music, 0.5).times[:3], [0.5, 1.0, 1.5])
    assert np.isnan(rests_on_beat(motion, music.select(music.times < 0.5)))


def test_banks_are_loaded_without_torch() -> None:
    code = (
        "import sys; from harmolab.systems.choreographer.banks import shipped_bank; shipped_bank()\n"
        "print('torch' in sys.modules, 'matplotlib' in sys.modules)"
    )
    shown = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert shown.split() == ["False", "False"]


@pytest.mark.data
@pytest.mark.slow
def test_salsa_may_be_shown(data_root: Path) -> None:
    names = ("W_3", "W_20", "C_4", "C_8", "R_4", "T_8")  # 86 to 128 beats a minute
    songs = [load_recording(data_root / "beatlocked" / f"DANCE_{name}").clip for name in names]
    bank, rows = shipped_bank("salsa"), []
    for clip in songs:
        beats = music_beats(clip)
        dances = [bank.choreograph(clip.audio, beats, seconds=LONGEST, seed=seed) for seed in (0, 1)]
        rows += [measured(made, beats, bank) for made in dances]
    table = pd.DataFrame(rows)
    mean = table.mean()
    assert len(table) == 12
    assert mean["likeness"] >= 11 / 12
    assert mean["seam"] <= 10.0 and table["worst seam"].max() <= 18.0
    assert mean["jerk ratio"] <= 1.0 and mean["foot_skating"] <= 0.15
    assert mean["rests"] >= 0.25 and mean["rests_late"] < 0.0


@pytest.mark.data
def test_the_shipped_salsa_is_what_its_takes_give(data_root: Path, tmp_path: Path) -> None:
    made = write_bank(shipped_takes(data_root / "free_dance", "salsa"), tmp_path, style="salsa")
    assert (tmp_path / "model.npz").stat().st_size == (FOLDER / "salsa" / "model.npz").stat().st_size
    shipped = shipped_bank("salsa")
    for take, other in zip(made.takes, shipped.takes, strict=True):
        np.testing.assert_allclose(take.motion.positions, other.motion.positions, atol=1e-9)
        assert take.name == other.name
    assert isinstance(shipped.limits, LikenessLimits)


def test_a_body_that_only_turns_and_travels_has_no_rests() -> None:
    motion = dance(1)
    body = np.repeat(motion.positions[:1], motion.n_frames, axis=0)
    moments = np.linspace(0.0, 9.0, motion.n_frames)[:, None]
    statue = replace(motion, positions=turned(body, moments) + 0.3 * moments[..., None])
    assert np.isnan(rests_on_beat(statue, metronome(np.ones(24), first=0.25, duration=12.0)))
