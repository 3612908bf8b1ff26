"""Records and settings check themselves once, so that everything behind them may trust what it gets."""

import copy
import json
import pickle
import re
from collections.abc import Callable
from dataclasses import FrozenInstanceError, asdict, fields, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import harmolab
from harmolab import evaluate, frechet_distance, lab
from harmolab.beats.audio import audio_beats, music_beats, onset_envelope, with_clicks
from harmolab.beats.meter import MeterUnit, describe_beats, meter_units, with_one
from harmolab.beats.visual import visual_beats
from harmolab.body.skeletons import Skeleton
from harmolab.lab.explain.page import dance_page
from harmolab.lab.harmonise import harmonise
from harmolab.metrics.likeness import likeness
from harmolab.metrics.quality import foot_skating, jerk
from harmolab.musician import explain_playing
from harmolab.params import CHOICES, BarPattern, HarmonyParams
from harmolab.readers.beats import save_beats
from harmolab.readers.motion import save_motion
from harmolab.score import HarmonyScore, score_harmony
from harmolab.shape_speed import shape_speed
from harmolab.systems import Choreographer, mel_features
from harmolab.systems.harmogan.params import ModelParams, TrainParams
from harmolab.systems.training.features import FeatureParams
from harmolab.types import Audio, BeatTrack, Clip, Motion, Notes
from harmolab.verdict.judge import other_measures, score_clip, score_motion
from study.profile import RunProfile
from tests.builders import cases, refused, track

PAIR = Skeleton(("hip", "knee"), (-1, 0))


def motion(frames: int = 4, fps: float = 2.0) -> Motion:
    return Motion(np.arange(frames * 6.0).reshape(frames, 2, 3), fps, PAIR)


def test_audio_span_takes_the_samples_from_start_on():
    np.testing.assert_array_equal(Audio(np.arange(10.0), 2.0).span(1.0, 1.5).samples, [2, 3, 4])


def test_audio_keeps_single_precision_of_a_tensor_too():
    for samples in (np.zeros(3, np.float32), torch.zeros(3)):
        assert Audio(samples, 8000).samples.dtype == np.float32


MUSIC = track([1.0]), track([1.0])
SILENCE, FRAMES, TRAINED = Audio(np.zeros(10), 2.0), np.zeros((4, 2, 3)), torch.zeros(4, requires_grad=True)


@cases(
    "message, record, values",
    (r"samples must be a non-empty mono array \(S,\), got shape \(2, 5\)", Audio, (np.zeros((2, 5)), 8000)),
    ("samples must be a non-empty mono array", Audio, ([], 8000)),
    (r"samples holds NaN or infinity \(first at index 1\)", Audio, ([0.0, np.nan], 8000)),
    ("samples are whole numbers; divide them by full scale", Audio, (np.array([0, 9], np.int16), 8000)),
    *((f"sample_rate must be positive and finite, got {n}", Audio, ([0.0], n)) for n in (0, np.nan)),
    ("sample_rate must be a number, got 'fast'", Audio, ([0.0], "fast")),
    *(("samples must be an array of numbers", Audio, (x, 8000)) for x in (["loud"], None, [10**400], [1j], TRAINED)),
    *((f"no audio from {n} s for 1.0 s in a recording of 5.00 s", SILENCE.span, (n, 1.0)) for n in (-1.0, 5.0, np.nan)),
    ("a skeleton needs one parent per joint, got 0 joints, 0 parents", Skeleton, ((), ())),
    ("got 1 joints, 2 parents", Skeleton, (("hip",), (-1, 0))),
    ("joints must be a list of names, got the text 'hip'", Skeleton, ("hip", (-1, 0, 1))),
    *(("parents must be -1 or the index of another joint", Skeleton, (("hip",), (n,))) for n in (0, -1.5, "-1", None)),
    ("parents must be -1 or the index of another joint", Skeleton, (("hip", "knee"), (-1, 2))),
    (r"be \(frames, joints, 3\) or \(frames, joints, 2\), got \(4, 2\)", Motion, (np.zeros((4, 2)), 15.0, PAIR)),
    (r"got \(4, 2, 4\)", Motion, (np.zeros((4, 2, 4)), 15.0, PAIR)),
    ("motion needs at least two frames, got 1", Motion, (np.zeros((1, 2, 3)), 15.0, PAIR)),
    ("positions have 3 joints, the skeleton 2", Motion, (np.zeros((4, 3, 3)), 15.0, PAIR)),
    ("positions exceed 1e12: not metres", Motion, (FRAMES + 1e13, 15.0, PAIR)),
    (r"positions holds NaN or infinity \(first at index 0, 0, 0\)", Motion, (FRAMES + np.inf, 15.0, PAIR)),
    ("fps must be positive and finite, got -15.0", Motion, (FRAMES, -15.0, PAIR)),
    (r"valid must have one entry per frame \(4\), got shape \(3,\)", Motion, (FRAMES, 15.0, PAIR, [True] * 3)),
    ("valid must be True or False", Motion, (FRAMES, 15.0, PAIR, [0.4, np.nan, 1.0, 1.0])),
    ("positions has masked entries; interpolate", Motion, (np.ma.masked_equal(FRAMES, 0.0), 15.0, PAIR)),
    *((f"no motion from {n} s for 1 s in a motion of 2.00 s", motion(4, 2.0).span, (n, 1)) for n in (1.5, np.nan)),
    ("no beats from nan s on", MUSIC[0].span, (np.nan, 1)),
    *(("no notes from .*nan", Notes([0.0], [1.0], [60]).span, part) for part in ((np.nan, 1), (0, np.nan))),
    (r"notes need one of their offsets each, got \(2,\) for 1 onsets", Notes, ([0.0], [1.0, 2.0], [60])),
    ("beat times reach 5400 in a clip of 10 s; were these frames?", BeatTrack, ([0.0, 5400.0], [1, 1], 15.0, 10.0)),
    ("beat times start at -0.1 s; they must not be negative", BeatTrack, ([-0.1], [1], 15.0, 10.0)),
    ("times must increase strictly; sort them and remove doubles", BeatTrack, ([1.0, 1.0], [1, 1], 15.0, 10.0)),
    ("beat times must increase strictly", BeatTrack, ([2.0, 1.0], [1, 1], 15.0, 10.0)),
    ("beat strengths must not be negative", BeatTrack, ([1.0], [-1], 15.0, 10.0)),
    (r"times \(2,\) and strengths \(1,\) must be two equal lists", BeatTrack, ([1.0, 2.0], [1], 15.0, 10.0)),
    (r"beat times holds NaN or infinity \(first at index 0\)", BeatTrack, ([np.nan], [1], 15.0, 10.0)),
    (r"bar_places must .* per beat \(2\), got shape \(1,\)", BeatTrack, ([1.0, 2.0], [1, 1], 15.0, 10.0, [0])),
    ("bar_places must be whole numbers", BeatTrack, ([1.0, 2.0], [1, 1], 15.0, 10.0, [0.5, np.nan])),
    ("bar_places must not be negative, got -1", BeatTrack, ([1.0, 2.0], [1, 1], 15.0, 10.0, [-1, 0])),
    ("fit must be a share, 0 to 1, got nan", partial(BeatTrack, fit=np.nan), ([1.0], [1], 15.0, 10.0)),
    (r"windows must be \(W, 2\)", partial(BeatTrack, windows=[1, 2]), ([1.0], [1], 15.0, 10.0)),
    ("a bar pattern needs whole beats, at least one beat, got 0", BarPattern, (0, (1.0,), (0.0,))),
    ("a bar pattern needs whole beats, at least one beat, got 1.5", BarPattern, (1.5, (1.0,), (0.0,))),
    *(("cosines and sines must be two equal lists", BarPattern, (1, (1.0,) * n, (1.0,) * 2 * n)) for n in (0, 1)),
    ("coefficients must be finite", BarPattern, (1, (float("nan"),), (0.0,))),
    (r"a meter unit must end after it starts, got 2\.0 to 1\.0 s", MeterUnit, (2.0, 1.0, [True], "4/4")),
    ("waltz: motion starting at 9.00 s does not overlap audio of 5.00 s", Clip, ("waltz", SILENCE, motion(), 9.0)),
    ("skeleton must be a harmolab.Skeleton, got tuple", Motion, (FRAMES, 15.0, ("hip", "knee"))),
    ("audio must be a harmolab.Audio, got ndarray", Clip, ("waltz", np.zeros(10))),
    ("motion must be a harmolab.Motion, got ndarray", Clip, ("waltz", SILENCE, FRAMES)),
    ("beats must be a harmolab.BeatTrack, got list", Clip, ("waltz", SILENCE, None, 0.0, "", [1.0])),
    ("a harmolab.Clip is needed, got str; score_files takes paths", score_clip, ("waltz.wav",)),
    ("BeatTrack and a harmolab.Motion are needed, got list and Motion", score_motion, ([1.0], motion())),
    ("are needed, got BeatTrack and ndarray", score_motion, (track([1.0]), FRAMES)),
    ("a harmolab.BeatTrack is needed, got list", score_harmony, (track([1.0]), [1.0])),
    ("a harmolab.HarmonyParams is needed, got str", partial(score_harmony, params="paper"), MUSIC),
    ("a harmolab.HarmonyParams is needed, got str", partial(score_motion, params="paper"), (MUSIC[0], motion())),
    ("a harmolab.HarmonyParams is needed, got str", score_clip, (Clip("waltz", SILENCE, motion()), "paper")),
    ("a harmolab.HarmonyParams is needed, got str", partial(visual_beats, params="paper"), (motion(),)),
    *(("a harmolab.Clip is needed, got NoneType", each, (None,)) for each in (music_beats, other_measures)),
    ("n_rotations must be a whole number, not negative, got -1", partial(score_harmony, n_rotations=-1), MUSIC),
    ("seed must be a whole number, not negative, got 0.5", partial(score_motion, seed=0.5), (MUSIC[0], motion())),
    *(("seed must be a whole .* got -1", partial(each, seed=-1), ([], [])) for each in (evaluate, frechet_distance)),
    *(("a harmolab.Motion is needed, got ndarray", f, (FRAMES,)) for f in (visual_beats, jerk, foot_skating, likeness)),
    ("a harmolab.Motion is needed, got ndarray", lab.rests_on_beat, (FRAMES, MUSIC[0])),
    ("a harmolab.Motion is needed, got ndarray", lab.draw_poses, (None, FRAMES, [0.0], 0)),
    ("a harmolab.Motion is needed, got ndarray", lab.render_skeleton, (FRAMES,)),
    ("a harmolab.Motion is needed, got ndarray", lab.blind_page, (SILENCE, [FRAMES])),
    ("a harmolab.Motion is needed, got ndarray", harmolab.playing_score, (FRAMES, MUSIC[0], "piano")),
    ("a harmolab.BeatTrack is needed, got list", harmolab.other_scores, ([1.0], [1.0])),
    ("a harmolab.BeatTrack is needed, got list", harmolab.other_scores, (MUSIC[0], [1.0])),
    ("motion 1 must be a harmolab.Motion, got ndarray", Choreographer.of, ([FRAMES],)),
    ("a harmolab.Motion is needed, got ndarray", save_motion, ("dance.npz", FRAMES)),
    *(
        ("a harmolab.Audio is needed, got ndarray", f, (np.zeros(10),))
        for f in (audio_beats, onset_envelope, mel_features)
    ),
    ("a harmolab.Audio is needed, got ndarray", lab.blind_page, (np.zeros(10), [])),
    *(("a harmolab.BeatTrack is needed, got list", each, ([1.0],)) for each in (describe_beats, meter_units)),
    *(
        ("a harmolab.BeatTrack is needed, got list", *each)
        for each in ((with_clicks, (SILENCE, [1.0])), (with_one, ([1.0], 0, 4)), (harmonise, (motion(), [1.0])))
    ),
    ("a harmolab.BeatTrack is needed, got list", save_beats, ("song.beats", [1.0])),
    (r"held must have one entry per frame \(4\), got shape \(1,\)", partial(likeness, motion(), held=np.ones(1)), ()),
    *((f"offset must be finite, got {n!r}", Clip, ("waltz", SILENCE, None, n)) for n in (float("nan"), None, "1")),
    ("unit_beats must leave at least one beat before a meter of six, got 6", partial(FeatureParams, unit_beats=6), ()),
)
def test_what_is_no_record_is_refused_by_name(message, record, values):
    refused(message, record, *values)


DANCED, RIGHT = Clip("waltz", SILENCE, motion()), np.array([True])
AXES = Axes(Figure(), (0, 0, 1, 1))
PICTURE = np.zeros((64, 64), np.uint8)
ITEMS = [lab.Item(name, {"true": name, "lagged": f"{name} late"}) for name in ("a", "b")]
KEY = lab.make_key(ITEMS, kind="pick", n=2, seed=1)
TRIALS = lab.make_trials(ITEMS, kind="pick", n=2, seed=1, rater="Ada")


@cases(
    "message, call, values",
    ("an evaluation of evaluate_dances is needed, got PosixPath", lab.write_evaluation, (DANCED, Path("out"))),
    *(("a dance of explain_performance is needed, got Clip", f, (DANCED,)) for f in (lab.dance_player, dance_page)),
    ("a harmolab.Clip is needed, got Motion", lab.write_dance, ("dance.gif", motion())),
    ("audio must be a harmolab.Audio", partial(harmolab.write_video, audio="a.wav"), ("a.mp4", [PICTURE], 5.0)),
    ("dancers must be a list of Dancer", partial(lab.Player, music=MUSIC[0], title=""), (SILENCE, [motion()])),
    ("music must be a harmolab.BeatTrack, got list", partial(lab.Player, music=[1.0], title=""), (SILENCE, [])),
    ("music must be a harmolab.BeatTrack, got list", partial(lab.find_offset, music=[1.0]), (SILENCE, motion())),
    ("track must be a harmolab.BeatTrack, got list", lab.draw_curve, (AXES, [0.0], [1.0], [1.0])),
    ("a harmolab.BeatTrack is needed, got list", partial(lab.draw_hits, delay=0.1), (None, [1.0], MUSIC[1], [0])),
    *(("pairs must be the number of", partial(lab.draw_hits, delay=0.1), (None, *MUSIC, x)) for x in (RIGHT, [0, 1])),
    ("a harmolab.HarmonyScore is needed, got float", lab.timing_figure, (0.5,)),
    ("scores by their modes are needed", lab.score_figure, ({"paper": DANCED},)),
    ("frame must be body or room, got 'floor'", partial(lab.rests_on_beat, frame="floor"), (motion(), MUSIC[0])),
    (r"a list of Dance\(system, song, motion, music\), got Clip", lab.measure_dances, ([DANCED], ["jerk"])),
    ("merge several one by one", harmolab.DanceMetric().merge_state, ([harmolab.DanceMetric()],)),
    ("a harmolab.Recording is needed, got Clip", partial(harmolab.compare, dances=["waltz"]), ([DANCED],)),
    ("null must be lagged or other, got 'late'", partial(harmolab.compare, null="late"), ([],)),
    ("beats must be annotated or tracked, got 'known'", partial(harmolab.compare, beats="known"), ([],)),
    ("n_rotations must be a whole number, not negative, got -1", partial(harmolab.compare, n_rotations=-1), ([],)),
    ("a harmolab.Notes is needed, got list", harmolab.note_beats, ([1.0], 3.0)),
    ("sound must be Notes, .*, got Audio", harmolab.playing_score, (motion(), SILENCE, "piano")),
    ("a musician's Performance is needed, got Motion", explain_playing, (motion(),)),
    ("trials and their key are needed, got Key and TrialSet", lab.write_study, ("study", KEY, TRIALS)),
    ("answer files are needed, in a list as answer_files returns it; got 'study'", lab.merge, ("study",)),
    ("port 70000: .* 0-65535", partial(lab.StudyServer, port=70000), (None, None, None)),
)
def test_a_door_says_what_it_needs_in_place_of_what_it_got(message, call, values):
    refused(message, call, *values)


def test_bones_join_parents_to_children():
    assert Skeleton(("hip", "knee", "ankle"), (-1, 0, 1)).bones == ((0, 1), (1, 2))


def test_every_frame_is_valid_unless_said_otherwise():
    np.testing.assert_array_equal(motion(3).valid, [True, True, True])


def test_motion_span_takes_frames_and_their_validity():
    whole = replace(motion(6, 2.0), valid=[True, False, True, False, True, True])
    part = whole.span(1.0, 1.5)
    np.testing.assert_array_equal(part.positions, whole.positions[2:5])
    np.testing.assert_array_equal(part.valid, [True, False, True])


def test_arrays_of_a_record_are_read_only_copies():
    source = np.zeros((4, 2, 3))
    copy = Motion(source, 15.0, PAIR)
    source[0] = 1.0
    assert not copy.positions.any()
    refused("read-only", copy.positions.fill, 1.0)


def test_records_are_frozen():
    with pytest.raises(FrozenInstanceError):
        motion().fps = 30.0


def test_beats_are_selected_with_their_bar_places():
    chosen = track([1.0, 2.0, 3.0], bar_places=[2, 0, 1]).select(np.array([True, False, True]))
    np.testing.assert_array_equal(chosen.times, [1.0, 3.0])
    np.testing.assert_array_equal(chosen.bar_places, [2, 1])


def test_a_span_of_beats_includes_its_start_and_excludes_its_end():
    part = track([1.0, 2.0, 3.0, 4.0], bar_places=[0, 1, 2, 0]).span(2.0, 2.0)
    np.testing.assert_array_equal(part.times, [0.0, 1.0])
    np.testing.assert_array_equal(part.bar_places, [1, 2])
    assert part.duration == 2.0


def test_a_span_may_begin_before_the_recording():
    np.testing.assert_array_equal(track([1.0]).span(-0.5, 3.0).times, [1.5])


def test_beats_keep_their_quality_when_selected_or_cut():
    steady = replace(track([1.0, 2.0, 3.0]), quality=0.9)
    assert (steady.select(np.array([True, False, True])).quality, steady.span(1.5, 2.0).quality) == (0.9, 0.9)


def test_tracked_beats_are_sure_from_three_quarters_of_the_music_on_and_stay_so_when_cut():
    beats = track([1.0, 2.0, 3.0])
    assert beats.is_sure  # annotated
    assert replace(beats, fit=0.75).is_sure
    unsure = replace(beats, fit=0.74)
    assert not any(one.is_sure for one in (unsure, unsure.select(np.array([True, False, True])), unsure.span(1.5, 2.0)))


def test_tempo_is_that_of_a_line_through_the_beats_over_a_gap():
    # Every half second; the third beat is missing, two are 20 ms off in turn.
    assert track([0.0, 0.52, 1.5, 1.98, 2.5]).tempo == pytest.approx(120, rel=0.01)
    assert track([0.0, 0.5, 1.5, 2.0]).tempo == pytest.approx(120)
    assert np.isnan(track([1.0]).tempo)


def test_a_score_becomes_a_dictionary_that_json_takes():
    music, visual = BeatTrack([1.0, 2.0], [1.0, 0.5], 100.0, 3.0), BeatTrack([1.1], [1.0], 100.0, 3.0)
    evidence = HarmonyParams.paper(), music, visual, np.array([0, -1]), np.array([1.0, 0.0]), 0.75
    score = HarmonyScore(*evidence, 0.5, 0.25, 1.0, 2.0, 0.75, 0.1, 0.2, np.array([0.1, np.inf]))
    plain = json.loads(json.dumps(score.to_dict(), allow_nan=False))
    assert (plain["hits"], plain["intervals"]) == ([True, False], [0.1, None])  # infinitely far: there is none
    assert (plain["p_value"], plain["interval"]) == (None, [None, None])
    assert (plain["harmony"], plain["n_audio"], plain["n_visual"], plain["pairs"]) == (0.5, 2, 1, [0, -1])
    assert (plain["music_times"], plain["visual_times"]) == ([1.0, 2.0], [1.1])


# Settings


def test_paper_mode_has_the_papers_values():
    paper = HarmonyParams.paper()
    assert paper == HarmonyParams()
    assert (paper.audio_threshold, paper.visual_threshold, paper.reaction_delay, paper.beta) == (0.1, 1.0, 0.25, 2.0)
    assert (paper.measure, paper.detector, paper.fps, paper.clock, paper.lag) == ("hits", "turns", 15.0, 1.0, 0.0)


@cases(
    "changed, message",
    ({"audio_threshold": -0.1}, "audio_threshold must be zero or more, got -0.1"),
    ({"reaction_delay": float("nan")}, "reaction_delay must be zero or more, got nan"),
    ({"position_smoothing": float("inf")}, "position_smoothing must be zero or more, got inf"),
    ({"reaction_delay": 250}, "reaction_delay, smoothing and .* at most 10 s, got 250"),
    ({"smoothing": 1e9}, r"smoothing and position_smoothing must be at most 10 s, got 1e\+09"),
    ({"position_smoothing": 11}, "smoothing and position_smoothing must be at most 10 s, got 11"),
    ({"beta": 0.0}, "beta must be positive, got 0.0"),
    ({"clock": -1.0}, "clock must be positive, got -1.0"),
    ({"visual_threshold": -1.0}, "visual_threshold must be zero or more, or None, got -1.0"),
    ({"fps": 0.0}, "fps must be positive or None, got 0.0"),
    ({"reaction_delay": "x"}, "reaction_delay must be a number, got 'x'"),
    ({"smoothing": None}, "smoothing must be a number, got None"),
    ({"subframe": "no"}, "subframe must be True or False, got 'no'"),
    ({"speed": ["norm"]}, r"speed must be one of norm, signed, norm_of_sum; got \['norm'\]"),
    ({"lag": float("inf")}, "lag must lie within 2 s of the beat, got inf"),
    ({"measure": "pattern"}, "one of shape, hits; got 'pattern'; the joint speed in the room gave way"),
    ({"detector": "jumps"}, "detector must be one of turns, valleys, peaks, direction; got 'jumps'"),
    ({"pattern": "waltz"}, "pattern must be a BarPattern or None, got 'waltz'; see HOW_PATTERNS"),
    ({"matching": "one"}, "matching must be one of many, nearest, max; got 'one'"),
)
def test_bad_settings_are_refused_by_name(changed, message):
    refused(message, HarmonyParams, **changed)


def test_every_named_reading_is_accepted():
    for name, choices in CHOICES.items():
        assert [getattr(HarmonyParams(**{name: choice}), name) for choice in choices] == list(choices)


def test_the_profile_comes_from_the_environment(monkeypatch):
    monkeypatch.delenv("HARMOLAB_PROFILE", raising=False)
    assert RunProfile.from_env() == RunProfile.quick()
    monkeypatch.setenv("HARMOLAB_PROFILE", "full")
    assert RunProfile.from_env() == RunProfile.full()
    monkeypatch.setenv("HARMOLAB_PROFILE", "slow")
    refused("HARMOLAB_PROFILE must be one of quick, full, gpu, got 'slow'", RunProfile.from_env)


# Clips on one time line


def clip_of(offset: float, *, seconds: float = 10.0, fps: float = 10.0, frames: int = 60) -> Clip:
    """Sound whose samples count milliseconds, beats at every second, frames that count themselves."""
    positions = np.arange(frames, dtype=np.float64)[:, None, None] * np.ones((1, 1, 3))
    beats = BeatTrack(np.arange(1.0, seconds), np.ones(int(seconds) - 1), 100.0, seconds)
    audio = Audio(np.arange(1000 * seconds) / 1e6, 1000.0)
    return Clip("clip", audio, Motion(positions, fps, Skeleton.unnamed(1)), offset, beats=beats)


def test_a_span_of_a_clip_cuts_music_beats_and_motion_alike():
    part = clip_of(2.0).span(3.05, 2.0)
    assert (part.audio.samples[0], part.audio.duration) == (3050 / 1e6, 2.0)
    np.testing.assert_allclose(part.beats.times, [0.95, 1.95])
    # The first whole frame is number 11, at 3.1 s.
    assert part.motion.positions[0, 0, 0] == 11
    assert part.offset == pytest.approx(0.05)


def test_a_span_before_the_motion_keeps_its_distance():
    part = clip_of(2.0).span(1.5, 3.0)
    assert (part.offset, part.motion.positions[0, 0, 0]) == (0.5, 0)


def test_a_span_without_two_frames_of_motion_is_refused():
    refused("no motion from", clip_of(2.0).span, 0.0, 2.0)


def test_the_shared_stretch_of_a_motion_that_begins_before_the_music_begins_with_the_music():
    shared = clip_of(-0.25).shared()
    # Frame 3 lies at 0.05 s.
    assert (shared.offset, shared.motion.positions[0, 0, 0], shared.audio.samples[0]) == (0.0, 3, 50 / 1e6)
    np.testing.assert_allclose(shared.beats.times, [0.95, 1.95, 2.95, 3.95, 4.95])
    assert clip_of(-0.25).shared_frame() == 3


def test_the_shared_stretch_of_a_motion_that_outlasts_the_music_ends_with_the_music():
    shared = clip_of(7.0).shared()
    assert (shared.motion.n_frames, shared.audio.duration, shared.beats.duration) == (30, 3.0, 3.0)


def test_a_clock_stretches_the_shared_motion_over_more_music():
    shared = clip_of(0.0).shared(clock=1.5)
    assert (shared.motion.n_frames, shared.audio.duration) == (60, 9.0)
    refused("clock must be positive and finite, got 0", clip_of(0.0).shared, clock=0)


def test_training_settings_are_those_of_section_5_2():
    paper = TrainParams.paper()
    assert (paper.pretrain_epochs, paper.adversarial_epochs, paper.batch_size) == (225, 45, 10)
    assert (paper.pretrain_rate, paper.pretrain_drops, paper.pretrain_drop_epochs) == (0.001, (0.5, 0.2, 0.2, 0.5), 50)
    # "divided by 2 and 5 alternatively every 5 epochs"
    assert (paper.adversarial_rate, paper.adversarial_drops, paper.adversarial_drop_epochs) == (0.0001, (0.5, 0.2), 5)
    assert (paper.pretrain_kl_weight, paper.kl_weight) == (0.1, 0.0001)
    assert (paper.harmony_weight, paper.cross_domain_weight) == (1, 1)
    assert paper.mse_weight == paper.feature_weight == paper.gan_weight == 0.001
    assert (paper.discriminator_decay, paper.generator_decay) == (0.001, 0.0001)


def test_the_paper_has_no_terms_of_ours():
    paper = TrainParams.paper()
    assert (paper.smoothness_weight, paper.energy_weight, paper.foot_weight) == (0, 0, 0)
    assert (paper.moved_weight, paper.sketches, paper.critic_share, paper.clip) == (0, 0, 1, None)
    assert not ModelParams.paper().bounded


def test_features_of_the_paper_are_mfcc_at_15_hertz():
    assert FeatureParams.paper() == FeatureParams(fps=15.0, n_mfcc=20, beat_channels=False)
    # Onset strength, sine and cosine of beat and bar beside the MFCC.
    assert (FeatureParams.paper().n_audio, FeatureParams.recommended().n_audio) == (20, 25)


@pytest.mark.parametrize("settings", [TrainParams.paper(), TrainParams.recommended(), ModelParams.small()])
def test_settings_survive_json(settings: TrainParams | ModelParams):
    again = json.loads(json.dumps(asdict(settings)))
    again = {name: tuple(value) if isinstance(value, list) else value for name, value in again.items()}
    assert type(settings)(**again) == settings


PAPER, FEATURES, SMALL = TrainParams.paper(), FeatureParams.paper(), ModelParams.small()


@cases(
    "settings, name, value, rule",
    *((SMALL, field.name, 0, "positive") for field in fields(ModelParams) if field.name != "bounded"),
    *((PAPER, name, 0, "positive") for name in ("batch_size", "pose_epochs", "shards", "pretrain_drop_epochs")),
    *((PAPER, name, (0.5, 0.0), "positive factors") for name in ("pretrain_drops", "adversarial_drops")),
    *((PAPER, name, one, "zero or more") for name in ("pretrain_epochs", "seed", "sketches") for one in (-1, 2**32)),
    *((PAPER, name, -0.5, "zero or more") for name in ("harmony_weight", "shifted")),
    (PAPER, "discriminator_decay", float("nan"), "zero or more"),
    (PAPER, "shifted", 1.5, "a share, 0 to 1"),
    *((PAPER, name, -0.001, "positive") for name in ("pretrain_rate", "clip")),
    *((PAPER, name, float("nan"), "positive") for name in ("adversarial_rate", "clip")),
    *((PAPER, name, 0.0, "positive") for name in ("tau_end", "critic_share", "patience")),
    *((PAPER, name, float("inf"), "positive") for name in ("epsilon", "patience")),
    *((FEATURES, "fps", value, "positive") for value in (0.0, float("nan"))),
    *((PAPER, name, "3", "a number") for name in ("pretrain_rate", "critic_share")),
    *((PAPER, name, value, "a whole number") for name, value in (("batch_size", 1.5), ("seed", float("nan")))),
    (PAPER, "pretrain_drops", 0.5, "a list of numbers, each zero or more"),
    *((FEATURES, *row) for row in (("beat_channels", "no", "True or False"), ("unit_beats", np.inf, "a whole number"))),
    *((FEATURES, "n_mfcc", value, "positive") for value in (0, 2**16 + 1)),
)
def test_a_setting_out_of_range_is_refused_by_name(
    settings: TrainParams | ModelParams | FeatureParams, name: str, value: object, rule: str
):
    refused(re.escape(f"{name} must be {rule}, got {value!r}"), replace, settings, **{name: value})


@cases("copied", copy.deepcopy, lambda record: pickle.loads(pickle.dumps(record)))
def test_arrays_of_a_copy_stay_read_only(copied: Callable[[Any], Any]):
    unit = MeterUnit(0.0, 1.0, [True], "4/4")
    for record in map(copied, (track([1.0, 2.0]), motion(), Notes([0.0], [1.0], [60]), unit, shape_speed(motion()))):
        arrays = [value for value in vars(record).values() if isinstance(value, np.ndarray)]
        assert arrays and not any(array.flags.writeable for array in arrays)
