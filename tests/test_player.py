"""The player's page: what it holds, what it refuses, and the command that writes it."""

import base64
import html
import io
import json
import re
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import soundfile

import harmolab
from harmolab.beats.visual import visual_beats
from harmolab.body.kinematics import resample_motion
from harmolab.cli import app
from harmolab.clips import load_clip
from harmolab.lab.player_data import HEIGHT, Dancer, Player, blind_page, coded_sound, of_dance, player_of
from harmolab.lab.report.templates import framed
from harmolab.params import HarmonyParams
from harmolab.readers.motion import save_motion
from harmolab.score import score_harmony
from harmolab.types import Audio, BeatTrack, Clip, Motion
from harmolab.verdict.judge import score_clip
from tests.builders import cases, complaint, done, planted_dance, refused, still, track, write_dance, write_song

VALLEYS = HarmonyParams.valleys()


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_dance()


SILENCE, UNHEARD = Audio(np.zeros(8000), 8000), track([])


def dancer_of(motion: Motion, name: str = "dancer", music: BeatTrack = UNHEARD) -> Dancer:
    return dancer_with(visual_beats(motion, params=VALLEYS), motion, music, name)


def dancer_with(visual: BeatTrack, motion: Motion, music: BeatTrack, name: str = "") -> Dancer:
    return Dancer(name, motion, score_harmony(music, visual, params=VALLEYS, n_rotations=0))


def page_of(clip: Clip, **options: Any) -> str:
    dancer = dancer_of(clip.motion, music=clip.beats)
    return Player(clip.audio, [dancer], music=clip.beats, title="a song", **options).page


def shown_of(*dancers: Dancer, music: BeatTrack = UNHEARD, audio: Audio = SILENCE) -> dict[str, Any]:
    """The data of a page with these dancers, to silence where no sound is given."""
    return data_of(Player(audio, dancers, music=music, title="").page)


def data_of(page: str) -> dict[str, Any]:
    return json.loads(re.search(r"^const data = (.*);$", page, flags=re.MULTILINE)[1])


def values_of(packed: dict[str, Any]) -> np.ndarray:
    numbers = np.frombuffer(base64.b64decode(packed["numbers"]), "<u2").reshape(-1, len(packed["low"]))
    return np.array(packed["low"]) + np.array(packed["step"]) * numbers


def positions_of(dancer: dict[str, Any]) -> np.ndarray:
    return values_of(dancer["positions"]).reshape(dancer["frames"], dancer["joints"], 3)


def sound_of(page: str) -> tuple[np.ndarray, int]:
    return soundfile.read(io.BytesIO(base64.b64decode(data_of(page)["sound"]["ogg"])))


def delay_of(heard: np.ndarray, given: np.ndarray) -> int:
    """Samples by which one sound comes later than another of its length."""
    lags = np.fft.irfft(np.fft.rfft(heard, 2 * given.size) * np.conj(np.fft.rfft(given, 2 * given.size)))
    lag = int(np.argmax(lags))
    return lag - lags.size if lag > given.size else lag


# What the page holds


def test_movement_is_the_motion_to_a_tenth_of_a_millimetre(clip: Clip) -> None:
    shown = data_of(page_of(clip))["dancers"][0]
    assert shown["fps"] == clip.motion.fps
    moved = positions_of(shown) - clip.motion.positions
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0, 0], moved.shape), atol=2e-4)  # put on the floor
    assert positions_of(shown)[..., 1].min() == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize(("given", "shown"), [(15.0, 30.0), (30.0, 30.0), (50.0, 50.0), (120.0, 60.0)])
def test_page_shows_between_thirty_and_sixty_frames_a_second(given: float, shown: float) -> None:
    assert shown_of(dancer_of(still(120, fps=given)))["dancers"][0]["fps"] == shown


def test_sound_is_where_it_was_and_the_same_sound_the_same_bytes(clip: Clip) -> None:
    samples, rate = sound_of(page_of(clip))
    given = clip.audio.samples
    assert (rate, samples.size) == (clip.audio.sample_rate, given.size)
    assert delay_of(samples, given) == 0
    assert np.corrcoef(samples, given)[0, 1] > 0.95
    assert coded_sound(clip.audio, 3.0) == coded_sound(clip.audio, 3.0)


@pytest.mark.parametrize("seconds", [1.0, 3.0])
def test_sound_is_cut_or_filled_to_the_longest_motion(seconds: float) -> None:
    dancers = [dancer_of(still(45, fps=30.0), "short"), dancer_of(still(60, fps=30.0), "long")]
    page = Player(Audio(np.full(round(8000 * seconds), 0.5), 8000), dancers, music=track([1.9, 3.9]), title="").page
    samples, rate = sound_of(page)
    assert samples.size == 2 * rate
    assert data_of(page)["duration"] == 2.0
    assert [beat["time"] for beat in data_of(page)["music"]] == [1.9]
    assert np.abs(samples[rate + 1000 :]).max() < 0.05 or seconds == 3.0


def test_planted_hit_and_miss_and_the_first_beat_of_a_bar() -> None:
    dancer = dancer_with(track([1.08, 2.12]), still(120, fps=30.0), track([1.0, 2.0]))
    late = dancer_with(track([1.2, 2.05]), still(120, fps=30.0), track([1.0, 2.0]), "late")
    shown = shown_of(dancer, late, music=track([1.0, 2.0], bar_places=[3, 0]))
    assert shown["dancers"][0]["marks"] == [{"time": 1.0, "met": 1.08}, {"time": 2.0, "met": None}]
    assert [mark["met"] for mark in shown["dancers"][1]["marks"]] == [None, 2.05]
    assert (shown["dancers"][0]["visual"], shown["delay"]) == ([1.08, 2.12], 0.1)
    assert [beat["first"] for beat in shown["music"]] == [False, True]


def test_speed_curve_is_that_of_the_visual_beats(swinging_arm: Callable[..., Motion]) -> None:
    dancer = dancer_of(swinging_arm(1.0, 30.0))
    speed = shown_of(dancer)["dancers"][0]["speed"]
    curve, rests = values_of(speed)[:, 0], dancer.score.visual.times
    inner = rests[(rests > 0.5) & (rests < 5.5)]
    valleys = 1 + np.flatnonzero((curve[1:-1] < curve[:-2]) & (curve[1:-1] <= curve[2:]))
    assert inner.size == 10
    assert all(np.abs(valleys / speed["fps"] - time).min() < 0.02 for time in inner)


def test_image_coordinates_hang_upright(clip: Clip) -> None:
    points = clip.motion.positions[..., :2] * [100.0, -100.0] + [320.0, 400.0]
    (shown,) = shown_of(dancer_of(Motion(points, clip.motion.fps, clip.motion.skeleton)))["dancers"]
    assert shown["flat"]
    height = np.ptp(points[..., 1])
    raised = positions_of(shown)[..., 1] - (points[..., 1].max() - points[..., 1])
    np.testing.assert_allclose(raised, np.full_like(raised, raised[0, 0]), atol=height / 5e4)
    assert 0 < raised[0, 0] < 0.1 * height
    np.testing.assert_array_equal(positions_of(shown)[..., 2], 0.0)


def test_thirty_seconds_fit_into_a_megabyte() -> None:
    clip = harmolab.synthetic_clip("cha-cha", seconds=30.0, seed=1)
    motion = resample_motion(clip.motion, 30.0)
    assert (motion.n_frames, len(motion.skeleton.joints)) == (900, 21)
    assert len(Player(clip.audio, [dancer_of(motion)], music=clip.beats, title="").page.encode()) <= 1_000_000


def test_page_asks_the_network_for_nothing_and_quotes_what_it_is_given(clip: Clip) -> None:
    bad = '</script><script>alert("1")</script>'
    dancers = [dancer_of(clip.motion, bad)]
    page = Player(clip.audio.span(0.0, 1.0), dancers, music=clip.beats, title=bad, facts={bad: bad}).page
    assert not re.search(r"https?:|src=|href=|@import|url\(", re.sub(r'"[A-Za-z0-9+/=]{200,}"', '""', page))
    assert (page.count("<script>alert"), page.count("<script>")) == (0, 1)


def test_facts_are_a_table(clip: Clip) -> None:
    assert '<tr><th scope="row">above chance</th><td>0.91</td></tr>' in page_of(clip, facts={"above chance": "0.91"})
    assert "<table>" not in page_of(clip)


# What it refuses


def test_crowds_hours_and_sounds_that_no_browser_plays_are_refused() -> None:
    short = still(30, fps=30.0)
    for count in (0, 3):
        refused(f"one dancer or two, got {count}", shown_of, *[dancer_of(short)] * count)
    refused("one dancer or two, got 3", blind_page, SILENCE, [short] * 3)
    refused("start must be a finite number of seconds, got nan", player_of, [planted_dance()], start=float("nan"))
    refused("nothing to show from 100 s on: the music ends at 6 s", player_of, [planted_dance()], start=100.0)
    refused(r"600 s at most, got 3600\.0 s; cut", shown_of, dancer_of(still(3600, fps=1.0)))
    for rate in (100, 384_000):
        refused(f"got {rate}; load it at 44100 Hz", shown_of, dancer_of(short), audio=Audio(np.zeros(rate), rate))


def test_two_frames_of_one_joint_are_enough() -> None:
    shown = shown_of(dancer_of(still(2, fps=30.0, joints=1)), audio=Audio(np.ones(1), 8000))
    np.testing.assert_allclose(positions_of(shown["dancers"][0]), 0.0, atol=1e-6)


# For raters


def test_blind_page_holds_the_movement_and_sound_of_the_page_and_nothing_that_tells(clip: Clip) -> None:
    page, open_page = blind_page(clip.audio, [clip.motion]), page_of(clip)
    data, known = data_of(page), data_of(open_page)
    drawn = {"flat", "front", "fps", "frames", "joints", "points", "parts", "hips", "shadow", "stature", "room", "size"}
    drawn |= {"aim", "lift", "positions", "way"}
    assert (set(data), set(data["dancers"][0])) == ({"duration", "sound", "look", "dancers"}, {"name", *drawn})
    assert {name: data["dancers"][0][name] for name in drawn} == {name: known["dancers"][0][name] for name in drawn}
    np.testing.assert_array_equal(sound_of(page)[0], sound_of(open_page)[0])


def test_source_of_the_blind_page_has_no_beat_time_and_no_word_for_one(clip: Clip) -> None:
    page, open_page = blind_page(clip.audio, [clip.motion] * 2), page_of(clip, facts={"harmony": "0.93"})
    assert [dancer["name"] for dancer in data_of(page)["dancers"]] == ["left", "right"]
    without_bulk = re.compile(r'"(numbers|ogg)": "[^"]*"')
    times = {beat["time"] for beat in data_of(open_page)["music"]} | set(data_of(open_page)["dancers"][0]["visual"])
    text, known = without_bulk.sub("", page), without_bulk.sub("", open_page)
    assert all(f"{time}" in known for time in times)
    assert [time for time in times if re.search(rf"(?<![\d.]){time}(?!\d)", text)] == []
    for word in ("beat", "hit", "miss", "met", "mark", "tick", "speed", "0.93", "a song", clip.name):
        assert re.search(rf"\b{word}s?\b", re.sub(r"<style>.*</style>", "", text, flags=re.DOTALL)) is None, word


def test_frame_holds_the_page_whatever_is_in_it() -> None:
    shown = framed('<p title="a">&amp;</p>', title='"x"', height=300)
    assert " allowfullscreen>" in shown, "without it the button of the player inside does nothing"
    assert html.unescape(re.search(r' srcdoc="([^"]*)"', shown)[1]) == '<p title="a">&amp;</p>'
    assert 'title="&quot;x&quot;"' in shown and "height: 300px" in shown


# In a notebook, as a file


def test_shown_in_a_frame_and_saved_whole(clip: Clip, tmp_path: Path) -> None:
    player = Player(clip.audio, [dancer_of(clip.motion)], music=clip.beats, title='"quoted"')
    assert framed(player.page, title='"quoted": player', height=HEIGHT) == player._repr_html_()
    with pytest.raises(IsADirectoryError, match=r"is a folder; name a file in it"):
        player.save(tmp_path)
    player.save(tmp_path / "x.html")
    assert (tmp_path / "x.html").read_text("utf-8") == player.page
    assert [file.name for file in tmp_path.iterdir()] == ["x.html"]


@pytest.mark.slow
def test_player_needs_no_widget_library() -> None:
    names = "{'ipywidgets', 'matplotlib', 'torch'}"
    code = f"import sys, harmolab.lab.player_data; print({names} & set(sys.modules) or '')"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == ""


# The command


def with_files(folder: Path, clip: Clip) -> Path:
    write_song(folder / "song.wav", clip)
    write_dance(folder / "dance.npz", clip)
    return folder


@pytest.fixture(scope="module")
def files(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """song.wav, dance.npz (60 frames per second) and other.npz (25)."""
    folder = with_files(tmp_path_factory.mktemp("files"), clip)
    save_motion(folder / "other.npz", resample_motion(clip.motion, 25.0))
    return folder


def played(folder: Path, out: Path, *options: object) -> str:
    """The page of the dance with these options."""
    result = done(app, "play", folder / "song.wav", folder / "dance.npz", *options, "--out", out)
    assert f"wrote {out}" in result.output.replace("\n", "")
    return out.read_text("utf-8")


def test_offset_and_start_cut_sound_and_motion_at_the_same_moment(files: Path, tmp_path: Path, clip: Clip) -> None:
    page = played(files, tmp_path / "x.html", "--offset", 0.5, "--start", 2.01, "--seconds", 2)
    skipped = 91  # the first frame at or after 1.51 s
    moved = positions_of(data_of(page)["dancers"][0]) - clip.motion.positions[skipped : skipped + 120]
    np.testing.assert_allclose(moved, np.broadcast_to(moved[0, 0], moved.shape), atol=2e-4)
    samples, rate = sound_of(page)
    begins = round((0.5 + skipped / 60) * rate)
    assert np.corrcoef(samples, clip.audio.samples[begins : begins + samples.size])[0, 1] > 0.95


def test_motion_that_starts_before_the_sound_is_cut(files: Path, tmp_path: Path) -> None:
    assert data_of(played(files, tmp_path / "x.html", "--offset", -1.0))["duration"] == pytest.approx(5.0)


def test_annotated_beats_are_taken(files: Path, tmp_path: Path) -> None:
    (tmp_path / "song.beats").write_text("1.0 1\n2.0 2\n3.0 3\n")
    data = data_of(played(files, tmp_path / "x.html", "--beats", tmp_path / "song.beats", "--start", 1.5))
    assert [beat["time"] for beat in data["music"]] == [0.5, 1.5]


def test_second_motion_keeps_the_frames_of_the_first(files: Path, tmp_path: Path) -> None:
    one, other = data_of(played(files, tmp_path / "x.html", "--other", files / "other.npz", "--start", 1))["dancers"]
    assert (one["name"], other["name"]) == ("dance", "other")
    assert one["fps"] == other["fps"] == 60
    count = min(one["frames"], other["frames"])
    apart = positions_of(one)[:count, :, [0, 2]] - positions_of(other)[:count, :, [0, 2]]
    assert np.median(np.abs(apart)) < 0.002


def number_of(dancer: dict[str, Any]) -> float:
    return float(dancer["number"]["harmony_above_chance"])


@pytest.fixture(scope="module")
def long_files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """song.wav and dance.npz of 20 s, enough beats for a number; late.npz is the dance from 2 s on and knows it."""
    clip = planted_dance(seconds=20.0, fps=30.0)
    folder = with_files(tmp_path_factory.mktemp("long"), clip)
    save_motion(folder / "dance.npz", clip.motion, offset=0.0)
    save_motion(folder / "late.npz", clip.motion.span(2.0, 18.0), offset=2.0)
    return folder


def test_page_says_level_and_verdict_beside_the_number(long_files: Path, tmp_path: Path) -> None:
    page = played(long_files, tmp_path / "x.html")
    scored = done(app, "score", long_files / "song.wav", long_files / "dance.npz", "--json").stdout
    score = json.loads(scored)["recommended"]
    number = {name: score[name] for name in ("harmony_above_chance", "level")} | {"verdict": of_dance(score["verdict"])}
    assert data_of(page)["dancers"][0]["number"] == number
    assert f"<td>4 of 4: {number['verdict']}" in page and number["verdict"].startswith("The dance is on the beat")
    assert f"<td>{score['harmony_above_chance']:.3f} (p in time = {score['p_time']:.3f})</td>" in page


def test_page_of_a_part_has_the_number_of_the_whole_dance(long_files: Path, tmp_path: Path) -> None:
    page = played(long_files, tmp_path / "x.html", "--start", 3, "--seconds", 6)
    whole = score_clip(load_clip(long_files / "song.wav", long_files / "dance.npz"))
    assert data_of(page)["duration"] == pytest.approx(6.0)
    assert "the whole dance, of which this is a part" in page
    assert "of which this is a part" not in played(long_files, tmp_path / "y.html")
    assert data_of(page)["dancers"][0]["number"]["verdict"] == of_dance(whole.judgement.verdict)
    assert number_of(data_of(page)["dancers"][0]) == pytest.approx(whole.harmony_above_chance, abs=1e-9)


def test_page_names_the_command_of_the_same_dance_as_a_video(long_files: Path, tmp_path: Path) -> None:
    page = html.unescape(played(long_files, tmp_path / "x.html", "--how", "half time", "--offset", 0.123456789))
    assert f"dance.npz --offset 0.123456789 --how 'half time' --out {tmp_path / 'x.mp4'}" in page
    page = played(long_files, tmp_path / "x.html", "--other", long_files / "late.npz")  # which begins at 2 s
    assert "dance.npz --offset 0 --start 2 --out" in page
    dance, song = tmp_path / "dance.npy", long_files / "song.wav"  # nothing tells when it begins, nor its rate
    np.save(dance, planted_dance(seconds=20.0).motion.positions)
    done(app, "play", song, dance, "--fps", 60, "--start", 1, "--out", tmp_path / "y.html")
    assert "dance.npy --start 1 --fps 60 --out" in (tmp_path / "y.html").read_text("utf-8")


def test_a_second_dance_has_a_song_time_of_its_own(long_files: Path, tmp_path: Path) -> None:
    command = (long_files, tmp_path / "x.html", "--other", long_files / "late.npz", "--how", "rest", "--other-offset")
    data = data_of(played(*command[:-1]))
    one, other = data["dancers"]
    assert data["duration"] == pytest.approx(18.0)
    np.testing.assert_allclose(positions_of(one)[:500, :, 1], positions_of(other)[:500, :, 1], atol=2e-3)
    assert number_of(one) == pytest.approx(number_of(other), abs=1e-9)
    assert data_of(played(*command, 2))["dancers"] == data["dancers"]
    assert number_of(data_of(played(*command, 2.12))["dancers"][1]) < number_of(other) - 0.2


def test_two_dances_of_one_name_have_two_verdicts(clip: Clip) -> None:
    dances = [replace(clip, name="take"), replace(clip, name="take", motion=still(360, fps=60.0))]
    levels = re.findall(r'<th scope="row">take, (\w+): level</th><td>(\d of 4: .*?)</td>', player_of(dances).page)
    assert [side for side, _ in levels] == ["left", "right"] and levels[0][1] != levels[1][1]


@pytest.mark.parametrize("is_before", [False, True], ids=["after the song", "before it"])
def test_two_dances_whose_frames_lie_between_each_others_keep_their_moments(is_before: bool) -> None:
    whole = planted_dance(seconds=20.0, fps=30.0)
    song = whole.span(16 / 30, 19.0) if is_before else whole
    slow = replace(song, motion=Motion(song.motion.positions[::2], 15.0, song.motion.skeleton))
    part, begin = (whole.motion, -16 / 30) if is_before else (whole.motion.span(16 / 30, 19.0), 16 / 30)
    later = replace(song, motion=part, offset=begin + 0.007)
    data = data_of(player_of([slow, later]).page)
    one, other = (np.array(dancer["visual"][1:20]) for dancer in data["dancers"])
    assert other - one == pytest.approx(0.007, abs=0.015)
    marks = [[mark["time"] for mark in dancer["marks"]][:20] for dancer in data["dancers"]]
    salient = [beat["time"] for beat in data["music"] if beat["salient"]][:20]
    assert marks[0] == marks[1] == salient != []


def test_a_second_dance_at_another_rate_keeps_its_own_number(long_files: Path, files: Path, tmp_path: Path) -> None:
    save_motion(tmp_path / "slow.npz", resample_motion(planted_dance(seconds=20.0, fps=30.0).motion, 20.0))
    page = played(long_files, tmp_path / "x.html", "--other", tmp_path / "slow.npz")
    own = score_clip(load_clip(long_files / "song.wav", tmp_path / "slow.npz", offset=0.0))  # where the first begins
    assert number_of(data_of(page)["dancers"][1]) == pytest.approx(own.harmony_above_chance, abs=1e-9)


@cases(
    "options, out, fault",
    ((), "x.avi", "x.avi: a dance with its music is written as .html, .htm, .mp4, .webm, .gif; choose a name"),
    ((), "none/x.html", "none: no such folder"),
    (("--start", 60), "x.html", "nothing to show from 60 s on"),
    (("--offset", 60), "x.html", "song.wav"),
    (("--seconds", -1), "x.html", "seconds must be positive and finite, got -1"),
    (("--seconds", "inf"), "x.html", "--seconds must be a finite number, got inf"),
    (("--start", "nan"), "x.html", "--start must be a finite number, got nan"),
    (("--start", -3), "x.html", "seconds, got -3; the music begins at 0"),
    (("--dance", "polka"), "x.html", "polka"),
    (("--other", "nowhere.npz"), "x.html", "nowhere.npz: no such file"),
)
def test_what_cannot_be_done_is_one_line_and_no_file(
    files: Path, tmp_path: Path, options: tuple[object, ...], out: str, fault: str
) -> None:
    command = ("play", files / "song.wav", files / "dance.npz", "--out", tmp_path / out, *options)
    assert fault in complaint(app, *command)
    assert list(tmp_path.iterdir()) == []
