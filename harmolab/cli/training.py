"""`harmolab train`: from folders of recordings to a generator that dances."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from harmolab.cli.common import plain_errors, progress

if TYPE_CHECKING:
    from harmolab.data.splits import Split
    from harmolab.params import TrainParams

__all__ = ["train"]

PRESETS = ("small", "paper")


def train(
    data: Annotated[list[Path], typer.Argument(help="Corpora: folders of sequences (see `harmolab data check`).")],
    out: Annotated[Path, typer.Option(help="Folder of the run: weights, history, split, settings.")],
    preset: Annotated[str, typer.Option(help="Size: small (1 M parameters, a laptop) or paper (8 M).")] = "small",
    params: Annotated[str, typer.Option(help="Losses and features: paper (Sec. 5.2) or recommended.")] = "recommended",
    harmony_weight: Annotated[float | None, typer.Option(help="Weight of the harmony loss; 0 is the ablation.")] = None,
    pretrain_epochs: Annotated[int | None, typer.Option(help="Instead of 225.", min=0)] = None,
    adversarial_epochs: Annotated[int | None, typer.Option(help="Instead of 45.", min=0)] = None,
    pretrained: Annotated[Path | None, typer.Option(help="Run on the same data whose pretraining is used.")] = None,
    step: Annotated[int, typer.Option(help="Beats between the starts of training units.", min=1)] = 2,
    seed: Annotated[int, typer.Option(help="Of weights, order and the pose network.", min=0)] = 1,
    split_seed: Annotated[int, typer.Option(help="Of the split by motion group.", min=0)] = 0,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the run in --out; start it if none.")] = False,
    accelerator: Annotated[str, typer.Option(help="auto, cpu or cuda.")] = "auto",
) -> None:
    """Train HarmoGAN: 225 epochs of pretraining, then 45 adversarial ones; a killed run goes on with --resume.

    Several processes: `torchrun --nproc-per-node 2 -m harmolab.cli train ...`. Units are split by motion group into
    training, validation and test; split.json in the run says how. Then: `harmolab dance SONG --weights RUN`.
    """
    with plain_errors():
        chosen = _settings(params, harmony_weight, pretrain_epochs, adversarial_epochs, seed)
        _check_choice("preset", preset, PRESETS)
        split = _split(data, params, step, split_seed)
        _train(split, out, preset, chosen, resume=resume, pretrained=pretrained, accelerator=accelerator)


def _check_choice(name: str, value: str, choices: tuple[str, ...]) -> None:
    if value not in choices:
        raise ValueError(f"--{name} must be {' or '.join(choices)}, got {value!r}")


def _settings(
    name: str, harmony_weight: float | None, pretrain: int | None, adversarial: int | None, seed: int
) -> TrainParams:
    """The named settings with what the command line changes."""
    from harmolab.params import TrainParams

    _check_choice("params", name, ("paper", "recommended"))
    base = TrainParams.paper() if name == "paper" else TrainParams.recommended()
    asked = {"harmony_weight": harmony_weight, "pretrain_epochs": pretrain, "adversarial_epochs": adversarial}
    return replace(base, seed=seed, **{key: value for key, value in asked.items() if value is not None})


def _split(data: list[Path], params: str, step: int, seed: int) -> Split:
    """Units of all corpora, split by motion group."""
    from harmolab.data.clips import load_units
    from harmolab.data.splits import split_units
    from harmolab.params import FeatureParams

    features = FeatureParams.paper() if params == "paper" else FeatureParams.recommended()
    split = split_units(load_units(data, features, step=step, progress=progress), seed=seed)
    counts = ", ".join(f"{len(getattr(split, side).units)} {side}" for side in ("train", "validation", "test"))
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
    from harmolab.training import make_fabric, train_harmogan

    model = ModelParams.paper() if preset == "paper" else ModelParams.small()
    fabric = make_fabric(accelerator=accelerator)
    epochs = (0 if pretrained else params.pretrain_epochs) + params.adversarial_epochs
    bar = EpochBar(epochs)
    train_harmogan(
        split, out, model=model, params=params, resume=resume, pretrained=pretrained, fabric=fabric, report=bar
    )
    bar.close()
    if fabric.is_global_zero:
        typer.echo(f"trained: {out}; dance with it: harmolab dance SONG --weights {out} --out dance.mp4")


class EpochBar:
    """Progress over epochs with the loss terms; lines of text where standard error is no terminal."""

    def __init__(self, epochs: int) -> None:
        from tqdm import tqdm

        self.terminal = sys.stderr.isatty()
        self.bar = tqdm(total=epochs, unit="epoch", disable=not self.terminal)

    def __call__(self, row: dict[str, Any]) -> None:
        shown = " ".join(f"{name} {value:.3g}" for name, value in row.items() if isinstance(value, float))
        self.bar.set_description(row["phase"])
        self.bar.set_postfix_str(shown, refresh=False)
        self.bar.update(row["epoch"] + 1 - self.bar.n)
        if not self.terminal and "val_mse" in row:
            typer.echo(f"{row['phase']} epoch {row['epoch'] + 1}: {shown}", err=True)

    def close(self) -> None:
        self.bar.close()
