"""Your own dance: where it begins, what is told, and the page."""

import html
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from harmolab.data.synthetic import synthetic_clip, synthetic_motion
from harmolab.lab.explain import performance as own
from harmolab.lab.explain.page import dance_page, dance_player, save_page
from harmolab.lab.explain.performance import OwnDance, Placement, load_performance
from harmolab.lab.player_data import of_dance
from harmolab.lab.render.stick import render_skeleton
from harmolab.params import HOW_PATTERNS, HarmonyParams
from harmolab.readers.audio import load_sound
from harmolab.readers.motion import save_motion
from harmolab.readers.video import write_video
from harmolab.types import Audio, Clip, Motion
from tests.builders import planted_dance, refused, write_song
from tests.test_labs_browser import at_address, closed

SECONDS, START = 20.0, 0.4
RESTING = HarmonyParams.recommended(HOW_PATTERNS["rest"])


@pytest.fixture(scope="module")
def clip() -> Clip:
    return planted_dance(seconds=SECONDS)


def danced(clip: Clip, late: Callable[[np.ndarray], np.ndarray]) -> Motion:
    """The dance from 0.4 s on, its movements late by `late(beats)`."""
    beats = clip.beats.times + late(clip.beats.times)
    return synthetic_motion(beats, seconds=SECONDS, fps=60.0, dance="cha-cha", seed=1).span(START, SECONDS - START)


@pytest.fixture(scope="module")
def folder(clip: Clip, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A song; a dance 80 ms late in its second half, as motion, as video with the song's sound, and as silent video."""
    folder = tmp_path_factory.mktemp("own")
    write_song(folder / "song.wav", clip)
    (folder / "s.beats").write_text("\n".join(f"{time:.6f}" for time in clip.beats.times))
    motion = danced(clip, lambda beats: 0.08 * (beats > SECONDS / 2 + START / 2))
    save_motion(folder / "dance.npz", motion)
    heard = clip.audio.span(START, SECONDS - START)
    noise = np.random.default_rng(0).normal(0, 0.02, heard.samples.size)
    room = Audio(0.3 * heard.samples + noise, heard.sample_rate)
    for name, sound in (("film.mp4", room), ("silent.mp4", None)):
        write_video(folder / name, render_skeleton(motion, fps=25.0, height=96), 25.0, audio=sound)
    return folder


def told_of(folder: Path, name: str | Path, **more: Any) -> OwnDance:
    """The dance beside its song, whose beats are annotated, so that planted times are exact; rests were told."""
    settings = {"beats": folder / "s.beats", "params": RESTING} | more
    return own.explain_performance(folder / "song.wav", load_performance(folder / name), **settings)


@pytest.fixture(scope="module")
def late(folder: Path) -> OwnDance:
    return told_of(folder, "dance.npz", offset=START)


@pytest.fixture(scope="module")
def page(late: OwnDance) -> str:
    return dance_page(late)


@pytest.fixture(scope="module")
def filmed(folder: Path) -> OwnDance:
    return told_of(folder, "film.mp4")


@pytest.fixture(scope="module")
def film_page(filmed: OwnDance) -> str:
    return dance_page(filmed)


def change_of(dance: OwnDance) -> float:
    return next(finding.value for finding in dance.words.findings if finding.kind == "change")


def test_known_offset_tells_what_was_planted(late: OwnDance):
    assert change_of(late) == pytest.approx(0.08, abs=0.015)
    assert [half.mean for half in late.words.halves] == pytest.approx([0.0, 0.08], abs=0.015)
    assert re.match(r"You are on the beat: you rest on it \(\d\d ms late\)\.", late.verdict) and late.is_together


def test_offset_found_by_movement_says_nothing_about_the_place_in_the_beat(folder: Path, clip: Clip):
    told = told_of(folder, "dance.npz")
    period = float(np.diff(clip.beats.times).mean())
    assert (told.placement.source, told.placement.period) == ("movement", pytest.approx(period, abs=0.01))
    # The lateness of one half is shared out between both: 40 ms.
    assert (told.placement.seconds - START + 0.04 + period / 2) % period == pytest.approx(period / 2, abs=0.02)
    assert told.verdict.startswith("You are in time with this song. Where in its beat you dance cannot be told")
    assert [finding.kind for finding in told.words.findings] == ["tempo", "rate", "change"]
    assert change_of(told) == pytest.approx(0.08, abs=0.015) and "; which beat is not known" in str(told.placement)
    plain = told.to_dict()
    assert {plain[name] for name in ("harmony_above_chance", "p_place", "lag_s", "interval")} == {None}
    assert plain["p_time"] <= 0.05


@pytest.mark.parametrize(
    ("shift", "words"),
    [(0.1, "ms late for a rest on the beat"), (-0.1, "ms early for a rest on the beat"), (0.0, "You are on the beat")],
)
def test_a_shift_is_told_only_with_a_known_offset(folder: Path, clip: Clip, tmp_path: Path, shift: float, words: str):
    save_motion(tmp_path / "shifted.npz", danced(clip, lambda beats: np.full(beats.shape, shift)))
    assert words in told_of(folder, tmp_path / "shifted.npz", offset=START).verdict
    unplaced = told_of(folder, tmp_path / "shifted.npz")
    assert re.search(r"\b(ms|early|late)\b", " ".join([unplaced.verdict, *unplaced.words.sentences])) is None


def test_a_motion_file_that_keeps_its_song_time_needs_no_offset(folder: Path, clip: Clip, tmp_path: Path):
    save_motion(tmp_path / "kept.npz", danced(clip, lambda beats: np.zeros(beats.shape)), offset=START)
    kept = told_of(folder, tmp_path / "kept.npz", guess=5.0)  # notebook 13 always has a guess, for what says nothing
    assert kept.placement == Placement(START, "folder")
    assert str(kept.placement) == "Your dance begins at 0.40 s of the song, as its recording says."
    assert kept.verdict.startswith("You are on the beat")


def test_a_place_of_which_others_fit_as_well_is_one_where_the_dance_may_begin():
    places = (Placement(9.0, "sound", repeats=True), Placement(9.0, "movement", 0.5, 0.8))
    assert all(str(place).startswith("Your dance may begin at 9.00 s of the song") for place in places)
    sure = (Placement(9.0, "sound"), Placement(9.0, "movement", 0.5, 0.97))
    assert all(str(place).startswith("Your dance begins at 9.00 s of the song") for place in sure)
    assert str(Placement(-9.0, "sound")).startswith("Your dance begins 9.00 s before the song: found by")


def test_dance_to_no_beat_is_given_no_timing(folder: Path, clip: Clip, tmp_path: Path):
    times = np.sort(np.random.default_rng(3).uniform(0, SECONDS, len(clip.beats)))
    save_motion(tmp_path / "lost.npz", synthetic_motion(times, seconds=SECONDS, fps=60.0, dance="cha-cha", seed=1))
    told = told_of(folder, tmp_path / "lost.npz", offset=0.0)
    assert not told.is_together and told.verdict.startswith("No sign that you follow this beat.")


@pytest.mark.slow
def test_sound_of_a_video_tells_its_offset_outright(filmed: OwnDance):
    assert (filmed.placement.source, filmed.placement.seconds) == ("sound", pytest.approx(START, abs=0.01))
    assert [half.mean for half in filmed.words.halves] == pytest.approx([0.0, 0.08], abs=0.03)


@pytest.mark.slow
def test_a_film_is_read_in_both_ways_and_says_what_was_not(folder: Path):
    rows = own.film_readings(folder / "song.wav", folder / "film.mp4", beats=folder / "s.beats")
    assert list(rows.index) == [own.BODY, own.FLOW] and rows.loc[own.BODY].tolist() == [own.ABSENT, "", ""]
    assert rows.loc[own.FLOW, "verdict"] == told_of(folder, "film.mp4", params=None).verdict
    assert rows.loc[own.FLOW, "how sure"].startswith("How sure: ")
    unread = own.film_readings(folder / "song.wav", folder / "film.mp4", beats=folder / "s.beats", offset=900.0)
    assert "does not overlap" in unread.loc[own.FLOW, "verdict"]


@pytest.mark.slow
def test_video_without_sound_or_with_another_song_is_placed_by_its_movement(folder: Path, clip: Clip):
    silent, film = (load_performance(folder / name) for name in ("silent.mp4", "film.mp4"))
    assert silent.sound is None
    for recording, song in ((silent, clip), (film, synthetic_clip("waltz", seconds=SECONDS, seed=9))):
        assert own.place_performance(recording, song.audio, song.beats).source == "movement"
    assert not own.explain_performance(folder / "song.wav", silent, params=RESTING).clip.has_start


@pytest.mark.slow
def test_video_can_be_its_own_song(folder: Path):
    own_song = own.explain_performance(folder / "film.mp4", load_performance(folder / "film.mp4"), params=RESTING)
    assert own_song.placement == Placement(0.0, "same")
    first, second = (part.mean for part in own_song.words.halves)
    assert second - first == pytest.approx(0.08, abs=0.03)


def test_dance_that_begins_before_the_song_is_heard_from_the_first_note(folder: Path, clip: Clip):
    told = told_of(folder, "dance.npz", offset=-3.0)
    assert told.skipped == pytest.approx(3.0) and told.motion.duration == pytest.approx(SECONDS - START - 3.0, abs=0.02)
    np.testing.assert_allclose(told.audio.samples, load_sound(folder / "song.wav").samples[: told.audio.samples.size])


def test_offset_outside_the_song_is_refused_by_name(folder: Path):
    refused(r"dance\.npz: .*does not overlap", told_of, folder, "dance.npz", offset=500.0)
    refused("a performance is needed, got str", own.explain_performance, folder / "song.wav", "dance.npz")


def test_numbers_are_plain_enough_for_json(late: OwnDance):
    plain = late.to_dict()
    assert (plain["verdict"], plain["offset"]["source"]) == (late.verdict, "given")
    assert plain["interval"][0] < plain["harmony_above_chance"] < plain["interval"][1]
    assert [finding["kind"] for finding in plain["findings"]] == ["score", "tempo", "rate", "lag", "change", "hits"]
    assert (plain["level"], plain["lag_s"]) == (4, late.judgement.lag_s)


# The page


def test_page_holds_verdict_words_pictures_player_and_doubts(late: OwnDance, page: str):
    text = html.unescape(page)
    assert late.verdict in text
    assert all(sentence in text for sentence in late.words.sentences)
    assert page.count("data:image/png;base64,") == 2
    inside = html.unescape(re.search(r' srcdoc="([^"]*)"', page)[1])
    # The sound's stream has a random number, so two players differ there.
    assert inside[:1000] == dance_player(late).page[:1000]
    assert "harmolabPlayer" in inside and "What may be wrong" in page
    assert "0.40 s of the song, as you said" in text


@pytest.mark.slow
def test_page_of_a_dance_that_is_named_shows_how_well_each_beat_fits_it(folder: Path):
    dances = [told_of(folder, "dance.npz", offset=offset, dance="cha-cha") for offset in (START, None)]
    assert all(of_dance(dance.verdict) in html.unescape(dance_player(dance).page) for dance in dances)
    page, unplaced = (html.unescape(dance_page(dance)) for dance in dances)
    assert "1 is the best moment, 0.5 the middle one" in page and "nearest moment of rest" not in page
    assert "nearest moment of rest" in unplaced and "by its bars" in page and "by its bars" not in unplaced


@pytest.mark.slow
def test_page_asks_the_network_for_nothing(page: str, film_page: str):
    for text in (page, film_page):
        assert not re.search(r"https?:|<script|<link|@import|url\(", re.sub(r' srcdoc="[^"]*"', "", text))


@pytest.mark.slow
def test_page_of_a_video_shows_pictures_at_beats_and_says_why_no_figure(filmed: OwnDance, film_page: str):
    assert film_page.count("data:image/jpeg;base64,") == 8
    assert "srcdoc" not in film_page and "there is no stick figure to play" in film_page and "Joints" not in film_page
    refused(r"film\.mp4: is a video", dance_player, filmed)


@pytest.mark.slow
def test_page_of_a_video_in_which_a_body_was_found_plays_it(late: OwnDance, filmed: OwnDance):
    video = replace(late.performance, path=filmed.performance.path, is_video=True)
    page = dance_page(replace(late, performance=video))
    assert "srcdoc" in page and "The movement is that of the body which was found" in page
    assert "optical flow" not in page and "everything that moves counts" not in page


def test_names_of_files_are_only_text(late: OwnDance):
    name = "<img src=x onerror=alert(1)>\"'&amp;.npz"
    page = dance_page(replace(late, performance=replace(late.performance, path=Path(name))))
    assert "<img src=x" not in page
    assert f"<h1>{html.escape(name).replace('&quot;', '&#34;').replace('&#x27;', '&#39;')} to song.wav</h1>" in page


def test_failed_page_leaves_the_old_one(late: OwnDance, tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    path = tmp_path / "page.html"
    path.write_text("old")

    def fail(*_args: object, **_named: object) -> None:
        raise OSError("disk full")

    monkeypatch.setattr("harmolab.lab.explain.page.dance_page", lambda dance: "new")
    monkeypatch.setattr(Path, "replace", fail)
    with pytest.raises(OSError, match="disk full"):
        save_page(path, late)
    assert path.read_text() == "old"
    assert [file.name for file in tmp_path.iterdir()] == ["page.html"]


@pytest.mark.browser
@pytest.mark.parametrize("width", [1280, 390])
def test_page_fits_the_screen_and_plays(late: OwnDance, chromium: Any, tmp_path: Path, width: int):
    save_page(tmp_path / "page.html", late)
    page = at_address(chromium, (tmp_path / "page.html").as_uri(), {"width": width, "height": 900})
    page.locator("iframe").scroll_into_view_if_needed()
    page.frame_locator("iframe").locator("#play").click()
    page.wait_for_function("document.querySelector('iframe').contentWindow.harmolabPlayer.time() > 0.3")
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator("figure img").first.evaluate("image => image.naturalWidth > 0")
    assert not page.is_visible("details p")
    page.emulate_media(media="print")
    assert page.is_visible("details p")
    closed(page)
