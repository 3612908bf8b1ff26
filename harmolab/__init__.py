"""harmolab: is this motion in harmony with this music?

>>> from harmolab import HarmonyParams, score_clip, synthetic_clip
>>> score = score_clip(synthetic_clip("waltz", seed=3), HarmonyParams.recommended())
>>> score.harmony_above_chance > 0.5
True

Names are resolved on first use, so that ``import harmolab`` is quick and loads no plotting or training library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from harmolab.beats.audio import audio_beats
    from harmolab.beats.meter import MeterUnit
    from harmolab.beats.saliency import salient_audio, salient_visual
    from harmolab.beats.visual import visual_beats
    from harmolab.corpora.synthetic import synthetic_clip
    from harmolab.harmony import score_clip, score_harmony, score_motion
    from harmolab.io.audio import load_audio
    from harmolab.io.beats import load_beats
    from harmolab.io.motion import load_motion, save_motion
    from harmolab.lab.compare.auc import compare
    from harmolab.lab.profile import RunProfile
    from harmolab.params import BarPattern, HarmonyParams
    from harmolab.systems.harmogan.generate import synthesize_dance
    from harmolab.types import Audio, BeatTrack, Clip, HarmonyScore, Motion, Skeleton

__version__ = "0.1.0"

_HOME = {
    "harmolab.types": ("Audio", "BeatTrack", "Clip", "HarmonyScore", "Motion", "Skeleton"),
    "harmolab.params": ("BarPattern", "HarmonyParams"),
    "harmolab.lab.profile": ("RunProfile",),
    "harmolab.io.audio": ("load_audio",),
    "harmolab.io.beats": ("load_beats",),
    "harmolab.io.motion": ("load_motion", "save_motion"),
    "harmolab.beats.audio": ("audio_beats",),
    "harmolab.beats.visual": ("visual_beats",),
    "harmolab.beats.meter": ("MeterUnit",),
    "harmolab.beats.saliency": ("salient_audio", "salient_visual"),
    "harmolab.harmony": ("score_clip", "score_harmony", "score_motion"),
    "harmolab.lab.compare.auc": ("compare",),
    "harmolab.corpora.synthetic.clip": ("synthetic_clip",),
    "harmolab.systems.harmogan.generate": ("synthesize_dance",),
}
_MODULE_OF = {name: module for module, names in _HOME.items() for name in names}

__all__ = [
    "Audio",
    "BarPattern",
    "BeatTrack",
    "Clip",
    "HarmonyParams",
    "HarmonyScore",
    "MeterUnit",
    "Motion",
    "RunProfile",
    "Skeleton",
    "audio_beats",
    "compare",
    "load_audio",
    "load_beats",
    "load_motion",
    "salient_audio",
    "salient_visual",
    "save_motion",
    "score_clip",
    "score_harmony",
    "score_motion",
    "synthesize_dance",
    "synthetic_clip",
    "visual_beats",
]


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module 'harmolab' has no attribute {name!r}")
    return getattr(import_module(_MODULE_OF[name]), name)


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
