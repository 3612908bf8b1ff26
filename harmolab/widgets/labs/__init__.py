"""Labs: the choices of a score on controls, and one picture that shows what they do."""

from harmolab.widgets.labs.clips import Corpus
from harmolab.widgets.labs.corpus import CorpusLab, corpus_lab, draw_corpus_lab
from harmolab.widgets.labs.detector import detector_lab, draw_detector_lab
from harmolab.widgets.labs.lab import Lab, params_line
from harmolab.widgets.labs.meter import draw_meter_lab, meter_lab
from harmolab.widgets.labs.saliency import draw_saliency_lab, saliency_lab
from harmolab.widgets.labs.scoring import N_ROTATIONS, draw_lab, lab_params, scoring_lab
from harmolab.widgets.labs.stage import Stage

__all__ = [
    "N_ROTATIONS",
    "Corpus",
    "CorpusLab",
    "Lab",
    "Stage",
    "corpus_lab",
    "detector_lab",
    "draw_corpus_lab",
    "draw_detector_lab",
    "draw_lab",
    "draw_meter_lab",
    "draw_saliency_lab",
    "lab_params",
    "meter_lab",
    "params_line",
    "saliency_lab",
    "scoring_lab",
]
