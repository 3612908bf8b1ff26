"""A pianist and a violinist in the plane, planted on the notes of pieces that follow from a seed.

The sound is rendered from the same notes. The truth comes with every performance: the points without noise, the part
of them that follows from the notes, planted faults by name, the camera, and the strikes or turns of the bow.
"""

from harmolab.musician.synthetic.performance import (
    FAULTS,
    PlantedPerformance,
    planted_performance,
    planted_performances,
)
from harmolab.musician.synthetic.pieces import PlantedPiece, planted_piece, rendered_notes

__all__ = [
    "FAULTS",
    "PlantedPerformance",
    "PlantedPiece",
    "planted_performance",
    "planted_performances",
    "planted_piece",
    "rendered_notes",
]
