"""`DanceMetric` as a metric of torchmetrics: for `MetricCollection`, for Lightning, and for several processes."""

import json
from typing import Any

import torch
from torch import Tensor
from torchmetrics import Metric


class TorchDanceMetric(Metric):
    """A `DanceMetric` whose state is a tensor that torchmetrics gathers from all processes.

    The state are the measured rows, a line of JSON each, as bytes: joined to those of other processes they are the
    rows of all, with every number as it was.

    Parameters
    ----------
    metric : DanceMetric, whose `torchmetrics` makes this: it measures, and is emptied each time
    options : of `torchmetrics.Metric`
    """

    full_state_update = False
    is_differentiable = False
    higher_is_better = None
    lines: list[Tensor] | Tensor

    def __init__(self, metric: Any, **options: Any) -> None:
        super().__init__(**options)
        self.metric = metric
        self.add_state("lines", default=[], dist_reduce_fx="cat")

    def update(self, *args: Any, **options: Any) -> None:
        """As `DanceMetric.update`."""
        self.metric.reset()
        self.metric.update(*args, **options)
        text = "".join(f"{json.dumps(row)}\n" for row in self.metric.rows)
        data = torch.tensor(bytearray(text.encode()), dtype=torch.uint8, device=self.device)
        self.lines = [*self._parts(), data]

    def compute(self) -> dict[str, float]:
        """As `DanceMetric.compute`, of the dances of all processes."""
        content = b"".join(part.to("cpu", torch.uint8).numpy().tobytes() for part in self._parts())
        self.metric.reset()
        self.metric.merge_state(json.loads(line) for line in content.splitlines())
        return self.metric.compute()

    def sync(self, *args: Any, **options: Any) -> None:
        """As `torchmetrics.Metric.sync`, which a process without any dance would leave out, and the others wait for."""
        self.lines = [*self._parts(), torch.empty(0, dtype=torch.uint8, device=self.device)]
        super().sync(*args, **options)

    def _parts(self) -> list[Tensor]:
        return list(self.lines) if isinstance(self.lines, list | tuple) else [self.lines]

    @property
    def remarks(self) -> tuple[str, ...]:
        """As those of `DanceMetric`, on the dances of the last `compute`."""
        return self.metric.remarks
