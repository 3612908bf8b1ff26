"""The field's other measures: of beats against music (`beats`), of motion alone (`quality`), of sets (`frechet`)."""

from harmolab.metrics.beats import (
    AIST_SIGMA,
    AIST_SMOOTHING,
    MIR_EVAL_NAMES,
    beat_align,
    beat_coverage,
    beat_hit_rate,
    kinematic_params,
    mir_eval_scores,
    other_scores,
)
from harmolab.metrics.frechet import FrechetResult, diversity, frechet_distance, multimodality, standardise
from harmolab.metrics.quality import (
    PEAK_PERCENTILE,
    StepSpeeds,
    bone_error,
    foot_skating,
    freezing,
    jerk,
    largest_step,
    pfc,
    relative_jerk,
)
from harmolab.metrics.steps import STEP

__all__ = [
    "AIST_SIGMA",
    "AIST_SMOOTHING",
    "MIR_EVAL_NAMES",
    "PEAK_PERCENTILE",
    "STEP",
    "FrechetResult",
    "StepSpeeds",
    "beat_align",
    "beat_coverage",
    "beat_hit_rate",
    "bone_error",
    "diversity",
    "foot_skating",
    "frechet_distance",
    "freezing",
    "jerk",
    "kinematic_params",
    "largest_step",
    "mir_eval_scores",
    "multimodality",
    "other_scores",
    "pfc",
    "relative_jerk",
    "standardise",
]
