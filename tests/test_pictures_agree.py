"""Every picture and page of a score shows the score's own pairs, whatever the settings."""

import json
import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from harmolab.lab.figures.beats import draw_timing, score_figure
from harmolab.lab.labs.live import Stage
from harmolab.lab.labs.scoring import scoring_numbers
from harmolab.lab.player import Dancer, Player
from harmolab.lab.render.stick import hit_times
from harmolab.params import CHOICES, HarmonyParams
from harmolab.score import HarmonyScore
from harmolab.types import Audio, BeatTrack, Motion
from harmolab.verdict.judge import music_and_motion, score_motion
from tests.builders import planted_dance
from tests.notebook_cells import notebook_cells

CELLS = notebook_cells("11_frame_by_frame")
MODES = {"paper": HarmonyParams.paper(), "valleys": HarmonyParams.valleys(), "recommended": HarmonyParams.recommended()}
FEW, ALL = 20, 200  # sets of settings in a quick run and in a whole one


def settings(rng: np.random.Generator) -> tuple[str, dict[str, object]]:
    """A mode, and what the lab's controls may change about it."""
    return str(rng.choice(list(MODES))), {
        "lag": round(float(rng.uniform(-0.3, 0.3)), 3),
        "matching": str(rng.choice(CHOICES["matching"])),
        "reaction_delay": round(float(rng.uniform(0.03, 0.3)), 3),
        "detector": str(rng.choice(CHOICES["detector"])),
    }


@pytest.fixture(scope="module")
def dance() -> tuple[BeatTrack, Motion]:
    """A dancer who begins a fifth of a second late, so that hits depend on lag and delay."""
    clip = planted_dance("cha-cha", seconds=7.0, fps=30.0, seed=4)
    return music_and_motion(replace(clip, offset=clip.offset + 0.2, motion=clip.motion.span(0.0, 6.0)))


@pytest.fixture(scope="module", params=[FEW, pytest.param(ALL, marks=pytest.mark.slow)])
def cases(
    request: pytest.FixtureRequest, dance: tuple[BeatTrack, Motion]
) -> list[tuple[str, dict[str, object], HarmonyScore]]:
    """Random settings, and the score by each."""
    rng = np.random.default_rng(11)
    drawn = [settings(rng) for _ in range(request.param)]
    return [
        (mode, values, score_motion(*dance, params=replace(MODES[mode], **values), n_rotations=0))
        for mode, values in drawn
    ]


def marked(ax: Axes, label: str) -> list[float]:
    """Places along time of the marks with a label, in order."""
    return sorted(float(x) for line in ax.lines if line.get_label() == label for x in line.get_xdata())


def music_hits(score: HarmonyScore) -> list[float]:
    return score.music.times[score.pairs >= 0].tolist()


def both_hits(score: HarmonyScore) -> list[float]:
    """Times of the music beats that are hit, and of the visual beats that hit them."""
    pairs = score.pairs[score.pairs >= 0]
    return sorted([*music_hits(score), *score.visual.times[np.unique(pairs)].tolist()])


def figure_marks(ax: Axes) -> list[float]:
    return sorted(marked(ax, "hit") + marked(ax, "above the median moment"))


def in_score_figure(score: HarmonyScore, motion: Motion) -> tuple[list[float], list[float]]:
    return figure_marks(score_figure({"one": score}).axes[0]), both_hits(score)


def in_dance_figure(score: HarmonyScore, motion: Motion) -> tuple[list[float], list[float]]:
    return marked(CELLS.draw_speed(Figure().subplots(), motion, score), "hit"), music_hits(score)


def in_timing_figure(score: HarmonyScore, motion: Motion) -> tuple[list[float], list[float]]:
    return marked(draw_timing(Figure().subplots(), score), "hit"), music_hits(score)


def in_marks_of_videos(score: HarmonyScore, motion: Motion) -> tuple[list[float], list[float]]:
    hits = score.pairs >= 0
    later = np.maximum(score.music.times[hits], score.visual.times[score.pairs[hits]])
    return hit_times(score).tolist(), sorted(later.tolist())


@pytest.mark.parametrize("drawn", [in_score_figure, in_dance_figure, in_timing_figure, in_marks_of_videos])
def test_hits_shown_are_the_pairs_of_the_score(
    drawn: Callable[[HarmonyScore, Motion], tuple[list[float], list[float]]],
    cases: list[tuple[str, dict[str, object], HarmonyScore]],
    dance: tuple[BeatTrack, Motion],
):
    results = [(mode, values, *drawn(score, dance[1])) for mode, values, score in cases]
    assert [row for row in results if row[2] != pytest.approx(row[3])] == []
    assert sum(bool(expected) for *_, expected in results) > len(cases) / 2  # there was something to show


def test_dance_figure_is_made_of_these_rows(
    cases: list[tuple[str, dict[str, object], HarmonyScore]], dance: tuple[BeatTrack, Motion]
):
    scores = {str(number): score for number, (_, _, score) in enumerate(cases[:3])}
    figure = CELLS.dance_figure(dict.fromkeys(scores, dance[1]), dance[0], scores, 0.0, {})
    assert [marked(ax, "hit") for ax in figure.axes[1::2]] == [music_hits(score) for score in scores.values()]


def test_scoring_lab_counts_the_pairs_of_the_score(
    cases: list[tuple[str, dict[str, object], HarmonyScore]], dance: tuple[BeatTrack, Motion]
):
    stage = Stage(*dance)
    wrong = []
    for mode, values, score in cases:
        lab = {"delay" if name == "reaction_delay" else name: value for name, value in values.items()}
        numbers = scoring_numbers(stage, mode=mode, **lab)
        hits = numbers["times"][numbers["shares"] > 0.5] if mode == "recommended" and len(numbers["shares"]) else None
        if mode != "recommended" and numbers["pairs"].tolist() != score.pairs.tolist():
            wrong.append((mode, values))
        if hits is not None and hits.tolist() != score.music.times[score.shares > 0.5].tolist():
            wrong.append((mode, values))
    assert wrong == []


def test_player_page_shows_the_pairs_of_the_score(
    cases: list[tuple[str, dict[str, object], HarmonyScore]], dance: tuple[BeatTrack, Motion]
):
    music, motion = dance
    sound = Audio(np.zeros(8000), 8000.0)
    wrong = []
    for mode, values, score in cases:
        page = Player(sound, [Dancer("one", motion, score)], music=music, title="").page
        data = json.loads(re.search(r"^const data = (.*);$", page, flags=re.MULTILINE)[1])
        met = [mark["met"] for mark in data["dancers"][0]["marks"]]
        pairs = [round(float(score.visual.times[pair]), 4) if pair >= 0 else None for pair in score.pairs]
        if met != pairs:
            wrong.append((mode, values))
    assert wrong == []
