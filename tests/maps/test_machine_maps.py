"""Maps and sensitivities of machines hold what the functions say, in the units of their user."""

from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from charts import made
from machines import same_block, two_blocks, two_mass
from steadyslip.linear.stable_values import nearest_value
from steadyslip.maps.plan.map_file import map_from_text

SHEAR = Path(__file__).parents[2] / "examples" / "machines" / "two-surfaces.toml"
GAINS, SCREWS = np.array([0.5, 1.0, 3.0, 8.0]), np.array([20.0, 100.0, 400.0])
OVER = {"drive.kp": GAINS, "links.screw.stiffness": SCREWS}


def of_gain(*names):
    kinds = {
        "edge": ss.maps.Edge, "stable_values": ss.maps.StableValues, "safety_factor": ss.maps.SafetyFactor,
        "margin": ss.maps.LogMargin,
    }  # fmt: skip
    return [kinds[name](along="drive.kp") for name in names]


def test_a_map_holds_what_the_functions_give(tmp_path):
    machine = two_mass(measured="table", kd=0.5)
    compute = ["status", "growth_rate", "frequency", *of_gain("edge", "stable_values", "safety_factor", "margin")]
    data = made(ss.Map(machine, OVER, compute, chunk=5), tmp_path).dataset
    for i, kp in enumerate(GAINS):
        for j, stiffness in enumerate(SCREWS):
            at = {"drive.kp": i, "links.screw.stiffness": j}
            one, here = machine.with_values({"drive.kp": kp, "links.screw.stiffness": stiffness}), data.isel(at)
            intervals = ss.stable_values(one, "drive.kp")
            ends = intervals[np.isfinite(intervals) & (intervals > 0)]
            edge = ends[np.argmin(np.abs(ends - kp))] if len(ends) else np.nan
            first = ss.eigenvalues(one)[0]
            np.testing.assert_allclose(here["stable_values"].values[: len(intervals)], intervals, rtol=1e-9)
            assert np.isnan(here["stable_values"].values[len(intervals) :]).all()
            np.testing.assert_allclose(here["edge"], edge, rtol=1e-9)
            np.testing.assert_allclose(here["safety_factor"], kp / edge, rtol=1e-9)
            np.testing.assert_allclose(here["margin"], np.log(kp / edge), rtol=1e-7, atol=1e-9)
            np.testing.assert_allclose(here["growth_rate"], first.real, rtol=1e-9)
            np.testing.assert_allclose(here["frequency"], abs(first.imag) / (2 * np.pi), rtol=1e-9)
            np.testing.assert_allclose(here["damping_ratio"], -first.real / abs(first), rtol=1e-9)
            inside = np.any((intervals[:, 0] < kp) & (kp < intervals[:, 1]))
            assert bool(here["status"] == 1) == inside == (first.real < 0)


@pytest.mark.parametrize("seed", [0, 1, 4])
def test_a_machine_of_one_body_is_mapped_as_its_slider(seed, tmp_path):
    block, machine = same_block(seed)
    own, names = "links.spring.stiffness", ("safety_factor", "margin")
    k = block.stiffness * np.array([0.1, 1.0, 7.0])
    kinds = [ss.maps.SafetyFactor(along=own), ss.maps.LogMargin(along=own), ss.maps.Edge(along=own)]
    found = made(ss.Map(machine, {own: k}, [*kinds, "status", "growth_rate"]), tmp_path).dataset
    wanted = made(
        ss.Map(block, {"stiffness": k}, [*names, "critical_stiffness", "status", "growth_rate"]), tmp_path, "block.zarr"
    ).dataset
    for name in (*names, "status", "growth_rate"):
        np.testing.assert_allclose(found[name].values, wanted[name].values, rtol=1e-7, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(found["edge"].values, wanted["critical_stiffness"].values, rtol=1e-7)


def test_intervals_of_a_late_machine_are_those_of_each():
    late = two_mass(kp=4.0, kd=3.0).with_values({"drive.delay": 0.1})
    values = [80.0, 100.0]
    found = ss.stable_values(late, "drive.kd", {"links.screw.stiffness": values})
    for one, own in zip(values, found, strict=True):
        expected = ss.stable_values(late.with_values({"links.screw.stiffness": one}), "drive.kd")
        np.testing.assert_allclose(own[: len(expected)], expected, rtol=1e-9)


def test_the_nearest_edge_is_a_finite_end_above_zero():
    intervals = np.array([[[0.0, 2.0], [5.0, np.inf]], [[np.nan] * 2] * 2, [[0.0, np.inf], [np.nan] * 2]])
    np.testing.assert_array_equal(nearest_value(intervals, [3.0, 1.0, 1.0]), [2.0, np.nan, np.nan])


def test_axes_and_results_are_in_forces_where_a_contact_has_an_area(tmp_path):
    name = "contacts.first.contact.preload"
    text = f"""{SHEAR.read_text()}
[map]
compute = ["growth_rate", "edge"]
over = {{ "{name}" = {{ from = "10 kN", to = "60 kN", points = 3 }} }}
edge = {{ along = "{name}" }}
"""
    found = made(map_from_text(text), tmp_path)
    machine = ss.read_rig(SHEAR)
    np.testing.assert_allclose(found.dataset[name].values * 25e-4, [10e3, 35e3, 60e3])
    assert (found.unit("edge"), found.area(name), found.area("edge")) == ("N", 25e-4, None)
    np.testing.assert_allclose(found.dataset["edge"], ss.stable_values(machine, name)[0, 1] * 25e-4, rtol=1e-9)
    assert "kN" in str(found)
    assert "Pa" not in str(found)
    axes = found.plot(show="edge")
    assert axes.get_xlabel() == "contact first preload σ₀ (kN)"
    assert axes.get_ylabel() == "edge of contact first preload σ₀ (kN)"


@pytest.mark.parametrize(
    ("compute", "words"),
    [
        ("critical_stiffness", "is only for sliders"), ("stable_stiffness", "is only for sliders"),
        ("edge", r"map.edge.along: missing; .* such as 'links.screw.stiffness'"),
        (ss.maps.Edge(along="drive.velocity"), "do not depend on drive.velocity linearly"),
        (ss.maps.LogMargin(along="drive.kpp"), "drive.kp"),
        (ss.maps.SafetyFactor(along="drive.delay"), "drive.delay has no positive value"),
    ],
)  # fmt: skip
def test_questions_that_a_machine_does_not_answer_are_refused(compute, words):
    with pytest.raises(ss.ParameterError, match=words):
        ss.Map(two_mass(), OVER, compute)


def test_simulated_results_are_those_of_each_contact(tmp_path):
    machine = two_blocks(2.0, -0.4, 0.5)
    step = ss.protocol.DisturbanceStep(at=0.1, by=0.2, on="one")
    protocol = ss.Protocol(pieces=[step], until=0.5)
    over = {"links.first.stiffness": [1.5, 2.0], "protocol.pieces.1.by": [0.2, 0.4]}
    plan = ss.Map(machine, over, "events", protocol=protocol)
    found = made(plan, tmp_path)
    vary = {name: np.array(values) for name, values in over.items()}
    vary["links.first.stiffness"] = vary["links.first.stiffness"][:, None]
    expected = ss.simulate_many(machine, vary, protocol, progress=False)
    assert set(expected.events) < set(found.results)
    for name, values in expected.events.items():
        np.testing.assert_array_equal(found.dataset[name], values)
    assert found.unit("two.event_force_drop") == "N"
    assert found.unit("protocol.pieces.1.by") == "N"


def test_shares_are_those_of_what_a_formula_says():
    """A mass on a dashpot and a stiff enough spring halves by −c/2m: damping decides all of it, stiffness nothing."""
    machine = ss.Machine(
        bodies={"mass": ss.machine.SlidingBody(mass=2.0)},
        links={"pull": ss.machine.Spring(between=("drive", "mass"), stiffness=100.0, damping=0.5)},
        contacts={"base": ss.machine.Surface(
            body="mass", friction=ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.3, v_stribeck=1.0),
            contact=ss.laws.ConstantNormalStress(preload=1.0),
        )},
        drive=ss.machine.Pull(velocity=1.0),
    )  # fmt: skip
    over = {"links.pull.damping": (0.4, 1.6, "log"), "links.pull.stiffness": (50.0, 200.0)}
    found = ss.sensitivity(machine, over, points=256)
    assert list(found.first) == ["growth_rate"]
    np.testing.assert_allclose(found.first["growth_rate"], [1.0, 0.0], atol=1 / 256)  # of as many sets of points
    assert found.total["growth_rate"][1] < 1e-20
    assert "links.pull.damping" in str(found)
