"""What the notebooks run on, and their tables as functions from RunProfile to DataFrame."""

from harmolab.experiments.study import (
    Agreement,
    agreement,
    beat_agreement,
    clip_of_study,
    corpus_folders,
    data_root,
    excerpt,
    pattern_of_study,
    readable_recordings,
    strong_by_place,
    study_recordings,
    synthetic_corpus,
)

__all__ = [
    "Agreement",
    "agreement",
    "beat_agreement",
    "clip_of_study",
    "corpus_folders",
    "data_root",
    "excerpt",
    "pattern_of_study",
    "readable_recordings",
    "strong_by_place",
    "study_recordings",
    "synthetic_corpus",
]
