"""A branch of cycles that many tests look at."""

import pytest

import steadyslip as ss
from dimensionless import unit_rig


@pytest.fixture(scope="session")
def damped():
    """A supercritical branch over many decades."""
    return ss.cycles(unit_rig("slip", 0.5, 0.4, damping=1e-3))
