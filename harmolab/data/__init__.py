"""Corpora: folders of sequences, the recordings of Tang et al., and what a file or folder holds."""

from harmolab.data.check import Finding, check
from harmolab.data.folders import (
    Problem,
    Recording,
    RecordingFolders,
    find_recordings,
    iter_recordings,
    load_any_motion,
    load_recording,
)

__all__ = [
    "Finding",
    "Problem",
    "Recording",
    "RecordingFolders",
    "check",
    "find_recordings",
    "iter_recordings",
    "load_any_motion",
    "load_recording",
]
