"""How the networks are trained, and how they dance a whole song (Fig. 7a and 7b)."""

from __future__ import annotations

from collections.abc import Mapping

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from harmolab.params import TrainParams
from harmolab.viz.boxes import TINTS, count_text, draw_arrow, draw_box, inch_axes, tint_legend
from harmolab.viz.style import COLOURS, figure_style

__all__ = ["LOSSES", "draw_dancing", "draw_training", "framework_figure"]

# Term of `TrainParams` -> its sign, the paper's equation, and what is compared with what.
LOSSES = {
    "kl": ("$L_{kl}$: 2-D poses", "Eq. 24", "$V'_{2d}$ against $V_{2d}$"),
    "mse": ("$L_{mse}$: poses", "Eq. 25", "$V'$ against $V$, the meter counts more"),
    "feature": ("$L_{feat}$: pose network", "Eq. 26", "its features of $V'$ against those of $V$"),
    "gan": ("$L_{gan}$: discriminators", "Eq. 28-31", "$D_{cd}$ (CROSS) hears and sees, $D_{st}$ (TEMPORAL) sees $V'$"),
    "harmony": ("$L_{harmo}$: harmony", "Eq. 27", "beats of $V'$ against the music's; ours: above chance"),
    "smoothness": ("jerk", "not in the paper", "only what $V'$ has more than $V$"),
    "energy": ("energy", "not in the paper", "as much movement as in $V$"),
    "foot": ("feet", "not in the paper", "sliding where those of $V$ stand"),
}
_ROW = 0.67  # inches
_WIDE = 3.5
TRAINING, DANCING = (11.4, _ROW * len(LOSSES) + 0.1), (11.4, 2.6)
_METERS = ("meter 1", "meter 2", "meter 3")
_PRIOR = 0.3  # share of a meter drawn as the beats that go on into the next


def draw_training(ax: Axes, counts: Mapping[str, int], params: Mapping[str, TrainParams]) -> Axes:
    """Panel a: from music and initial poses to the weighted losses that change the generator.

    Parameters
    ----------
    ax : Axes of `TRAINING` inches, see `harmolab.viz.boxes.inch_axes`
    counts : parameters of "generator", "cross_domain" and "spatial_temporal"
    params : name of a way to train -> its settings; their loss weights are written out, 0 is a term that is off
    """
    middle = TRAINING[1] / 2
    draw_box(ax, (0.95, middle + 0.9), ["music $A_f$", "of a meter unit"], tint="audio", width=1.7, rounded=False)
    lines = ["initial poses $V_f$", "last meter, then", "its mean pose (Eq. 23)"]
    draw_box(ax, (0.95, middle - 0.9), lines, tint="motion", width=1.7, rounded=False)
    draw_box(ax, (3.15, middle), ["generator $G$", f"{count_text(counts['generator'])} parameters"], width=1.6)
    draw_box(ax, (5.2, middle), ["motion $V'$"], tint="motion", width=1.1, rounded=False)
    for y, edge in ((middle + 0.9, 0.21), (middle - 0.9, -0.21)):
        draw_arrow(ax, [(1.8, y), (3.15, y), (3.15, middle + edge)])
    draw_arrow(ax, [(3.95, middle), (4.65, middle)])
    left = 6.45
    for row, name in enumerate(LOSSES):
        y = TRAINING[1] - _ROW * (row + 0.5)
        title, equation, what = LOSSES[name]
        if name == "gan":
            for word, network in (("CROSS", "cross_domain"), ("TEMPORAL", "spatial_temporal")):
                what = what.replace(word, count_text(counts[network]))
        weights = ", ".join(f"{key} {_weight(each, name)}" for key, each in params.items())
        draw_box(ax, (left + _WIDE / 2, y), [f"{title} ({equation})", what, f"weight: {weights}"], width=_WIDE)
        draw_arrow(ax, [(5.75, middle), (6.05, middle), (6.05, y), (left, y)])
        ax.plot([left + _WIDE, left + _WIDE + 0.25], [y, y], color=COLOURS["ink"], linewidth=1.1, zorder=1)
    _draw_feedback(ax, left + _WIDE + 0.25, middle)
    return ax


def _weight(params: TrainParams, name: str) -> str:
    """A loss term's weight, and which discriminator it is for where only one is heard."""
    weight = f"{getattr(params, f'{name}_weight'):g}"
    return f"{weight} ($D_{{st}}$ alone)" if name == "gan" and params.cross_domain_weight == 0 else weight


def _draw_feedback(ax: Axes, x: float, middle: float) -> None:
    """The sum of the losses, and its way back to the generator."""
    ends = [TRAINING[1] - _ROW * (row + 0.5) for row in (0, len(LOSSES) - 1)]
    ax.plot([x, x], ends, color=COLOURS["ink"], linewidth=1.1, zorder=1)
    half = draw_box(ax, (x + 0.65, middle), ["$L_{total}$", "(Eq. 32)"], width=0.85)
    draw_arrow(ax, [(x, middle), (x + 0.225, middle)])
    low = 0.03
    draw_arrow(ax, [(x + 0.65, middle - half), (x + 0.65, low), (3.6, low), (3.6, middle - 0.22)], dashed=True)
    ax.text(3.72, 0.12, "its gradient changes $G$", fontsize=9, color=COLOURS["ink"])


def draw_dancing(ax: Axes) -> Axes:
    """Panel b: meter by meter, the last beats danced are the initial poses of the next meter."""
    length, start = 3.0, 1.35
    music, network, motion = 2.3, 1.45, 0.55
    for y, label in ((music, "music $A_f$"), (network, "$V_f$: stored pose"), (motion, "motion $V'$")):
        ax.text(0.05, y, label, va="center", fontsize=9, color=COLOURS["ink"])
    for number, name in enumerate(_METERS):
        left = start + number * (length + 0.25)
        middle = left + length / 2
        draw_box(ax, (middle, music), [name], tint="audio", width=length, rounded=False)
        half = draw_box(ax, (middle, network), ["generator $G$"], width=1.5)
        draw_box(ax, (middle, motion), [f"dance of {name}"], tint="motion", width=length, rounded=False)
        draw_arrow(ax, [(middle, music - 0.14), (middle, network + half)])
        draw_arrow(ax, [(middle, network - half), (middle, motion + 0.14)])
        end = left + length
        tail = end - _PRIOR * length
        corner = (tail, motion - 0.1425)
        ax.add_patch(_last_beats(corner, end - tail))
        if number + 1 < len(_METERS):
            x, following = (tail + end) / 2, end + 0.25 + length / 2
            draw_arrow(ax, [(x, motion + 0.14), (x, network), (following - 0.75, network)]).set_gid("handing over")
    draw_arrow(ax, [(start + 0.25, network), (start + length / 2 - 0.75, network)])
    return ax


def _last_beats(corner: tuple[float, float], width: float) -> Rectangle:
    """The end of a meter's dance, hatched: what the generator is given with the next one."""
    box = Rectangle(corner, width, 0.285, facecolor=TINTS["motion"], edgecolor=COLOURS["visual"], linewidth=0, zorder=3)
    box.set(hatch="///", gid="last beats")
    return box


def framework_figure(counts: Mapping[str, int], params: Mapping[str, TrainParams]) -> Figure:
    """`draw_training` above `draw_dancing`."""
    with figure_style():
        figure = Figure(figsize=(TRAINING[0], TRAINING[1] + DANCING[1] + 1.3))
        figure.set_layout_engine("none")
        ax = inch_axes(figure, (0.0, DANCING[1] + 0.9), TRAINING)
        draw_training(ax, counts, params).set_title("a  Training: every meter unit has a recorded answer $V$")
        title = "b  Dancing a song: the last beats danced (hatched) are the next meter's initial poses"
        draw_dancing(inch_axes(figure, (0.0, 0.35), DANCING)).set_title(title)
        below = inch_axes(figure, (0.0, 0.0), (DANCING[0], 0.35))
        below.legend(handles=tint_legend()[:2], loc="lower left", ncols=2)
    return figure
