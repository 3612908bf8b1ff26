"""The evaluation of systems that dance: from folders of motions and songs to a table of how well each does."""

import itertools
import os
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import version
from operator import attrgetter
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from harmolab import files
from harmolab.files import MissingFrameRate, PathLike, Progress, check_output, is_close, plain, silent, write_json
from harmolab.lab.evaluate import engine, pairing, summary
from harmolab.lab.evaluate.measured import MEASURES, NETWORK_PACKAGES, has_networks, shipped_pose_net, weights_digest
from harmolab.lab.evaluate.pairing import RECORDED, Pair, Pairing, Unpaired
from harmolab.lab.evaluate.protocols import protocol_of
from harmolab.lab.evaluate.reference import Reference, is_saved, load_reference, measured_reference, save_reference
from harmolab.lab.evaluate.rows import CONTROLS, RowOptions, clip_row, control_pairs, pair_file, recorded_limits
from harmolab.lab.evaluate.sets import Collected, SetNumber, collect, protocol_sets, set_numbers, written_parts
from harmolab.readers.motion_file import ReadingOptions
from harmolab.readers.smpl import load_body

# Settings of an evaluation: which folders, read how


@dataclass(frozen=True)
class EvaluationSettings:
    """Settings of an evaluation: the folders that are read, and how.

    Paths may be text or Path.

    Parameters
    ----------
    systems : dict
        Name of a system -> folder of its dances.
    music : path
        Folder of the songs. A dance goes with the song of the same name, or whose name stands in its own as a word
        (`harmolab.lab.evaluate.pairing` has all rules).
    reference : path
        Recorded dances: a folder, a file that an evaluation has saved (`harmolab evaluate --save-reference`), or
        "synthetic", the file that comes with harmolab.
    pairs : path or None
        File of a list that says which dance goes with which song: a table with the columns motion and music, and
        optionally system, seed and offset (seconds into the song).
    protocols : sequence of str
        Names of published evaluation codes whose numbers are added (`PROTOCOLS`).
    fps : float, or dict by the name of a system
        Frame rate of motion files that hold none.
    scale, smpl, up : as in `harmolab.load_motion`
    pose_net : path or None
        Weights of a pose network for its Fréchet distance; None takes the one that comes with harmolab.
    resamples : int
        Resamplings behind each interval over songs.
    seed : int
        Of the resamplings.
    slice_stride : float or None, seconds
        Time from one slice of a song to the next, for dances that are named by their slice.
    seed_frames : int, or dict by the name of a system
        Frames at the start of each dance that its system was given; they are left out.

    Raises
    ------
    ValueError
        If there are no systems, one has the name of a row that every table has, or a protocol or axis is unknown.
    """

    systems: Mapping[str, PathLike]
    music: PathLike
    reference: PathLike
    pairs: PathLike | None = None
    protocols: Sequence[str] = ()
    fps: float | Mapping[str, float] | None = None
    scale: float | None = None
    pose_net: PathLike | None = None
    resamples: int = summary.RESAMPLES
    seed: int = 0
    smpl: PathLike | None = None
    up: str = ""
    slice_stride: float | None = None
    seed_frames: int | Mapping[str, int] = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "systems", {name: Path(folder) for name, folder in self.systems.items()})
        for name in ("music", "reference", "pairs", "pose_net", "smpl"):
            path = getattr(self, name)
            object.__setattr__(self, name, None if path is None else Path(path))
        if taken := set(self.systems) & set(CONTROLS):
            raise ValueError(f"{min(taken)!r} is the name of a row that every table has; call the system otherwise")
        if not self.systems and self.pairs is None:
            raise ValueError("there is nothing to evaluate: name a folder of dances, or --system NAME=FOLDER")
        ReadingOptions(up=self.up)  # an error for another axis
        object.__setattr__(self, "protocols", tuple(dict.fromkeys(self.protocols)))
        for name in self.protocols:
            protocol_of(name)

    def seed_frames_of(self, system: str) -> int:
        """Number of frames at the start of a system's dances that are left out."""
        return self.seed_frames if isinstance(self.seed_frames, int) else self.seed_frames.get(system, 0)

    def fps_of(self, system: str) -> float | None:
        """Frame rate of a system's files that hold none; None where it was not passed."""
        return self.fps.get(system) if isinstance(self.fps, Mapping) else self.fps

    @property
    def inputs(self) -> tuple[Path, ...]:
        """All files and folders that are read; "synthetic" is none of them."""
        paths = (*self.systems.values(), self.music, self.reference, self.pairs, self.pose_net, self.smpl)
        return tuple(Path(path) for path in paths if path is not None)

    def to_dict(self) -> dict[str, Any]:
        """The settings as JSON holds them."""
        named = {name: str(value) if isinstance(value, Path) else value for name, value in vars(self).items()}
        return {**named, "systems": {name: str(folder) for name, folder in self.systems.items()}}


# From the plan to the table

_ERROR = re.compile(r"^(?:ValueError|FileNotFoundError|MissingFrameRate): ")  # of this package: their words say all
MARK = "evaluation.json"  # settings of an evaluation; a folder without it is not ours
CLIPS, ROWS = "clips.csv", "rows"
PART_DANCES = 256  # rows of a part: a row has some 200 numbers, and the part that grows is held
Keep = Callable[[Pair], bool]


class Counts(NamedTuple):
    """Numbers of the dances of a system that were measured, of their songs, of their seeds, and of the dances in all.

    `total` counts also the dances that cannot be read or have a fault, and those that go with no song.
    """

    dances: int
    songs: int
    seeds: int
    total: int

    @property
    def text(self) -> str:
        """The number of dances, "22 of 40" where some were not measured."""
        return f"{self.dances}" if self.dances == self.total else f"{self.dances} of {self.total}"


class Extreme(NamedTuple):
    """The best or the worst dance of a system by harmony above chance, and the number of dances it was picked among."""

    pair: Pair
    harmony: float
    dances: int


@dataclass(frozen=True, eq=False)
class Evaluation:
    """The result of `evaluate_dances`: the table of an evaluation, and the numbers behind it.

    `write_evaluation` writes it as a page and in other formats.

    Parameters
    ----------
    settings : EvaluationSettings
    options : RowOptions
        Settings of the measurement of each dance.
    systems : tuple of str
        Names of the systems, in the order of the table.
    controls : tuple of str
        Names of the rows that come after them for comparison, such as the recorded dances and a held pose.
    songs : DataFrame
        By system and song, the mean of every measure over dances and seeds; by group of songs where there are more than
        5,000 songs.
    means : dict
        (system, measure) -> its mean over songs, with an interval. Columns of a protocol have means over dances.
    differences : list
        The differences of two systems in each measure, paired by song, with an interval.
    sets : dict
        (system, measure) -> number of the system's dances as a set: Fréchet distance, diversity, multimodality.
    ranks : dict
        Measure -> system -> its rank; systems without one are left out.
    counts : dict
        System -> numbers of dances, songs and seeds that were measured.
    facts : dict
        System -> fact, such as "fps" -> number of dances that have each value.
    extremes : dict
        System -> (its worst dance, its best), by harmony.
    unpaired : tuple
        Files that have no part in the table, with the reason.
    errors : tuple
        Dances that could not be measured, with the reason.
    """

    settings: EvaluationSettings
    options: RowOptions
    systems: tuple[str, ...]
    controls: tuple[str, ...]
    songs: pd.DataFrame
    means: Mapping[tuple[str, str], summary.Mean]
    differences: Sequence[summary.Difference]
    sets: Mapping[tuple[str, str], SetNumber]
    ranks: Mapping[str, Mapping[str, int]]
    counts: Mapping[str, Counts]
    facts: Mapping[str, Mapping[str, Counter[str]]]
    extremes: Mapping[str, tuple[Extreme, ...]]
    unpaired: tuple[Unpaired, ...]
    errors: tuple[Unpaired, ...]

    @property
    def rows(self) -> tuple[str, ...]:
        """The names of all rows of the table."""
        return (*self.systems, *self.controls)

    def over_songs(self, system: str) -> str:
        """Words to stand behind a share of a system's dances: ", in the mean over songs", or "" with one a song."""
        return "" if self.counts[system].dances == self.counts[system].songs else ", in the mean over songs"

    @property
    def missing(self) -> int:
        """Number of dances of the systems, and of recorded ones, that were not measured."""
        counts = (self.counts[name] for name in (*self.systems, RECORDED))
        return sum(one.total - one.dances for one in counts)

    @property
    def measures(self) -> tuple[str, ...]:
        """The measures of single dances that anything was measured of, in the order of the table."""
        measured = dict.fromkeys(measure for _, measure in self.means)
        published = (name for one in self.settings.protocols for name in measured if name.startswith(f"{one} "))
        return (*(name for name in MEASURES if name in measured), *published)

    @property
    def set_measures(self) -> tuple[str, ...]:
        """The measures of sets of dances that there are."""
        return tuple(dict.fromkeys(measure for _, measure in self.sets))


def evaluate_dances(
    settings: EvaluationSettings,
    out: PathLike,
    *,
    jobs: int | None = 0,
    scheduler: str = "",
    resume: bool = False,
    force: bool = False,
    progress: Progress = silent,
) -> Evaluation:
    """Evaluate systems that dance: measure every dance, and compare the systems with each other.

    Recorded dances, a held pose and other controls stand beside them. `harmolab evaluate` is this function and
    `write_evaluation`; for dances in memory take `measure_dances` or `harmolab.evaluate`.

    Parameters
    ----------
    settings : EvaluationSettings
    out : str or path
        Folder that gets the settings and clips.csv, which has a row for each dance. It also keeps what was measured so
        far, so that a run that was stopped can be resumed.
    jobs, scheduler, resume : as in `run_rows`
    force : bool
        Write into a folder that no evaluation wrote, whose files stay; or begin a run anew that was cut off.
    progress : function(iterable, label) -> iterable
        Reports on the dances, such as a progress bar.

    Returns
    -------
    Evaluation

    Raises
    ------
    FileNotFoundError, ValueError
        If a folder is missing or nothing in it goes with a song, if no dance of a system can be measured, or if `out`
        must not be written to. Both name the folder or file.

    Examples
    --------
    >>> settings = EvaluationSettings({"ours": "ours"}, music="songs", reference="recorded")  # doctest: +SKIP
    >>> write_evaluation("table", evaluate_dances(settings, "table"))  # doctest: +SKIP
    """
    engine.check_engine_installed(jobs, scheduler)
    out = Path(out)
    plan = begun(settings, out, resume=resume, force=force, progress=progress)
    parts = measured_parts(plan, out, jobs=jobs, scheduler=scheduler, resume=resume, progress=progress)
    return finished(settings, plan, parts, out)


class Plan(NamedTuple):
    """All that an evaluation measures, before it is measured.

    `tasks` are the pairs of all rows, in the order of the table, `saved` the reference whose rows are measured already,
    `unpaired` the files that have no part in the table.
    """

    options: RowOptions
    tasks: tuple[Pair, ...]
    saved: Reference | None
    unpaired: tuple[Unpaired, ...]


def planned(settings: EvaluationSettings, *, keep: Keep = lambda pair: True, progress: Progress = silent) -> Plan:
    """The plan of an evaluation; of its tasks those that `keep` is true of, so that a shard does not hold the others.

    Errors as `evaluate_dances`.
    """
    saved = saved_reference(settings)
    pairs, unpaired, _ = evaluation_pairs(settings, keep=keep)
    recorded = [pair for pair in pairs if pair.kind == RECORDED]
    if settings.smpl is not None:
        load_body(settings.smpl)  # a damaged file is an error now, not in every row
    same = {name: getattr(settings, name) for name in ("scale", "smpl", "up")}
    options = RowOptions(pose_net=_pose_net(settings), protocols=tuple(settings.protocols), **same)
    _check_rates(pairs, options)
    limits = recorded_limits(recorded, options, progress=progress) if saved is None else saved.limits
    options = replace(options, limits=limits)
    controls = (pair for pair in control_pairs(recorded) if keep(pair))
    return Plan(options, (*(pair for pair in pairs if pair.kind != RECORDED), *controls), saved, unpaired)


def begun(
    settings: EvaluationSettings, out: Path, *, resume: bool, force: bool, progress: Progress,
    keep: Keep = lambda pair: True, **mark: Any,
) -> Plan:  # fmt: skip
    """The plan of a run in a folder, which gets its settings, unfinished, once nothing speaks against it.

    `mark` is written beside the settings. Errors as `evaluate_dances`.
    """
    check_table_folder(out, settings, force=force)
    engine.check_free(out / ROWS)
    is_run = (out / ROWS / engine.MANIFEST).is_file()
    if is_run and resume:
        _check_shard(out, mark.get("shard"))
    elif is_run and not force:
        engine.read_rows(out / ROWS)  # an error where it was cut off: what it measured is not thrown away unasked
    plan = planned(settings, keep=keep, progress=progress)
    if is_run and resume:
        _check_limits(out / ROWS, settings, plan.options)
        engine.check_resumed(in_order(plan.tasks), out / ROWS, plan.options.to_dict())
    write_mark(out, settings, rows=None, **mark)
    return plan


def _check_shard(out: Path, shard: str | None) -> None:
    """ValueError where the run in a folder is of another shard, before its dances are read."""
    if (former := read_mark(out).get("shard")) != shard:
        raise ValueError(f"{out}: the run was begun otherwise: shard was {former} and is {shard}; name another folder")


def read_mark(out: Path) -> Mapping[str, Any]:
    """The folder's mark, as `write_mark` wrote it; FileNotFoundError or ValueError names the file."""
    with files.reading(out / MARK, "the settings of an evaluation") as file:
        about = files.read_json(file)
        if not isinstance(about, dict) or not isinstance(about.get("settings"), dict):
            raise ValueError("holds no settings of an evaluation")
        return about


def write_mark(out: Path, settings: EvaluationSettings, **more: Any) -> None:
    """Make the folder of an evaluation, and write its settings there; `rows` is None until all are measured."""
    out.mkdir(parents=True, exist_ok=True)
    about = {"maker": "harmolab evaluate", "version": version("harmolab"), "settings": settings.to_dict(), **more}
    write_json(out / MARK, about)


def in_order(tasks: Iterable[Pair]) -> list[Pair]:
    """Tasks in the order in which they are measured."""
    return sorted(tasks, key=lambda pair: pair.key)


def measured_parts(
    plan: Plan, out: Path, *, jobs: int | None, scheduler: str, resume: bool, progress: Progress
) -> Iterator[pd.DataFrame]:
    """The rows of the tasks of a plan, by `run_rows`."""
    return engine.run_rows(
        in_order(plan.tasks), partial(clip_row, options=plan.options), out / ROWS, jobs=jobs,
        scheduler=scheduler, resume=resume, force=not resume, settings=plan.options.to_dict(),
        stamp=attrgetter("stamp"), part_rows=PART_DANCES, progress=progress,
    )  # fmt: skip


def finished(settings: EvaluationSettings, plan: Plan, parts: Iterable[pd.DataFrame], out: Path) -> Evaluation:
    """The evaluation that rows come to, which are written to clips.csv on the way."""
    saved, tasks = plan.saved, plan.tasks
    controls = () if saved is None else (saved.for_pose_net(weights_digest(plan.options.pose_net)).rows,)
    collected = collect(itertools.chain(controls, written_parts(parts, out / CLIPS, tasks)))
    pairs = (*tasks, *(saved.pairs if saved else ()))
    evaluation = _evaluation(settings, plan.options, pairs, collected, plan.unpaired)
    write_mark(out, settings)  # it is complete
    return evaluation


def saved_reference(settings: EvaluationSettings) -> Reference | None:
    """The reference that settings name; None for a folder of recorded dances.

    Raises
    ------
    FileNotFoundError, ValueError
        As `load_reference`; and where it lacks the numbers of a protocol.
    """
    if not is_saved(settings.reference):
        return None
    reference = load_reference(settings.reference)
    if missing := [name for name in settings.protocols if name not in reference.protocols]:
        raise ValueError(
            f"{settings.reference}: has no numbers of the protocol {missing[0]}; save it anew with --protocol"
        )
    return reference


def write_reference(path: PathLike, evaluation: Evaluation, out: PathLike) -> None:
    """Write the recorded dances of an evaluation that was measured into `out` as a `Reference`, into one file.

    Raises
    ------
    ValueError
        Its recorded dances come out of such a file themselves.
    """
    settings, options = evaluation.settings, evaluation.options
    if is_saved(settings.reference):
        raise ValueError(f"{settings.reference}: is a saved reference already; name a folder of recorded dances")
    save_reference(path, measured_reference(Path(out) / ROWS, options.limits, settings.protocols, options.pose_net))


def _check_limits(rows: Path, settings: EvaluationSettings, options: RowOptions) -> None:
    """ValueError where a run was begun with other recorded dances, from the limits of which all of its rows follow."""
    former, now = engine.read_manifest(rows).get("settings"), plain(options.to_dict())
    if isinstance(former, dict) and not is_close(former, now) and {**former, "limits": None} == {**now, "limits": None}:
        raise ValueError(
            f"{settings.reference}: the recorded dances have changed since {rows} was begun, and the likeness of every "
            "dance with them; begin anew by --force, without --resume"
        )


def check_table_folder(out: Path, settings: EvaluationSettings, *, force: bool) -> None:
    """ValueError unless a table may be written to `out`: it is no input, nor in a folder of dances, and new or ours."""
    check_output(out, settings.inputs)
    for folder in map(Path, (*settings.systems.values(), settings.reference)):
        if folder.resolve() in out.resolve().parents:
            raise ValueError(f"{out}: lies in a folder of dances ({folder}); choose another place for the table")
    if out.exists() and not out.is_dir():
        raise ValueError(f"{out}: is a file; name a folder for the table")
    if out.exists() and any(out.iterdir()) and not (out / MARK).is_file() and not force:
        raise ValueError(f"{out}: holds files that are no table of harmolab; name a new folder, or pass --force")
    if not (parent := out.resolve().parent).is_dir():
        raise ValueError(f"{out.parent}: no such folder")
    if not os.access(out if out.exists() else parent, os.W_OK | os.X_OK):
        raise ValueError(f"{out}: nothing may be written there; name a folder in another place")


def evaluation_pairs(settings: EvaluationSettings, *, keep: Keep = lambda pair: True) -> Pairing:
    """The dances of all systems that `keep` is true of, and the recorded ones, with their songs.

    Errors as `evaluate_dances`.
    """
    songs = pairing.songs_in(settings.music)
    has_folder = not is_saved(settings.reference)
    in_folder = partial(pairing.folder_pairs, songs=songs, slice_stride=settings.slice_stride)
    parts = [in_folder(RECORDED, settings.reference, kind=RECORDED)] if has_folder else []
    if settings.pairs is None:
        folders = (in_folder(name, folder) for name, folder in settings.systems.items())
        parts += [Pairing(tuple(filter(keep, part.pairs)), part.unpaired) for part in folders]
    else:
        default, stride = next(iter(settings.systems), "generated"), settings.slice_stride
        pairs_of = partial(pairing.listed_pairs, settings.pairs, settings.music, settings.systems)
        parts.append(pairs_of(default=default, slice_stride=stride, keep=keep))
    pairs = tuple(_with_answers(settings, pair) for part in parts for pair in part.pairs)
    listed = {system for part in parts for system in part.systems}
    _check_names(settings, {*settings.systems, *listed})
    if taken := listed & set(CONTROLS):
        raise ValueError(f"{settings.pairs}: {min(taken)!r} is a row of every table; call the system otherwise")
    if settings.pairs is not None and (unlisted := [name for name in settings.systems if name not in listed]):
        raise ValueError(f"{settings.pairs}: names no dance of {unlisted[0]!r}, whose folder was passed; leave it out")
    unpaired = tuple(one for part in parts for one in part.unpaired)
    return Pairing(pairs, (*unpaired, *pairing.unused_songs(songs, pairs)))


def _with_answers(settings: EvaluationSettings, pair: Pair) -> Pair:
    """The pair with its system's frame rate and with the frames that it was given; a recorded dance was given none."""
    seed_frames = 0 if pair.kind == RECORDED else settings.seed_frames_of(pair.system)
    return replace(pair, seed_frames=seed_frames, fps=settings.fps_of(pair.system))


def _check_names(settings: EvaluationSettings, systems: Collection[str]) -> None:
    """ValueError for a rate or a seed of a system that is not there."""
    for option, value, others in (("fps", settings.fps, (RECORDED,)), ("seed-frames", settings.seed_frames, ())):
        if isinstance(value, Mapping) and (unknown := [name for name in value if name not in (*systems, *others)]):
            raise ValueError(f"--{option} {unknown[0]}={value[unknown[0]]:g}: no system is called {unknown[0]!r}")


def _pose_net(settings: EvaluationSettings) -> Path | None:
    """The weights of the pose network: those of the settings, else the shipped ones; None where they cannot be run."""
    if settings.pose_net is None:
        return shipped_pose_net()
    if not has_networks():
        raise ValueError(f"{settings.pose_net}: a pose network needs {' and '.join(NETWORK_PACKAGES)}; install them")
    from harmolab.systems.training.pose_network import load_pose_net

    load_pose_net(settings.pose_net)  # a damaged file is an error now, not in every row
    return Path(settings.pose_net)


def _check_rates(pairs: Sequence[Pair], options: RowOptions) -> None:
    """The error of the first system whose first dance has no frame rate, before anything is measured."""
    first = {pair.system: pair for pair in reversed(pairs)}
    for system in dict.fromkeys(pair.system for pair in pairs):
        try:
            pair_file(first[system], options)
        except MissingFrameRate:
            raise
        except (ValueError, OSError):
            continue  # one damaged file is a line of the table's errors


def _evaluation(
    settings: EvaluationSettings, options: RowOptions, tasks: Sequence[Pair], collected: Collected,
    unpaired: Iterable[Unpaired],
) -> Evaluation:  # fmt: skip
    """The record of what was collected."""
    by_key = {pair.key: pair for pair in tasks}
    # A recorded dance that cannot be measured fails in the rows of all controls, with the same words.
    errors = tuple(dict.fromkeys(_failure(by_key[key].motion, reason) for key, reason in collected.errors.items()))
    names, unpaired = tuple(dict.fromkeys(pair.system for pair in tasks)), tuple(dict.fromkeys(unpaired))
    unmatched = Counter(one.system for one in unpaired)
    counts = {name: _counts(name, tasks, collected.errors, unmatched[name]) for name in names}
    if lost := [name for name in names if not counts[name].dances]:
        first = next(reason for key, reason in collected.errors.items() if by_key[key].system == lost[0])
        raise ValueError(f"no dance of {lost[0]!r} could be measured: {_ERROR.sub('', first)}")
    systems = tuple(name for name in names if name not in CONTROLS)
    songs = collected.song_means
    interval = partial(summary.song_interval, count=settings.resamples, seed=settings.seed)
    differences = summary.system_differences(songs, names, interval=interval)
    sets = set_numbers(collected.features, seed=settings.seed)
    for name in settings.protocols:
        sets |= protocol_sets(collected.features, name)
    published = [name for name in map(str, songs.columns) if name.partition(" ")[0] in settings.protocols]
    means = summary.system_means(songs, interval=interval)
    means |= summary.dance_means(collected.sums, collected.counts, published, interval=interval)
    rank = partial(summary.ranks, differences, systems)
    ranks = {name: rank(name, better=summary.measure_of(name).better) for name in map(str, songs.columns)}
    extremes: dict[str, tuple[Extreme, ...]] = {}
    for name in (*systems, RECORDED):
        if name in collected.extremes:
            dances = int(collected.counts.loc[name]["harmony"].sum())
            extremes[name] = tuple(Extreme(by_key[key], harmony, dances) for harmony, key in collected.extremes[name])
    return Evaluation(
        settings, options, systems, tuple(name for name in names if name in CONTROLS), songs,
        means, differences, sets, ranks, counts, collected.facts, extremes,
        tuple(dict.fromkeys(unpaired)), errors,
    )  # fmt: skip


def _failure(motion: Path, reason: str) -> Unpaired:
    """A dance that was not measured, and the reason without its kind of error and without the name of the dance."""
    return Unpaired(motion, _ERROR.sub("", reason).removeprefix(f"{motion}: "))


def _counts(system: str, tasks: Iterable[Pair], errors: Mapping[str, str], unmatched: int) -> Counts:
    """The counts of a system of which so many dances go with no song."""
    own = [pair for pair in tasks if pair.system == system]
    measured = [pair for pair in own if pair.key not in errors]
    songs, seeds = {pair.song for pair in measured}, {pair.seed for pair in measured}
    return Counts(len(measured), len(songs), len(seeds), len(own) + unmatched)
