"""An axis behind a compliant screw rings while it hunts: strokes to and fro are told, not the rests within them."""

import numpy as np
import pytest

import steadyslip as ss

AXIS = """
[bodies.motor]
motion = "rotation"
inertia = "40 kg cm^2"
[bodies.table]
mass = "240 kg"
[links.screw]
kind = "screw"
between = ["motor", "table"]
lead = "10 mm/rev"
stiffness = "120 N/um"
damping = "5 N s/mm"
[contacts.guide]
body = "table"
[contacts.guide.friction]
law = "coulomb"
mu_coulomb = 0.11
mu_static = 0.19
[contacts.guide.contact]
law = "constant"
preload = "3.2 kN"
[drive]
control = "rotary-pid"
body = "motor"
measured = "table"
velocity = 0
velocity_of = "table"
kp = "5 N m/rad"
kd = "0.2 N m s/rad"
ki = "50 N m/(rad s)"
"""


def test_strokes_of_a_ringing_axis_are_those_to_and_fro():
    found = ss.hunt(ss.rig_from_text(AXIS))
    assert found.hunts
    rising = np.flatnonzero((found.error[:-1] < 0) & (found.error[1:] >= 0) & (found.time[1:] > 3.0))
    assert found.period == pytest.approx(np.mean(np.diff(found.time[rising])), rel=0.15)  # means over other cycles
    assert len(found.strokes) > 5 * found.time[-1] / found.period
    assert "with brief rests in" in str(found)
    for end in (2.4, 4.0):
        assert ss.hunt(ss.rig_from_text(AXIS), until=end).hunts is not False
