"""From recordings to windows of Music2Dance, in boxes (in place of Fig. 2): every number is measured."""

from __future__ import annotations

from harmolab.systems.music2dance.networks import CONTACTS
from harmolab.systems.music2dance.params import Music2DanceParams
from harmolab.systems.music2dance.sequences import window_starts
from study.experiments.music2dance import coded_sequences, dancer_split, profiled
from study.profile import RunProfile

Boxes = dict[str, str]  # heading -> what stands below it


def recording_chain(profile: RunProfile, corpus: str, params: Music2DanceParams) -> Boxes:
    """Heading -> what stands below it, in place of Fig. 2: recordings, code, windows, the split by figure."""
    sequences = coded_sequences(profile, corpus, profiled(profile, params))
    frames = sum(sequence.n_frames for sequence in sequences.sequences)
    groups = dancer_split(profile, corpus).groups
    counts = {
        side: sum(len(window_starts(each, groups[side], sequences.params)) for each in sequences.sequences)
        for side in groups
    }
    every = {segment.group for each in sequences.sequences for segment in each.segments}
    fps, window = sequences.params.fps, sequences.params.window
    return {
        "recordings": f"{len(sequences.sequences)} of {len(sequences.dances)} dances\n{frames / fps / 60:.1f} minutes",
        "motion code": f"{fps:g} frames a second\n{sequences.code.n_motion} channels + {CONTACTS} contacts",
        "figures": f"{len(every)} motion groups\nwindows of {window:g} s",
        **{side: f"{len(groups[side])} groups\n{count} windows" for side, count in counts.items()},
    }
