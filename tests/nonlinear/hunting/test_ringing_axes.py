"""An axis behind a compliant screw rings while it hunts: strokes to and fro are told, not the rests within them."""

import numpy as np
import pytest

import steadyslip as ss
from hunting_by_scipy import RINGING


def test_strokes_of_a_ringing_axis_are_those_to_and_fro():
    found = ss.hunt(ss.rig_from_text(RINGING))
    assert found.hunts
    rising = np.flatnonzero((found.error[:-1] < 0) & (found.error[1:] >= 0) & (found.time[1:] > 3.0))
    assert found.period == pytest.approx(np.mean(np.diff(found.time[rising])), rel=0.15)  # means over other cycles
    assert len(found.strokes) > 5 * found.time[-1] / found.period
    assert "with brief rests in" in str(found)
    for end in (2.4, 4.0):
        assert ss.hunt(ss.rig_from_text(RINGING), until=end).hunts is not False
