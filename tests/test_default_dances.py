"""What the shipped bank makes of a song when nothing else is asked of it."""

import pytest

from study import default_dances
from tests.builders import refused


def test_a_waltz_is_danced_by_a_person_who_passes_the_guard():
    (dance,) = default_dances(["waltz"]).values()
    assert dance.motion.duration == pytest.approx(30.0, abs=0.1)
    assert dance.likeness.passed
    assert 0 < dance.mean_seam < dance.worst_seam < 25
    assert dance.title.startswith("moves like recorded dancers (13 of 13 measures); seams ")


def test_a_dance_that_does_not_exist_has_no_song():
    refused("polka", default_dances, ["polka"])
