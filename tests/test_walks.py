"""How far a call walks: passes between the rooms of the house, and how often the costly steps are taken."""

import builtins
import inspect
import sys
from collections.abc import Callable
from functools import partial
from itertools import combinations, pairwise
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np
import pytest

import harmolab
from harmolab import clips
from harmolab.beats import audio as beats_of_sound
from harmolab.beats import visual
from harmolab.cli import app
from harmolab.params import HarmonyParams
from harmolab.readers import audio as sound_files
from harmolab.systems.choreographer import banks
from tests.builders import cases, done, planted_dance, write_dance, write_song

HOUSE = Path(harmolab.__file__).parent


def room(frame: FrameType) -> str | None:
    """The top-level entry of harmolab/ that a function stands in; None for other code, lambdas and comprehensions."""
    path = Path(frame.f_code.co_filename)
    if frame.f_code.co_name.startswith("<") or not path.is_relative_to(HOUSE):
        return None
    return path.relative_to(HOUSE).parts[0].removesuffix(".py")


def passes(call: Callable[[], object]) -> int:
    """How often execution goes from one room to another during a call; generators count each time they go on."""
    rooms: list[str] = []

    def note(frame: FrameType, event: str, _: object) -> None:
        if event == "call" and (name := room(frame)) is not None:
            rooms.append(name)

    sys.setprofile(note)
    try:
        call()
    finally:
        sys.setprofile(None)
    assert len(set(rooms)) > 2, "the call never walked through the house"
    return sum(left != right for left, right in pairwise(rooms))


def warm_passes(call: Callable[[], object]) -> int:
    """The passes of a second call in this process, when all is imported and compiled."""
    call()
    banks._bank.cache_clear()  # its movement is measured once
    return passes(call)


@pytest.fixture
def song(tmp_path: Path) -> Path:
    return write_song(tmp_path / "song.wav", planted_dance())


@pytest.fixture
def bvh(tmp_path: Path) -> Path:
    return write_dance(tmp_path / "dance.bvh", planted_dance())


succeed = partial(done, app)


def test_passes_are_counted_between_rooms_and_not_within_one():
    clip = planted_dance()
    assert clip.motion is not None
    curve = partial(visual.motion_curve, clip.motion, HarmonyParams.paper())
    curve()

    def walk() -> None:
        curve()
        curve()
        HarmonyParams.paper()
        curve()
        len(planted_beats)

    planted_beats = visual.visual_beats(clip.motion)
    assert passes(walk) == 3  # beats, params, beats, types


def test_a_score_walks_at_most_eighty_five_passes(song: Path, bvh: Path):
    # Two modes; the recommended one walks through the shape of the body, its tests and its words.
    assert warm_passes(lambda: succeed("score", song, bvh, "--offset", 0)) <= 85


def most(recordings: int) -> int:
    """Passes of a dance made of so many recordings."""
    return 175 + 25 * recordings


@pytest.mark.slow
def test_a_dance_made_of_recordings_walks_twenty_five_more_for_each_of_them(song: Path, tmp_path: Path):
    steps = warm_passes(lambda: succeed("dance", song, "--seconds", 3, "-q", "--out", tmp_path / "dance.npz"))
    assert steps <= most(len(banks.shipped_bank("salsa").takes))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::UserWarning")
def test_a_corrected_dance_with_its_video_walks_seventy_five_more(song: Path, tmp_path: Path):
    out, recordings = tmp_path / "dance.mp4", len(banks.shipped_bank("salsa").takes)
    words = ("dance", song, "--system", "harmogan", "--seconds", 3, "-q", "--out", out)
    assert warm_passes(lambda: succeed(*words)) <= most(recordings) + 75
    assert out.is_file()


class Calls(list[dict[str, Any]]):
    """The arguments by name of every call of one function, wherever it was imported to."""

    def __init__(self, patch: pytest.MonkeyPatch, function: Callable[..., Any]) -> None:
        signature = inspect.signature(function)

        def counting(*arguments: object, **options: object) -> Any:
            self.append(signature.bind(*arguments, **options).arguments)
            return function(*arguments, **options)

        for name, module in list(sys.modules.items()):
            if name.startswith("harmolab") and vars(module).get(function.__name__) is function:
                patch.setattr(module, function.__name__, counting)


@pytest.mark.slow
@cases("command, ending", ("score", ""), ("play", "html"), ("play", "mp4"), ("retime", "mp4"))
def test_a_command_decodes_the_song_and_finds_its_beats_once(
    song: Path, bvh: Path, monkeypatch: pytest.MonkeyPatch, command: str, ending: str
):
    decoded, tracked = (Calls(monkeypatch, one) for one in (sound_files.load_audio, beats_of_sound.audio_beats))
    succeed(command, song, bvh, *(["--out", song.with_suffix(f".{ending}")] if ending else []))
    assert [Path(call["path"]) for call in decoded] == [song]
    assert len(tracked) == 1


@pytest.mark.parametrize("arguments", [(), ("--others", "--plot", "score.png")])
def test_curves_are_computed_once(song: Path, bvh: Path, arguments: tuple[str, ...], monkeypatch: pytest.MonkeyPatch):
    monkeypatch.chdir(song.parent)
    computed = Calls(monkeypatch, visual._motion_curve)
    succeed("score", song, bvh, *arguments)
    curves = [visual.motion_curve(call["motion"], call["params"])[0] for call in computed]
    assert len(computed) >= 2  # the two modes read two curves
    assert not any(np.array_equal(one, other) for one, other in combinations(curves, 2))


@pytest.mark.parametrize("others", [False, True])
def test_mir_eval_is_imported_only_for_its_rows(song: Path, bvh: Path, others: bool, monkeypatch: pytest.MonkeyPatch):
    imported: list[str] = []
    plain = builtins.__import__

    def noting(name: str, *arguments: Any, **options: Any) -> Any:
        imported.append(name.partition(".")[0])
        return plain(name, *arguments, **options)

    monkeypatch.setattr(builtins, "__import__", noting)
    succeed("score", song, bvh, *(["--others"] if others else []))
    assert ("mir_eval" in imported) == others


@pytest.mark.slow
@pytest.mark.parametrize("ending", ["mp4", "html"])
def test_a_dance_decodes_the_song_once_and_scores_each_dance_once_a_mode(
    song: Path, tmp_path: Path, ending: str, monkeypatch: pytest.MonkeyPatch
):
    from harmolab.verdict.judge import score_motion

    succeed("dance", song, "--seconds", 2.5, "--out", tmp_path / "first.npz")  # all modules are there to be counted in
    decoded, tracked, scored = (
        Calls(monkeypatch, one) for one in (sound_files.load_audio, beats_of_sound.audio_beats, score_motion)
    )
    succeed("dance", song, "--seconds", 2.5, "--samples", 2, "--out", tmp_path / f"dance.{ending}")
    assert (len(decoded), len(tracked)) == (1, 1)
    # By our score; and for the table of a page by the paper's, and rests of the body on the beat and half a beat late.
    has_table = ending == "html"
    assert [call["params"].detector for call in scored].count("turns") == 2 * has_table
    assert len(scored) == 2 * (4 if has_table else 1)


def test_beats_are_tracked_in_the_same_sound_whatever_rate_the_clip_keeps(song: Path):
    own = clips.load_sound(song, sample_rate=None)
    assert np.array_equal(clips.tracked_sound(song, own).samples, clips.load_sound(song).samples)
