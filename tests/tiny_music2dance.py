"""Trainings of Music2Dance and its parts by the command, small enough for tests.

`python tiny_music2dance.py EPOCH TRAININGS` is `harmolab train ARGUMENTS...` for each of TRAININGS, lists of arguments
as JSON, killed (SIGKILL) when the second batch of that epoch begins. It prints how each ended.
"""

import json
import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from importlib import import_module
from typing import Any
from unittest.mock import patch

import torch
from typer.testing import CliRunner, Result

from harmolab.cli import app
from harmolab.systems.music2dance import train
from harmolab.systems.music2dance.attributes import AttributeParams
from harmolab.systems.music2dance.params import Music2DanceParams, SongParams
from harmolab.systems.training import loop

SONG = SongParams(channels=(2, 3), hidden=4, window=2.0, hop=1.0)
SIZES = {"window": 2.0, "residual": 8, "skip": 8, "groups": 1, "lstm": 8, "clusters": 3, "song": SONG}
EPOCHS = {"first_epochs": 3, "second_epochs": 2, "batch_size": 4, "start_seconds": 1.0}
TINY = replace(Music2DanceParams.recommended(), **SIZES, **EPOCHS)
TINY_ATTRIBUTES = AttributeParams(channels=(2, 3), hidden=4, window=4.0, hop=2.0, epochs=3, batch_size=3)


@contextmanager
def tiny_settings() -> Iterator[None]:
    """Within it, what is trained by name is small, and validated every second epoch."""
    with (
        patch.object(Music2DanceParams, "recommended", lambda: TINY),
        patch.object(AttributeParams, "recommended", lambda: TINY_ATTRIBUTES),
        patch.object(train, "VALIDATE_EVERY", 2),
    ):
        yield


def trained(*arguments: object) -> Result:
    """The outcome of `harmolab train ARGUMENTS...` on the CPU."""
    command = ["train", *map(str, arguments), "--accelerator", "cpu"]
    with tiny_settings():
        return CliRunner().invoke(app, command, env={"COLUMNS": "200"})


@contextmanager
def killed_in(epoch: int) -> Iterator[None]:
    """Within it, this process is killed when the second batch of an epoch, counted over all phases, begins."""
    whole = loop.epoch_shards

    def until(fabric: Any, units: Any, number: int, batching: Any) -> Iterator[Any]:
        for place, shards in enumerate(whole(fabric, units, number, batching)):
            if number == epoch and place == 1:
                os.kill(os.getpid(), signal.SIGKILL)
            yield shards

    with patch.object(loop, "epoch_shards", until):
        yield


def ended(epoch: int, arguments: list[str]) -> int:
    """Exit code of a training that is killed in an epoch: it is forked, and need not import torch and Fabric first."""
    if child := os.fork():
        return os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with killed_in(epoch):
        os._exit(trained(*arguments).exit_code)


if __name__ == "__main__":
    sys.modules["torchmetrics"] = None  # type: ignore[assignment]  # Fabric asks for its version by importing it: seconds
    torch.set_num_threads(1)
    import_module("lightning_fabric")
    print([ended(int(sys.argv[1]), arguments) for arguments in json.loads(sys.argv[2])])
