"""Corpora: folders of recordings, those of Tang et al. among them, and summaries of files and folders."""

from harmolab.data.check import FileSummary, check
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
    "FileSummary",
    "Problem",
    "Recording",
    "RecordingFolders",
    "check",
    "find_recordings",
    "iter_recordings",
    "load_any_motion",
    "load_recording",
]
