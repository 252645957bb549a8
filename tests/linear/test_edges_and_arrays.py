"""Edges in any parameter, and arrays of rigs."""

import math

import numpy as np
import pytest

import steadyslip as ss
from rigs_of_theory import D_C, SIGMA, V0, A, B, rate_state, rig
from steadyslip.linear.search import SPLIT, Search
from steadyslip.linear.status import status_where_counted


def test_edge_values_invert_the_closed_forms():
    friction = rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.56))
    r = rig(friction=friction, contact=ss.laws.InclinedSpring(steady_normal_stress=SIGMA, angle=-0.5), stiffness=7.8e9)
    t = math.tan(-0.5)
    expected = {
        "friction.b": A + 7.8e9 * D_C / SIGMA * (1 + 0.14 * t),
        "friction.d_c": SIGMA * (B - A) / (7.8e9 * (1 + 0.14 * t)),
        "slider.stiffness": SIGMA * (B - A) / (D_C * (1 + 0.14 * t)),
        "contact.angle": math.atan((SIGMA * (B - A) / (7.8e9 * D_C) - 1) / 0.14),
        "friction.normal_memory.alpha": 0.7 - (SIGMA * (B - A) / (7.8e9 * D_C) - 1) / t,
    }
    for name, value in expected.items():
        edges = [e for e in ss.boundary(r, name) if e.kind == "oscillatory"]
        assert min(abs(e.value / value - 1) for e in edges) < 1e-11, name
        for edge in edges:
            low, high = edge.bracket
            assert low <= edge.value <= high
            growth = ss.growth_rate(r, {name: np.array([edge.value * (1 - 1e-6), edge.value * (1 + 1e-6)])})
            assert growth[0] * growth[1] < 0


def test_narrowing_ends_between_two_neighbouring_numbers():
    """A bracket of relative width w has at most w/2⁻⁵³ numbers in it, and each round keeps one part in `SPLIT`."""
    r, width = rig(friction=rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.56)), stiffness=7.8e9), 1e-9
    (edge,) = ss.boundary(r, "friction.b")
    scan, rounds = Search(r, "friction.b", (), 0), []

    def status(x):
        rounds.append(x)
        return status_where_counted(scan.values(x))

    scan.status = status
    ends = edge.value * (1 + width * np.array([-0.5, 0.5]))
    low, high = (end.item() for end in scan._narrowed(*ends[:, None], *status(ends)[:, None]))
    assert (low, high) == (np.nextafter(high, 0), np.nextafter(low, 1))
    assert edge.bracket[0] <= low < high <= edge.bracket[1]
    assert len(rounds) - 1 <= math.ceil(math.log(width * 2**53, SPLIT)) + 1  # one more by rounding of the parts


def test_lock_up_edge_and_its_kind():
    r = rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5), stiffness=1e12)
    lock = [e for e in ss.boundary(r, "angle") if e.kind == "lock-up"]
    assert [e.value for e in lock] == pytest.approx([-math.atan(1 / 0.7)], rel=1e-12)


def test_a_window_between_samples_is_found():
    """A narrow unstable window in velocity: friction weakens only around one speed."""
    from steadyslip.core.domains import positive

    class Dip(ss.laws.FrictionLaw):
        centre: float = ss.laws.parameter("m/s", positive, "velocity of the dip")

        def memory(self):
            return ("Theta",)

        def strength(self, v, sigma, memory, tau):
            import sympy as sp

            return sigma * (0.6 + 0.01 * sp.log(v / self.centre) + memory[0])

        def rates(self, v, sigma, memory, tau):
            return (-v / 1e-5 * (memory[0] - self.steady_memory(v, sigma)[0]),)

        def steady_memory(self, v, sigma):
            import sympy as sp

            return (-1e-3 * sp.tanh(80 * sp.log(v / self.centre)),)

    r = rig(friction=Dip(centre=2.3041e-6), contact=ss.laws.ConstantNormalStress(preload=SIGMA), stiffness=1.0)
    edges = ss.boundary(r, "velocity")
    assert [e.stable for e in edges] == ["below", "above"]
    assert (
        edges[0].value < 2.3041e-6 < edges[1].value < 10 ** (1 / 40) * edges[0].value
    )  # narrower than the spacing of the samples


def test_range_is_checked():
    r = rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5))
    assert ss.boundary(r, "angle", between=("-60 deg", "-50 deg"))[0].kind == "lock-up"
    with pytest.raises(ss.ParameterError, match="between -90 deg and 90 deg"):
        ss.boundary(r, "angle", between=("-100 deg", 0))
    with pytest.raises(ss.ParameterError, match="low < high"):
        ss.boundary(r, "angle", between=(0.1, 0.0))
    with pytest.raises(ss.ParameterError, match="does not have it"):
        ss.boundary(r, "axial_stiffness")
    with pytest.raises(ss.UnknownNameError, match="did you mean"):
        ss.boundary(r, "contact.angel")


def test_arrays_equal_one_at_a_time():
    friction = rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.56))
    r = rig(friction=friction, contact=ss.laws.InclinedSpring(preload=SIGMA, angle=0.1))
    angles, masses = np.radians([-70, -40, 0.0, 30])[:, None], np.array([0.0, 1e9, 1e11])
    vary = {"contact.angle": angles, "slider.mass": masses}
    k, sets, growth = ss.critical_stiffness(r, vary), ss.stable_stiffness(r, vary), ss.growth_rate(r, vary)
    assert (k.shape, sets.shape, growth.shape) == ((4, 3), (4, 3, 1, 2), (4, 3))
    assert ss.eigenvalues(r, vary).shape == (4, 3, 3)
    for i, j in np.ndindex(4, 3):
        one = r.with_values({"contact.angle": angles[i, 0], "slider.mass": masses[j]})
        assert k[i, j] == pytest.approx(ss.critical_stiffness(one), rel=1e-13, nan_ok=True)
        assert growth[i, j] == pytest.approx(ss.growth_rate(one), rel=1e-9, nan_ok=True)
    assert np.all(np.isnan(k[0]))  # locked up, and no other rig suffers
    assert np.all(np.isfinite(k[1:3]))


def test_large_arrays_go_in_pieces():
    r = rig(friction=rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.56)))
    a = np.linspace(0.005, 0.02, 100_003)
    whole = ss.critical_stiffness(r, {"friction.a": a})
    np.testing.assert_array_equal(whole[::97], ss.critical_stiffness(r, {"friction.a": a[::97]}))
    two = rig(
        friction=ss.laws.RateState(
            a=A, states=[ss.laws.State(b=B, d_c=D_C), ss.laws.State(b=0.1, d_c=1.0)], mu_ref=0.7, v_ref=V0
        )
    )
    sets = ss.stable_stiffness(two, {"friction.a": a})
    few = ss.stable_stiffness(two, {"friction.a": a[:100]})
    np.testing.assert_array_equal(sets[:100, : few.shape[1]], few)


def test_labelled_arrays_keep_labels_and_gain_units():
    import xarray as xr

    angle = xr.DataArray(np.radians([-30, 0, 30]), dims="angle", coords={"angle": [-30, 0, 30]})
    mass = xr.DataArray([0.0, 1e9], dims="mass")
    r = rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=0.1))
    k = ss.critical_stiffness(r, {"contact.angle": angle, "mass": mass})
    assert k.dims == ("angle", "mass")
    assert (k.name, k.attrs["units"]) == ("critical_stiffness", "Pa/m")
    assert k.sel(angle=0).item(0) == pytest.approx(
        ss.critical_stiffness(r.with_values({"contact.angle": 0.0})), rel=1e-13
    )
    assert ss.stable_stiffness(r, {"contact.angle": angle}).dims == ("angle", "interval", "end")


def test_bad_arrays_are_all_reported():
    with pytest.raises(ss.ParameterError) as caught:
        ss.critical_stiffness(rig(), {"friction.a": [0.01, -1], "friction.d_c": [math.nan], "angel": 1, "mass": []})
    found = {p.name: p.message for p in caught.value.problems}
    assert "-1.0 at position (1,)" in found["friction.a"]
    assert "nan at position (0,)" in found["friction.d_c"]
    assert "unknown parameter" in found["angel"]
    assert "empty" in found["slider.mass"]
    with pytest.raises(ss.ParameterError, match="the rig does not have it"):
        ss.critical_stiffness(rig(), {"axial_stiffness": [1e9]})
    with pytest.raises(ss.ParameterError, match="do not broadcast"):
        ss.critical_stiffness(rig(), {"a": [0.01, 0.02], "b": [1, 2, 3]})


def test_matrices_that_overflow_are_not_available():
    """Not infinities, and no warning of NumPy's."""
    small = rig(friction=rate_state(a=1e-300), mass=0.0, radiation_damping=0.0, damping=0.0)
    with pytest.raises(ss.NotAvailable, match="floating point"):
        ss.state_space(small.with_values({"contact.preload": 1e-10, "stiffness": 1e300}))


@pytest.mark.parametrize("value", [1e300, 1.7e308, 1e-308])
@pytest.mark.parametrize("name", ["mass", "stiffness", "friction.d_c"])
def test_search_ends_with_floating_point(name, value):
    """Six decades beyond such a number there is nothing; that is no fault of a parameter."""
    try:
        edges = ss.boundary(rig(mass=1e3).with_values({name: value}), name)
    except ss.NotAvailable as error:
        assert "floating point" in str(error)  # noqa: PT017
    else:
        assert all(math.isfinite(edge.value) for edge in edges)


@pytest.mark.parametrize("b", [0.005, 0.009, 0.0095])
@pytest.mark.parametrize("alpha", [0.0, 0.4])
def test_a_pull_that_locks_up_is_said_to(alpha, b):
    """Where μ(v) reaches 1/gain steady sliding ends; next to it only rounding calls it a slow growth."""
    friction = rate_state(a=0.01, b=b, mu_ref=0.5, v_ref=1e-6, normal_memory=ss.laws.LinkerDieterich(alpha=alpha))
    pull = ss.laws.SelfEnergising(preload=5e6, gain=1.98)
    held = ss.Slider(friction=friction, contact=pull, stiffness=1e9, drive=ss.machine.SteadyDrive(1e-6))
    edges = [e for e in ss.boundary(held, "drive.velocity") if e.stable == "below"]
    last = 1e-6 * math.exp((1 / 1.98 - 0.5) / (0.01 - b))
    if last < 1.0:
        assert [e.kind for e in edges] == ["lock-up"]
        assert edges[0].value == pytest.approx(last, rel=1e-6)
    assert "grows without oscillating" not in str(ss.analyze(held))
