"""The reader's own song and dance, picked in a notebook."""

import re
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import ipywidgets

SONGS = "audio/*"
DANCES = ".npz,.npy,.pkl,.csv,.json,.bvh,.c3d,.zip,video/*"


class OwnFiles(ipywidgets.VBox):
    """Two rows, a song and a dance: a button that uploads a file, and a line for the path of one that is large.

    An uploaded file is written into a temporary folder under a name of ours; of its own name only the ending is kept.

    Examples
    --------
    >>> files = OwnFiles()
    >>> files.song is None
    True
    """

    def __init__(self) -> None:
        self._folder = TemporaryDirectory()
        self._rows = {kind: _row(kind, accept) for kind, accept in {"song": SONGS, "dance": DANCES}.items()}
        super().__init__([ipywidgets.HBox(row) for row in self._rows.values()])

    @property
    def song(self) -> Path | None:
        """The song's file; None when nothing was picked."""
        return self._file("song")

    @property
    def dance(self) -> Path | None:
        """The file of the motion or video, or a folder of key points; None when nothing was picked."""
        return self._file("dance")

    def _file(self, kind: str) -> Path | None:
        upload, line = self._rows[kind]
        if line.value.strip():
            return Path(line.value.strip()).expanduser()
        if not upload.value:
            return None
        picked = upload.value[0]
        ending = Path(picked["name"]).suffix
        if not re.fullmatch(r"\.\w{1,8}", ending, flags=re.ASCII):
            raise ValueError(f"the {kind} needs a name that ends in its format, such as .wav or .bvh")
        path = Path(self._folder.name) / f"{kind}{ending.lower()}"
        path.write_bytes(picked["content"])
        return path

    def _repr_mimebundle_(self, **kwargs: Any) -> dict[str, Any]:
        return {**(super()._repr_mimebundle_(**kwargs) or {}), "text/plain": "pick your files in JupyterLab"}


def _row(kind: str, accept: str) -> tuple[ipywidgets.FileUpload, ipywidgets.Text]:
    """A button and a line for one file."""
    upload = ipywidgets.FileUpload(accept=accept, description=kind)
    return upload, ipywidgets.Text(placeholder=f"or the path of the {kind}", layout={"width": "28rem"})
