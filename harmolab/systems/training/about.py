"""The description of a system on disk: ``<stem>.json`` beside its numbers. Reading it needs no torch.

``<stem>.json``
    The system, its class, what is needed to build it again, the SHA-256 of the file beside it, and whatever the caller
    adds about training.
"""

import json
from collections.abc import Iterable, Mapping, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

from harmolab.body.skeletons import Skeleton
from harmolab.files import MAX_TEXT_BYTES, PathLike, atomic_write, read_json, reading, write_synced

FORMAT = 1
DEFAULT_STEM = "model"
SETTINGS = "settings.json"  # of a run, from its first moment on; the weights come at its end
MOST_JOINTS, MOST_UNITS, MOST_FPS = 1000, 2**16, 1000  # a description beyond is not one of ours
_WHAT = "weights of harmolab"
_PICKLES = (".pt", ".pth", ".pkl", ".pickle", ".ckpt", ".bin")
_SUFFIXES = (".safetensors", ".npz", ".json")


def read_about(path: PathLike) -> dict[str, Any]:
    """The JSON of stored weights: class, sizes, shapes, harmolab's version, and "meta" as passed to `save_weights`."""
    file = json_file(weights_stem(path))
    if not file.exists():
        if file.with_name(SETTINGS).exists():
            raise FileNotFoundError(f"{path}: its training has not ended; go on with the same command and --resume")
        raise FileNotFoundError(f"{file}: no such file; name a folder that harmolab train wrote weights to (--out)")
    with reading(file, _WHAT, max_bytes=MAX_TEXT_BYTES):
        about = read_json(file)
        if not isinstance(about, dict) or "format" not in about or not isinstance(about.get("build"), dict):
            raise ValueError(f'does not describe weights of harmolab: it needs "format": {FORMAT} and "build": {{...}}')
        if about["format"] != FORMAT:
            raise ValueError(f"has format {about['format']!r}; this version reads {FORMAT}. Update harmolab")
    return about


def weights_stem(path: PathLike) -> Path:
    """The path without the suffix of either file, "model" inside a folder; ValueError for a pickle."""
    path = Path(path)
    if path.suffix.lower() in _PICKLES:
        raise ValueError(f"{path}: pickled weights are never loaded, they can run any code; convert to safetensors")
    if path.suffix in _SUFFIXES:
        return path.with_suffix("")
    return path / DEFAULT_STEM if path.is_dir() else path


def corpora(data: Iterable[PathLike]) -> list[PathLike]:
    """The folders of some corpora; ValueError for a single path, whose letters would be taken for folders."""
    if isinstance(data, str | Path):
        raise ValueError(f"data are folders of corpora: put the one that there is into a list; got {str(data)!r}")
    return [*data]


def json_file(stem: Path) -> Path:
    """The description beside the numbers of that stem."""
    return stem.with_name(f"{stem.name}.json")


def write_about(stem: Path, about: Mapping[str, Any], numbers: Path, data: bytes) -> None:
    """Write a description, and the file of numbers beside it, to a folder made if need be; both whole or not at all.

    Format and version stand before what the caller says.
    """
    text = json.dumps({"format": FORMAT, "harmolab": version("harmolab"), **about}, indent=1, allow_nan=False)
    stem.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(json_file(stem)) as text_part, atomic_write(numbers) as part:
        write_synced(text_part, text.encode())
        write_synced(part, data)


def whole(name: str, value: object, least: int = 1, most: int = MOST_UNITS) -> int:
    """A size from a description, as an int; ValueError for what is none, or out of range."""
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise ValueError(f"describes {name} = {str(value)[:40]}; a whole number from {least} to {most} is needed")
    return value


def stored_list(build: Mapping[str, Any], name: str) -> Sequence[Any]:
    """A list of a description; ValueError for what is none."""
    if not isinstance(build[name], list | tuple):
        raise ValueError(f"describes {name} = {str(build[name])[:40]}; a list is needed")
    return build[name]


def stored_skeleton(build: Mapping[str, Any]) -> Skeleton:
    """The skeleton of a description; ValueError for one of too many joints."""
    skeleton = Skeleton(*(tuple(stored_list(build["skeleton"], name)) for name in ("joints", "parents")))
    if len(skeleton.joints) > MOST_JOINTS:
        raise ValueError(f"describes {len(skeleton.joints)} joints, more than {MOST_JOINTS}")
    return skeleton
