"""Shapes inside the attribute classifier, measured by running it once (Fig. 5)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any, NamedTuple

import torch
from torch import Tensor, nn
from torch.utils.hooks import RemovableHandle

from harmolab.systems.common.layers import parameter_count
from harmolab.systems.common.song_layers import KERNEL, TemporalConvolution
from harmolab.systems.music2dance.attributes import N_AUDIO, AttributeClassifier


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
    stages: list[Stage] = []
    was_training, hooks = classifier.training, list(_hooks(classifier, stages))
    try:
        classifier.eval()(torch.zeros(1, classifier.params.n_cells, N_AUDIO))
    finally:
        classifier.train(was_training)
        for hook in hooks:
            hook.remove()
    return stages


def _hooks(classifier: AttributeClassifier, stages: list[Stage]) -> Iterator[RemovableHandle]:
    """Hooks that add to `stages` as the modules run."""

    def note(name: str, values: Any, layer: nn.Module | None = None) -> None:
        tensor: Tensor = values[0] if isinstance(values, tuple) else values
        count = 0 if layer is None else parameter_count(layer)
        stages.append(Stage(name, tuple(tensor.shape[1:]), count, _detail(layer)))

    front = classifier.encoder.front
    yield classifier.register_forward_pre_hook(lambda _, inputs: note("features", inputs))
    if isinstance(front, TemporalConvolution):
        # It comes with the moment of padding that this convolution takes away again.
        yield front.layers[0].register_forward_pre_hook(lambda _, x: note("one channel", x[0][:, :, : 1 - KERNEL]))
        for layer in front.layers:
            yield layer.register_forward_hook(lambda own, _, result: note("convolution", result, own))
        yield front.register_forward_hook(lambda _, inputs, result: note("channels joined", result))
    else:
        for layer in front.layers:
            if isinstance(layer, nn.Linear):
                yield layer.register_forward_hook(lambda own, _, result: note("fully connected", result, own))
    yield classifier.encoder.reader.register_forward_hook(lambda own, _, result: note("Bi-LSTM", result, own))
    yield classifier.verdict.register_forward_pre_hook(lambda _, inputs: note("mean over time", inputs))
    yield classifier.verdict.register_forward_hook(lambda own, _, result: note("classes", result, own))


def _detail(layer: nn.Module | None) -> str:
    """Sizes of a layer that the shapes do not show."""
    if isinstance(layer, nn.LSTM):
        return f"{layer.hidden_size} in each direction"
    convolutions = [part for part in layer.modules() if isinstance(part, nn.Conv2d)] if layer else []
    return ", ".join(f"kernel {part.kernel_size[0]}, stride {part.stride[0]}" for part in convolutions)
