"""`harmolab train`: from folders of recordings to a generator that dances."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from inspect import signature
from pathlib import Path
from types import TracebackType
from typing import Annotated, Any

import typer

from harmolab.cli.common import plain_errors, progress


def train(
    data: Annotated[list[Path], typer.Argument(help="Corpora: folders of sequences (see `harmolab data check`).")],
    out: Annotated[Path, typer.Option(help="Folder of the run: weights, history, split, settings.")],
    system: Annotated[str, typer.Option(help="A system of harmolab, or a class: package.module:Class.")] = "harmogan",
    preset: Annotated[
        str | None, typer.Option(help="Size: small (1 M parameters, a laptop) or paper (8 M).", show_default="small")
    ] = None,
    params: Annotated[
        str | None,
        typer.Option(help="Losses and features: paper (Sec. 5.2) or recommended.", show_default="recommended"),
    ] = None,
    harmony_weight: Annotated[
        float | None, typer.Option(help="Weight of the harmony loss; 0 is the ablation.", show_default="1")
    ] = None,
    pretrain_epochs: Annotated[
        int | None, typer.Option(help="Epochs of pretraining.", min=0, show_default="225")
    ] = None,
    adversarial_epochs: Annotated[int | None, typer.Option(help="Epochs after it.", min=0, show_default="45")] = None,
    pretrained: Annotated[
        Path | None, typer.Option(help="Run on the same data whose pretraining is taken over.")
    ] = None,
    step: Annotated[
        int | None, typer.Option(help="Beats between the starts of training units.", min=1, show_default="2")
    ] = None,
    seed: Annotated[int, typer.Option(help="Of first weights, order of the units and the pose network.", min=0)] = 1,
    split_seed: Annotated[
        int | None, typer.Option(help="Of the split by motion group.", min=0, show_default="0")
    ] = None,
    shards: Annotated[
        int | None,
        typer.Option(
            help="Parts of a batch; as many as processes: the same result to the last bit.", min=1, show_default="1"
        ),
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in --out; start it if none.")] = False,
    accelerator: Annotated[str | None, typer.Option(help="auto, cpu or cuda.", show_default="auto")] = None,
) -> None:
    """Train a system: HarmoGAN in 225 epochs of pretraining, then 45 adversarial ones.

    **What it does.** Cuts the recordings into meters with the beats before them, splits these by motion group into
    training, validation and test (split.json says how), trains a small pose network for the feature loss, then the
    generator. history.csv has every loss term and the scores on the validation units, epoch by epoch; so has
    `tensorboard --logdir RUN`.

    **Stopped?** The same command with --resume goes on where the run was, after a kill too, to the same result.

    **With and without the harmony loss**, sharing the pretraining:

        harmolab train DATA --out with

        harmolab train DATA --out without --harmony-weight 0 --pretrained with

    **Several processes** share each batch: `torchrun --nproc-per-node 2 -m harmolab.cli train DATA --out RUN`. One
    process with `--shards 2` has the same result to the last bit; without it they differ by rounding, which grows.

    **Then:** `harmolab dance SONG --weights RUN --out dance.mp4`

    **A system of your own** is a class that fulfils `harmolab.systems.System`; it takes the options that its `train`
    has. Name it in both commands: `--system package.module:Class`.
    """
    options: dict[str, Any] = {
        "preset": preset, "params": params, "harmony_weight": harmony_weight, "pretrain_epochs": pretrain_epochs,
        "adversarial_epochs": adversarial_epochs, "pretrained": pretrained, "step": step, "split_seed": split_seed,
        "shards": shards, "accelerator": accelerator,
    }  # fmt: skip
    with plain_errors():
        _train(system, data, out, options, seed=seed, resume=resume)


def _train(system: str, data: list[Path], out: Path, options: dict[str, Any], *, seed: int, resume: bool) -> None:
    """Run the training with a bar that shows every term; the first process alone tells of it."""
    first = int(os.environ.get("RANK", 0)) == 0

    def notice(line: str) -> None:
        if first:
            typer.echo(line if line.startswith("units: ") else f"harmolab: {line}", err=True)

    with EpochBar() as bar:
        try:
            from harmolab.systems import find

            trained = find(system).train
            told = accepted(trained, options, {"report": bar, "notice": notice, "progress": progress})
            trained(data, out, seed=seed, resume=resume, **told)
        except ModuleNotFoundError as error:
            raise ValueError(f"training needs {error.name}; install it with: pip install 'harmolab[train]'") from None
    if first:
        named = f" --system {system}" if ":" in system else ""
        typer.echo(f"trained: {out}; dance with it: harmolab dance SONG --weights {out}{named} --out dance.mp4")


def accepted(function: Callable[..., Any], options: Mapping[str, Any], extras: Mapping[str, Any]) -> dict[str, Any]:
    """Keywords for a system's function: the options that were given (not None), and those extras that it takes.

    Raises
    ------
    ValueError
        For an option that it does not take.
    """
    known = signature(function).parameters
    takes_all = any(parameter.kind is parameter.VAR_KEYWORD for parameter in known.values())
    given = {name: value for name, value in options.items() if value is not None}
    if other := [name for name in given if name not in known and not takes_all]:
        raise ValueError(f"--{other[0].replace('_', '-')} is no option of this system")
    return given | {name: value for name, value in extras.items() if name in known}


class EpochBar:
    """Progress over the epochs of each phase, with every loss term and the last validation below it.

    Where standard error is no terminal: a line for each validated epoch.

    Nothing is drawn before the first epoch.
    """

    def __init__(self) -> None:
        from rich.console import Console
        from rich.live import Live
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        console = Console(stderr=True)
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
        self.bar = Progress(*columns, console=console)
        self.task = self.bar.add_task("preparing", total=None)
        self.terms: dict[str, float] = {}
        self.live = Live(self.bar, console=console) if console.is_terminal else None

    def __enter__(self) -> Callable[[Mapping[str, Any], int], None]:
        return self.show

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.live is not None:
            self.live.stop()

    def show(self, row: Mapping[str, Any], end: int) -> None:
        """One more epoch: a row of the history, and the epoch that its phase ends at."""
        values = {name: value for name, value in row.items() if isinstance(value, float)}
        if self.live is None:
            if any(name.startswith("val_") for name in row):
                typer.echo(f"{row['phase']} epoch {row['epoch'] + 1}: {_line(values)}", err=True)
            return
        self.live.start()
        kept = {name: value for name, value in self.terms.items() if name.startswith("val_")}
        self.terms = kept | values
        self.bar.update(self.task, description=row["phase"], total=end, completed=row["epoch"] + 1)
        self.live.update(self._drawn(), refresh=True)

    def _drawn(self) -> Any:
        """The bar, the terms of the last epoch, the scores of the last validation."""
        from rich.console import Group
        from rich.text import Text

        found = {name: value for name, value in self.terms.items() if name.startswith("val_")}
        losses = {name: value for name, value in self.terms.items() if name not in found}
        lines = [Text(_line(losses))]
        if found:
            lines.append(Text(f"validation: {_line({name[4:]: value for name, value in found.items()})}"))
        return Group(self.bar, *lines)


def _line(values: Mapping[str, float]) -> str:
    """Names and values, three digits each."""
    return "  ".join(f"{name} {value:.3g}" for name, value in values.items())
