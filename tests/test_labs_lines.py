"""Settings of the labs as Python text, which makes them again."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from harmolab.lab.labs.live import params_line
from harmolab.params import CHOICES, BarPattern, HarmonyParams

PRESETS = (HarmonyParams.paper(), HarmonyParams.recommended(), HarmonyParams.valleys())


@pytest.mark.parametrize("params", PRESETS)
def test_preset_is_written_by_its_name(params: HarmonyParams):
    assert params_line(params) in ("HarmonyParams.paper()", "HarmonyParams.recommended()", "HarmonyParams.valleys()")
    assert eval(params_line(params)) == params


def test_numbers_of_numpy_and_a_learnt_pattern_are_written_as_plain_python():
    pattern = BarPattern(2, (np.float64(-0.5), np.float64(0.25)), (np.float64(0.1), np.float64(0.0)), 'it\'s "learnt"')
    params = HarmonyParams(lag=np.float64(0.1), pattern=pattern)
    assert "np." not in params_line(params)
    assert eval(params_line(params)) == params


numbers = st.floats(0.0, 10.0, allow_nan=False)
any_params = st.builds(
    replace,
    st.sampled_from(PRESETS),
    audio_threshold=numbers,
    visual_threshold=st.none() | numbers,
    lag=st.floats(-1.0, 1.0),
    fps=st.none() | st.floats(1.0, 120.0),
    subframe=st.booleans(),
    **{name: st.sampled_from(choices) for name, choices in CHOICES.items()},
    pattern=st.builds(lambda values: BarPattern(1, tuple(values), tuple(values)), st.lists(numbers, min_size=1)),
)


@given(any_params)
def test_any_settings_come_back_from_their_line(params: HarmonyParams):
    assert eval(params_line(params)) == params
