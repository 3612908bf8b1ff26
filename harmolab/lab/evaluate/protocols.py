"""Named presets of published evaluation codes: their conventions and faults, to put both numbers side by side."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

from numpy.typing import ArrayLike

from harmolab.lab.evaluate.published import (
    bas_frames,
    beat_align_frames,
    coco_joints,
    pfc_frames,
    set_scores,
    smpl_features,
    smpl_features_from_start,
)
from harmolab.lab.evaluate.published_music import MusicBeats, aist_beats, bailando_beats
from harmolab.types import BeatTrack, FloatArray, Motion

SAME_RATE = 1e-3  # relative; a rate nearer to the published one than this is the published one


@dataclass(frozen=True)
class Protocol:
    """The conventions by which a published code evaluates dances.

    Parameters
    ----------
    source : str
        The paper and its code.
    fps : float, hertz
        The rate that its numbers of frames are meant for. Motions of other rates are not resampled, as they are not
        there: `remarks` says so.
    music_beats : (sound of `HOP` samples a frame of the motion, name of the song) -> its beats; None where the code
        takes none
    clip : (Motion, BeatTrack on its time line) -> name -> number of one dance
    features : Motion -> "kinetic" and "geometric" -> array of one dance, all that `sets` needs of it
    sets : (features, reference), arrays of one row a dance -> FID_k, FID_g, Div_k, Div_g
        `clip` and `features` raise ValueError that names the joints where a skeleton lacks some that the published code
        takes. Dicts are empty where the code has no such measure.
    notes : tuple of str
        Conventions and known faults, a sentence each.

    Examples
    --------
    >>> PROTOCOLS["edge"].fps
    30.0
    """

    source: str
    fps: float
    music_beats: MusicBeats | None
    clip: Callable[[Motion, BeatTrack], dict[str, float]]
    features: Callable[[Motion], dict[str, FloatArray]]
    sets: Callable[[Mapping[str, ArrayLike], Mapping[str, ArrayLike]], dict[str, float]]
    notes: tuple[str, ...]

    def remarks(self, motion: Motion, scores: Mapping[str, float]) -> tuple[str, ...]:
        """Sentences on one dance: another frame rate, other joints, filler frames, numbers that are NaN.

        Parameters
        ----------
        motion : Motion
        scores : dict of `clip` of it
        """
        lines = {
            f"The motion has {motion.fps:g} frames per second, the published constants are for {self.fps:g}; "
            "frames were taken as they are.": not math.isclose(motion.fps, self.fps, rel_tol=SAME_RATE),
            "The 17 joints of COCO were taken, where published scores are of SMPL's 24.": (
                "BeatAlign" in scores and bool(coco_joints(motion.skeleton))
            ),
            "Frames that are not valid were taken for motion; the published code knows none.": not motion.valid.all(),
        }
        nan = [f"{name} is NaN: {_UNDEFINED[name]}" for name, value in scores.items() if math.isnan(value)]
        return (*(line for line, holds in lines.items() if holds), *nan)


def _beat_align(motion: Motion, music: BeatTrack) -> dict[str, float]:
    return {"BeatAlign": beat_align_frames(motion, music)}


def _bas(motion: Motion, music: BeatTrack) -> dict[str, float]:
    return {"BAS": bas_frames(motion, music)}


def _pfc(motion: Motion, music: BeatTrack) -> dict[str, float]:
    return {"PFC": pfc_frames(motion)}


def _no_features(motion: Motion) -> dict[str, FloatArray]:
    return {}


def _no_sets(features: Mapping[str, ArrayLike], reference: Mapping[str, ArrayLike]) -> dict[str, float]:
    return {}


_UNDEFINED = MappingProxyType(
    {
        "BeatAlign": "there are no music beats, where the published code stops with an error.",
        "BAS": "there are no beats of the music or of the motion, where the published code stops with an error.",
        "PFC": "the root does not accelerate; the published code divides 0 by 0, and its mean over all dances is NaN.",
    }
)
_FRAMES = "Frames are counted, not seconds, so the score depends on the frame rate."
_MEANS = "Published means are over dances; here a song counts once, however many dances there are to it."
_MUSIC_BEATS = (
    "Music beats are librosa's as they come, tracked in the whole song with a frame of 512 samples for each of the "
    "motion ({strength}; prior of the tempo: {prior}), and not those of this table, be these annotated or tracked."
)
_OF_SETS = (
    "Kinetic features (72) take frames for sixtieths of a second and misplace a bracket: a third of them measure the "
    "place of a joint, 3540 times its metres, where an acceleration is meant.",
    "Geometric features (32) divide by 1/120 s, so speeds are doubled; some velocities and planes are of the wrong "
    "points or sides; thresholds are lengths of SMPL's mean body; the lowest joint is the floor.",
    "Features are standardised by mean and SD + 1e-10 of the reference, so one in which the whole reference agrees "
    "outweighs all others where a dance differs in it.",
    "FID_k and FID_g are not corrected for small samples: the fewer dances, the larger they are.",
    "Div_k and Div_g are mean distances between dances, of features standardised by the reference.",
    "Published tables take all motions of AIST++ for the reference, training included; here it is the one of the "
    "table. Fewer than two dances on a side give NaN.",
    "Versions differ: FID_g and Div_g in the paper of AIST++ are of earlier geometric features, with one more fault; "
    "copies in which the bracket is mended have other FID_k and Div_k.",
)
PROTOCOLS: Mapping[str, Protocol] = MappingProxyType(
    {
        "aist++": Protocol(
            "Li et al. 2021, google-research/mint with its author's fork, google/aistplusplus_api",
            60.0,
            aist_beats,
            _beat_align,
            smpl_features,
            set_scores,
            (
                "BeatAlign is the mean over motion beats of exp(-d^2 / 18), d frames to the nearest music beat: music "
                "beats without a motion beat cost nothing.",
                "Motion beats are frames whose summed joint speed is below that of ten frames on either side, "
                "unsmoothed; the first frame has speed 0, so none lies in the ten after it.",
                "A dance without motion beats scores 0; without music beats the published code stops, here NaN.",
                "Music beats after the end of a dance do not count; the published script counts them for generated "
                "dances, and not for recorded ones.",
                _FRAMES,
                _MEANS,
                _MUSIC_BEATS.format(
                    strength="mean onset strength",
                    prior="that in the name of a song of AIST, 120 beats a minute for others, where the code stops",
                ),
                *_OF_SETS,
                "Features depend on where in the room a dancer is, by the bracket.",
                "The published script leaves out the first 120 frames, which FACT is given; here all frames count.",
            ),
        ),
        "edge": Protocol(
            "Tseng et al. 2023, Stanford-TML/EDGE",
            30.0,
            None,
            _pfc,
            _no_features,
            _no_sets,
            (
                "PFC is the mean over frames of (slower of left ankle and toes) x (slower of the right ones) x "
                "(acceleration of the root, downward part left out) / (its largest in the clip), times 10^4.",
                "Foot speeds are horizontal metres a frame, not divided by the time step: at another frame rate the "
                "same dance has another score.",
                "The largest acceleration is that of each clip: one jump of the root makes the rest of a dance good.",
                "A root that does not accelerate gives 0 / 0, which makes the published mean NaN; here only the clip.",
                "PFC takes no music beats: it is the same with any song.",
                _MEANS,
                "The code takes z for up; motions here have y up, and axes are taken accordingly.",
                "The code stops where there are more than 1,000 dances (it draws 1,000 without importing `random`); "
                "here all count.",
                "No code for beat alignment, FID or diversity is public (issues 11, 27 and 46), so there is none here.",
            ),
        ),
        "bailando": Protocol(
            "Li Siyao et al. 2022, lisiyao21/Bailando",
            60.0,
            bailando_beats,
            _bas,
            smpl_features_from_start,
            set_scores,
            (
                "BAS is the mean over music beats of exp(-d^2 / 18), d frames to the nearest motion beat: the other "
                "way round than BeatAlign, so a dance that comes to rest all the time scores high.",
                "Motion beats are all minima, however shallow, of the mean joint speed smoothed by a Gaussian of five "
                "frames; speeds lie on the earlier of two frames, so a beat is one frame earlier than in aist++.",
                "Without beats of music or motion, as in a frozen clip, the published code stops; here NaN.",
                _FRAMES,
                _MEANS,
                _MUSIC_BEATS.format(
                    strength="median onset strength of the percussive part", prior="120 beats a minute"
                ),
                *_OF_SETS,
                "Features are of the first 1,200 frames, seen from where the root starts: by the bracket they measure "
                "how far a dancer goes from there.",
            ),
        ),
    }
)
