"""Links far stiffer than all else: every answer is that of a rigid link, in arrays and for single rigs, or none."""

from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from machines import stacked_pads
from steadyslip.linear.high_precision_eigenvalues import precise_eigenvalues
from steadyslip.linear.spectrum import spectrum
from steadyslip.model.point import operating_point

EXAMPLES = Path(__file__).parents[2] / "examples"
FACTORS = (1e8, 1e12, 1e18, 1e30, 1e50)
STEMS = sorted(path.stem for path in (EXAMPLES / "machines").glob("*.toml"))
MACHINES = [stem if stem == "geared-servo" else pytest.param(stem, marks=pytest.mark.campaign) for stem in STEMS]


def machine(stem):
    return ss.read_rig(EXAMPLES / "machines" / f"{stem}.toml")


def stiff_parameters(rig):
    return [name for name in rig.parameters() if name.startswith("links.") and name.endswith(".stiffness")]


@pytest.mark.parametrize("stem", MACHINES)
def test_eigenvalues_of_arrays_are_those_of_many_digits(stem):
    """The geared servo's friction is loaded by its own stiff link: the squares of its stiffness cancel."""
    rig = machine(stem)
    for name in stiff_parameters(rig):
        values = rig.value(name) * np.array(FACTORS)
        rows = ss.eigenvalues(rig, {name: values})
        for value, row in zip(values, rows, strict=True):
            point = operating_point(rig.with_values({name: value}))
            right = precise_eigenvalues(point, row[np.isfinite(row)])
            assert np.max(np.abs(row - right) / np.abs(right)) < 1e-9, (name, value)


@pytest.mark.parametrize("stem", MACHINES)
def test_verdict_rate_and_status_agree_on_a_stiff_link(stem):
    """Nothing is on an edge because a stiff link rings within a period much longer than it takes to die out."""
    rig = machine(stem)
    for name in stiff_parameters(rig):
        for factor in FACTORS[1::2]:
            stiff = rig.with_values({name: rig.value(name) * factor})
            found, rate = ss.analyze(stiff), ss.growth_rate(stiff)
            assert not found.on_edge, (name, factor)
            assert found.stable == (rate < 0) == (ss.stability(stiff) == "stable")
            assert found.growth_rate == pytest.approx(rate, rel=1e-9)


def test_edges_of_a_servo_with_a_stiff_gear_are_those_of_a_rigid_one():
    rig = machine("geared-servo")
    for stiffness in (1e16, 1e20, 1e60):
        (edge,) = ss.boundary(rig.with_values({"links.teeth.stiffness": stiffness}), "drive.kp")
        assert edge.value == pytest.approx(436219.9598, rel=1e-9)


def test_where_rounding_hides_eigenvalues_arrays_have_none_and_edges_are_refused():
    """Pads that hold each other in so many ways that only numbers are there."""
    pads, name = stacked_pads(3), "links.along-pad1.stiffness"
    with pytest.warns(ss.OutOfRangeWarning, match="1 of 3 rigs"):
        rates = ss.growth_rate(pads, {name: np.array([1.0, 1e8, 1e14])})
    assert rates[0] == pytest.approx(-0.0177069, rel=1e-5)
    assert rates[1] == pytest.approx(0.0310482, rel=1e-4)
    assert np.isnan(rates[2])
    assert list(ss.stability(pads, {name: np.array([1.0, 1e14])})) == ["stable", "out of range"]
    stiff = pads.with_values({name: 1e14})
    assert ss.growth_rate(stiff) == pytest.approx(rates[1], rel=1e-4)
    assert np.all(np.isfinite(spectrum(operating_point(stiff))))
    with pytest.raises(ss.NotAvailable, match=r"links\.along-pad1\.stiffness = 1e\+14 N/m is the largest"):
        ss.boundary(stiff, "drive.velocity")


BRISTLES = [(1e13, 1e11), (1e20, 1e18), (1e34, 1e23)]


@pytest.mark.parametrize(("stiffness", "damping"), BRISTLES)
@pytest.mark.parametrize(
    ("stem", "law"), [("machines/telescope", "contacts.bearing.friction"), ("lead-screw", "friction")]
)
def test_stiff_bristles_with_damping_leave_the_other_eigenvalues_alone(stem, law, stiffness, damping):
    """Products of the slopes of the bristles' rate cancel, many orders above what is left."""
    rig = ss.read_rig(EXAMPLES / f"{stem}.toml")
    rig = rig.with_values({f"{law}.bristle_stiffness": stiffness, f"{law}.bristle_damping": damping})
    own = ss.eigenvalues(rig)
    own = own[np.isfinite(own)]
    right = precise_eigenvalues(operating_point(rig), own)
    assert np.max(np.abs(own - right) / np.abs(right)) < 1e-9
    assert (ss.stability(rig) == "stable") == (right[0].real < 0)
    assert not ss.analyze(rig).on_edge


def test_edges_of_stiff_bristles_are_few():
    """About a hundred were listed that do not exist."""
    law = "contacts.bearing.friction"
    rig = machine("telescope").with_values({f"{law}.bristle_stiffness": 1e20, f"{law}.bristle_damping": 1e18})
    assert len(ss.boundary(rig, "drive.velocity")) == 2
    assert len(ss.boundary(rig, f"{law}.viscous")) == 1
