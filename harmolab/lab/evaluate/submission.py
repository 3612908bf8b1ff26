"""A row for the leaderboard: a folder made from a table, that can be sent, and whose numbers follow from its files.

==============  ======================================================================================================
``row.json``    "about", which people write: what the data are; "measured": command, versions, settings, numbers
evidence.csv    a line a dance with its measures: all numbers are computed from it
files.csv       name and SHA-256 of every file of motion and music; the digest of the data is computed from it
==============  ======================================================================================================

A README.md that people write may stand beside them.
"""

import datetime
import hashlib
import io
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import pandas as pd

from harmolab.files import PathLike, is_close, plain, read_json, reading, write_json, write_text
from harmolab.lab.evaluate import summary
from harmolab.lab.evaluate.as_text import MUSICAL
from harmolab.lab.evaluate.engine import MANIFEST, read_manifest
from harmolab.lab.evaluate.evaluation import CLIPS, MARK, ROWS
from harmolab.lab.evaluate.measured import MEASURES
from harmolab.lab.evaluate.pairing import OTHER_SONG, RECORDED, annotation_of, input_stamp
from harmolab.lab.evaluate.parts import STAMP, part_paths, part_texts
from harmolab.lab.evaluate.reference import is_saved
from harmolab.lab.evaluate.rows import CONTROLS
from harmolab.lab.evaluate.sets import collect

ROW, EVIDENCE, FILES, README = "row.json", "evidence.csv", "files.csv", "README.md"
ABOUT = ("title", "by", "synthetic", "data", "licence", "obtain", "note", "commands")
MAY_BE_EMPTY = ("note", "commands", "synthetic")
# Of a dance, beside its measures.
NAMES = ("system", "seed", "song", "kind", "dance", "beats", "fps", "joints", "offset", "begins")
TABLE_MEASURES = (
    *("harmony", "harmony_dance", "significant", "paper_harmony", "paper_harmony_chance", "beat_align_motion"),
    *("beat_align_music", "mir_eval_f", "pfc", "foot_skating", "freezing", "jerk", "likeness"),
)
# Settings of an evaluation that its numbers depend on, beside the folders.
OPTIONS = ("protocols", "fps", "scale", "smpl", "up", "slice_stride", "seed_frames", "resamples", "seed")
_OPTION = {"protocols": "protocol"}  # settings whose option is called otherwise
LARGEST = 100_000  # bytes of the evidence
MOST_RESAMPLES = 100_000  # of the intervals of a row that others send
_PLACE = re.compile(r"(?:^|[\s\"',=])(?:/|~/|[A-Za-z]:\\)\S")  # a path of somebody's disk


class Submission(NamedTuple):
    """The content of a row but for "about": its evidence, its files, and what was measured."""

    evidence: pd.DataFrame
    files: pd.DataFrame
    measured: dict[str, Any]


def evaluate_numbers(dances: pd.DataFrame, settings: Mapping[str, Any]) -> dict[str, Any]:
    """Mean, interval and rank of each measure of each system, from the evidence, as the table has them.

    Means are over songs, those of the columns of a protocol over dances.

    Parameters
    ----------
    dances : DataFrame, the evidence
    settings : with the entries resamples and seed

    Returns
    -------
    dict : "systems", name -> numbers of dances and songs, and measure -> mean, interval and rank; "deaf", the measures
        of music by which recorded dances are not better than the same with another song
    """
    collected = collect([dances.assign(key=dances.index.map("{:06d}".format), skeleton="", error="")])
    songs = collected.song_means
    interval = partial(summary.song_interval, count=settings["resamples"], seed=settings["seed"])
    present = dict.fromkeys(dances["system"])
    systems = [name for name in present if name not in CONTROLS]
    names = [*systems, *(name for name in CONTROLS if name in present)]
    published = summary.dance_means(collected.sums, collected.counts, _published(dances), interval=interval)
    means = summary.system_means(songs, interval=interval) | published
    differences = summary.system_differences(songs, names, interval=interval)
    numbers: dict[str, dict[str, Any]] = {}
    for name in names:
        own = dances[dances["system"] == name]
        numbers[name] = {"dances": len(own), "songs": own["song"].nunique()}
        for measure in (*TABLE_MEASURES, *_published(dances)):
            if (name, measure) in means:
                mean, low, high, _ = means[name, measure]
                places = summary.ranks(differences, systems, measure, better=summary.measure_of(measure).better)
                numbers[name][measure] = {"mean": mean, "interval": [low, high], "rank": places.get(name)}
    pair = (RECORDED, OTHER_SONG)
    clear = {one.measure for one in differences if (one.a, one.b) == pair and one.is_clear and one.low > 0}
    deaf = {*MUSICAL, "significant"} - clear
    return {"systems": numbers, "deaf": [name for name in TABLE_MEASURES if name in deaf]}


def _published(dances: pd.DataFrame) -> list[str]:
    """The columns of published protocols: their names have a blank, and no others do."""
    return [name for name in map(str, dances) if " " in name]


def submission_of(table: PathLike) -> Submission:
    """The content of a row, from the folder that `harmolab evaluate --out` wrote.

    Raises
    ------
    FileNotFoundError, ValueError
        There is no table in the folder, or some of its dances were not measured; names it.
    """
    table = Path(table)
    with reading(table / MARK, "an evaluation") as path:
        about = read_json(path)
        settings = about["settings"] | {"smpl": Path(about["settings"].get("smpl") or "").name}
        if about.get("rows", 0) is None:
            raise ValueError("holds a run that is not finished; go on with it by --resume")
        if is_saved(settings["reference"]):
            raise ValueError(
                "was made beside saved recorded dances; a row needs their folder by --reference, since it names the "
                "hash of each file: measure anew, into another folder"
            )
    with reading(table / CLIPS, "the dances of an evaluation") as path:
        clips = _dances(path.read_bytes())
    if failed := _failed(table, clips):
        raise ValueError(f"{table / CLIPS}: {failed} dances could not be measured; a row is of whole sets: mend them")
    _check_unchanged(table, clips)
    dances = clips[[name for name in (*NAMES, *MEASURES, *_published(clips)) if name in clips]]
    annotations = [beats for music in set(clips["music"]) if (beats := annotation_of(Path(music))) is not None]
    files = file_hashes([*clips["motion"], *clips["music"], *annotations])
    options = {name: settings[name] for name in OPTIONS if settings.get(name) not in (None, "", 0) or name == "seed"}
    measured = {
        "kind": "evaluate", "command": _command(settings, options), "settings": options, "digest": digest_of(files),
        "recordings": sorted(set(dances["song"])),
        "versions": read_manifest(table / ROWS)["versions"] if (table / ROWS / MANIFEST).is_file() else {},
    }  # fmt: skip
    return Submission(dances, files, measured)


def _check_unchanged(table: Path, clips: pd.DataFrame) -> None:
    """ValueError where a dance or song is not there any more, or is another than was measured."""
    measured = {text.split(" ")[0] for part in part_paths(table / ROWS) for text in part_texts(part, STAMP)}
    for motion, music in dict.fromkeys(zip(clips["motion"], clips["music"], strict=True)):
        if missing := next((path for path in (motion, music) if not Path(path).exists()), None):
            raise FileNotFoundError(f"{missing}: no such file; go to the folder in which the table was made")
        if measured and input_stamp(Path(motion), Path(music)) not in measured:
            raise ValueError(
                f"{motion} or {music}: has changed since it was measured, in size or time of change (a copy keeps it "
                "by cp -p); measure it again with --resume"
            )


def _dances(content: bytes) -> pd.DataFrame:
    """A table of dances; whatever is no number is a text: songs may be called 001 or None."""
    text = dict.fromkeys({*NAMES, "recording", "motion", "music", "error"} - {"fps", "joints", "offset"}, str)
    dances = pd.read_csv(io.BytesIO(content), dtype=text, keep_default_na=False, na_values=[""])
    return dances.fillna(dict.fromkeys(dances.select_dtypes(exclude="number"), ""))


def _failed(table: Path, clips: pd.DataFrame) -> int:
    """The number of dances of an evaluation that were not measured, of the systems also those that go with no song."""
    errors = clips["error"] != ""
    if not (table / "table.csv").is_file():
        return int(errors.sum())
    counts = pd.read_csv(table / "table.csv")
    missing = (counts["total"] - counts["dances"])[~counts["control"]].sum() if "total" in counts else 0
    return int(missing + (errors & clips["system"].isin([RECORDED, *CONTROLS])).sum())


def _command(settings: Mapping[str, Any], options: Mapping[str, Any]) -> str:
    """The command of an evaluation with these `OPTIONS`, without the places of its folders."""
    systems = settings["systems"].items()
    words: list[tuple[str, Any]] = [("system", f"{key}={Path(place).name}") for key, place in systems]
    words += [(name, Path(settings[name]).name) for name in ("music", "reference", "pairs") if settings.get(name)]
    for name, value in options.items():
        several = [f"{key}={one}" for key, one in value.items()] if isinstance(value, dict) else value
        words += [(name, one) for one in (several if isinstance(several, list) else [value])]
    texts = (f"--{_OPTION.get(name, name).replace('_', '-')} {word}" for name, word in words)
    return " ".join(["harmolab evaluate", *texts, "--out table"])


def file_hashes(paths: Iterable[PathLike]) -> pd.DataFrame:
    """Name and SHA-256 of some files and of all in some folders but hidden ones, whatever lies above them; sorted."""
    lines = sorted(
        (path.relative_to(top.parent).as_posix(), hashlib.sha256(path.read_bytes()).hexdigest())
        for top in map(Path, set(paths))
        for path in (top.rglob("*") if top.is_dir() else [top])
        if path.is_file() and not path.name.startswith(".")
    )
    return pd.DataFrame(lines, columns=["file", "sha256"])


def digest_of(files: pd.DataFrame) -> str:
    """SHA-256 over the names and hashes of files, in the order of their names."""
    lines = sorted(f"{name} {digest}\n" for name, digest in zip(files["file"], files["sha256"], strict=True))
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def sources_digest() -> str:
    """SHA-256 over the Python files of the package: two copies of one version that differ have different ones."""
    folder = Path(__file__).resolve().parents[2]
    lines = (path.relative_to(folder).as_posix().encode() + path.read_bytes() for path in sorted(folder.rglob("*.py")))
    return hashlib.sha256(b"".join(lines)).hexdigest()


def write_submission(table: PathLike, out: PathLike) -> None:
    """Write the folder of a row from that of a table; an "about" that is there stays as it is.

    Raises
    ------
    FileNotFoundError, ValueError
        As `submission_of`; `out` holds other files than those of a row.
    """
    out = Path(out)
    names = {path.name for path in out.iterdir() if not path.name.startswith(".")} if out.is_dir() else set()
    if strangers := sorted(names - {ROW, EVIDENCE, FILES, README}):
        raise ValueError(f"{out}: holds {strangers[0]}, which is no part of a row; name a new folder")
    row = submission_of(table)
    former = dict(row_content(out).get("about", {})) if (out / ROW).is_file() else {}
    about = dict.fromkeys(ABOUT, "") | {"synthetic": False, "commands": []} | former
    out.mkdir(parents=True, exist_ok=True)
    write_text(out / EVIDENCE, csv_text(row.evidence))
    write_text(out / FILES, csv_text(row.files))
    code = {"version": version("harmolab"), "sources": sources_digest(), "date": datetime.date.today().isoformat()}
    numbers = evaluate_numbers(read_evidence(out), row.measured["settings"])
    write_json(out / ROW, {"about": about, "measured": row.measured | {"harmolab": code, "numbers": numbers}})


def csv_text(table: pd.DataFrame) -> str:
    """A table as the files of a row hold it: six digits."""
    return str(table.to_csv(index=False, float_format="%.6g", lineterminator="\n"))


def row_content(folder: Path) -> dict[str, Any]:
    """The content of row.json in a folder; errors as `harmolab.files.reading`."""
    with reading(folder / ROW, "a row of the leaderboard") as path:
        content = read_json(path)
        if not isinstance(content, dict):
            raise ValueError("must be an object with about and measured")
        return content


def read_evidence(folder: Path) -> pd.DataFrame:
    """The evidence of a row; what stands for no seed or no dance is an empty text."""
    with reading(folder / EVIDENCE, "the evidence of a row") as path:
        return _dances(path.read_bytes())


def submission_faults(folder: PathLike) -> list[str]:
    """Sentences on what a row lacks or what does not follow from its own files; empty for a row that can be sent.

    Raises
    ------
    FileNotFoundError, ValueError
        A file of the row is missing or damaged; names it.
    """
    folder = Path(folder)
    content, evidence = row_content(folder), read_evidence(folder)
    with reading(folder / FILES, "the files of a row") as path:
        files = pd.read_csv(path, dtype=str)
        if list(files) != ["file", "sha256"]:
            raise ValueError(f"must have the columns file and sha256, got {list(files)}")
    about, measured = content.get("about"), content.get("measured")
    if not (isinstance(about, dict) and isinstance(measured, dict)):
        return [f"{ROW}: lacks about or measured; make the row by harmolab evaluate submit TABLE --out FOLDER"]
    with reading(folder / ROW, "a row of the leaderboard"):  # a setting or a column may be missing, or be no number
        return [*about_faults(about), *_number_faults(measured, evidence, files), *_text_faults(folder)]


def about_faults(about: Mapping[str, Any]) -> Iterator[str]:
    """One sentence on the fields that people have not written yet."""
    empty = [name for name in ABOUT if name not in about or (name not in MAY_BE_EMPTY and not about[name])]
    if empty:
        yield f'{ROW}: "about" lacks {", ".join(empty)}'


def _number_faults(measured: Mapping[str, Any], evidence: pd.DataFrame, files: pd.DataFrame) -> Iterator[str]:
    if not 100 <= measured["settings"]["resamples"] <= MOST_RESAMPLES:
        yield f"{ROW}: resamples must lie between 100 and {MOST_RESAMPLES}"
        return
    if not is_close(plain(evaluate_numbers(evidence, measured["settings"])), measured["numbers"]):
        yield f"{ROW}: its numbers do not follow from {EVIDENCE}; make the row anew"
    if measured.get("digest") != digest_of(files):
        yield f"{ROW}: the digest of the data does not follow from {FILES}"
    if sorted(set(evidence["song"])) != measured.get("recordings"):
        yield f"{ROW}: its recordings are not the songs of {EVIDENCE}"


def _text_faults(folder: Path) -> Iterator[str]:
    size = (folder / EVIDENCE).stat().st_size
    if size >= LARGEST:
        yield f"{EVIDENCE}: has {size} bytes; a row stays below {LARGEST}"
    for name in (ROW, EVIDENCE, FILES, README):
        if (folder / name).is_file() and (place := _PLACE.search((folder / name).read_text("utf-8"))):
            yield f"{name}: names a place on a disk ({place[0].strip()}...); it would be published"
