"""Frozen settings. A variant is a difference: ``replace(HarmonyParams.paper(), beta=1.0)``."""

from harmolab.params.learning import FeatureParams, ModelParams, TrainParams
from harmolab.params.scoring import CHOICES, DANCES, BarPattern, Dance, HarmonyParams, RunProfile

__all__ = [
    "CHOICES",
    "DANCES",
    "BarPattern",
    "Dance",
    "FeatureParams",
    "HarmonyParams",
    "ModelParams",
    "RunProfile",
    "TrainParams",
]
