"""Comparing true with wrong music over a tiny corpus of analytic dancers, whose every movement is known.

The music has a beat every half second, four in a bar. A dancer's speed goes through a cycle of two beats, fastest
`peak` beats after the first of them; figures differ in what they do besides.
"""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from harmolab.body.skeletons import Skeleton
from harmolab.data.recordings import Recording, recording_beats
from harmolab.files import plain
from harmolab.lab.compare.auc import CorpusResult, compare
from harmolab.lab.compare.scores import LAGS, hit_scores, shifted_music
from harmolab.lab.compare.windows import cut_clips, dance_patterns, learn_patterns
from harmolab.metrics.beat_alignment import beat_align
from harmolab.params import BarPattern
from harmolab.readers.beats import BeatAnnotation, Unit
from harmolab.types import Audio, Clip, Motion
from harmolab.verdict.bar_pattern import fit_pattern
from harmolab.verdict.judge import score_clip
from tests.builders import cases, refused

PERIOD = 0.5
START = 1.0  # audio time of motion frame 0
FPS = 30.0


@pytest.fixture(autouse=True)
def no_cache(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HARMOLAB_CACHE", "off")


def travel(positions: np.ndarray) -> Motion:
    """Three joints that go the same way along a line."""
    joints = positions[:, None, None] * np.array([[1.0, 0.0, 0.2], [0.5, 0.5, 0.0], [0.0, 1.0, -0.3]])
    return Motion(joints, FPS, Skeleton.unnamed(3))


def dancer(seed: int, *, peak: float = 0.0, seconds: float = 6.0, extra: float = 0.4) -> Motion:
    """Speed 2 + cos over two beats, fastest at `peak`, plus slower and faster waves that make this dancer different."""
    rng = np.random.default_rng(seed)
    x = np.arange(round(seconds * FPS)) / FPS / PERIOD  # motion starts on a downbeat
    place = 2 * x + np.sin(np.pi * (x - peak)) / np.pi
    for cycle in rng.uniform(0.3, 1.5, 3):  # of a beat; no multiple of the music's
        place = place + extra * np.sin(2 * np.pi * cycle * x + rng.uniform(0, 6.3)) / (2 * np.pi * cycle)
    return travel(place)


def danced(
    name: str,
    motion: Motion,
    *figures: str,
    period: float = PERIOD,
    dance: str = "cha-cha",
    unit: str | None = None,
    bars: bool = True,
) -> Recording:
    """A sequence to a silent song; each figure fills an equal stretch of it."""
    seconds = START + motion.duration + 1.0
    times = np.arange(round(seconds / period)) * period + START % period
    edges = START + np.linspace(0, motion.duration, len(figures) + 1)
    units = tuple(Unit(unit or f"{name}-{i}", edges[i], edges[i + 1], 4, figure) for i, figure in enumerate(figures))
    downbeats = START + 4 * period * np.arange(2) if bars else None
    annotation = BeatAnnotation(times, downbeats, 4 if bars else None, 60 / period, dance, units, START)
    clip = Clip(name, Audio(np.zeros(round(seconds * 2000)), 2000), motion, START, "hand-made", dance=dance)
    return Recording(clip, annotation, Path("corpus") / name)


def corpus(count: int = 6, *, peak: float = 0.3, **options: object) -> list[Recording]:
    """As many dancers of one mind, each with a figure of its own."""
    return [danced(f"S{i}", dancer(i, peak=peak), f"figure {i}", **options) for i in range(count)]


def part_of(sequence: Recording):
    (part,) = cut_clips(sequence, "annotated", 6.0)
    return part


def compared(sequences: list[Recording], **options: object) -> CorpusResult:
    return compare(sequences, **({"n_rotations": 40} | options))


# Parts


def test_a_part_knows_its_place_its_music_and_its_figures():
    parts = cut_clips(danced("S", dancer(1, seconds=13.0), "A", "B"), "annotated", 6.0)
    assert [(part.window, part.start, part.duration) for part in parts] == [(0, 1.0, 6.0), (1, 7.0, 6.0)]
    assert [set(part.figures) for part in parts] == [{"A"}, {"A", "B"}]  # A ends at 7.5 s
    assert [part.unit for part in parts] == ["S-0", "S-1"]
    assert {(part.cycle, part.period) for part in parts} == {(2, 0.5)}
    np.testing.assert_allclose(parts[1].music().times, np.arange(12) * 0.5)


def test_parts_start_on_a_frame():
    # 7.0 s at 30 fps in three windows of 2.33 s: frames 0, 69.9 and 139.8.
    parts = cut_clips(danced("S", dancer(1, seconds=7.0)), "annotated", 2.33)
    np.testing.assert_allclose([part.start for part in parts], START + np.array([0, 70, 140]) / 30)


def test_a_whole_sequence_is_one_window_of_parts_of_six_seconds_and_more():
    parts = cut_clips(danced("S", dancer(1, seconds=20.0)), "annotated", None)
    assert [part.window for part in parts] == [0, 0, 0]
    assert [part.duration for part in parts] == pytest.approx([20 / 3] * 3, abs=1 / 30)


def test_a_sequence_shorter_than_the_window_is_one_window():
    (part,) = cut_clips(danced("S", dancer(1, seconds=4.0)), "annotated", 6.0)
    assert part.duration == 4.0


def test_late_music_has_every_beat_later():
    part = part_of(danced("S", dancer(1)))
    np.testing.assert_allclose(part.music().times, np.arange(12) * 0.5)
    np.testing.assert_allclose(part.music(0.2).times, np.arange(12) * 0.5 + 0.2)
    np.testing.assert_allclose(part.music(-0.2).times, np.arange(12) * 0.5 + 0.3)  # early: the next beat comes first


def test_beats_of_silent_music_all_have_strength_one():
    assert set(recording_beats(danced("S", dancer(1)), "annotated").strengths) == {1.0}


def test_the_grid_of_scores_moves_the_music_by_tenths_of_a_beat():
    # Stops 0.3 beat after every music beat: music that is late by 0.3 beat meets them.
    x = np.arange(180) / FPS / PERIOD
    part = part_of(danced("S", travel(x + np.sin(2 * np.pi * (x - 0.3 - 0.5)) / (2 * np.pi)), "A"))
    grid = hit_scores(part, shifted_music(part))
    assert all(values.shape == (20,) for values in grid.values())
    for name in ("valleys", "mir_eval_f", "beat_align_music"):
        assert grid[name][[3, 13]].min() == pytest.approx(grid[name].max(), abs=0.05), name
    assert grid["mir_eval_f"][[0, 6, 10, 16]].max() < 0.2
    moves = part.visual["kinematic"].times
    for step in range(20):
        assert grid["beat_align_music"][step] == pytest.approx(beat_align(part.music(step * 0.05).times, moves))


# What is fitted, and on what


def test_true_music_ranks_above_lagged_music_for_the_recommended_score():
    row = compared(corpus()).summary["scores"]["recommended"]
    assert row["auc"] > max(0.95, row["chance_band"][1])
    assert row["mean_true"] > 0.5 > 0.0 > row["mean_wrong"]


def test_patterns_are_learnt_on_other_sequences_and_other_figures():
    # X moves the opposite way. B would give A's answer away; A itself would as well.
    a, b = danced("A", dancer(1, peak=1.0), "X"), danced("B", dancer(2, peak=1.0), "X")
    c, d = danced("C", dancer(3), "Y"), danced("D", dancer(4), "Z")
    parts = [part_of(sequence) for sequence in (a, b, c, d)]
    learnt = learn_patterns(parts)
    others = fit_pattern([parts[2].sums, parts[3].sums])
    assert (learnt[0].cosines, learnt[0].sines) == (others.cosines, others.sines)
    assert learnt[0].cosines[0] > 0.5
    result = compared([a, b, c, d])
    assert result.patterns["cha-cha"][0].cosines == others.cosines
    assert result.true["recommended"][0] < -0.5  # judged by the others, A dances the wrong way round


def test_a_figure_that_recurs_beside_another_is_not_fitted_on():
    judged, mixed = danced("A", dancer(1, peak=1.0), "X"), danced("B", dancer(2, peak=1.0), "Y", "X")
    parts = [part_of(sequence) for sequence in (judged, mixed, danced("C", dancer(3), "Z"))]
    assert learn_patterns(parts)[0].cosines == fit_pattern([parts[2].sums]).cosines


def test_another_window_of_the_same_sequence_is_not_fitted_on():
    parts = cut_clips(danced("A", dancer(1, seconds=12.0), "X", "Y"), "annotated", 6.0)
    assert learn_patterns(parts) == [BarPattern.stop_on_the_beat()] * 2


def test_other_dances_are_not_fitted_on():
    parts = [part_of(danced("A", dancer(1), "X")), part_of(danced("B", dancer(2), "Y", dance="rumba"))]
    assert learn_patterns(parts) == [BarPattern.stop_on_the_beat()] * 2


def beating(seed: int, *, peak: float = 0.3) -> Motion:
    """Speed 2 + cos over every beat, fastest at `peak`, beside a slow wave."""
    x = np.arange(180) / FPS / PERIOD
    slow = 0.2 * np.sin(2 * np.pi * 0.11 * x + seed)
    return travel(2 * x + slow + np.sin(2 * np.pi * (x - peak)) / (2 * np.pi))


def test_without_bars_the_curve_over_one_beat_is_learnt():
    sequences = [danced(f"S{i}", beating(i), f"figure {i}", bars=False) for i in range(4)]
    parts = [part_of(sequence) for sequence in sequences]
    assert {part.cycle for part in parts} == {1}
    for pattern in learn_patterns(parts):
        assert pattern.beats == 1
        assert np.arctan2(pattern.sines[0], pattern.cosines[0]) / (2 * np.pi) == pytest.approx(0.3, abs=0.05)
    row = compared(sequences).summary["scores"]["recommended"]
    assert row["auc"] > 0.9
    assert row["mean_true"] > 0.8


def test_fitting_on_another_corpus_leaves_out_shared_figures():
    judged = [danced("A", dancer(1, peak=1.0), "X")]
    shared, other = danced("B", dancer(2, peak=1.0), "X"), danced("C", dancer(3), "Y")
    both = compared(judged, fit_on=[shared, other])
    assert both.patterns["cha-cha"][0].cosines == fit_pattern([part_of(other).sums]).cosines
    assert both.true["recommended"][0] < -0.5
    assert compared(judged, fit_on=[shared]).patterns["cha-cha"] == [BarPattern.stop_on_the_beat()]


def test_fitting_on_another_corpus_takes_nothing_from_the_judged_one():
    judged = corpus(4, peak=1.0)
    teachers = [danced(f"T{i}", dancer(10 + i), f"other {i}") for i in range(4)]
    result = compared(judged, fit_on=teachers)
    expected = fit_pattern([part_of(teacher).sums for teacher in teachers])
    assert {pattern.cosines for pattern in result.patterns["cha-cha"]} == {expected.cosines}
    assert "4 sequences of another corpus" in result.summary["fitted_on"]


def test_the_constant_lag_is_the_dancers_own():
    # Fastest 0.3 beat after each beat: speed peaks meet music that is 0.3 beat late, give or take the delay (0.2 beat).
    result = compared([danced(f"S{i}", beating(i), f"figure {i}") for i in range(4)])
    assert result.true["peaks_lagged"].mean() > 0.9
    assert result.true["peaks"].mean() < 0.0


def test_the_pattern_of_each_dance_is_learnt_on_all_its_parts():
    sequences = [danced("A", dancer(1, peak=0.5), "X"), danced("B", dancer(2, peak=0.5), "X")]
    sequences.append(danced("C", dancer(3), "Y", dance="rumba"))
    patterns = dance_patterns(sequences)
    assert sorted(patterns) == ["cha-cha", "rumba"]
    first = np.arctan2(patterns["cha-cha"].sines[0], patterns["cha-cha"].cosines[0])
    assert first / np.pi == pytest.approx(0.5, abs=0.1)  # half a beat of a cycle of two
    assert np.hypot(patterns["rumba"].cosines[0], patterns["rumba"].sines[0]) > 0.5


# Judgement


def test_lagged_music_is_later_by_the_stated_tenths_of_a_beat():
    # Dancers who stop half a beat late: of the lags 0.3 to 0.7 the middle one suits them.
    x = np.arange(180) / FPS / PERIOD
    late = [travel(x + 0.02 * np.sin(0.7 * x + seed) + np.sin(2 * np.pi * x) / (2 * np.pi)) for seed in range(3)]
    result = compared([danced(f"S{i}", motion, f"figure {i}") for i, motion in enumerate(late)])
    assert LAGS == (3, 4, 5, 6, 7)
    assert (result.wrong["beat_align_music"].argmax(axis=1) == 2).all()
    assert result.wrong["valleys"][:, 2].min() > 0.9 > 0.0 > result.true["valleys"].max()
    assert result.summary["scores"]["valleys"]["auc"] == 0.0


@pytest.mark.slow
def test_a_random_motion_lies_inside_its_chance_band():
    def wandering(seed: int) -> Motion:
        rng = np.random.default_rng(seed)
        times = np.arange(180) / FPS
        waves = [np.sin(2 * np.pi * hertz * times + rng.uniform(0, 6.3)) for hertz in rng.uniform(0.3, 2.0, 6)]
        return travel(np.sum(waves, axis=0))

    result = compared([danced(f"S{i}", wandering(i), f"figure {i}") for i in range(10)], n_rotations=300)
    scores = result.summary["scores"]
    for name, row in scores.items():
        low, high = row["chance_band"]
        assert low < 0.5 < high < low + 0.75, name  # the discriminant: .72
    low, high = scores["recommended"]["chance_band"]
    assert low <= scores["recommended"]["auc"] <= high


@pytest.mark.slow
def test_parts_of_one_unit_turn_together():
    # By patterns of others, six units turned each alone are never all right or wrong; one unit, danced six times, is.
    teachers = [danced(f"T{i}", dancer(10 + i, peak=0.3), f"other {i}") for i in range(4)]

    def width(**options: object) -> float:
        result = compared(corpus(**options), fit_on=teachers, n_rotations=200)
        low, high = result.summary["scores"]["recommended"]["chance_band"]
        return high - low

    assert width(unit="one") > 0.8 > width()


@pytest.mark.slow
def test_band_is_at_least_as_wide_as_with_recordings_that_turn_as_one():
    # Two units a recording: alone they turn twelve times, and chance spreads less than over six recordings.
    motions = [dancer(i, peak=0.3, seconds=12.0) for i in range(6)]
    named = [danced(f"S{i}", motion, f"A{i}", f"B{i}") for i, motion in enumerate(motions)]
    unnamed = [danced(f"S{i}", motion) for i, motion in enumerate(motions)]
    bands = [compared(one, n_rotations=100).summary["scores"]["valleys"]["chance_band"] for one in (named, unnamed)]
    assert bands[0] == bands[1]


@pytest.mark.slow
def test_a_window_longer_than_a_part_scores_the_mean_of_its_parts():
    sequences = [danced(f"S{i}", dancer(i, seconds=12.0), f"figure {i}") for i in range(3)]
    short, long = compared(sequences, window=6.0), compared(sequences, window=12.0)
    assert (short.summary["n"], long.summary["n"]) == (6, 3)
    for name, values in long.true.items():
        np.testing.assert_allclose(values, short.true[name].reshape(3, 2).mean(axis=1), err_msg=name)
        np.testing.assert_allclose(long.wrong[name], short.wrong[name].reshape(3, 2, 5).mean(axis=1), err_msg=name)


def test_other_music_is_another_sequences():
    # Two tempi: to the other's music a dancer drifts through every phase.
    result = compared(corpus(3) + slow(3), null="other")
    assert (result.wrong["recommended"].shape, result.summary["null"]) == ((6, 5), "other")
    assert result.summary["scores"]["recommended"]["auc"] > 0.8


def slow(count: int) -> list[Recording]:
    """Dancers to music with a beat every 0.7 s."""
    slower, faster = (2 * x + np.sin(np.pi * (x - 0.3)) / np.pi for x in np.arange(180) / FPS / [[0.7], [PERIOD]])
    motions = [travel(dancer(20 + i, peak=0.3).positions[:, 0, 0] - faster + slower) for i in range(count)]
    return [danced(f"slow {i}", motion, f"slow {i}", period=0.7) for i, motion in enumerate(motions)]


def test_sequences_of_the_same_name_in_two_folders_are_two():
    second = replace(danced("S", dancer(2), "Y"), folder=Path("elsewhere") / "S")
    result = compared([danced("S", dancer(1), "X"), second])
    assert (result.summary["n"], result.summary["n_sequences"]) == (2, 2)


def test_the_same_seed_gives_the_same_result():
    first, again = (json.dumps(compared(corpus(3), seed=5).summary) for _ in range(2))
    assert first == again


# The dictionary


def test_the_summary_has_the_form_that_is_documented_and_json_takes_it():
    sequences = [*corpus(3), danced("R", dancer(9), "figure R", dance="rumba")]
    summary = json.loads(json.dumps(compared(sequences, corpus="tiny").summary, allow_nan=False))
    about = {name: summary[name] for name in ("corpus", "window", "null", "beats", "n")}
    assert about == {"corpus": "tiny", "window": 6.0, "null": "lagged", "beats": "annotated", "n": 4}
    wanted = {"paper", "recommended", "hit_rate", "beat_align_motion", "beat_align_music", "mir_eval_f"}
    assert wanted <= set(summary["scores"])
    for row in summary["scores"].values():
        assert set(row) >= {"auc", "interval", "chance_band", "by_dance"}
        assert set(row["by_dance"]) == {"C", "R"}
        assert (row["by_dance"]["C"]["n"], row["by_dance"]["R"]["n"]) == (3, 1)
        assert 0 <= row["auc"] <= 1
        assert all(low <= high for low, high in (row["interval"], row["chance_band"])), row


def test_without_rotations_there_is_no_band_and_one_sequence_has_no_interval():
    assert compared(corpus(2), n_rotations=0).summary["scores"]["paper"]["chance_band"] == [None, None]
    assert compared(corpus(1)).summary["scores"]["paper"]["interval"] == [None, None]


def test_dances_are_told_by_their_initial_or_their_name():
    names = {"cha-cha": "C", "salsa": "salsa", "samba": "S", "": "?"}
    sequences = [danced(f"S{i}", dancer(i), f"figure {i}", dance=dance) for i, dance in enumerate(names)]
    assert set(compared(sequences).summary["scores"]["paper"]["by_dance"]) == set(names.values())


def test_the_summary_says_what_was_fitted_on():
    assert compared(corpus(2)).summary["fitted_on"] == "other sequences, without the figures of the judged clip"
    unnamed = [danced(f"S{i}", dancer(i)) for i in range(2)]
    assert "figures are not named here" in compared(unnamed).summary["fitted_on"]


# Verdicts


def dancing(index: int, *, dance: str = "cha-cha") -> Recording:
    """Twenty seconds, 40 beats, of a dancer who seldom departs from the cycle."""
    return danced(f"S{index}", dancer(index, seconds=20.0, extra=0.1), f"figure {index}", dance=dance)


def test_verdict_on_a_recording_is_that_of_its_score():
    sequences = [dancing(0), dancing(1), dancing(2, dance="salsa")]
    result = compared(sequences, n_rotations=0)
    assert [row["name"] for row in result.summary["recordings"]] == ["S0", "S1", "S2"]
    for sequence, row in zip(sequences, result.summary["recordings"], strict=True):
        score = score_clip(replace(sequence.clip, beats=recording_beats(sequence, "annotated")))
        judged = {name: getattr(score.judgement, name) for name in ("level", "verdict", "p_time", "p_place", "lag_s")}
        numbers = {name: plain(getattr(score, name)) for name in ("harmony_above_chance", "p_value")}
        assert row | judged | numbers | {"dance": sequence.clip.dance} == row


def test_levels_count_recordings_with_true_and_with_lagged_music():
    result = compared([dancing(i) for i in range(4)], n_rotations=0)
    levels = result.summary["levels"]
    assert levels["true"] == np.bincount([row["level"] for row in result.summary["recordings"]], minlength=5).tolist()
    assert sum(levels["lagged"]) == 4
    # By a curve learnt on the others these dancers, who all do the same, are on the beat; 0.3 beat late and more not.
    assert (levels["true, learnt"], levels["lagged, learnt"][4]) == ([0, 0, 0, 0, 4], 0)


def test_recordings_without_a_teacher_are_left_out_of_the_learnt_levels():
    levels = compared([dancing(0), dancing(1), dancing(2, dance="rumba")], n_rotations=0).summary["levels"]
    assert sum(levels["true"]) == 3
    assert sum(levels["true, learnt"]) == sum(levels["lagged, learnt"]) == 2


# Odd corpora


def test_a_frozen_dancer_is_told_by_no_score():
    frozen = [danced(f"S{i}", travel(np.full(180, 0.1)), f"figure {i}") for i in range(3)]
    for name, row in compared(frozen).summary["scores"].items():
        assert row["auc"] == pytest.approx(0.5), name


def test_tracked_beats_are_found_in_the_sound(click_track):
    sequence = danced("S", dancer(1), "X")
    clicks = click_track(120, seconds=sequence.clip.audio.duration)
    sounding = replace(sequence, clip=replace(sequence.clip, audio=clicks), annotation=None)
    result = compared([sounding], beats="tracked", n_rotations=0)
    assert (result.summary["beats"], result.summary["n"]) == ("tracked", 1)
    tracked = recording_beats(sounding, "tracked")
    assert np.abs(tracked.times - 0.5 * np.round(tracked.times / 0.5)).max() < 0.035


def to_clicks(sequence: Recording, click_track) -> Recording:
    """The same to clicks on its beats."""
    clicks = click_track(120, seconds=sequence.clip.audio.duration)
    beats = sequence.annotation.track(clicks.duration)
    return replace(sequence, clip=replace(sequence.clip, audio=clicks, beats=beats))


def test_tracked_beats_are_counted_through_a_recording_and_teachers_keep_their_bars(click_track):
    sequence = to_clicks(danced("S", dancer(1, seconds=13.0), "X"), click_track)
    parts, placed = (cut_clips(sequence, beats, 6.0) for beats in ("tracked", "annotated"))
    assert [part.is_placed for part in (*parts, *placed)] == [False, False, True, True]
    for part, other in zip(parts, placed, strict=True):
        assert part.cycle == 2
        np.testing.assert_array_equal(part.track.bar_places, np.arange(len(part.track)) % 2)
        np.testing.assert_array_equal(part.sums.sums, other.sums.sums)


def test_true_music_ranks_above_lagged_music_where_one_is_not_known(click_track):
    silent = [danced(f"S{i}", dancer(i, seconds=12.0, extra=0.1), f"figure {i}") for i in range(4)]
    sequences = [to_clicks(sequence, click_track) for sequence in silent]
    row = compared(sequences, beats="tracked").summary["scores"]["recommended"]
    assert row["auc"] > max(0.9, row["chance_band"][1])


@cases(
    "change, options, message",
    ({"annotation": None}, {}, "no beats.json; use tracked beats"),
    ({"annotation": BeatAnnotation([])}, {}, "beats.json holds no beats; use tracked beats"),
    ({}, {"window": 0.0}, "window must be a positive number of seconds, or None for whole sequences; got 0.0"),
    ({}, {"window": -6.0}, "window must be a positive number of seconds"),
    ({}, {"fit_on": []}, "no recording to fit on"),
    ({}, {"null": "other"}, "other music needs at least two recordings"),
)
def test_what_cannot_be_compared_is_refused(change: dict, options: dict, message: str):
    refused(message, compared, [replace(danced("S", dancer(1), "X"), **change)], **options)


def test_a_sequence_without_motion_and_no_sequences_are_refused():
    sequence = danced("S", dancer(1), "X")
    refused(r"corpus.S: no motion", compared, [replace(sequence, clip=replace(sequence.clip, motion=None))])
    refused("no recording to compare", compare, iter(()))


def test_music_without_a_beat_in_the_part_scores_zero():
    sequence = danced("S", dancer(1), "X")
    early = replace(sequence.annotation, times=np.array([0.1, 0.6]), downbeats=None)
    result = compared([replace(sequence, annotation=early)], n_rotations=0)
    assert result.true["paper"][0] == result.true["recommended"][0] == 0.0
