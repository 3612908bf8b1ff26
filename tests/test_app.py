"""The page of `harmolab app`: who is answered, how files come in, and that they are gone whatever ends it."""

import json
import os
import re
import resource
import signal
import socket
import struct
import subprocess
import sys
import time
from base64 import b64encode
from collections.abc import Callable, Iterator
from contextlib import closing
from dataclasses import replace
from http.client import HTTPConnection
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import numpy as np
import pytest

from harmolab import load_motion, synthetic_clip
from harmolab.cli import app
from harmolab.cli.app_work import work
from harmolab.cli.dancers import THREES
from harmolab.cli.retiming import WORSE
from harmolab.lab.app import LOCK, AppServer, Order, Teller, sweep, without_options
from harmolab.readers.bvh import save_bvh
from harmolab.readers.motion import save_motion
from harmolab.readers.video import write_video
from harmolab.types import Motion
from tests.builders import cases, complaint, planted_dance, refused, write_pair, write_song
from tests.phone_videos import Phone, film, filmed_part
from tests.test_labs_browser import PHONE, WIDE, at_address, closed
from tests.test_listening_presenting import ask
from tests.tiny_app import echo, placed

ENDINGS = {"dance": (".mp4", ".npz"), "song": (".wav", ".mp4")}


@pytest.fixture
def server() -> Iterator[AppServer]:
    server = AppServer(echo, ENDINGS, ("waltz", "rumba"))
    with server.running():
        yield server


def state(server: AppServer) -> dict[str, Any]:
    return json.loads(ask(server.address, "GET", path=f"{server.path}state")[1])


def order(server: AppServer, **content: object) -> tuple[int, str]:
    return ask(server.address, "POST", json.dumps(content))


def finished(server: AppServer, is_true: Callable[[dict[str, Any]], bool] = lambda now: not now["working"]) -> Any:
    """The state once it is that."""
    for _ in range(600):
        if is_true(now := state(server)):
            return now
        time.sleep(0.05)
    raise AssertionError(f"still {now}")


def after(server: AppServer, task: str, **words: str) -> dict[str, Any]:
    """The state once an order is done."""
    order(server, task=task, **words)
    return finished(server)


def put(server: AppServer, name: str, content: bytes = b"bytes", **options: object) -> tuple[int, str]:
    return ask(server.address, "PUT", content, path=f"{server.path}{name}", **options)


def kept(server: AppServer) -> list[str]:
    return sorted(path.name for path in server.folder.rglob("*") if path.is_file() and path.name != LOCK)


# Who is answered


def test_only_this_machine_is_answered_by_its_own_name_and_with_the_token(server: AppServer):
    parts = urlsplit(server.address)
    assert server._server.server_address[0] == "127.0.0.1"
    for host in ("evil.example", f"evil.example:{parts.port}", "127.0.0.1", f"192.168.1.7:{parts.port}", ""):
        assert ask(server.address, "GET", headers={"Host": host})[0] == 404
        assert put(server, "dance/x.mp4", headers={"Host": host})[0] == 404
    assert ask(server.address, "GET", headers={"Host": f"localhost:{parts.port}"})[0] == 200
    for path in ("/", "/state", "/dance/x.mp4", f"{parts.path[:-2]}/"):
        assert {ask(server.address, method, path=path)[0] for method in ("GET", "POST", "PUT")} == {404}
    assert kept(server) == []
    refused(rf"port {parts.port}: .*; choose another", AppServer, echo, ENDINGS, port=parts.port)


def test_page_asks_for_nothing_elsewhere(server: AppServer):
    status, page = ask(server.address, "GET")
    assert (status, "http" in page.replace(server.address, "")) == (200, False)
    assert "<option>waltz</option>" in page


# Files that come in


def test_a_file_takes_the_place_of_the_one_before_and_can_be_forgotten(server: AppServer):
    assert put(server, "dance/one.mp4") == put(server, "dance/my%20tw%C3%B6.MP4", b"more") == (200, "")
    assert put(server, "song/a.wav") == (200, "")
    assert state(server)["files"] == {"dance": "my twö.MP4", "song": "a.wav"}
    assert kept(server) == ["a.wav", "my twö.MP4"]
    assert order(server, task="forget", slot="song") == (200, "")
    assert kept(server) == ["my twö.MP4"]


@cases(
    "name, status, fault",
    ("dance/x.exe", 400, "x.exe: a dance ends in .mp4, .npz"),
    ("song/mp4", 400, "mp4: a song ends in .wav, .mp4"),
    ("song/.wav", 400, "a song ends in"),
    ("other/x.mp4", 404, "nothing here"),
    ("state", 404, "nothing here"),
)
def test_a_file_of_no_use_is_refused_in_a_sentence(server: AppServer, name: str, status: int, fault: str):
    answer = put(server, name)
    assert (answer[0], fault in answer[1]) == (status, True), answer
    assert kept(server) == []


@pytest.mark.parametrize("name", ["..%2F..%2Fx.mp4", "%2Fetc%2Fx.mp4", "a%00b.mp4", "%0A.mp4", "é" * 300 + ".mp4"])
def test_a_hostile_name_stays_in_the_folder(server: AppServer, name: str):
    assert put(server, f"dance/{name.replace('é', '%C3%A9')}") == (200, "")
    assert (len(kept(server)), len(list(server.folder.iterdir()))) == (1, 2)  # its folder, and the lock


def test_a_file_that_is_too_large_or_ends_too_early_leaves_nothing(server: AppServer):
    server.most_upload = 1000
    assert put(server, "dance/x.mp4", headers={"Content-Length": "1001"}) == (400, "at most 1000 bytes are taken")
    assert put(server, "dance/x.mp4", headers={"Content-Length": "-1"})[0] == 400
    with closing(HTTPConnection(*server._server.server_address, timeout=10)) as connection:
        connection.request("PUT", f"{server.path}dance/x.mp4", b"some", {"Content-Length": "900"})
        connection.sock.shutdown(1)  # no more comes
        reply = connection.getresponse()
        assert (reply.status, reply.read()) == (400, b"the file came in part only")
    assert [path.name for path in server.folder.iterdir()] == [LOCK]


def test_a_browser_that_breaks_off_prints_nothing(server: AppServer, capfd: pytest.CaptureFixture[str]):
    with socket.create_connection(server._server.server_address) as connection:
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))  # reset, not closed
    time.sleep(0.2)
    assert capfd.readouterr().err == ""


@pytest.mark.slow
def test_a_large_file_goes_to_the_disk_and_not_into_the_memory(server: AppServer, tmp_path: Path):
    size = 64 * 2**20
    with (tmp_path / "large").open("wb") as file:
        file.truncate(size)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with (tmp_path / "large").open("rb") as file:
        assert put(server, "dance/x.mp4", file, headers={"Content-Length": str(size)}) == (200, "")
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 16 * 2**10  # kilobytes, of both sides
    assert next(server.folder.rglob("x.mp4")).stat().st_size == size


# Orders


def test_an_order_is_done_and_its_lines_and_pages_are_shown(server: AppServer):
    put(server, "dance/x.mp4")
    assert order(server, task="judge", style="rumba", how="half time", offset="1.5") == (200, "")
    now = finished(server)
    assert (now["lines"], now["fault"], now["number"]) == (["x.mp4 rumba 1.5 half time", "more"], "", 1)
    assert now["offset"] == 1.5
    assert now["views"] == [{"kind": "page", "title": "Why", "name": "why.html", "address": "1/why.html"}]
    assert ask(server.address, "GET", path=f"{server.path}1/why.html") == (200, "because")
    for name in ("2/why.html", "1/other.html", "1/../1/why.html", "x.mp4"):
        assert ask(server.address, "GET", path=f"{server.path}{name}")[0] == 404
    put(server, "song/y.wav")  # where the dance begins in another song is not known, nor what was said true of it
    assert (state(server)["offset"], state(server)["lines"], state(server)["number"]) == (None, [], 0)


def test_a_dance_is_made_to_fit_where_the_last_verdict_found_it_and_not_where_it_was_said_to_be():
    server = AppServer(placed, ENDINGS)
    with server.running():
        for words, place in (({}, "3.0 False"), ({"offset": "1.5"}, "None True"), ({}, "3.0 False")):
            assert after(server, "judge", **words)["lines"] == [f"{words.get('offset')} True"]
            assert after(server, "fit")["lines"] == [place]


@pytest.mark.slow
def test_a_fault_or_the_end_of_the_worker_is_a_sentence_and_the_app_lives_on(server: AppServer):
    put(server, "dance/x.mp4")
    assert after(server, "fit")["fault"] == "x.mp4: cannot be read"
    assert after(server, "dance")["fault"].startswith("The work broke off")
    assert after(server, "judge")["lines"][0] == "x.mp4  None"


@pytest.mark.slow
def test_a_file_that_comes_in_after_work_has_begun_takes_nothing_from_it(server: AppServer):
    put(server, "dance/x.mp4")

    def chunks() -> Iterator[bytes]:
        yield b"half"
        order(server, task="judge", style="waltz")
        yield b"whole"

    refused("worked on", server.put, "dance/z.mp4", chunks())
    assert state(server)["files"]["dance"] == "x.mp4" and not list(server.folder.rglob("z.mp4"))
    order(server, task="stop")


@pytest.mark.slow
def test_work_can_be_stopped_and_nothing_else_begins_meanwhile(server: AppServer):
    order(server, task="judge", style="waltz")
    finished(server, lambda now: now["views"] != [])
    busy = (400, "Something is being worked on; wait, or stop it.")
    assert order(server, task="judge") == put(server, "dance/x.mp4") == busy
    assert after(server, "stop")["fault"] == "Stopped."
    assert after(server, "judge")["fault"] == ""


@cases(
    "content, fault",
    ({"task": "judge", "style": "../x"}, "../x: is no dance that is known"),
    ({"task": "judge", "style": "\ud800"}, "?: is no dance that is known"),
    ({"task": "judge", "how": "jump"}, "jump: is nothing that is done on a beat"),
    ({"task": "judge", "offset": "nan"}, "nan: seconds are a number"),
    ({"task": "judge", "offset": 10**400}, "000: seconds are a number"),
    ({"task": "judge", "offset": [1]}, "seconds are a number"),
    ({"task": "?"}, "there is no '?'"),
    ([], "orders come as a record"),
)
def test_an_order_of_no_sense_is_refused(server: AppServer, content: Any, fault: str):
    status, text = ask(server.address, "POST", json.dumps(content))
    assert (status, fault in text) == (400, True), text
    assert not state(server)["working"]


# The end


def test_the_button_that_closes_ends_it_and_the_folder_is_gone():
    server = AppServer(echo, ENDINGS)
    with server.running():
        put(server, "dance/x.mp4")
        assert server.folder.is_dir()
        order(server, task="close")
        assert server.finished.wait(10)
    assert not server.folder.exists()


def test_a_page_that_lives_keeps_its_files_when_another_one_starts(server: AppServer):
    put(server, "dance/x.mp4")
    sweep()
    assert kept(server) == ["x.mp4"]


@pytest.mark.slow
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
@pytest.mark.parametrize("is_group", [False, True])
def test_whatever_ends_the_command_the_files_are_gone(
    ending: signal.Signals, is_group: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a background job ignores it, and so would its children
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    environment = os.environ | {"TMPDIR": str(tmp_path)}
    words = [sys.executable, "-m", "harmolab.cli", "app", "--no-open"]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, env=environment, start_new_session=True) as app:
        address = app.stdout.readline().split()[1]
        assert ask(address, "PUT", b"0" * 5000, path=f"{urlsplit(address).path}dance/x.mp4")[0] == 200
        ask(address, "POST", json.dumps({"task": "judge"}))  # in the middle of work
        assert len(list(tmp_path.rglob("x.mp4"))) == 1
        (os.killpg if is_group else os.kill)(app.pid, ending)
    if ending == signal.SIGKILL and is_group:  # nobody is left to remove anything but the next page
        sweep()
    for _ in range(200):
        if left := list(tmp_path.glob("harmolab_app_*")):
            time.sleep(0.1)
    assert left == []


# In a browser


@pytest.fixture(scope="module")
def phone_video(tmp_path_factory: pytest.TempPathFactory) -> Path:
    motion, sound, _ = filmed_part(planted_dance("cha-cha", seconds=22.0, seed=1))
    return film(tmp_path_factory.mktemp("film") / "phone.mp4", motion, sound, Phone(height=240))


def dropped(page: Any, *paths: Path) -> None:
    """Drop files on the page, as from a folder on the desktop."""
    page.evaluate(
        """async files => {
          const transfer = new DataTransfer(), content = text => Uint8Array.from(atob(text), one => one.charCodeAt(0));
          for (const [name, text] of files) transfer.items.add(new File([content(text)], name));
          const options = { dataTransfer: transfer, bubbles: true, cancelable: true };
          document.body.dispatchEvent(new DragEvent("drop", options));
        }""",
        [[path.name, b64encode(path.read_bytes()).decode()] for path in paths],
    )


def waited(page: Any) -> None:
    page.wait_for_function("!document.querySelector('#judge').disabled", timeout=180_000)


@pytest.fixture
def real() -> Iterator[AppServer]:
    from harmolab.cli.labs import new_server

    server = new_server()
    with server.running():
        yield server


@pytest.mark.browser
@pytest.mark.slow
@pytest.mark.parametrize("viewport", [WIDE, PHONE])
def test_a_dropped_phone_video_becomes_a_verdict_a_player_and_a_lab(
    real: AppServer, phone_video: Path, viewport: dict[str, int], chromium: Any
):
    page = at_address(chromium, real.address, viewport)
    dropped(page, phone_video)
    page.wait_for_selector("#dance.full")
    page.keyboard.press("Tab")
    page.press("#judge", "Enter")
    page.get_by_role("status").filter(has_text="on the beat").wait_for(timeout=180_000)
    assert "on the beat" in page.inner_text(".verdict")
    waited(page)
    assert page.inner_text("#fault") == ""
    page.click("text=Sliders")
    lab = page.frame_locator("iframe[title=Sliders]")
    assert lab.locator(".sentence").inner_text() == page.inner_text(".verdict")
    lab.get_by_role("button", name="the paper's").click()
    before = lab.locator("code").inner_text()
    slider = lab.locator("input[type=range]").first
    for _ in range(10):
        slider.press("ArrowLeft")
    assert lab.locator("code").inner_text() != before
    page.click("text=Your video with its beats")
    page.wait_for_function("document.querySelector('video').readyState >= 2")
    page.evaluate("document.querySelector('video').play()")
    page.wait_for_function("document.querySelector('video').currentTime > 0.5")
    assert page.evaluate("document.documentElement.scrollWidth") <= viewport["width"]
    closed(page)


@pytest.mark.browser
@pytest.mark.slow
def test_a_movement_and_its_song_get_a_player_are_made_to_fit_and_wrong_files_a_sentence(
    real: AppServer, tmp_path: Path, chromium: Any
):
    song, dance = write_pair(tmp_path, planted_dance(seconds=16.0, fps=30.0))[:2]
    page = at_address(chromium, real.address)
    (tmp_path / "wrong.mp4").write_bytes(b"\xff\xd8\xff\xe0\0\x10JFIF\0" * 99)  # a photo
    dropped(page, tmp_path / "wrong.mp4")
    page.wait_for_selector("#dance.full")
    page.click("#judge")
    page.wait_for_selector("#fault:not(:empty)", timeout=60_000)
    assert re.match("wrong.mp4: cannot be read as video: .* kind of file, such as a photo", page.inner_text("#fault"))
    (tmp_path / "wrong.txt").write_text("x")
    dropped(page, tmp_path / "wrong.txt")
    assert re.match(r"wrong.txt: a song ends in \.wav.*; a dance in \.3gp, \.avi", page.inner_text("#fault"))
    dropped(page, tmp_path / "wrong.mp4", dance)
    fault = f"wrong.mp4, {dance.name}: several files for the dance; drop each on its own field."
    assert page.inner_text("#fault") == fault
    page.evaluate("document.querySelector('details.more').open = true")
    page.fill("#offset", "7")
    page.select_option("#how", "hit")
    dropped(page, song, tmp_path / "wrong.txt", dance)
    assert page.input_value("#offset") == page.input_value("#how") == ""  # they were said of another dance
    page.wait_for_selector("#song.full")
    waited(page)
    assert page.inner_text("#fault").startswith("wrong.txt: a song ends in .wav")
    page.click("#fit")
    page.wait_for_selector("#fault:has-text('it is not known yet')", timeout=60_000)
    page.select_option("#how", "rest")
    with page.expect_request(lambda request: request.method == "POST") as asked:
        page.click("#judge")
    assert asked.value.post_data_json["how"] == "rest"
    page.wait_for_selector(".verdict", timeout=60_000)
    waited(page)
    page.frame_locator("iframe[title=Player]").locator("#play").click()
    page.click("#fit")
    page.click("text=The movement", timeout=60_000)
    with page.expect_download() as download:
        page.click("text=Save dance_in_time.npz")
    assert np.load(download.value.path())["positions"].shape[0] > 100
    page.click("#invent")
    page.wait_for_function("one('step').textContent === 'drawing …' && one('share').value > 0.1", timeout=60_000)
    page.click("text=For Blender", timeout=60_000)
    with page.expect_download() as download:
        page.click(f"text=Save {song.stem}_dance.bvh")
    download.value.save_as(tmp_path / "invented.bvh")
    assert load_motion(tmp_path / "invented.bvh").duration > 15.0
    page.wait_for_selector("text=A video")
    assert page.inner_text(".verdict >> nth=0").startswith("Moves like recorded dancers")
    assert page.inner_text("h2 >> nth=1") == page.inner_text("#pair") == f"{dance.name} to {song.name}"
    page.reload()
    page.wait_for_selector("#song.full")
    with closing(page.context.new_page()) as tab:
        tab.goto(real.address)
        tab.wait_for_selector("#song.full")
    page.goto(real.address)  # a new visit, which begins empty
    finished(real, lambda now: now["files"] == {})
    closed(page)


def test_a_film_whose_movement_was_not_read_is_not_made_to_fit(tmp_path: Path):
    sway = np.int64(77 + 50 * np.sin(np.arange(300) / 6))
    frames = [np.pad(np.zeros((6, 6), np.uint8), ((40, 44), (at, 154 - at)), constant_values=250) for at in sway]
    write_video(tmp_path / "dot.mp4", frames, 15.0, audio=planted_dance("cha-cha", seconds=20.0).audio)
    refused("no sign of the beat", work, Order("fit", None, tmp_path / "dot.mp4", "", None, tmp_path), Teller(print))
    unplaced = Order("fit", tmp_path / "song.wav", tmp_path / "dot.mp4", "", None, tmp_path)
    refused('Ask "Am I in time\\?" first', work, unplaced, Teller(print))
    assert "no sign of the beat" in complaint(app, "retime", tmp_path / "dot.mp4", "--out", tmp_path / "x.mp4")
    assert [path.name for path in tmp_path.iterdir()] == ["dot.mp4"]


@pytest.mark.slow
def test_who_says_that_they_hit_the_beat_is_judged_by_that_and_bent_to_it(tmp_path: Path):
    files = write_pair(tmp_path, planted_dance(seconds=20.0, fps=30.0))[:2]
    near = "of the moments half way between beats now, and before near 0%."
    for task, words in (("judge", "for a hit on the beat"), ("fit", near)):
        said: list[dict[str, Any]] = []
        work(Order(task, *files, "cha-cha", 0.0, tmp_path, how="hit"), Teller(said.append))
        lines = next(one["lines"] for one in said if "lines" in one)
        assert any(words in line for line in lines) and "Judged as a cha-cha, as you said." not in lines, lines
    assert any(line.startswith("After: You are on the beat: you hit it") for line in lines), lines
    said.clear()
    work(Order("judge", *files, "tango", 0.0, tmp_path), Teller(said.append))
    text = " ".join(next(one["lines"] for one in said if "lines" in one))
    assert "judged as if no dance was named." in text and "as you said." in text and "Judged as a tango" not in text
    said.clear()
    work(Order("fit", *files, "", 0.0, tmp_path, has_start=False, how="hit"), Teller(said.append))
    assert "of the beats" in next(one["lines"][0] for one in said if "lines" in one)
    page = (tmp_path / "in_time.html").read_text("utf-8")
    music, rests = (json.loads(re.search(rf'"{name}": (\[.*?\])', page)[1]) for name in ("music", "visual"))
    beats = np.array([beat["time"] for beat in music[2:-2]])
    assert np.abs(beats[:, None] - rests).min(axis=1).max() < 0.1  # it shows what the line says


@pytest.mark.slow
def test_a_dance_that_has_no_music_at_both_ends_is_said_as_by_score(tmp_path: Path):
    clip = planted_dance(seconds=20.0, fps=30.0)
    song, positions = write_song(tmp_path / "song.wav", clip), np.tile(clip.motion.positions, (2, 1, 1))
    long = Motion(positions, 30.0, clip.motion.skeleton)
    save_motion(tmp_path / "long.npz", long)
    said: list[dict[str, Any]] = []
    work(Order("judge", song, tmp_path / "long.npz", "", -5.0, tmp_path), Teller(said.append))
    lines = next(one["lines"] for one in said if "lines" in one)
    assert "The dance begins 5.0 s before song.wav: a verdict counts minutes from the begin of the song." in lines
    ends = (
        "The music of song.wav ends 15.0 s before the dance does: only 20.0 s of the dance have music and are judged."
    )
    assert ends in lines, lines


@pytest.mark.slow
def test_what_was_guessed_of_a_file_of_movement_and_its_faults_are_said(tmp_path: Path):
    clip = planted_dance(seconds=20.0, fps=30.0)
    elbows, positions = (
        [clip.motion.skeleton.joints.index(f"elbow {side}") for side in "LR"],
        clip.motion.positions.copy(),
    )
    for some in (slice(100, 104), slice(300, 304)):
        positions[some, elbows] = positions[some, elbows[::-1]]
    save_bvh(tmp_path / "dance.bvh", replace(clip.motion, positions=positions))
    text = (tmp_path / "dance.bvh").read_text()
    (tmp_path / "dance.bvh").write_text(re.sub("Frame Time: .*", "Frame Time: 0.033", text))
    said: list[dict[str, Any]] = []
    song = write_song(tmp_path / "song.wav", clip)
    work(Order("judge", song, tmp_path / "dance.bvh", "", 0.0, tmp_path), Teller(said.append))
    lines = next(one["lines"] for one in said if "lines" in one)
    assert "Frame rate guessed: it is rounded." in lines, lines
    assert any(line.startswith("Joints jump, faster than 10 m/s in 4 frames") for line in lines), lines


@pytest.mark.slow
def test_sliders_of_the_first_minute_alone_are_called_so(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    files = write_pair(tmp_path, planted_dance(seconds=12.0, fps=30.0))[:2]
    for seconds, words in ((5.0, ", first minute"), (60.0, "")):
        for module in ("common", "app_work"):
            monkeypatch.setattr(sys.modules[f"harmolab.cli.{module}"], "OF_LAB", seconds)
        said: list[dict[str, Any]] = []
        work(Order("judge", *files, "", 0.0, tmp_path), Teller(said.append))
        assert f"Sliders{words}" in [one["view"]["title"] for one in said if "view" in one]
        assert f"<title>dance to song{words}: the scoring lab</title>" in (tmp_path / "lab.html").read_text("utf-8")


def test_what_bending_spoilt_is_said_and_no_place_that_was_found(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    files = write_pair(tmp_path, synthetic_clip("rumba", seconds=24.0, jitter=0.15, seed=3))[:2]
    monkeypatch.setattr("harmolab.cli.app_work.is_worse", lambda retimed: True)
    for has_start in (True, False):
        said: list[dict[str, Any]] = []
        work(Order("fit", *files, "", 0.0, tmp_path, has_start), Teller(said.append))
        lines = next(one["lines"] for one in said if "lines" in one)
        places = ["on the beat" in text for text in (*lines[3:5], (tmp_path / "in_time.html").read_text())]
        assert (lines[0], places) == (WORSE, [has_start] * 3), lines


def test_a_bent_movement_that_is_too_long_for_the_player_is_kept_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    for module in ("harmolab.lab.player_data", "harmolab.cli.app_work"):
        monkeypatch.setattr(f"{module}.LONGEST", 5.0)
    said: list[dict[str, Any]] = []
    files = write_pair(tmp_path, planted_dance())[:2]
    work(Order("fit", *files, "", 0.0, tmp_path), Teller(said.append))
    assert [one["view"]["title"] for one in said if "view" in one] == ["The movement"]


def test_a_page_that_is_left_out_is_said_and_each_step(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr("harmolab.lab.player_data.LONGEST", 5.0)
    said: list[dict[str, Any]] = []
    song = write_song(tmp_path / "song.wav", planted_dance())
    work(Order("dance", song, None, "", None, tmp_path), Teller(said.append))
    assert "the player shows 5 s at most" in next(one["lines"][-1] for one in said if "lines" in one)
    assert {"finding the beats", "dancing", "drawing"} <= {one.get("step") for one in said}


def test_sentences_of_the_page_name_no_options():
    said = "Say where the dance begins (--offset), what you mean (--how hit), or film it (with its song)."
    assert without_options("no sound; name its file, before the film or in its place") == "no sound; name its file"
    assert without_options(WORSE) == "The dance goes less well with the music than before: keep it as it was."
    assert without_options(THREES) == "the music seems to go in threes, so ballroom is danced"
    tapped = "Tap the beats of this song (`harmolab beats --tap`), and give them (--beats)."
    assert without_options(tapped) == "Tap the beats of this song (`harmolab beats --tap`)."
    assert without_options("76 are taken: leave it out, or say its beats (--beats).") == "76 are taken: leave it out."
    assert without_options(said) == "Say where the dance begins, what you mean, or film it (with its song)."
