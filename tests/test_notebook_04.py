"""Notebook 04: the equations in its cells are those of the package, and its words those of its table."""

import numpy as np
import pandas as pd
import pytest

from harmolab import HarmonyParams, music_and_motion, score_harmony, synthetic_clip, visual_beats
from tests.notebook_cells import notebook_cells

PAPER = HarmonyParams.paper()
CELLS = notebook_cells("04_salience_and_scoring", paper=PAPER)
TABLE = pd.DataFrame(
    {
        "beats": ["turns", "turns", "valleys", "valleys"],
        "delay": [0.1, 0.25, 0.1, 0.25],
        "hit_rate": [0.5, 0.9, 0.6, 0.7],
        "chance": [0.4, 0.88, 0.3, 0.6],
        "delay_of_paper": 0.25,
    }
)


@pytest.mark.parametrize(("dance", "fps"), [("waltz", 30.0), ("jive", 25.0), ("rumba", 60.0), ("samba", 120.0)])
def test_its_equations_give_the_package_s_score(dance: str, fps: float) -> None:
    beats, motion = music_and_motion(synthetic_clip(dance, seconds=20.0, fps=fps, seed=4))
    score = score_harmony(beats, visual_beats(motion, params=PAPER), params=PAPER, n_rotations=0)
    times, strengths = CELLS.noticed_music(beats.times, beats.strengths)
    moments = CELLS.noticed_movement(*CELLS.turns(CELLS.at_rate(motion.positions, motion.fps), PAPER.fps))
    harmony, hits = CELLS.harmony(times, strengths, moments, PAPER.reaction_delay, PAPER.beta)
    assert len(moments) == score.n_visual > 10
    assert harmony == pytest.approx(score.harmony, rel=1e-12)
    assert np.array_equal(hits, score.hits)


def test_its_words_name_the_numbers_of_the_table() -> None:
    tables = {"eq18_tolerance_and_chance": TABLE}
    finding = "Within the 0.25 s of the paper turns of the joint speed hit 90% of the beats, and at random moments 88%."
    assert CELLS.finding(tables) == finding
    words = CELLS.reading(tables)
    assert (
        "Turns of the joint speed (paper) stand furthest above chance at 0.1 s, by 10%: they hit 50%, chance 40%."
        in words
    )
    assert "Valleys of the joint speed stand furthest above chance at 0.1 s, by 30%: they hit 60%, chance 30%." in words
