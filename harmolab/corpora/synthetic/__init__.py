"""Music and dance whose beats were planted: the embedded default, and the instrument that tells what a score can see.

Seven ballroom dances, a band that plays them, and a dancer of 21 joints whose movement units end on the beats. The
truth comes with every clip: beats and downbeats of the music, ends of the movements, figures.
"""

from __future__ import annotations

from harmolab.corpora.synthetic.beats import ClipSettings
from harmolab.corpora.synthetic.body import DANCER
from harmolab.corpora.synthetic.clip import PlantedClip, planted_clip, synthetic_clip
from harmolab.corpora.synthetic.corpus import write_corpus
from harmolab.corpora.synthetic.dance import synthetic_motion
from harmolab.corpora.synthetic.figures import figure_names
from harmolab.corpora.synthetic.music import PlantedMusic, synthetic_music

__all__ = [
    "DANCER",
    "ClipSettings",
    "PlantedClip",
    "PlantedMusic",
    "figure_names",
    "planted_clip",
    "synthetic_clip",
    "synthetic_motion",
    "synthetic_music",
    "write_corpus",
]
