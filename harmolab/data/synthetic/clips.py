"""Synthetic clips with the truth about them, music and dance on the same beats; and corpora of them on disk.

A corpus is ordinary files: a folder per clip with audio.wav, motion.npz and beats.json.
"""

import itertools
import json
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, dataclass, replace
from numbers import Integral
from pathlib import Path
from typing import Any, cast

import numpy as np
from filelock import FileLock

from harmolab.data.synthetic.beats import ClipSettings
from harmolab.data.synthetic.dancer import choreography, dance_motion, figure_names
from harmolab.data.synthetic.music import planted_music
from harmolab.files import UNFINISHED, PathLike, Progress, atomic_folder, plain, silent, write_json
from harmolab.params import DANCES
from harmolab.readers.audio import save_audio
from harmolab.readers.beats import BeatAnnotation, Unit
from harmolab.readers.motion import save_motion
from harmolab.types import Clip, FloatArray, Motion

SHORTEST_UNIT = 0.25  # seconds of a figure below which it does not count as being in the clip


@dataclass(frozen=True, eq=False)
class PlantedClip:
    """A synthetic clip, and the truth about it: what was planted.

    Parameters
    ----------
    clip : Clip
        Its `beats` are the planted music beats, with the accents of the bar as strengths.
    annotation : BeatAnnotation
        Beats, first beats of the bars, meter, mean tempo and figures, on the clip's time line.
    visual_beat_times : (M,) array, seconds
        Every movement end inside the clip, which is a rest of the dancer.
    settings : ClipSettings
        The settings that it follows from.
    """

    clip: Clip
    annotation: BeatAnnotation
    visual_beat_times: FloatArray
    settings: ClipSettings


def planted_clip(settings: ClipSettings, *, name: str | None = None) -> PlantedClip:
    """The synthetic clip that the settings describe, with the truth about it.

    Parameters
    ----------
    settings : ClipSettings
    name : str
        Name of the clip; its dance and seed when left out.

    Returns
    -------
    PlantedClip

    Raises
    ------
    ValueError
        For a setting out of range; the message names it.

    Examples
    --------
    >>> planted = planted_clip(ClipSettings("waltz", seconds=4.0, tempo=90.0, fps=30.0))
    >>> round(planted.clip.beats.tempo), planted.annotation.meter
    (90, 3)
    """
    music = planted_music(settings)
    danced = choreography(music.grid, settings)
    motion = dance_motion(danced, settings)
    name = f"{settings.dance} {settings.seed}" if name is None else name
    clip = Clip(name, music.audio, motion, 0.0, "synthetic", music.beats, settings.dance)
    ends = danced.ends.times
    annotation = BeatAnnotation(
        music.beats.times,
        music.downbeat_times,
        music.grid.meter,
        music.grid.tempo(settings.seconds),
        settings.dance,
        _units_inside(danced.units, music.beats.times, settings.seconds),
        source="synthetic",
        strengths=music.beats.strengths,
    )
    return PlantedClip(clip, annotation, ends[(ends >= 0) & (ends < settings.seconds)], settings)


def _units_inside(units: tuple[Unit, ...], beat_times: FloatArray, seconds: float) -> tuple[Unit, ...]:
    """The parts of the units that lie inside the clip, each with the beats that fall into it."""
    inside = []
    for unit in units:
        start, end = max(unit.start, 0.0), min(unit.end, seconds)
        if end - start > SHORTEST_UNIT:
            beats = int(((beat_times > start) & (beat_times <= end)).sum())
            inside.append(Unit(unit.name, start, end, beats, unit.figure))
    return tuple(inside)


def synthetic_clip(dance: str = "cha-cha", **settings: Any) -> Clip:
    """A synthetic clip: computed music, and a computed dancer who rests on its beats; to try things without recordings.

    Music and dance both begin at time 0, and `Clip.beats` are the planted music beats. The same seed at another frame
    rate is the same dance, seen at other moments. `planted_clip` also has the planted movement ends and the figures.

    Parameters
    ----------
    dance : str
        One of `DANCES`.
    **settings
        seconds (6 when left out), fps, tempo, drift, lateness, jitter, omission, redundancy, noise, figures,
        sample_rate and seed, as in `ClipSettings`.

    Returns
    -------
    Clip

    Raises
    ------
    ValueError
        For a setting out of range; the message names it.

    Examples
    --------
    >>> clip = synthetic_clip("waltz", seconds=4.0, fps=30.0, seed=7)
    >>> clip.motion.n_frames, clip.audio.duration
    (120, 4.0)
    """
    return planted_clip(ClipSettings(dance, **settings)).clip


# Corpora on disk

# Raise it when the same settings give other clips than before: a resumed corpus must not mix two makes.
GENERATOR = 1
PARTS = ("audio.wav", "motion.npz", "beats.json")
FIGURES_PER_CLIP = 2
_CLIP_NAME = re.compile(r"clip_\d{4,}_(" + "|".join(DANCES) + ")")
ROTATING = {"dance", "figures"}  # settings that differ from clip to clip


def write_corpus(
    out: PathLike, *, clips: int = 200, seed: int = 1, progress: Progress = silent, **settings: Any
) -> Path:
    """Write a corpus of synthetic clips: a folder for each, with audio.wav, motion.npz and beats.json.

    The folders are called ``clip_0001_cha-cha`` and so on; the seven dances take turns. Each clip dances two figures of
    its dance, and clips take the figures in rotation, so that most clips share no figure with any other.

    A folder appears whole. A run that was stopped goes on where it was: folders with the same settings are kept, those
    with other settings are written anew. Of two that write the same folder at once, one waits for the other.

    Parameters
    ----------
    out : str or path
        A new or empty folder, or one that an earlier run wrote.
    clips : int
        Number of clips, 1 to 100,000.
    seed : int
        Of the corpus. Each clip has its own seed, which follows from it and stands in the clip's beats.json.
    progress : function(iterable, label) -> iterable
        Reports on the clips, such as a progress bar.
    **settings
        seconds, fps, tempo, drift, lateness, jitter, omission, redundancy, noise and sample_rate of every clip, as in
        `ClipSettings`.

    Returns
    -------
    Path of the folder `out`

    Raises
    ------
    ValueError
        If `out` holds anything else, or more clips than `clips`; nothing is overwritten then. Or for a setting out of
        range.
    """
    out = Path(out)
    if isinstance(clips, bool) or not isinstance(clips, Integral) or not 1 <= clips <= 100_000:
        raise ValueError(f"clips must be a whole number from 1 to 100000, got {clips!r}")
    if rotating := ROTATING & settings.keys():
        raise ValueError(f"{min(rotating)} is no setting of a corpus; dances and figures take turns in it")
    common = ClipSettings(seed=seed, **settings)
    plan = _plan(common, clips)
    _check_folder(out, set(plan))
    planted_clip(next(iter(plan.values())))  # settings out of range fail here, before a folder is made
    out.mkdir(parents=True, exist_ok=True)
    with _locked(out / ".lock"):
        for leftover in out.glob(f"{UNFINISHED}clip_*"):
            shutil.rmtree(leftover)
        shared = {key: value for key, value in asdict(common).items() if key not in ROTATING}
        write_json(out / "corpus.json", {"source": "synthetic", "generator": GENERATOR, "clips": int(clips), **shared})
        for name, one in progress(plan.items(), "making clips"):
            if not _is_finished(out / name, one):
                _write_clip(out / name, planted_clip(one, name=name))
    return out


def _plan(common: ClipSettings, clips: int) -> dict[str, ClipSettings]:
    """The settings of every clip by its folder's name."""
    plan: dict[str, ClipSettings] = {}
    for index, dance in enumerate(itertools.islice(itertools.cycle(DANCES), clips)):
        seed = int(np.random.SeedSequence([common.seed, 6, index]).generate_state(1)[0])
        figures = _figures(dance, common.seed, index // len(DANCES), common.seconds)
        plan[f"clip_{index + 1:04d}_{dance}"] = replace(common, dance=dance, seed=seed, figures=figures)
    return plan


def _figures(dance: str, seed: int, turn: int, seconds: float) -> tuple[str, ...]:
    """The figures of the `turn`-th clip of a dance: the vocabulary in a new order each time it is used up."""
    names = figure_names(dance)
    per_clip = int(np.clip(seconds // 8, FIGURES_PER_CLIP, len(names)))
    per_round = len(names) // per_clip
    order = np.random.default_rng([seed, 7, list(DANCES).index(dance), turn // per_round]).permutation(len(names))
    first = turn % per_round * per_clip
    return tuple(names[place] for place in order[first : first + per_clip])


@contextmanager
def _locked(lock: Path) -> Iterator[None]:
    """One writer at a time, as long as it writes; no lock file is left, and one that waits makes it anew."""
    with FileLock(lock):
        try:
            yield
        finally:
            with suppress(PermissionError):  # Windows keeps an open file
                lock.unlink()


def _check_folder(out: Path, expected: set[str]) -> None:
    """ValueError unless `out` can take the corpus without touching what others put there."""
    if out.exists() and not out.is_dir():
        raise ValueError(f"{out}: is a file; name a folder for the corpus")
    entries = sorted(out.glob("[!.]*"))
    ours = bool(entries) and _read_json(out / "corpus.json").get("source") == "synthetic"
    for each in entries:
        if ours and each.name == "corpus.json":
            continue
        if not (ours and each.is_dir() and _CLIP_NAME.fullmatch(each.name)):
            raise ValueError(f"{out}: holds {each.name}, which no synthetic corpus wrote; choose an empty folder")
        if each.name not in expected:
            raise ValueError(f"{out}: holds {each.name}, which is not among the clips asked for; choose another folder")
        if foreign := sorted(part.name for part in each.iterdir() if part.name not in PARTS):
            raise ValueError(f"{each}: holds {foreign[0]}, which no synthetic corpus wrote; move it elsewhere first")


def _is_finished(folder: Path, settings: ClipSettings) -> bool:
    """True if a folder holds the very clip that the settings describe."""
    is_whole = all((folder / part).is_file() for part in PARTS)
    return is_whole and bool(_read_json(folder / "beats.json").get("settings") == _recorded(settings))


def _recorded(settings: ClipSettings) -> dict[str, Any]:
    """The settings as they stand in beats.json."""
    return dict(plain({"generator": GENERATOR, **asdict(settings)}))


def _write_clip(folder: Path, planted: PlantedClip) -> None:
    """Write a clip's folder in place of what an earlier run left there."""
    with atomic_folder(folder) as part:
        save_audio(part / "audio.wav", planted.clip.audio)
        save_motion(part / "motion.npz", cast(Motion, planted.clip.motion), offset=planted.clip.offset)
        write_json(part / "beats.json", _annotation(planted))


def _annotation(planted: PlantedClip) -> dict[str, Any]:
    """The content of beats.json."""
    truth, settings = planted.annotation, planted.settings
    return {
        "source": "synthetic",
        "dance": truth.dance,
        "meter": truth.meter,
        "bpm": _rounded(truth.bpm),
        "beats_s": _rounded(truth.times),
        "beat_strengths": _rounded(truth.strengths),
        "downbeats_s": _rounded(truth.downbeats),
        "visual_beats_s": _rounded(planted.visual_beat_times),
        "motion_offset_s": 0.0,
        "seed": settings.seed,
        "units": [_unit(unit) for unit in truth.units],
        "settings": _recorded(settings),
    }


def _unit(unit: Unit) -> dict[str, Any]:
    """An entry of "units"."""
    times = {"start_s": _rounded(unit.start), "end_s": _rounded(unit.end)}
    return {"name": unit.name, **times, "beats": unit.beats, "figure": unit.figure}


def _rounded(values: Any) -> Any:
    """Numbers to a microsecond, as JSON takes them."""
    return np.round(values, 6).tolist()


def _read_json(path: Path) -> dict[str, Any]:
    """The content of a JSON file of ours; empty when it is missing or damaged."""
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError):
        return {}
    return content if isinstance(content, dict) else {}
