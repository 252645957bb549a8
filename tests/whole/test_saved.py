"""What is saved is read back to the last bit; a fixed sample of what `saved_at_random.py` does by hand."""

import numpy as np
import pytest

import saved_at_random
import steadyslip as ss
from rigs_of_theory import rig


@pytest.mark.campaign
@pytest.mark.parametrize(
    ("what", "count"),
    [("rigs", 30), ("runs", 5), ("maps", 1), ("answers", 2), ("fits", 3), ("draws", 2), ("populations", 2)],
)
def test_what_is_saved_at_random_is_read_back(what, count):
    assert list(saved_at_random.found(what, count, 1)) == []


def test_a_difference_of_one_bit_is_seen():
    assert saved_at_random.differs(1.0, np.nextafter(1.0, 2.0).item())
    assert saved_at_random.differs(0.0, -0.0)
    assert saved_at_random.differs({"a": [1.0]}, {"a": (1.0,)})
    assert saved_at_random.plain({"a": float("inf")})
    assert not saved_at_random.differs({"a": [np.array([1.0, np.nan])]}, {"a": [np.array([1.0, np.nan])]})


def test_a_number_has_one_zero():
    """Files leave out what equals its default, so that -0.0 came back as 0.0."""
    assert str(rig(damping=-0.0).damping) == "0.0"
    assert str(ss.protocol.VelocityStep(at=-0.0, to=-0.0).to) == "0.0"


def test_an_edge_infinitely_far_in_its_own_size_is_no_number_in_json():
    """5e-324 to 1.57 is a factor that no float holds; --json ended in a traceback."""
    found = ss.analyze(rig(contact=ss.laws.InclinedSpring(preload=5e6, angle=5e-324)))
    edges = [one for one in found.to_dict()["boundaries"] if one["parameter"] == "contact.angle"]
    assert edges
    assert {one["relative_distance"] for one in edges} == {None}
    assert saved_at_random.plain(found.to_dict()) == ""


@pytest.mark.parametrize("least", [5e-324, 1e-300])
def test_the_smallest_damping_has_the_edges_of_none(least):
    """The least size to look at, decades below, is 0 and was divided by; and the largest was out of reach."""
    edges = [ss.boundary(rig(damping=one), "damping") for one in (0.0, least)]
    assert [one.value for one in edges[1]] == pytest.approx([one.value for one in edges[0]])
    assert edges[1]


def test_lines_of_a_column_do_not_end_inside_of_a_text():
    """Of numbers that are written with their unit, a total not giving the same bits: the file was no TOML."""
    area = 0.43
    change = tuple(one for n in range(1, 400) if (one := (-10.0) ** (n % 9) / n) * area / area != one)
    assert len(change) > 20
    plan = ss.Protocol(pieces=(ss.protocol.DisturbanceTable(time=tuple(range(len(change))), change=change),))
    text = ss.rig_to_text(rig(area=area), plan)
    assert ss.protocol_from_text(text) == plan
