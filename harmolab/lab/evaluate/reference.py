"""Recorded dances measured once, in one file that every later evaluation reads: `harmolab evaluate --save-reference`.

The file is an .npz with the rows of the controls (recorded dances, the same with another song, a pose that is held) and
with the limits of likeness. It holds numbers and names, no movement and no sound. An evaluation with it has the numbers
of one with the folder.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from harmolab.files import WRITTEN_BY, PathLike, atomic_write, plain, reading
from harmolab.lab.evaluate.engine import ERROR, KEY, read_rows
from harmolab.lab.evaluate.measured import weights_digest
from harmolab.lab.evaluate.pairing import OTHER_SONG, RECORDED, Pair
from harmolab.lab.evaluate.sets import feature_names
from harmolab.metrics.likeness import LikenessLimits
from harmolab.readers.arrays import read_npz
from harmolab.types import FloatArray

FORMAT = "harmolab reference 1"
SYNTHETIC = "synthetic"  # stands for the file that comes with harmolab
SHIPPED = Path(__file__).with_name("synthetic.npz")
NAMES = ("system", "seed", "song", "motion", "music", "kind")  # text that every row has
_KINDS = {"about": "u", "numbers": "f"}


@dataclass(frozen=True, eq=False)
class Reference:
    """Recorded dances as an evaluation takes them: measured, not to be watched.

    Parameters
    ----------
    rows : DataFrame, a row a dance of each control: `clip_row` with "key" and an empty "error"
    limits : LikenessLimits of the recorded dances, None where they gave none
    protocols : as in `EvaluationSettings`, of which published codes the rows have the numbers
    pose_net : str, digest of the weights behind the pose features, "" without these
    """

    rows: pd.DataFrame
    limits: LikenessLimits | None = None
    protocols: Sequence[str] = ()
    pose_net: str = ""

    @property
    def pairs(self) -> tuple[Pair, ...]:
        """The pair of each row; its paths are names alone."""
        return tuple(_pair(row) for row in self.rows[list(NAMES)].to_dict("records"))

    @property
    def features(self) -> pd.DataFrame:
        """The rows of the recorded dances with their own songs."""
        return self.rows[self.rows["system"] == RECORDED]

    def for_pose_net(self, digest: str) -> "Reference":
        """The same without features of another pose network than that of the digest."""
        if digest == self.pose_net or "pose" not in feature_names(self.rows):
            return self
        others = [name for name in self.rows if not str(name).startswith("f_pose_")]
        return Reference(self.rows[others], self.limits, self.protocols)


def _pair(row: Mapping[Any, Any]) -> Pair:
    return Pair(row["system"], row["seed"], row["song"], Path(row["motion"]), Path(row["music"]), row["kind"])


def measured_reference(
    rows_folder: PathLike, limits: LikenessLimits | None, protocols: Sequence[str], pose_net: Path | None
) -> Reference:
    """The reference in the rows of an evaluation with recorded dances.

    Raises
    ------
    FileNotFoundError, ValueError
        There is no finished run in the folder, or none of its recorded dances was measured; names it.
    """
    parts = (part[(part["kind"] != "generated") & (part[ERROR] == "")] for part in read_rows(rows_folder))
    rows = pd.concat(parts, ignore_index=True)
    if RECORDED not in set(rows["system"]):
        raise ValueError(f"{rows_folder}: holds no recorded dance that was measured")
    order = [RECORDED, OTHER_SONG, *sorted(set(rows["system"]) - {RECORDED, OTHER_SONG})]
    rows = rows.iloc[np.argsort([order.index(name) for name in rows["system"]], kind="stable")].reset_index(drop=True)
    # The movement of the dances with another song is that of the recorded ones.
    features = [name for name in map(str, rows) if name.startswith("f_")]
    rows.loc[rows["system"] == OTHER_SONG, features] = np.nan
    rows = rows.assign(**{name: [Path(path).name for path in rows[name]] for name in ("motion", "music")})
    return _with_keys(Reference(rows, limits, tuple(protocols), weights_digest(pose_net)))


def _with_keys(reference: Reference) -> Reference:
    rows = reference.rows.assign(**{KEY: [pair.key for pair in reference.pairs], ERROR: ""})
    first = [KEY, ERROR]
    rows = rows[[*first, *(name for name in rows if name not in first)]]
    return Reference(rows, reference.limits, reference.protocols, reference.pose_net)


def save_reference(path: PathLike, reference: Reference) -> None:
    """Write a reference into one .npz file, whole or not at all; the same bytes for the same reference."""
    rows = reference.rows.drop(columns=[KEY, ERROR])
    numeric = [name for name in map(str, rows) if pd.api.types.is_numeric_dtype(rows[name])]
    text = {name: rows[name].fillna("").tolist() for name in map(str, rows) if name not in numeric}
    about = {
        "format": FORMAT, "columns": list(map(str, rows)), "numeric": numeric, "text": text,
        "limits": reference.limits, "protocols": reference.protocols, "pose_net": reference.pose_net,
    }  # fmt: skip
    content = np.frombuffer(json.dumps(plain(about), ensure_ascii=False).encode(), np.uint8)
    with atomic_write(path) as part, part.open("wb") as file:
        numbers = rows[numeric].to_numpy(np.float64)
        own = {WRITTEN_BY.replace(" ", "_"): np.array(True)}
        np.savez_compressed(file, allow_pickle=False, about=content, numbers=numbers, **own)


def is_saved(path: PathLike) -> bool:
    """True for a file and for "synthetic", False for a folder of recorded dances, be it there or not."""
    return Path(path).is_file() or (str(path) == SYNTHETIC and not Path(path).exists())


def load_reference(path: PathLike) -> Reference:
    """The reference in a file of `save_reference`; "synthetic" is that of synthetic dances, which comes with harmolab.

    Raises
    ------
    FileNotFoundError, ValueError
        There is no such file, or it is damaged or something else; names it.
    """
    if str(path) == SYNTHETIC and is_saved(path):
        return _shipped()
    with reading(path, "a folder of recorded dances or a file of `harmolab evaluate --save-reference`") as file:
        arrays = read_npz(file, _KINDS)
        if arrays.keys() != _KINDS.keys():
            raise ValueError("is no reference that `harmolab evaluate --save-reference` wrote")
        return _unpacked(json.loads(arrays["about"].tobytes()), arrays["numbers"])


@cache
def _shipped() -> Reference:
    return load_reference(SHIPPED)


def _unpacked(about: dict[str, Any], numbers: FloatArray) -> Reference:
    """The reference in the content of a file; ValueError where something does not fit."""
    if about["format"] != FORMAT:
        raise ValueError(f"has format {about['format']!r}; this version reads {FORMAT!r}")
    columns = dict(zip(about["numeric"], numbers.T, strict=True)) | about["text"]
    if set(about["columns"]) != set(columns) or {len(column) for column in columns.values()} != {len(numbers)}:
        raise ValueError("its columns do not fit each other")
    if not all(isinstance(word, str) for column in about["text"].values() for word in column):
        raise ValueError("holds names that are no text")
    rows = pd.DataFrame({name: columns[name] for name in about["columns"]})
    if RECORDED not in set(rows["system"]) or not {*NAMES, "skeleton"} <= set(about["text"]):
        raise ValueError("holds no recorded dances")
    limits = None if about["limits"] is None else LikenessLimits.from_dict(about["limits"])
    return _with_keys(Reference(rows, limits, tuple(map(str, about["protocols"])), str(about["pose_net"])))
