"""Edges of maps refined, and which parameters decide."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from charts import RANGES, STIFFNESSES, made, rig
from machines import at_random

# -- edges -------------------------------------------------------------------------------------------------


@settings(max_examples=3, deadline=None)
@given(st.integers(5, 12), st.integers(5, 12), st.integers(1, 3))
def test_a_refined_edge_is_that_of_the_fine_grid(tmp_path_factory, columns, rows, rounds):
    """Cells of the fine grid whose corners differ are all found, with the same values; few points are computed."""
    folder = tmp_path_factory.mktemp("refined")
    angles, stiffness = (lambda n: ss.maps.Grid("-50 deg", "70 deg", n)), (lambda n: ss.maps.Grid(1e9, 1e11, n, "log"))
    base = ss.Map(rig(), {"angle": angles(columns), "stiffness": stiffness(rows)}, ["status", "growth_rate"])
    found = ss.refine(made(base, folder), rounds)
    fine = ss.Map(
        rig(), {"angle": angles((columns - 1) * 2**rounds + 1), "stiffness": stiffness((rows - 1) * 2**rounds + 1)},
        ["status"],
    )  # fmt: skip
    full = made(fine, folder, "fine.zarr").dataset
    status = full["status"].values
    crossings = np.count_nonzero(status[1:] != status[:-1]) + np.count_nonzero(status[:, 1:] != status[:, :-1])
    assert len(found.sides) == crossings
    at = full.sel({"contact.angle": xr.DataArray(found.points["contact.angle"]),
                   "slider.stiffness": xr.DataArray(found.points["slider.stiffness"])}, method="nearest")  # fmt: skip
    np.testing.assert_array_equal(at["status"], found.points["status"])
    np.testing.assert_allclose(at["contact.angle"], found.points["contact.angle"], rtol=1e-9, atol=1e-12)
    assert len(found.points["status"]) < 0.8 * fine.size


def test_an_edge_is_followed_through_a_side_whose_ends_agree(tmp_path):
    """A bump of the edge pokes into a cell all whose corners are above it."""

    def above(one, vary):
        x, y = np.log10(vary["slider.stiffness"] / 1e9), np.log10(vary["friction.d_c"] / 1e-6)
        return y - 0.9 - 0.35 * np.exp(-(((x - 0.5) / 0.13) ** 2))

    def grid(n):
        over = {
            "stiffness": ss.maps.Grid(1e9, 1e10, n, "log"),
            "friction.d_c": ss.maps.Grid(1e-6, 1e-4, 2 * n - 1, "log"),
        }
        return ss.Map(rig(), over, [ss.maps.measure(above, arrays=True)])

    found = ss.refine(made(grid(2), tmp_path), 4, of="above", level=0.0, compute=grid(2).compute)
    fine = made(grid(17), tmp_path, "fine.zarr").dataset["above"].values > 0
    crossings = np.count_nonzero(fine[1:] != fine[:-1]) + np.count_nonzero(fine[:, 1:] != fine[:, :-1])
    assert np.any(found.edge["friction.d_c"] > 1.2e-5)
    assert len(found.sides) == crossings


def test_a_refined_edge_is_the_critical_stiffness(tmp_path):
    base = ss.Map(
        rig(), {"angle": ss.maps.Grid("-40 deg", "60 deg", 6), "stiffness": STIFFNESSES, "friction.b": [0.016, 0.018]},
        ["growth_rate"],
    )  # fmt: skip
    found = ss.refine(made(base, tmp_path), 5)
    edge = found.edge
    exact = ss.critical_stiffness(rig(), {n: v for n, v in edge.items() if n != "slider.stiffness"})
    assert set(edge["friction.b"]) == {0.016, 0.018}  # a list has nothing between its values
    step = np.log(1000) / 29 / 32
    slope = 3 * np.radians(20) / 32  # of ln k_cr over an angle step
    assert np.max(np.abs(np.log(edge["slider.stiffness"] / exact))) < 0.5 * step + slope
    assert str(found).startswith("edge of growth_rate at 0")
    again = ss.refine(ss.open_map(tmp_path / "map.zarr"), 5)
    np.testing.assert_array_equal(again.edge["slider.stiffness"], edge["slider.stiffness"])
    found.to_csv(tmp_path / "edge.csv")
    table = (tmp_path / "edge.csv").read_text().splitlines()
    assert table[0] == "contact.angle (rad),slider.stiffness (Pa/m),friction.b (1),one side,other side"
    assert len(table) == 1 + len(found.sides)


def test_what_cannot_be_refined_is_said(tmp_path):
    sampled = ss.Map(rig(), samples=ss.maps.Samples(RANGES, 16), compute=["status"])
    with pytest.raises(ss.NotAvailable, match="samples have no neighbours"):
        ss.refine(made(sampled, tmp_path, "a.zarr"))
    listed = ss.Map(rig(), {"angle": [0.1, 0.2]}, ["status", "critical_stiffness"])
    listed_found = made(listed, tmp_path, "b.zarr")
    with pytest.raises(ss.NotAvailable, match="no grid to refine"):
        ss.refine(listed_found)
    with pytest.raises(ss.ParameterError, match="give the value of critical_stiffness"):
        ss.refine(listed_found, of="critical_stiffness")
    with pytest.raises(ss.ParameterError, match="rounds"):
        ss.refine(listed_found, 0)
    flat = ss.Map(
        rig(), {"stiffness": ss.maps.Grid(1e12, 2e12, 3)}, ["status", ss.maps.measure(lambda one: 1.0, name="one")]
    )
    with pytest.raises(ss.NotAvailable, match="computes the function 'one'"):
        ss.refine(made(flat, tmp_path, "c.zarr"))
    with pytest.raises(ss.NotAvailable, match="no edge to refine"):
        ss.refine(ss.open_map(tmp_path / "c.zarr"), compute=["status"])


# -- sensitivity -------------------------------------------------------------------------------------------


def test_sobol_indices_of_a_known_product():
    """k_cr = (b − a) σ/d_c with everything uniform: means and variances by hand."""
    base = rig(contact=ss.laws.ConstantNormalStress(preload=5e6))
    a, b, d = (0.010, 0.012), (0.016, 0.019), (1e-6, 2e-6)
    found = ss.sensitivity(base, {"friction.a": a, "friction.b": b, "friction.d_c": d}, "critical_stiffness",
                           points=8192)  # fmt: skip
    variance = {"a": np.ptp(a) ** 2 / 12, "b": np.ptp(b) ** 2 / 12}
    x = np.mean(b) - np.mean(a)
    x2 = x**2 + variance["a"] + variance["b"]
    y, y2 = np.log(d[1] / d[0]) / np.ptp(d), 1 / (d[0] * d[1])
    whole = x2 * y2 - (x * y) ** 2
    first = [y**2 * variance["a"], y**2 * variance["b"], x**2 * (y2 - y**2)]
    total = [y2 * variance["a"], y2 * variance["b"], x2 * (y2 - y**2)]
    np.testing.assert_allclose(found.first["critical_stiffness"], np.array(first) / whole, atol=0.01)
    np.testing.assert_allclose(found.total["critical_stiffness"], np.array(total) / whole, atol=0.01)
    low, high = found.total_interval["critical_stiffness"]
    assert np.all(low < found.total["critical_stiffness"])
    assert np.all(found.total["critical_stiffness"] < high)
    assert found.ranked("critical_stiffness")[0] == "friction.d_c"
    assert found.missing["critical_stiffness"] == 0


def test_the_margin_is_additive_where_its_parts_multiply():
    """ln(k/k_cr) = ln k + ln d_c − ln(b − a) − ln σ: shares alone are all there is, and add up to one."""
    base = rig(contact=ss.laws.ConstantNormalStress(preload=5e6))
    over = {"stiffness": (1e9, 1e11, "log"), "friction.d_c": (1e-6, 1e-5, "log")}
    found = ss.sensitivity(base, over, ["margin"], points=4096)
    expected = np.array([np.log(100) ** 2, np.log(10) ** 2])
    np.testing.assert_allclose(found.first["margin"], expected / expected.sum(), atol=0.01)
    np.testing.assert_allclose(found.total["margin"], expected / expected.sum(), atol=0.01)


def test_points_without_a_result_are_counted_and_left_out():
    found = ss.sensitivity(rig(), {"friction.a": (0.010, 0.018), "friction.b": (0.015, 0.0151)}, points=1024)
    share = 1 - (0.01505 - 0.010) / 0.008
    assert found.missing["critical_stiffness"] == pytest.approx(share, abs=0.02)
    assert found.points["critical_stiffness"] == 256  # of some 400 sets
    assert "are left out" in str(found)
    assert found.first["critical_stiffness"][0] > 0.9


def test_what_has_no_sensitivity_is_said():
    over = {"friction.a": (0.010, 0.012), "friction.b": (0.016, 0.018)}
    for change, message in {
        "points": "a power of 2", "one": "at least two", "of": "not one number", "none": "exists at 0",
    }.items():  # fmt: skip
        arguments = {"over": over, "of": "margin", "points": 128}
        if change == "points":
            arguments["points"] = 100
        elif change == "one":
            arguments["over"] = {"friction.a": (0.010, 0.012)}
        elif change == "of":
            arguments["of"] = "status"
        else:
            arguments["over"] = {"friction.a": (0.020, 0.022), "friction.b": (0.016, 0.018)}
        with pytest.raises(ss.SteadyslipError, match=message):
            ss.sensitivity(rig(), **arguments)
    flat = {"friction.mu_ref": (0.5, 0.6), "drive.velocity": (1e-6, 2e-6)}
    with pytest.raises(ss.NotAvailable, match="does not depend on"):
        ss.sensitivity(rig(contact=ss.laws.ConstantNormalStress(preload=5e6)), flat, "critical_stiffness", points=64)
    found = ss.sensitivity(
        rig(contact=ss.laws.ConstantNormalStress(preload=5e6)), flat, ["critical_stiffness", "growth_rate"], points=64
    )
    machine = at_random(21)[0]  # whose growth rate depends on neither, but for rounding
    names = ("links.l1.stiffness", "contacts.c0.friction.v_ref")
    nothing = {name: (0.5 * machine.value(name), 2 * machine.value(name)) for name in names}
    with pytest.raises(ss.NotAvailable, match="does not depend on"):
        ss.sensitivity(machine, nothing, "growth_rate", points=64)
    assert set(found.first) == {"growth_rate"}  # what has none costs the others nothing
    assert "no shares of critical_stiffness: critical_stiffness does not depend on friction.mu_ref" in str(found)
