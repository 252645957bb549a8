"""Results cannot be written to, whatever holds their arrays."""

from dataclasses import dataclass, fields

import numpy as np
import pytest

import steadyslip as ss
from rigs_of_theory import rig
from steadyslip.core.results import ReadOnly


def arrays(value):
    """All arrays of a result."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, tuple):
        for one in value:
            yield from arrays(one)
    elif isinstance(value, dict):
        for one in value.values():
            yield from arrays(one)


@dataclass(frozen=True)
class Several(ReadOnly):
    one: np.ndarray
    two: tuple
    three: dict
    four: str = "x"


def test_arrays_are_read_only_and_those_given_are_left_alone():
    given = np.arange(3.0)
    found = Several(given, (given, given), {"a": given, "b": {"c": given}})
    assert len(list(arrays((found.one, found.two, found.three)))) == 5
    for one in arrays((found.one, found.two, found.three)):
        with pytest.raises(ValueError, match="read-only"):
            one[0] = 1.0
    given[0] = 7.0


def test_a_run_and_an_ensemble_cannot_be_written_to():
    run = ss.simulate(rig(), until=1.0)
    many = ss.simulate_many(rig(), {"stiffness": np.array([8e9, 9e9])}, until=1.0, progress=False)
    for result in (run, many):
        found = [one for item in fields(result) for one in arrays(getattr(result, item.name))]
        assert found
        assert not any(one.flags.writeable for one in found)
