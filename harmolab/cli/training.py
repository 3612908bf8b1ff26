"""`harmolab train`: from folders of recordings to a generator that dances."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harmolab.cli.common import plain_errors, progress

if TYPE_CHECKING:
    from harmolab.data.splits import Split
    from harmolab.params import TrainParams

__all__ = ["EpochBar", "train"]

CHOICES = {"preset": ("small", "paper"), "params": ("recommended", "paper"), "accelerator": ("auto", "cpu", "cuda")}


def train(
    data: Annotated[list[Path], typer.Argument(help="Corpora: folders of sequences (see `harmolab data check`).")],
    out: Annotated[Path, typer.Option(help="Folder of the run: weights, history, split, settings.")],
    preset: Annotated[str, typer.Option(help="Size: small (1 M parameters, a laptop) or paper (8 M).")] = "small",
    params: Annotated[str, typer.Option(help="Losses and features: paper (Sec. 5.2) or recommended.")] = "recommended",
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
    step: Annotated[int, typer.Option(help="Beats between the starts of training units.", min=1)] = 2,
    seed: Annotated[int, typer.Option(help="Of first weights, order of the units and the pose network.", min=0)] = 1,
    split_seed: Annotated[int, typer.Option(help="Of the split by motion group.", min=0)] = 0,
    shards: Annotated[
        int, typer.Option(help="Parts of a batch; as many as processes: the same result to the last bit.", min=1)
    ] = 1,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in --out; start it if none.")] = False,
    accelerator: Annotated[str, typer.Option(help="auto, cpu or cuda.")] = "auto",
) -> None:
    """Train HarmoGAN: 225 epochs of pretraining, then 45 adversarial ones.

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
    """
    with plain_errors():
        for name, value in (("preset", preset), ("params", params), ("accelerator", accelerator)):
            _check_choice(name, value)
        changed = {"harmony_weight": harmony_weight, "pretrain_epochs": pretrain_epochs}
        changed |= {"adversarial_epochs": adversarial_epochs, "seed": seed, "shards": shards}
        chosen = _settings(params, changed)
        _check_out(out, resume=resume)
        split = _split(data, params, step, split_seed)
        _train(split, out, preset, chosen, resume=resume, pretrained=pretrained, accelerator=accelerator)


def _is_first() -> bool:
    """Whether this process is the one that writes and prints."""
    return int(os.environ.get("RANK", 0)) == 0


def _check_choice(name: str, value: str) -> None:
    if value not in CHOICES[name]:
        raise ValueError(f"--{name} must be {' or '.join(CHOICES[name])}, got {value!r}")


def _check_out(out: Path, *, resume: bool) -> None:
    """Refuse a folder before the recordings are read, which takes minutes. Other processes leave that to the first."""
    try:
        from harmolab.training.folders import check_folder
    except ModuleNotFoundError as error:
        raise ValueError(f"training needs {error.name}; install it with: pip install 'harmolab[train]'") from None
    if _is_first():
        check_folder(out, resume=resume)


def _settings(name: str, changed: Mapping[str, Any]) -> TrainParams:
    """The named settings with what the command line changes; None changes nothing."""
    from harmolab.params import TrainParams

    base = TrainParams.paper() if name == "paper" else TrainParams.recommended()
    return replace(base, **{key: value for key, value in changed.items() if value is not None})


def _split(data: list[Path], params: str, step: int, seed: int) -> Split:
    """Units of all corpora, split by motion group."""
    from harmolab.data.clips import load_units
    from harmolab.data.splits import split_units
    from harmolab.params import FeatureParams

    features = FeatureParams.paper() if params == "paper" else FeatureParams.recommended()
    units = load_units([*data], features, step=step, progress=progress)
    split = split_units(units, seed=seed)
    if _is_first():
        for note in units.notes:
            typer.echo(f"harmolab: left out: {note}", err=True)
        counts = ", ".join(f"{len(getattr(split, side))} {side}" for side in ("train", "validation", "test"))
        typer.echo(f"units: {counts}; data: {split.train.source}", err=True)
    return split


def _train(
    split: Split,
    out: Path,
    preset: str,
    params: TrainParams,
    *,
    resume: bool,
    pretrained: Path | None,
    accelerator: str,
) -> None:
    """Run the training with a bar that shows every term."""
    from harmolab.params import ModelParams
    from harmolab.training import make_fabric
    from harmolab.training.run import train_harmogan

    model = ModelParams.paper() if preset == "paper" else ModelParams.small()
    fabric = make_fabric(accelerator=accelerator)
    first = 0 if pretrained else params.pretrain_epochs
    ends = {"pose network": params.pose_epochs, "pretrain": first, "adversarial": first + params.adversarial_epochs}
    with EpochBar(ends, shown=fabric.is_global_zero) as bar:
        train_harmogan(
            split, out, model=model, params=params, resume=resume, pretrained=pretrained, fabric=fabric, report=bar
        )
    if fabric.is_global_zero:
        typer.echo(f"trained: {out}; dance with it: harmolab dance SONG --weights {out} --out dance.mp4")


class EpochBar:
    """Progress over the epochs of each phase, with every loss term and the last validation below it.

    Where standard error is no terminal: a line for each validated epoch.

    Parameters
    ----------
    ends : phase -> number of the epoch it ends at
    shown : False draws nothing
    """

    def __init__(self, ends: Mapping[str, int], *, shown: bool = True) -> None:
        from rich.console import Console
        from rich.live import Live
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

        console = Console(stderr=True)
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
        self.ends = ends
        self.bar = Progress(*columns, console=console)
        self.task = self.bar.add_task("preparing", total=None)
        self.terms: dict[str, float] = {}
        self.live = Live(self.bar, console=console) if shown and console.is_terminal else None

    def __enter__(self) -> Callable[[Mapping[str, Any]], None]:
        if self.live is not None:
            self.live.start()
        return self.show

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if self.live is not None:
            self.live.stop()

    def show(self, row: Mapping[str, Any]) -> None:
        """One more epoch: a row of the history."""
        values = {name: value for name, value in row.items() if isinstance(value, float)}
        if self.live is None:
            if "val_mse" in row:
                typer.echo(f"{row['phase']} epoch {row['epoch'] + 1}: {_line(values)}", err=True)
            return
        kept = {name: value for name, value in self.terms.items() if name.startswith("val_")}
        self.terms = kept | values
        self.bar.update(self.task, description=row["phase"], total=self.ends[row["phase"]], completed=row["epoch"] + 1)
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
