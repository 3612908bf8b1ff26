"""What the shipped bank makes of a song when nothing else is asked of it."""

import pytest

from tests.builders import refused
from tests.notebook_cells import notebook_cells

default_dances = notebook_cells("11_frame_by_frame").default_dances


def test_a_waltz_is_danced_by_a_person_who_passes_the_guard():
    ((title, dance),) = default_dances(["waltz"]).items()
    assert dance.motion.duration == pytest.approx(30.0, abs=0.1)
    assert 0 < dance.mean_seam_cm < dance.worst_seam_cm < 25
    assert title.startswith("waltz (synthetic song): moves like recorded dancers (13 of 13 measures); seams ")


def test_a_dance_that_does_not_exist_has_no_song():
    refused("polka", default_dances, ["polka"])
