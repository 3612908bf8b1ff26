"""Dances to whole songs, recorded and generated, as `harmolab.lab.evaluate.measured` takes them (notebooks 08, 09).

Harmony of the joint speed in the room can be had by turning alone, and a dance that corrects a sketch has the sketch's.
So beside the harmony of the body stand what a statue gets on the same path, what the sketch has, and what is left half
a beat late or with another song; beside all of them, whether the dance moves like recorded dancers at all.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
import pandas as pd

from harmolab.body.kinematics import in_body, resample_motion
from harmolab.body.skeletons import side_pairs
from harmolab.data.recordings import Recording, find_recordings, load_recording, recording_beats
from harmolab.lab.evaluate.measured import SOURCES, Dance, later, measure_dances, rests_on_beat
from harmolab.lab.harmonise import harmonise
from harmolab.metrics.features import frechet_distance, kinetic_features, standardise
from harmolab.metrics.likeness import LikenessLimits
from harmolab.params import DANCE_PATTERNS, HarmonyParams
from harmolab.significance import mean_interval
from harmolab.systems.choreographer.generate import Choreographer
from harmolab.systems.harmogan.sketches import dance_patterns
from harmolab.systems.harmogan.system import HarmoGAN, corrected
from harmolab.systems.training.pose_network import PoseNet, embed_windows
from harmolab.systems.training.requests import DanceRequest
from harmolab.types import BeatTrack, FloatArray, Motion
from harmolab.verdict.judge import score_motion
from study.experiments.generation import VARIANTS, corpus_root, generator_corpora, trained
from study.experiments.judging import RECORDED
from study.profile import RunProfile

OWN = ("DANCE_C_4", "DANCE_R_4", "DANCE_T_8", "DANCE_W_3")  # of the beat-locked recordings; else one of each dance
SONG_SECONDS, RATE = 30.0, 15.0
WINDOW = 2.0  # seconds that a Frechet distance compares
LATER = 1.7  # seconds from where another song's dancer begins: songs of one corpus begin on a bar
QUICK_OWN = 3  # songs in a quick profile, of which the search is given one
GUARDED = ("spread", "hands", "ankles", "crossed", "turns", "nearest", "knees", "jerk", "skating")
# Measure of the long table -> column of the table of means.
SONG_COLUMNS = {f"likeness_{name}": name for name in GUARDED}
SONG_COLUMNS |= {"rests": "body", "rests_late": "body, late", "rests_other": "body, other song"}
SONG_COLUMNS |= {"pattern": "pattern", "pattern_late": "pattern, late", "pattern_other": "pattern, other song"}
SONG_COLUMNS |= {"room_rests": "room", "statue_rests": "statue", "fid": "fid", "fid_kinetic": "fid_kinetic"}
SONG_COLUMNS |= {"trunk": "trunk", "moved": "moved"}

SKETCH, SEARCH, CORRECTED, UNJUDGED = "sketch", "search", "recommended", "recommended, no discriminators"
WITHOUT = f"{CORRECTED}, without"
BESIDE = (0.0, 0.25, 0.5)  # beats by which sketches are laid beside their music, to ask whether it is heard
COMPARED = ("rests", "pattern")  # measures that rows are compared by
REACH = 0.04  # metres: a search may move joints as far as the generator may
# Name of a generator -> its variant, and the number of its trainings.
GENERATORS = {
    CORRECTED: (VARIANTS[CORRECTED], 3),
    WITHOUT: (VARIANTS[WITHOUT], 1),
    UNJUDGED: (VARIANTS[CORRECTED].weighted(gan_weight=0.0), 3),
    "paper": (VARIANTS["paper"], 1),
}


def beats_of(song: Recording) -> BeatTrack:
    """The annotated beats of a song; tracked ones where there are none."""
    return recording_beats(song, "annotated" if song.annotation is not None else "tracked")


def recorded_dance(song: Recording, seconds: float) -> Motion:
    """The beginning of a recorded dance; ValueError where nobody was recorded."""
    if song.clip.motion is None:
        raise ValueError(f"{song.folder}: has no motion")
    return song.clip.motion.span(0.0, seconds)


def song_request(song: Recording, seconds: float, seed: int = 1) -> DanceRequest:
    """A dance to a song, from where the recorded dancer begins and for as long at most."""
    clip, seconds = song.clip, recorded_dance(song, seconds).duration
    return DanceRequest(clip.audio, beats_of(song), clip.offset, seconds, seed, dance=clip.dance)


def generated_dance(system: HarmoGAN | Choreographer, song: Recording, seconds: float, seed: int = 1) -> Motion:
    """What a system dances to a song: `song_request`."""
    return system.respond(song_request(song, seconds, seed))


def as_dance(system: str, seed: str | int, song: Recording, motion: Motion) -> Dance:
    """A motion to a song with the beats on its own time line."""
    beats = beats_of(song).span(song.clip.offset, motion.duration)
    return Dance(system, song.folder.name, motion, beats, seed, song.clip.dance)


@dataclass(frozen=True, eq=False)
class OwnSongs:
    """Songs that are kept from all training, and the trained systems; in the quick profile these did hear the songs.

    Parameters
    ----------
    profile : RunProfile
    songs : the recordings that are kept
    others : all other recordings
    systems : (name in `GENERATORS`, number of the training) -> system, trained on the others
    pose_net : that of the first system, which measures the Frechet distances
    limits : LikenessLimits of the guard, the shipped ones when left out
    """

    profile: RunProfile
    songs: tuple[Recording, ...]
    others: tuple[Recording, ...]
    systems: Mapping[tuple[str, int], HarmoGAN]
    pose_net: PoseNet
    limits: LikenessLimits | None = None

    @property
    def corrector(self) -> HarmoGAN:
        """The first training with the recommended loss."""
        return self.systems[CORRECTED, 1]

    @property
    def sketcher(self) -> Choreographer:
        """The choreographer of the others, whose dances the recommended generators correct."""
        if self.corrector.sketches is None:
            raise ValueError(f"{CORRECTED}: has no sketches")
        return self.corrector.sketches


def own_songs(profile: RunProfile) -> OwnSongs:
    """The songs of the first corpus that are kept, and the generators of `GENERATORS`, trained now unless before."""
    corpus = generator_corpora(profile)[0]
    recordings = {
        folder.name: load_recording(folder) for folder in find_recordings(corpus_root(profile, corpus)).folders
    }
    names = own_names(recordings)[: QUICK_OWN if profile.epochs else None]
    runs = {
        (name, seed): trained(profile, corpus, variant, seed, without=() if profile.epochs else names)
        for name, (variant, count) in GENERATORS.items()
        for seed in range(1, min(count, profile.n_seeds) + 1)
    }
    own, others = ([one for name, one in recordings.items() if (name in names) is kept] for kept in (True, False))
    systems = {key: HarmoGAN.load(run.folder) for key, run in runs.items()}
    return OwnSongs(profile, tuple(own), tuple(others), systems, next(iter(runs.values())).pose_net)


def own_dances(own: OwnSongs) -> pd.DataFrame:
    """The long table of half a minute to the songs: recorded, sketches, a search on them, and every generator.

    Each song is danced `RunProfile.draws` times, from one sketch each; the seed of a line is "training/draw".
    """
    dances = [as_dance(RECORDED, "1/1", song, half_a_minute(song)) for song in own.songs]
    moved: list[tuple[str, str, str, str, float]] = []
    for song, draw in product(own.songs, range(1, own.profile.draws + 1)):
        sketch = generated_dance(own.sketcher, song, SONG_SECONDS, draw)
        motions = {(SKETCH, 1): sketch}
        motions |= {key: generated_dance(system, song, SONG_SECONDS, draw) for key, system in own.systems.items()}
        if not own.profile.epochs or (song is own.songs[0] and draw == 1):
            motions[SEARCH, 1] = searched(sketch, song, own.sketcher)
        for (name, training), motion in motions.items():
            seed = f"{training}/{draw}"
            dances.append(as_dance(name, seed, song, resample_motion(motion, RATE)))
            if name != "paper":
                moved.append((name, song.folder.name, seed, "moved", moved_cm(motion, sketch)))
    dances = [one._replace(limits=own.limits) for one in dances]
    table = song_table(dances, distances_from([half_a_minute(song) for song in own.others], own.pose_net), own.songs)
    return pd.concat([table, pd.DataFrame(moved, columns=table.columns)], ignore_index=True)


def searched(sketch: Motion, song: Recording, bank: Choreographer) -> Motion:
    """A sketch brought into harmony by search: by the pattern of its dance in the bank's takes, else by rests."""
    pattern = dance_patterns(bank.takes).get(song.clip.dance)
    params = HarmonyParams.valleys() if pattern is None else HarmonyParams.recommended(pattern)
    return harmonise(sketch, as_dance(SKETCH, 1, song, sketch).music, reach=REACH, params=params)


def moved_cm(motion: Motion, sketch: Motion) -> float:
    """Mean way of the joints of a dance from those of its sketch, centimetres, both seen from the root."""
    return 100 * float(np.linalg.norm(in_body(motion).positions - in_body(sketch).positions, axis=-1).mean())


def trunk_cm(motion: Motion) -> float:
    """Standard deviation of the trunk's width, centimetres, mean of hips and shoulders; NaN without their names."""
    widths = [motion.positions[:, left] - motion.positions[:, right] for left, right in side_pairs(motion.skeleton)]
    return 100 * float(np.mean([np.linalg.norm(width, axis=1).std() for width in widths])) if widths else np.nan


def hearing(own: OwnSongs) -> pd.DataFrame:
    """Does it hear? Sketches laid beside the beat, and what the first training makes of them with the music.

    Returns
    -------
    DataFrame, a row for each distance of the sketches from their music, in beats, and motion; means over songs and
    draws of harmony above chance, as given and half a beat late
    """
    dances: list[Dance] = []
    for song, draw, beside in product(own.songs, range(1, own.profile.draws + 1), BESIDE):
        request = song_request(song, SONG_SECONDS, draw)
        sketch = own.sketcher.respond(replace(request, beats=later(request.track(), beside)))
        for name, motion in ((SKETCH, sketch), (CORRECTED, corrected(own.corrector.generator, sketch, request))):
            dances.append(as_dance(name, f"{beside:g}", song, resample_motion(motion, RATE)))
    table = measure_dances(dances, ["rests", "rests_late"], others=PATTERN)
    means = table.pivot_table("value", ["seed", "system"], "measure", sort=False, dropna=False)
    means = means[["rests", "rests_late", *PATTERN]].rename(columns=SONG_COLUMNS).rename_axis(columns=None)
    return means.rename_axis(["beats beside", "motion"]).reset_index().astype({"beats beside": float})


def song_differences(table: pd.DataFrame) -> pd.DataFrame:
    """The recommended generator less each other row, dance by dance: mean and 95 % interval (Student's t) over dances.

    Dances are paired by song and draw; of several trainings each dance counts once, by its mean.
    """
    lines = table[table["measure"].isin(COMPARED) & (table["song"] != "")]
    draws = lines["seed"].astype(str).str.rpartition("/")[2]
    wide = lines.assign(draw=draws).pivot_table("value", ["measure", "song", "draw"], "system", dropna=False)
    rows = []
    for name, measure in product([SKETCH, WITHOUT, UNJUDGED, SEARCH], COMPARED):
        own = wide.xs(measure, level="measure")
        change = (own[CORRECTED] - own[name]).dropna()
        mean, low, high = mean_interval(change.to_numpy(np.float64)) if len(change) else (np.nan,) * 3
        about = {"over": name, "measure": SONG_COLUMNS[measure], "dances": len(change)}
        rows.append({**about, "change": mean, "low": low, "high": high})
    return pd.DataFrame(rows)


def song_table(
    dances: Collection[Dance], distances: Mapping[str, Callable[..., float]], songs: Collection[Recording] = ()
) -> pd.DataFrame:
    """The long table of dances with the measures of `SONG_COLUMNS` and "likeness"; distances as of `distances_from`.

    "rests_other" and "pattern_other" are means over the music of all `songs` but the dance's own.
    """
    single = [name for name in SONG_COLUMNS if name in SOURCES]
    others = dict(PATTERN) | {f"{name}_other": _with_others(measure, songs) for name, measure in OF_MUSIC.items()}
    others["trunk"] = lambda dance: trunk_cm(dance.motion)
    return measure_dances(dances, [*single, "likeness"], others=others, of_sets=distances)


def _with_others(measure: Callable[[Dance], float], songs: Collection[Recording]) -> Callable[[Dance], float]:
    """A measure's mean over the music of other songs; NaN without any."""

    def mean(dance: Dance) -> float:
        others = [song for song in songs if song.folder.name != dance.song]
        tracks = [beats_of(song).span(song.clip.offset + LATER, dance.motion.duration) for song in others]
        values = [measure(dance._replace(music=track)) for track in tracks]
        return float(np.mean(values)) if values else np.nan

    return mean


def song_means(table: pd.DataFrame) -> pd.DataFrame:
    """Means of `song_table`, a row a system; "guard" counts the dances that move like recorded dancers ("0 of 4")."""
    wide = table.pivot_table("value", "system", "measure", sort=False, dropna=False)
    judged = table[table["measure"] == "likeness"].groupby("system", sort=False)["value"]
    guard = judged.agg(lambda own: f"{(own == 1).sum()} of {own.size}")
    means = wide.reindex(columns=list(SONG_COLUMNS)).rename(columns=SONG_COLUMNS)
    return means.assign(guard=guard).rename_axis("motion").rename_axis(columns=None).reset_index()


def own_names(recordings: Mapping[str, Recording]) -> tuple[str, ...]:
    """The songs that are kept from training: `OWN` where they are all there, else the first of each dance."""
    dances = pd.Series({name: recording.clip.dance for name, recording in recordings.items()})
    return OWN if set(OWN) <= set(recordings) else tuple(dances.drop_duplicates().index)


def distances_from(recorded: Sequence[Motion], pose_net: PoseNet) -> dict[str, Callable[..., float]]:
    """Functions of dances to their Frechet distances from windows of recorded motions, the bias taken off.

    "fid" sees poses by a pose network with the joints of all, "fid_kinetic" how fast each joint moves.
    """
    poses, speeds = embed_windows(recorded, pose_net, seconds=WINDOW), _kinetic(recorded)

    def fid(dances: Sequence[Dance], _: object) -> float:
        return frechet_distance(embed_windows([one.motion for one in dances], pose_net, seconds=WINDOW), poses).value

    def fid_kinetic(dances: Sequence[Dance], _: object) -> float:
        own = _kinetic([one.motion for one in dances])
        return frechet_distance(standardise(own, speeds), standardise(speeds, speeds)).value

    return {"fid": fid, "fid_kinetic": fid_kinetic}


def half_a_minute(song: Recording) -> Motion:
    """Half a minute of the recorded dancer at the frame rate at which all dances are measured."""
    return resample_motion(recorded_dance(song, SONG_SECONDS), RATE)


def _pattern(dance: Dance) -> float:
    """Harmony above chance by the recommended score; NaN for a dance without bar pattern, or no movement to judge."""
    if dance.dance not in DANCE_PATTERNS:
        return np.nan
    params = HarmonyParams.recommended(DANCE_PATTERNS[dance.dance])
    return score_motion(dance.music, dance.motion, params=params, n_rotations=0).harmony_above_chance


# Measures that ask about the music, by name; of patterns also with the music half a beat late.
OF_MUSIC: Mapping[str, Callable[[Dance], float]] = {
    "rests": lambda dance: rests_on_beat(dance.motion, dance.music),
    "pattern": _pattern,
}
PATTERN: Mapping[str, Callable[[Dance], float]] = {
    "pattern": _pattern,
    "pattern_late": lambda dance: _pattern(dance._replace(music=later(dance.music, 0.5))),
}


def _kinetic(motions: Sequence[Motion]) -> FloatArray:
    """Kinetic features (N, K) of all whole windows of motions."""
    starts = [np.arange(0.0, motion.duration - WINDOW + 1e-6, WINDOW) for motion in motions]
    pairs = zip(motions, starts, strict=True)
    return np.stack([kinetic_features(motion.span(start, WINDOW)) for motion, own in pairs for start in own.tolist()])
