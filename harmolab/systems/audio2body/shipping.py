"""Weights of a player for publication: 16 bits, without the recordings that it was trained on."""

from __future__ import annotations

from pathlib import Path

from harmolab.io.files import PathLike
from harmolab.systems.audio2body.system import Audio2Body
from harmolab.systems.common.about import DEFAULT_STEM
from harmolab.systems.common.weights import save_weights


def ship(run: PathLike, out: PathLike) -> None:
    """Write the network of a run to `out`.

    Parameters
    ----------
    run : folder of `harmolab train FOLDER --system audio2body`
    out : folder; files in it are replaced

    Raises
    ------
    FileNotFoundError, ValueError
        If the run is not complete or damaged.
    """
    system = Audio2Body.load(run)
    save_weights(Path(out) / DEFAULT_STEM, system.network, system.meta, half=True)
