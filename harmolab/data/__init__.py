"""Corpora: folders of sequences, the recordings of Tang et al., and what a file or folder holds."""

from harmolab.data.check import Finding, check
from harmolab.data.folders import (
    Found,
    Problem,
    Sequence,
    find_sequences,
    iter_sequences,
    load_any_motion,
    load_sequence,
)

__all__ = [
    "Finding",
    "Found",
    "Problem",
    "Sequence",
    "check",
    "find_sequences",
    "iter_sequences",
    "load_any_motion",
    "load_sequence",
]
