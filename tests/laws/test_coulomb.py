"""Coulomb friction: steady sliding does not know the friction at rest, and simulation refuses it in words."""

from dataclasses import replace

import numpy as np
import pytest

import steadyslip as ss
from friction_laws import rig_with

LAW = ss.laws.Coulomb(mu_coulomb=0.3, mu_static=0.4, viscous=0.5)


def test_steady_sliding_has_the_friction_of_sliding():
    point = ss.analyze(rig_with(LAW, velocity=1e-3, mass=10.0))
    assert point.steady.friction == pytest.approx(0.3 + 0.5 * 1e-3, rel=1e-14)
    damping = 0.5 * 5e6  # m s² + σ σ2 s + k = 0
    assert np.sort_complex(point.eigenvalues) == pytest.approx(
        np.sort_complex(np.roots([10.0, damping, 1e9])), rel=1e-9
    )


def test_less_friction_at_rest_than_in_sliding_is_refused():
    with pytest.raises(ss.ParameterError, match=r"mu_static: got 0\.2, with mu_coulomb = 0\.3; allowed: at least"):
        replace(LAW, mu_static=0.2)


def test_simulation_refuses_larger_friction_at_rest():
    with pytest.raises(ss.NotAvailable, match=r"friction\.mu_static: got 0.4, more than mu_coulomb = 0.3"):
        ss.simulate(rig_with(LAW, velocity=1e-3, mass=10.0), until=1.0)
    run = ss.simulate(rig_with(replace(LAW, mu_static=None), velocity=1e-3, mass=10.0), until=1e-3)
    assert run["v"][-1] == pytest.approx(1e-3, rel=1e-9)
