"""Error and hits of musicians side by side (readings, section 6), and the errors of real hands.

The two disagree: a prediction that shrinks towards the mean wins pixels and loses strikes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd

from harmolab.files import PathLike, Progress, silent
from harmolab.musician.events import CERTAIN, note_beats, playing_events, playing_score
from harmolab.musician.instrument_sets import load_pianomime
from harmolab.musician.params import Audio2BodyParams
from harmolab.musician.perform import predicted_points
from harmolab.musician.performances import Performance
from harmolab.musician.sequences import PlayedSequence, PlayedSet, read_sequence, sides
from harmolab.musician.train import errors, frame_errors, mean_pose_errors
from harmolab.params import HarmonyParams
from harmolab.score import score_harmony
from harmolab.types import FloatArray, Motion, Notes
from study.experiments.planted_truth import planted_points
from study.experiments.player_tables import (
    ANOTHER_PIECE,
    FINAL,
    LONG_DELAY,
    MEAN_POSE,
    OURS,
    SCHEDULE,
    gain_settings,
    n_player_seeds,
    player_errors,
    row_settings,
)
from study.experiments.players import (
    PLANTED,
    PlayerData,
    TrainedPlayer,
    profiled,
    read_set,
    trained_player,
    with_rendered_sound,
)
from study.profile import RunProfile

PLANTED_HANDS, LATE = "planted hands", "delay 125 ms"
MEANS = ("events", "depth", "body", "left", "right")  # of a table of hits: means over pieces and seeds
SCORED = (FINAL, LATE, OURS, ANOTHER_PIECE)


def scored_settings(data: PlayerData, row: str) -> Audio2BodyParams:
    """The settings of a row of `SCORED`."""
    return replace(row_settings(data, FINAL), delay=LONG_DELAY) if row == LATE else row_settings(data, row)


def piece_scores(
    profile: RunProfile, data: PlayerData, *, rows: Sequence[str] = SCORED, progress: Progress = silent
) -> pd.DataFrame:
    """Error and hits of every test piece of planted players: planted hands, and predicted ones of every row and seed.

    Events of movement are strikes, or turns of the bow; events of sound are the onsets of the notes.

    Returns
    -------
    DataFrame with the columns hands, seed (0: planted), piece, error (pixels, full), hits (above chance, own music),
    p, share, chance, other (hits with the music of each other test piece, mean), events (for each onset), depth (median
    depth of a strike or length of a stroke, pixels), body (hits of the whole body's speed), and of pianists left and
    right (hits of each hand with its own notes)

    Raises
    ------
    ValueError
        For real hands: no camera above the keys sees a strike.
    """
    if data.label != PLANTED:
        raise ValueError(f"{data.label}: strikes cannot be seen from above, and no score of them is evidence")
    played = read_set(data, profiled(profile, data, row_settings(data, FINAL)))
    notes = {each.name: each.notes for each in data.test if each.notes is not None}
    parts: list[dict[str, Any]] = []
    jobs = [(PLANTED_HANDS, 0), *((row, seed) for seed in range(1, n_player_seeds(profile) + 1) for row in rows)]
    for row, seed in progress(jobs, f"hits, {data.instrument}"):
        for sequence, points in _hands(profile, data, played, row, seed):
            values = _scores(_motion(points, played), notes, sequence.name, data.instrument, profile.n_rotations)
            error = frame_errors(points, sequence.points)[sequence.accepted].mean()
            parts.append({"hands": row, "seed": seed, "piece": sequence.name, "error": error, **values})
    return pd.DataFrame(parts)


def _hands(
    profile: RunProfile, data: PlayerData, played: PlayedSet, row: str, seed: int
) -> Iterator[tuple[PlayedSequence, FloatArray]]:
    """Test pieces, and their points (T, 2 P) as planted, or as the network of a row predicts them."""
    if row == PLANTED_HANDS:
        for sequence in sides(played.sequences, data.split.test):
            yield sequence, planted_points(data.planted[sequence.name], played.reference, "clean")
        return
    network = trained_player(profile, data, scored_settings(data, row), seed).system.network
    for sequence in sides(read_set(data, network.params).sequences, data.split.test):
        yield sequence, predicted_points(network, sequence.sound)


def _motion(points: FloatArray, played: PlayedSet) -> Motion:
    return Motion(points.reshape(len(points), -1, 2), played.params.fps, played.skeleton)


def _scores(
    motion: Motion, notes: Mapping[str, Notes], piece: str, instrument: str, n_rotations: int
) -> dict[str, float]:
    """Scores of one player with the notes of `piece`, and with those of the other pieces."""
    own = playing_score(motion, notes[piece], instrument, n_rotations=n_rotations)
    events, params = playing_events(motion, instrument), HarmonyParams.playing()
    others = [
        score_harmony(note_beats(other, motion.duration), events, params=params, n_rotations=0).harmony_above_chance
        for name, other in notes.items()
        if name != piece
    ]
    return {
        "hits": own.score.harmony_above_chance,
        "p": own.score.p_value,
        "share": own.score.mean_share,
        "chance": own.score.chance,
        "other": float(np.mean(others)) if others else float("nan"),
        "events": own.score.n_visual / max(own.score.n_audio, 1),
        "depth": float(np.median(events.strengths)) if len(events) else 0.0,
        "body": own.body.harmony_above_chance,
        **{hand: score.harmony_above_chance for hand, score in own.hands.items()},
    }


def hits_table(scores: pd.DataFrame) -> pd.DataFrame:
    """Error and hits side by side: means over pieces, SDs over seeds of those means.

    Parameters
    ----------
    scores : DataFrame of `piece_scores`

    Returns
    -------
    DataFrame with the columns hands, seeds, pieces, error, "error SD", hits, "hits SD", "largest p", "pieces p < .05"
    (share of pieces and seeds), other, "largest other" (of one piece, without its sign), events, depth, body, and left
    and right where there are
    """
    rows = []
    for hands, own in scores.groupby("hands", sort=False):
        by_seed = own.groupby("seed")[["error", "hits"]].mean()
        row: dict[str, Any] = {"hands": hands, "seeds": len(by_seed), "pieces": own["piece"].nunique()}
        for name in ("error", "hits"):
            row |= {name: by_seed[name].mean(), f"{name} SD": by_seed[name].std(ddof=0)}
        row |= {"largest p": own["p"].max(), "pieces p < .05": float((own["p"] < CERTAIN).mean())}
        row |= {"other": own["other"].mean(), "largest other": own["other"].abs().max()}
        rows.append(row | {name: own[name].mean() for name in MEANS if name in own})
    return pd.DataFrame(rows)


def gains_table(
    profile: RunProfile, data: PlayerData, *, seeds: int | None = None, progress: Progress = silent
) -> pd.DataFrame:
    """Each change of our settings alone, and all of them: the error on test pieces beside `SCHEDULE`, seed by seed.

    Returns
    -------
    DataFrame with the columns data, instrument, row, seeds, error, "of mean pose", gain (of error) and, of planted
    players, hits; for each its "SD" over seeds ("error SD")
    """
    rows = [*gain_settings(data), OURS]
    errors = player_errors(profile, data, rows=rows, seeds=seeds, progress=progress)
    full = errors.pivot_table(index="seed", columns=["side", "row"], values="full")
    test = full["test"][rows]
    parts = {"error": test, "of mean pose": test / full[MEAN_POSE][rows], "gain": -test.sub(test[SCHEDULE], axis=0)}
    means = {name: part.mean() for name, part in parts.items()}
    spreads = {f"{name} SD": part.std(ddof=0) for name, part in parts.items()}
    about = {"data": data.label, "instrument": data.instrument, "row": rows, "seeds": len(test)}
    table = pd.DataFrame(about).join(pd.DataFrame(means | spreads), on="row")
    if data.label != PLANTED:
        return table
    hits = hits_table(piece_scores(profile, data, rows=rows, progress=progress)).set_index("hands")
    return table.join(hits[["hits", "hits SD"]], on="row")


def hands_errors(run: TrainedPlayer, folder: PathLike) -> dict[str, float]:
    """Full errors of real hands that a network never saw: a folder of clips as `load_pianomime` reads them.

    Their sound is rendered from their notes; they are cleaned and placed as test pieces are. Whether a clip repeats a
    piece of the training is not checked here.

    Parameters
    ----------
    run : TrainedPlayer, trained on real hands
    folder : of clips.csv and its clips

    Returns
    -------
    dict of "clips", "frames" (accepted), "full", "mean pose" (millimetres), "of mean pose" (their ratio)

    Raises
    ------
    FileNotFoundError, ValueError
        As `load_pianomime`, and for clips with other points than the network's.
    """
    return unseen_errors(run, [with_rendered_sound(clip) for clip in load_pianomime(folder)])


def unseen_errors(run: TrainedPlayer, performances: Sequence[Performance]) -> dict[str, float]:
    """As `hands_errors`, of performances with sound."""
    network = run.system.network
    for each in performances:
        if each.motion.skeleton != network.skeleton:
            raise ValueError(f"{each.name}: has other points than those that the network was trained on")
    sequences = [read_sequence(each, network.params, network.reference, is_test=True) for each in performances]
    full, mean_pose = errors(network, sequences).full, mean_pose_errors(network, sequences).full
    return {
        "clips": len(sequences),
        "frames": int(sum(each.accepted.sum() for each in sequences)),
        "full": full,
        "mean pose": mean_pose,
        "of mean pose": full / mean_pose,
    }
