"""Controls of the live labs, in plain words with the paper's symbol beside them."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from harmolab.lab.widgets.labs.live import Menu, Slider

MODE = {
    "paper": "the paper's: turns of speed within 0.25 s",
    "recommended": "recommended: verdict on the shape of the body",
    "valleys": "stops: slowest moments within 0.1 s",
}
RATES = {None: "as recorded", 60.0: "60", 30.0: "30", 25.0: "25", 15.0: "15", 10.0: "10"}
POSITION_SMOOTHINGS = {0.0: "not at all", **{step / 20: f"{step / 20:.2f} s" for step in range(1, 7)}}
LAG = Slider("expect the dance later by", "lag", -0.4, 0.4, 0.02, "s")
CONTROLS: Mapping[str, Slider | Menu] = MappingProxyType(
    {
        "mode": Menu("way to score", "mode", MODE),
        "detector": Menu(
            "movements are",
            "detector",
            {
                "turns": "turns of the speed (fast and slow)",
                "valleys": "slowest moments",
                "peaks": "fastest moments",
                "direction": "changes of direction",
            },
        ),
        "matching": Menu(
            "one movement may serve",
            "matching",
            {"many": "several music beats", "nearest": "one music beat, in turn"},
        ),
        "delay": Slider("together means within", "T_delay", 0.0, 0.5, 0.01, "s"),
        "lambda1": Slider("ignore quiet music beats", "λ1", 0.0, 15.0, 0.1, "SD"),
        "lambda2": Slider("ignore small movements", "λ2", 0.0, 6.0, 0.1, "SD"),
        "beta": Slider("weigh missed beats", "β", 0.25, 4.0, 0.25, "×"),
        "lag": LAG,
        "normalisation": Menu(
            "strength of a beat",
            "normalisation",
            {"max": "of the largest", "mean": "of the mean", "raw": "as measured"},
        ),
        "saliency": Menu(
            "threshold",
            "Eq. 11, 13",
            {"threshold": "λ standard deviations", "literal": "as printed: one SD, whatever λ"},
        ),
        "visual_saliency": Menu(
            "a movement is large by its",
            "Eq. 13",
            {"difference": "step from the one before", "strength": "speed"},
        ),
        "fps": Menu("frames a second", "fps", RATES),
        "plateau": Menu(
            "a flat top counts",
            "Eq. 9",
            {"last": "at its end", "middle": "at its middle", "literal": "not at all, as printed"},
        ),
        "smoothing": Slider("smooth the curve over", "σ", 0.0, 0.3, 0.01, "s"),
        "position_smoothing": Menu("smooth the positions first, over", "σ", POSITION_SMOOTHINGS),
        "subframe": Menu("beats lie", "subframe", {False: "on frames", True: "between frames"}),
        "first_beat": Menu("the first movement", "Eq. 12", {"copy": "has the second's step", "drop": "is left out"}),
    }
)
METER_CONTROLS: Mapping[str, Slider | Menu] = MappingProxyType(
    {
        "every": Slider("take one beat of every", "n", 1.0, 4.0, 1.0),
        "first": Slider("leave out at the start", "beats", 0.0, 7.0, 1.0),
        "error": Slider("measure each strength wrongly by", "error", 0.0, 1.0, 0.05, "SD"),
    }
)


def named_controls(*names: str) -> dict[str, Slider | Menu]:
    """The named ones of `CONTROLS`, in this order."""
    return {name: CONTROLS[name] for name in names}
