"""Networks measured by running them once: layers, sizes and shapes of their parts (Fig. 7; Music2Dance Fig. 3, 5)."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn

from harmolab.systems.harmogan.networks import CrossDomainDiscriminator, Generator, SpatialTemporalDiscriminator
from harmolab.systems.music2dance.attributes import N_AUDIO, AttributeClassifier
from harmolab.systems.music2dance.networks import CONTACTS, DanceNetwork, LstmDancer
from harmolab.systems.music2dance.sequences import n_cells
from harmolab.systems.training.layers import KERNEL, TemporalConvolution, parameter_count
from harmolab.systems.training.units import Batch
from harmolab.types import SingleArray


@dataclass(frozen=True)
class Part:
    """An input, a part that learns, or an output of a network.

    Parameters
    ----------
    network : "generator", "cross_domain" or "spatial_temporal"
    name : argument of ``forward``, attribute of the network ("joining.0" inside a list), or field of its output
    layers : "input", "output", or the layers inside, such as "GRU" or "3 Conv1d"
    parameters : int, values that training changes
    shape : shape of the output for one unit; units that are cut have the number of pieces in front
    """

    network: str
    name: str
    layers: str
    parameters: int
    shape: str


def anatomy(generator: Generator, batch: Batch[SingleArray]) -> list[Part]:
    """Parts of a generator and of the two discriminators of its size, by running them on a batch.

    Parameters
    ----------
    generator : Generator; neither its weights nor its mode change
    batch : Batch of units for it
    """
    audio, initial, motion, mask = map(torch.from_numpy, (batch.audio, batch.initial, batch.motion, batch.mask))
    with torch.random.fork_rng(devices=[]):  # measuring must not change a training that follows
        cross = CrossDomainDiscriminator(generator.params, generator.n_audio, generator.skeleton)
        temporal = SpatialTemporalDiscriminator(generator.params, generator.skeleton)
    return [
        *parts_of("generator", generator, audio=audio, initial=initial),
        *parts_of("cross_domain", cross, audio=audio, motion=motion, mask=mask),
        *parts_of("spatial_temporal", temporal, motion=motion, mask=mask),
    ]


@torch.no_grad()
def parts_of(title: str, network: nn.Module, **inputs: Tensor) -> list[Part]:
    """Inputs (but for "mask"), parts that learn, in the order in which they run, and outputs of a network.

    Its children with parameters are the parts; lists of modules are opened.
    """
    n_units = len(next(iter(inputs.values())))
    result, passes = _passes(network, _learning_parts(network), **inputs)
    outputs = result._asdict() if hasattr(result, "_asdict") else {"output": result}

    def part(name: str, layers: str, tensor: Tensor, parameters: int = 0) -> Part:
        return Part(title, name, layers, parameters, shape_text(tensor.shape, n_units))

    return [
        *(part(name, "input", x) for name, x in inputs.items() if name != "mask"),
        *(part(name, layers_of(module), after, parameter_count(module)) for name, module, _, after in passes),
        *(part(name, "output", x) for name, x in outputs.items()),
    ]


Pass = tuple[str, nn.Module, Tensor, Tensor]  # a name, the module of that name, what goes into it and what comes out


def _passes(
    network: nn.Module, modules: Iterable[tuple[str, nn.Module]], *values: Tensor, **inputs: Tensor
) -> tuple[Any, list[Pass]]:
    """What a network answers, and a `Pass` for each of some modules in it, in the order in which they ran."""
    passes: list[Pass] = []

    def note(name: str, module: nn.Module, given: tuple[Any, ...], result: Any) -> None:
        passes.append((name, module, given[0], result[0] if isinstance(result, tuple) else result))

    hooks = [module.register_forward_hook(partial(note, name)) for name, module in modules]
    try:
        return network(*values, **inputs), passes
    finally:
        for hook in hooks:
            hook.remove()


def _learning_parts(network: nn.Module) -> Iterator[tuple[str, nn.Module]]:
    """Children with parameters; those of a list one by one."""
    for name, child in network.named_children():
        if isinstance(child, nn.ModuleList):
            yield from ((f"{name}.{place}", module) for place, module in child.named_children())
        elif any(True for _ in child.parameters()):
            yield name, child


def layers_of(module: nn.Module) -> str:
    """Classes of the layers with weights of their own, in order: "3 Conv1d", "GRU", "Conv1d + Linear"."""
    layers = [type(part).__name__ for part in module.modules() if any(True for _ in part.parameters(recurse=False))]
    runs = [(name, len(list(run))) for name, run in groupby(layers)]
    return " + ".join(f"{count} {name}" if count > 1 else name for name, count in runs)


def shape_text(shape: tuple[int, ...], n_units: int) -> str:
    """The shape of one unit in a batch; units that were cut into several pieces have their number in front.

    >>> shape_text((10, 60), 10), shape_text((50, 128), 10), shape_text((10,), 10)
    ('60', '5 of 128', '1')
    """
    first, *rest = shape
    inside = " \N{MULTIPLICATION SIGN} ".join(str(size) for size in rest) or "1"
    return f"{first // n_units} of {inside}" if first > n_units else inside


# Shapes inside the attribute classifier (Music2Dance, Fig. 5)


class Stage(NamedTuple):
    """A tensor on its way through the classifier.

    Parameters
    ----------
    name : in words
    shape : of one window
    parameters : int, values that training changes in the layer that it comes from
    detail : of that layer, in words
    """

    name: str
    shape: tuple[int, ...]
    parameters: int = 0
    detail: str = ""


@torch.no_grad()
def classifier_stages(classifier: AttributeClassifier) -> list[Stage]:
    """Every tensor from a window of features to the classes, noted while the modules run on a window of zeros.

    Parameters
    ----------
    classifier : AttributeClassifier; neither its weights nor its mode change
    """
    encoder, was_training = classifier.encoder, classifier.training
    convolutions = isinstance(encoder.front, TemporalConvolution)
    words = "convolution" if convolutions else "fully connected"
    modules = [(words, layer) for layer in encoder.front.layers if convolutions or isinstance(layer, nn.Linear)]
    modules += [("channels joined", encoder.front)] if convolutions else []
    modules += [("Bi-LSTM", encoder.reader), ("classes", classifier.verdict)]
    window = torch.zeros(1, classifier.params.n_cells, N_AUDIO)
    try:
        _, passes = _passes(classifier.eval(), modules, window)
    finally:
        classifier.train(was_training)
    stages = [_stage("features", window)]
    if convolutions:  # it comes with the moment of padding that this convolution takes away again
        stages.append(_stage("one channel", passes[0][2][:, :, : 1 - KERNEL]))
    for name, layer, before, after in passes:
        stages += [_stage("mean over time", before)] if name == "classes" else []
        stages.append(_stage(name, after, None if layer is encoder.front else layer))
    return stages


def _stage(name: str, tensor: Tensor, layer: nn.Module | None = None) -> Stage:
    """A tensor with what there is to say of the layer that it comes from."""
    return Stage(name, tuple(tensor.shape[1:]), 0 if layer is None else parameter_count(layer), _detail(layer))


def _detail(layer: nn.Module | None) -> str:
    """Sizes of a layer that the shapes do not show."""
    if isinstance(layer, nn.LSTM):
        return f"{layer.hidden_size} in each direction"
    convolutions = [part for part in layer.modules() if isinstance(part, nn.Conv2d)] if layer else []
    return ", ".join(f"kernel {part.kernel_size[0]}, stride {part.stride[0]}" for part in convolutions)


# Shapes of a training window on its way through Music2Dance's network, in boxes (Fig. 3)


@torch.no_grad()
def network_boxes(network: DanceNetwork) -> dict[str, str]:
    """Heading -> what stands below it: Fig. 3, the framework, with the shapes of a training window."""
    params, frames = network.params, network.params.n_frames
    cells = n_cells(params.song)
    music, moments = torch.zeros(1, cells, params.song.n_audio), torch.linspace(0, cells - 1, frames)[None]
    music_at_frames = network.music_at(music, moments)
    motion, contacts = torch.zeros(1, frames, network.motion_code.n_motion), torch.zeros(1, frames, CONTACTS)
    prediction = network.predicted(motion, contacts, music_at_frames, torch.zeros(1, dtype=torch.long))
    mapping = {} if network.mapping is None else {"mapping network": _shape(network.mapping(music))}
    body = f"{params.groups * len(params.dilations)} gated blocks\nsees {params.reach} frames"
    return {
        "music": f"{_shape(music)}\n{params.song.rate:g} moments a second",
        **mapping,
        "music at each frame": _shape(music_at_frames),
        "frames so far": f"{_shape(torch.cat([motion, contacts], dim=-1))}\n{params.fps:g} frames a second",
        "network": f"LSTM of {params.lstm}" if isinstance(network.body, LstmDancer) else body,
        "dance": f"learnt vector of {params.dance_vector}\n{len(network.dances)} dances",
        "next frame": f"mean, spread {_shape(prediction.mean)}\ncontacts {_shape(prediction.contacts)}",
        "parameters": f"{parameter_count(network):,}".replace(",", " "),
    }


def _shape(values: torch.Tensor) -> str:
    return " x ".join(map(str, values.shape[1:]))
