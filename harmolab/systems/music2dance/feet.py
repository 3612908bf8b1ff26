"""The foot constraint model (Sec. 4.5, Eq. 14): small changes of the lower body that take sliding out of a dance.

It sees the lower body, the places of both feet and which of them stand, and adds increments to the lower body's
channels. It learns on recorded motion with simulated sliding: noise, and everything smoothed.

It is trained by itself, into a folder of its own inside the run of a dancer, RUN/feet, where the dancer finds it.
"""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal, NamedTuple, Self

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn.functional import conv1d, pad

from harmolab.body.skeletons import foot_joints, joint_part
from harmolab.files import PathLike
from harmolab.systems.music2dance.codes import END_EFFECTORS, ROOT, MotionCode, PositionCode, RotationCode, stored_code
from harmolab.systems.music2dance.params import MOST_REACH, Music2DanceParams, Representation
from harmolab.systems.music2dance.sequences import LEAST_STD, SequenceSet, Windows, load_sequences, training_windows
from harmolab.systems.training.checkpoints import TrainOptions
from harmolab.systems.training.features import check_settings
from harmolab.systems.training.layers import PATH_CHANNELS, Normaliser, decode, drawn_by
from harmolab.systems.training.loop import Batching, Phase, Player, Shard, Terms, epoch_order, make_fabric
from harmolab.systems.training.network_system import Learner, changed, noticed_split
from harmolab.systems.training.runs import open_run
from harmolab.systems.training.splits import Split
from harmolab.systems.training.weights import stored_record
from harmolab.types import FloatArray

Kind = Literal["convolution", "lstm"]
KERNEL, CONTACTS = 3, 2
LEG_PARTS = ("hip", "knee", "ankle", "heel", "toe")
REACH = 4  # standard deviations of a Gaussian filter, on either side


@dataclass(frozen=True)
class FootParams:
    """The model, the sliding that it learns on, and its loss.

    Parameters
    ----------
    kind : "convolution", or "lstm" for the baseline of Table 2
    channels : int, of the hidden layers
    dilations : ints, one a convolution
    noise : float, standard deviations of a channel
    smoothing : (least, most) frames, standard deviation of the Gaussian after it; drawn once a window
    flipped : float, share of the contacts that are turned round, as predicted ones may be wrong
    smooth_weight : float, of the mean square of the increments' second differences
    velocity_weight : float, of the speed of standing feet; 0 is the paper's loss. For the code of positions only
    epochs, batch_size, learning_rate : of Adam
    seed : int
    """

    kind: Kind = "convolution"
    channels: int = 64
    dilations: tuple[int, ...] = (1, 3, 9)
    noise: float = 0.1
    smoothing: tuple[float, float] = (1.0, 4.0)
    flipped: float = 0.1
    smooth_weight: float = 0.1
    velocity_weight: float = 0.0
    epochs: int = 200
    batch_size: int = 16
    learning_rate: float = 1e-3
    seed: int = 1

    def __post_init__(self) -> None:
        check_settings(self, not_negative=("noise", "flipped", "smooth_weight", "velocity_weight", "epochs", "seed"))
        if not self.dilations or min(self.dilations) < 1 or not 0 < self.smoothing[0] <= self.smoothing[1]:
            raise ValueError("dilations must be one or more frames, and smoothing two rising numbers of frames")
        if sum(self.dilations) > MOST_REACH:
            raise ValueError(f"dilations must add up to {MOST_REACH} frames at most, got {sum(self.dilations)}")


def lower_channels(code: MotionCode) -> list[int]:
    """Channels of the lower body and the root in a motion code."""
    joints = code.skeleton.joints
    if isinstance(code, RotationCode):
        legs = [place for place, joint in enumerate(code.rotating) if joint_part(joints[joint]) in LEG_PARTS]
        return [*range(ROOT), *(ROOT + 3 * place + axis for place in legs for axis in range(3))]
    below = [joint for joint, name in enumerate(joints) if joint_part(name) in LEG_PARTS]
    root = code.skeleton.parents.index(-1)
    channels = [3 * joint + axis for joint in sorted({root, *below}) for axis in range(3)]
    return [*channels, *range(code.n_motion - PATH_CHANNELS, code.n_motion)]


def foot_channels(code: MotionCode) -> list[int]:
    """Channels of the places of both feet (toes) in a motion code, six; ValueError where there are none."""
    if isinstance(code, PositionCode):
        toes = [foot[-1] for foot in foot_joints(code.skeleton)]
        return [3 * joint + axis for joint in toes for axis in range(3)]
    if not code.end_effectors:
        raise ValueError("the foot model needs the places of the feet; use a code with end effectors")
    first = code.n_motion - 3 * len(END_EFFECTORS)
    places = [place for place, name in enumerate(END_EFFECTORS) if name.startswith("toe")]
    return [first + 3 * place + axis for place in places for axis in range(3)]


class FootModel(nn.Module):
    """Increments of the lower body: three dilated convolutions over time, or a layer, an LSTM and a layer.

    Parameters
    ----------
    params : FootParams
    code : of the motion

    Its attribute `meta`, about its training, is kept with stored weights.
    """

    system = "feet"

    def __init__(self, params: FootParams, code: MotionCode) -> None:
        super().__init__()
        self.params, self.motion_code = params, code
        self.meta: dict[str, Any] = {}
        self.motion_scale = Normaliser(code.n_motion)
        self.lower, self.feet = lower_channels(code), foot_channels(code)
        n_in, n_out = len(self.lower) + len(self.feet) + CONTACTS, len(self.lower)
        if params.kind == "lstm":
            self.first, self.last = nn.Linear(n_in, params.channels), nn.Linear(params.channels, n_out)
            self.reader = nn.LSTM(params.channels, params.channels, batch_first=True)
        else:
            sizes = (n_in, *(params.channels for _ in params.dilations[1:]), n_out)
            self.layers = nn.ModuleList(
                nn.Conv1d(a, b, KERNEL, dilation=dilation, padding=dilation, padding_mode="replicate")
                for a, b, dilation in zip(sizes, sizes[1:], params.dilations, strict=False)
            )
        last: Any = self.last if params.kind == "lstm" else self.layers[-1]
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)

    def forward(self, motion: Tensor, contacts: Tensor) -> Tensor:
        """Increments (N, T, L) of the lower body's channels, for standardised motion (N, T, C), contacts (N, T, 2)."""
        values = torch.cat([motion[..., self.lower], motion[..., self.feet], contacts], dim=-1)
        if self.params.kind == "lstm":
            return self.last(self.reader(torch.relu(self.first(values)))[0])
        values = values.transpose(1, 2)
        for layer in self.layers[:-1]:
            values = torch.relu(layer(values))
        return self.layers[-1](values).transpose(1, 2)

    def corrected(self, motion: Tensor, contacts: Tensor) -> tuple[Tensor, Tensor]:
        """Standardised motion (N, T, C) with the increments in it, and these (N, T, L)."""
        increments, changed = self(motion, contacts), motion.clone()
        changed[..., self.lower] += increments
        return changed, increments

    @torch.no_grad()
    def correct(self, code: FloatArray, contacts: FloatArray) -> FloatArray:
        """A motion code (T, C), not standardised, with the increments in it."""
        motion, standing = (torch.from_numpy(values).float()[None] for values in (code, contacts))
        scaled, deviation = self.motion_scale(motion), self.motion_scale.std.clamp(min=LEAST_STD)
        increments = (self.eval().corrected(scaled, standing)[0] - scaled)[0] * deviation
        return code + increments.double().numpy()

    def description(self) -> dict[str, Any]:
        """Everything that `built` needs beside the tensors, JSON-able."""
        return {"params": asdict(self.params), "code": self.motion_code.to_dict()}

    @classmethod
    def built(cls, build: Mapping[str, Any], tensors: Mapping[str, Tensor]) -> Self:
        """A model as its description says; ValueError for sizes that cannot be."""
        return cls(stored_record(FootParams, build["params"]), stored_code(build["code"]))


class Slid(NamedTuple):
    """Recorded motion and a slid one as corrected (N, T, C each, standardised), and the increments (N, T, L)."""

    motion: Tensor
    corrected: Tensor
    increments: Tensor


def slid_motion(motion: Tensor, model: FootModel, fps: float) -> Tensor:
    """Motion (N, T, C) whose lower body slides: noise added, then each window smoothed by a Gaussian of its own."""
    params = model.params
    least, most = params.smoothing
    widths = least + (most - least) * torch.rand(len(motion), 1)
    noisy = motion[..., model.lower] + params.noise * torch.randn(*motion.shape[:2], len(model.lower)).to(motion)
    slid = motion.clone()
    slid[..., model.lower] = smoothed(noisy, widths.to(motion))
    code = model.motion_code
    return _with_feet(slid, model.motion_scale, code, fps) if isinstance(code, RotationCode) else slid


def _with_feet(motion: Tensor, scale: Normaliser, code: RotationCode, fps: float) -> Tensor:
    """Standardised rotations (N, T, C) whose feet are where they put them: else they would tell what was not slid."""
    values = (motion * scale.std + scale.mean).cpu().double().numpy()
    fresh = np.stack([code.refreshed(each, fps) for each in values])
    return scale(torch.from_numpy(fresh).to(motion))


def smoothed(values: Tensor, widths: Tensor) -> Tensor:
    """Values (N, T, c) under Gaussians of standard deviations `widths` (N, 1), frames; the ends hold."""
    reach = int(np.ceil(REACH * float(widths.max())))
    kernels = torch.exp(-0.5 * (torch.arange(-reach, reach + 1).to(widths) / widths).square())
    kernels = kernels / kernels.sum(dim=1, keepdim=True)
    n, t, c = values.shape
    rows = pad(values.transpose(1, 2).reshape(1, n * c, t), (reach, reach), mode="replicate")
    filtered = conv1d(rows, kernels.repeat_interleave(c, dim=0)[:, None], groups=n * c)
    return filtered.reshape(n, c, t).transpose(1, 2)


def train_feet(split: Split, sequences: SequenceSet, options: TrainOptions, params: FootParams) -> FootModel:
    """Train a foot model on the windows of a split's training side, and keep everything about it in `options.out`.

    Raises
    ------
    ValueError
        As `open_run`; if a side of the split has no window, a training window a figure of another side, or a velocity
        weight is asked for a code of rotations.
    """
    check_velocity(params, sequences.params.representation)
    fabric = make_fabric(accelerator=options.accelerator)
    source = training_windows(split, sequences, fabric.device)
    batching = Batching(params.batch_size, 1, params.seed)
    settings = {"feet": params, "data": sequences.units.source, "code": sequences.params}
    with open_run(fabric, options, split, settings, batching, len(source)) as run:
        with drawn_by(params.seed):
            model = FootModel(params, sequences.code)
        model.motion_scale.set(source.statistics.motion_mean, source.statistics.motion_std)
        model.to(fabric.device)
        run.fit([_phase(model, sequences.params.fps)], source)
        updates = params.epochs * len(epoch_order(len(source), 0, batching))
        run.save(model.eval(), {"source": sequences.units.source, "updates": updates})
    return model


def check_velocity(params: FootParams, representation: Representation) -> None:
    """ValueError for a velocity weight where motion is coded as rotations."""
    if params.velocity_weight and representation == "rotations":
        raise ValueError("velocity_weight is for the code of positions; use 0")


def _phase(model: FootModel, fps: float) -> Phase:
    params = model.params
    player = Player(
        "feet", [*model.parameters()], lambda output, shard, row: foot_terms(model, output, shard.own, fps),
        {"mse": 1.0, "smooth": params.smooth_weight, "velocity": params.velocity_weight},
    )  # fmt: skip
    return Phase("feet", params.epochs, lambda number: params.learning_rate, {"feet": model}, [player],
                 forward=lambda shard, last: _corrected(model, shard, fps))  # fmt: skip


def _corrected(model: FootModel, shard: Shard, fps: float) -> Slid:
    """A batch with simulated sliding, and corrected."""
    return Slid(shard.own.motion, *model.corrected(*simulated_sliding(model, shard.own, fps, shard.seed)))


def simulated_sliding(model: FootModel, windows: Windows, fps: float, seed: int) -> tuple[Tensor, Tensor]:
    """Standardised motion (N, T, C) of windows that slides, and their contacts (N, T, 2), some of them wrong (R38)."""
    with drawn_by(seed, windows.motion.device):
        slid = slid_motion(windows.motion, model, fps)
        wrong = torch.rand(windows.contacts.shape).to(windows.contacts) < model.params.flipped
        return slid, torch.where(wrong, 1 - windows.contacts, windows.contacts)


def foot_terms(model: FootModel, output: Slid, windows: Windows, fps: float) -> Terms:
    """Error, smoothness of the increments, and the speed of standing feet where it counts."""
    away = (output.corrected - output.motion)[..., model.lower].square().mean(dim=-1)
    terms = {
        "mse": (away * windows.valid).sum() / windows.valid.sum().clamp(min=1.0),
        "smooth": output.increments.diff(n=2, dim=1).square().mean(),
    }
    if model.params.velocity_weight:
        terms["velocity"] = standing_speed(model, output.corrected, windows, fps)
    return terms


def standing_speed(model: FootModel, motion: Tensor, windows: Windows, fps: float) -> Tensor:
    """Mean square of the speed (m/s) along the floor of feet that stand, of standardised motion in positions.

    The speed of a foot is that of its slowest point: a foot that stands may roll over its toes or turn on its ball.
    """
    skeleton = model.motion_code.skeleton
    code = motion * model.motion_scale.std + model.motion_scale.mean
    steps = decode(code, fps)[..., [0, 2]].diff(dim=1).square().sum(dim=-1)  # (N, T - 1, J)
    speeds = torch.stack([steps[..., list(foot)].amin(dim=-1) * fps**2 for foot in foot_joints(skeleton)], dim=-1)
    standing = windows.contacts[:, 1:] * windows.contacts[:, :-1] * windows.valid[:, 1:, None]
    return (speeds * standing).sum() / standing.sum().clamp(min=1.0)


class Feet(Learner):
    """The foot constraint model (`FootModel`), as a thing to train."""

    result = FootModel

    @classmethod
    def learn(
        cls,
        data: list[PathLike],
        options: TrainOptions,
        *,
        representation: Representation = "positions",
        step: int = 2,
        split_seed: int = 0,
        **changes: Any,
    ) -> None:
        """`train`, on the figures of the training side; its own keywords:

        representation : "positions" or "rotations", as the dancer's that it serves
        step, split_seed : as of `harmolab.systems.training.network_system.PresetSystem.learn`
        changes : other values for fields of `FootParams`, such as ``epochs`` and ``velocity_weight``
        """
        params = changed(FootParams(), changes)
        coding = replace(Music2DanceParams.recommended(), representation=representation)
        check_velocity(params, representation)
        sequences = load_sequences(data, coding, step=step, progress=options.progress)
        train_feet(noticed_split(sequences.units, split_seed, step, options.notice), sequences, options, params)
