"""`harmolab train`: from folders of recordings to a system that dances or plays, or to a part of one."""

import math
import os
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from inspect import signature
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

import harmolab
from harmolab.cli.common import completed, is_told
from harmolab.cli.screen import LEVEL, LONGEST, USUAL, note, plain_errors, progress

if TYPE_CHECKING:
    from harmolab.types import BeatTrack, Motion

TRAIN_HINT = "install its packages by: pip install lightning-fabric safetensors tensorboardX torch"
# Measures of `harmolab evaluate` that some seconds of movement have: harmony needs more.
VALIDATED = ("beat_align_motion", "beat_align_music", "mir_eval_f", "foot_skating", "freezing", "jerk")
# Options whose names differ from those of the settings that they are of.
OPTIONS = {"first_epochs": "--phase1", "second_epochs": "--phase2"}
OPTIONS |= dict.fromkeys(("unit_epochs", "composition_epochs"), "--epochs")
SETTING = re.compile(rf"\b(?:{'|'.join(OPTIONS)})\b")
# Arguments that every system is given, and those that are no business of it.
LEARNERS = ("harmogan", "music2dance", "feet", "attributes", "lee2019", "ren2020", "audio2body")
ANY_SYSTEM = {"data", "out", "system", "song", "weights", "offset", "start", "seconds", "samples", "pattern", "one"}
ANY_SYSTEM |= {"beats", "corpus", "style", "scale", "harmonise", "as_json"}


def train(
    context: typer.Context,
    data: list[Path],
    out: Annotated[Path, typer.Option()],
    system: Annotated[str, typer.Option(autocompletion=completed(*LEARNERS))] = "harmogan",
    preset: Annotated[str, typer.Option(show_default="small; recommended")] = "small",
    params: Literal["recommended", "paper"] = "recommended",
    harmony_weight: Annotated[float | None, typer.Option(show_default="1")] = None,
    pretrain_epochs: Annotated[int | None, typer.Option(min=0, show_default="0; 225 in paper")] = None,
    adversarial_epochs: Annotated[int | None, typer.Option(min=0, show_default="9; 45 in paper")] = None,
    pose_epochs: Annotated[int | None, typer.Option(min=1, show_default="40")] = None,
    pretrained: Path | None = None,
    representation: Annotated[
        Literal["positions", "rotations"] | None, typer.Option(show_default="positions; rotations in paper")
    ] = None,
    phase1: Annotated[int | None, typer.Option(min=0, show_default="1300")] = None,
    phase2: Annotated[int | None, typer.Option(min=0, show_default="200")] = None,
    epochs: Annotated[int | None, typer.Option(min=0)] = None,
    velocity_weight: Annotated[float | None, typer.Option(show_default="0, the paper's loss")] = None,
    step: Annotated[int, typer.Option(min=1)] = 2,
    seed: Annotated[int, typer.Option(min=0, max=2**32 - 1)] = 1,
    split_seed: Annotated[int, typer.Option(min=0)] = 0,
    shards: Annotated[int, typer.Option(min=1)] = 1,
    resume: Annotated[bool, typer.Option("--resume")] = False,
    accelerator: Literal["auto", "cpu", "cuda"] = "auto",
) -> None:
    """Train a system, or a part of one. Without --system: HarmoGAN, 9 adversarial epochs that correct sketches.

    A *sketch* is a dance that harmolab makes of your recordings; HarmoGAN learns to fit it to the music.

    **What it does.** It cuts the recordings into units: a meter, with the beats before it. It splits the units by
    motion group into training, validation and test (split.json says how). It trains a small pose network, which the
    feature loss needs, and then the generator (with --params paper: 225 epochs of pretraining and 45 after it).
    history.csv has every loss term and the scores on the validation units, with measures of `harmolab evaluate`, epoch
    by epoch. `tensorboard --logdir RUN` shows the same.

    **Stopped?** The same command with --resume goes on where the run was, after a kill too, to the same result.

    **With and without the harmony loss** (with --params paper, add `--pretrained with` to the second line: it takes
    over the pretraining of the first):

        harmolab train DATA --out with

        harmolab train DATA --out without --harmony-weight 0

    **Several processes** share each batch: `torchrun --nproc-per-node 2 -m harmolab.cli train DATA --out RUN`. One
    process with `--shards 2` has the same result to the last bit. Without --shards its result differs: by rounding,
    which grows, and in the loss terms that compare whole batches.

    **Music2Dance** predicts a dance frame by frame. Phase 1 learns from recorded frames, phase 2 from its own: 1300 and
    200 epochs, about half an hour of one core for 18 minutes of recordings. Windows are 8 s long, so recordings must be
    longer. Two parts of it are trained by themselves, into folders inside its run, after it:

        harmolab train DATA --system music2dance --out RUN

        harmolab train DATA --system feet --out RUN/feet

        harmolab train DATA --system attributes --out RUN/attributes

    *feet* corrects the lower body. The paper's loss lowers the error, but feet slide more by it; with --velocity-weight
    3 they slide less than that. Planted feet, which need no training, slide least. *attributes* tells the dance from
    the song: a fifth of the songs of each dance is kept from training, and it is printed how many of these it names
    rightly. Neither dances by itself.

    **Audio to Body Dynamics** learns how a pianist or a violinist moves from the sound alone. DATA holds a folder for
    each performance: its sound, or a video; key points of body and hands from OpenPose, COCO-WholeBody or MediaPipe;
    and performance.json, which says `{"instrument": "piano"}` where the folder's name does not.
    docs/pose_estimation.md says how to make such a folder; `harmolab data check DATA` says how each was read. All must
    be of one instrument; points that one does not show are left out of all. A quarter of an hour and six pieces are the
    least to begin with. Whole pieces are kept for testing: their error stands under "errors" in model.json, beside that
    of the mean pose, which hears nothing. Presets: *recommended* (125 ms of delay, semitones, 40 epochs), *tables* (the
    captions of Tables 1 and 2, 300 epochs), *section_4* (the text).

        harmolab train DATA --system audio2body --out RUN

        harmolab perform SONG --weights RUN

    **After the training** of a system that dances: `harmolab dance SONG --weights RUN --out dance.mp4`

    **A system of your own** is a class that fulfils `harmolab.systems.System`; it takes the options that its `train`
    has. Name it in both commands: `--system package.module:Class`.

    Parameters
    ----------
    data : Folders of recordings (see `harmolab data check`).
    out : Folder of the run: weights, history, split, settings.
    system : harmogan, music2dance (or its parts feet and attributes), lee2019, ren2020; audio2body (musicians);
        package.module:Class.
    preset : HarmoGAN's size: small (1 M parameters, a laptop) or paper (7 M). For music2dance and attributes:
        recommended, paper. For audio2body: recommended, tables, section_4.
    params : HarmoGAN's losses and features: paper (Sec. 5.2) or recommended.
    harmony_weight : HarmoGAN's weight of the harmony loss; 0 is the ablation.
    pretrain_epochs : HarmoGAN's epochs of pretraining.
    adversarial_epochs : Epochs after it.
    pose_epochs : Epochs of its pose network.
    pretrained : Run of HarmoGAN on the same data whose pretraining is taken over.
    representation : Form in which music2dance and feet hold motion.
    phase1 : music2dance's epochs of learning from recorded frames.
    phase2 : Its epochs of learning from its own frames.
    epochs : Epochs of feet (default: 200), attributes (30), ren2020 (400), audio2body (its preset's); of lee2019's last
        two phases each (270; 1000 and 1500 in paper), after 100 of style.
    velocity_weight : Weight of the speed of standing feet in the loss of feet; with --representation positions only.
    step : Beats between the starts of training units.
    seed : Seed of the first weights, of the order of the units, and of the pose network.
    split_seed : Seed of the split by motion group.
    shards : Parts that each batch is cut into. With N parts, one process has the result of N processes to the last bit.
    resume : Go on with the run in --out; start it if there is none.
    accelerator : Device to train on.
    """
    first = int(os.environ.get("RANK", 0)) == 0  # of several processes, the one that tells
    with plain_errors(), epoch_bar() as report:
        try:
            from harmolab.systems.contract import PARTS, PLAYERS, trainable
            from harmolab.systems.training.checkpoints import TrainOptions

            notice = _notice if first else TrainOptions.notice
            extras = {"report": report, "notice": notice, "progress": progress, "measure": measured}
            if system in LEARNERS:
                import_module("lightning_fabric")  # a training begins with it, after minutes of reading
            learner = trainable(system)
            learner.train(data, out, **accepted(learner.train, context, extras))
        except ModuleNotFoundError as error:
            raise ValueError(f"training needs {error.name}; {TRAIN_HINT}") from None
        except (KeyboardInterrupt, SystemExit):
            note("stopped; the same command with --resume goes on from there")
            raise
        except ValueError as error:
            raise ValueError(SETTING.sub(lambda match: f"{match[0]} ({OPTIONS[match[0]]})", str(error))) from error
    history = Path(out) / "history.csv"
    if first and history.is_file() and len(history.read_text("utf-8").splitlines()) < 2:
        note("no epoch was trained: these are first weights, which have learnt nothing")
    if first and system in PARTS:
        typer.echo(f"trained: {out}, a part of {PARTS[system]}; a run uses it where it lies in RUN/{system}")
    elif first and system in PLAYERS:
        typer.echo(f"trained: {out}; play with it: harmolab perform SONG --weights {out}")
    elif first:
        named = f" --system {system}" if ":" in system else ""
        typer.echo(f"trained: {out}; dance with it: harmolab dance SONG --weights {out}{named} --out dance.mp4")


def _notice(line: str) -> None:
    if not line.startswith(("units: ", "songs: ", "test songs: ")):
        note(line)
    elif LEVEL.get() >= USUAL or line.startswith("test"):  # which is a result
        typer.echo(line, err=True)


def measured(motions: Sequence["Motion"], beats: Sequence["BeatTrack"]) -> dict[str, float]:
    """The numbers of `harmolab evaluate` for dances to validation units, those of `VALIDATED` that there are."""
    numbers = harmolab.evaluate(motions, beats)
    return {name: numbers[name] for name in VALIDATED if math.isfinite(numbers[name])}


def accepted(function: Callable[..., Any], context: typer.Context, extras: Mapping[str, Any]) -> dict[str, Any]:
    """Keywords for a system's function: the options on the command line, and those extras that it takes.

    Raises
    ------
    ValueError
        For an option that it does not take.
    """
    parameters = signature(function).parameters
    takes_all = any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters.values())
    own = {name: value for name, value in context.params.items() if name not in ANY_SYSTEM and is_told(context, name)}
    if other := [name for name in own if name not in parameters and not takes_all]:
        raise ValueError(f"--{other[0].replace('_', '-')} is no option of this system")
    return own | {name: value for name, value in extras.items() if name in parameters}


@contextmanager
def epoch_bar() -> Iterator[Callable[[Mapping[str, Any], int], None]]:
    """A function that shows an epoch: its row of the history and the epoch that its phase ends at.

    On a terminal it is a bar, with every loss term and the last validation below it, from the first epoch on. Where
    standard error is no terminal: a line for each validated epoch, and for one that ends long after the last line.
    """
    from rich.console import Console, Group
    from rich.live import Live
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeElapsedColumn
    from rich.text import Text

    console = Console(stderr=True)
    bar = Progress("{task.description}", BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), console=console)
    task, live = bar.add_task("", total=None), Live(bar, console=console)
    scores: dict[str, float] = {}  # of the last validation
    last = monotonic()  # moment of the last line

    def show(row: Mapping[str, Any], end: int) -> None:
        nonlocal last
        values = {name: value for name, value in row.items() if isinstance(value, float)}
        validation = {name.removeprefix("val_"): value for name, value in values.items() if name.startswith("val_")}
        scores.update(validation)
        if not console.is_terminal or LEVEL.get() < USUAL:
            if (validation or monotonic() - last >= LONGEST) and LEVEL.get() >= USUAL:
                last = monotonic()
                typer.echo(f"{row['phase']} epoch {row['epoch'] + 1}: {_line(values)}", err=True)
            return
        losses = {name: value for name, value in values.items() if not name.startswith("val_")}
        lines = [Text(_line(losses)), *([Text(f"validation: {_line(scores)}")] if scores else [])]
        bar.update(task, description=row["phase"], total=end, completed=row["epoch"] + 1)
        live.start()
        live.update(Group(bar, *lines), refresh=True)

    try:
        yield show
    finally:
        live.stop()


def _line(values: Mapping[str, float]) -> str:
    """Names and values, three digits each."""
    return "  ".join(f"{name} {value:.3g}" for name, value in values.items())
