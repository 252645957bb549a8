"""Cycles of rigs with delays: they begin as the centre manifold of the exact delay equation says."""

import numpy as np
import pytest

import steadyslip as ss
from late_motion import lagging, slider

RIGS = {
    "late servo": (slider("aging").rig, "slider.stiffness"),
    "late friction": (lagging(c=0.1).rig, "slider.damping"),
}


@pytest.mark.parametrize("name", RIGS)
def test_amplitudes_grow_as_the_onset_says(name):
    rig, along = RIGS[name]
    onset = ss.hopf(rig, along)
    bent = -onset.coefficient / onset.growth_slope  # of the parameter, over the amplitude of ln v squared
    ends = onset.value * (1 + 0.02 * np.sign(bent)), onset.value * (1 - 0.002 * np.sign(bent))
    found = ss.cycles(rig, along, between=tuple(sorted(ends)))
    small = [one for one in found.cycles if 5e-4 < one.amplitude < 5e-3]
    assert len(small) > 2
    for one in small:
        assert (one.value - onset.value) / one.amplitude**2 == pytest.approx(bent, rel=1e-3)
        assert one.stable == (onset.kind == "supercritical")
        assert one.period == pytest.approx(2 * np.pi / onset.angular_frequency, rel=1e-4)
