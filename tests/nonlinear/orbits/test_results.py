"""What comes back of a search for cycles: ranges, interruptions, reasons, files, figures, the command line."""

import sys
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from dimensionless import unit_rig
from rigs_of_theory import rate_state
from steadyslip.nonlinear.continuation import Failure
from steadyslip.nonlinear.orbits import tracer as tracer_module
from steadyslip.nonlinear.orbits.cycle import SpecialCycle
from steadyslip.nonlinear.orbits.end_reasons import ENDS, EndRules
from steadyslip.nonlinear.orbits.tracer import Tracer

EXAMPLES = Path(__file__).parents[3] / "examples"


def test_branch_remembers_its_steady_state_and_tolerance(damped):
    assert (damped.steady, damped.rtol) == (0, None)
    coarse = ss.cycles(damped.rig, most_points=30, rtol=1e-7)
    assert coarse.rtol == 1e-7
    value = 0.5 * (coarse["value"][-1] + coarse["value"][-2])
    errors = [abs(branch.at(value)[0].period / damped.at(value)[0].period - 1) for branch in (coarse, damped)]
    assert errors[0] > 10 * errors[1]


def test_range_and_interruption(damped):
    value = damped.onset.value
    branch = ss.cycles(damped.rig, between=(0.9 * value, 1.1 * value))
    assert branch["value"][-1] == pytest.approx(0.9 * value, rel=1e-7)
    assert "end of the range" in branch.end

    def stop(count, cycle):
        if count == 7:
            raise KeyboardInterrupt

    partial = ss.cycles(damped.rig, progress=stop)
    assert (len(partial), partial.end) == (7, "interrupted by the user")


def test_ctrl_c_keeps_what_there_is_wherever_it_comes(damped, monkeypatch):
    """While a simulation looks for another sheet, and at the start of the branch of twice the period."""
    between = (0.9 * damped.onset.value, 1.1 * damped.onset.value)

    def stop(*_arguments):
        raise KeyboardInterrupt

    def broken(self, limits, before, now, first, twice):
        return (ENDS["growth"], True) if now.cycle.amplitude > 0.1 else ("", True)

    with monkeypatch.context() as patched:
        patched.setattr(EndRules, "finished", broken)
        patched.setattr(sys.modules["steadyslip.nonlinear.orbits.cycle_search"], "cycle_near", stop)
        partial = ss.cycles(damped.rig, between=between)
    assert (len(partial) > 3, partial.end, partial.gaps) == (True, "interrupted by the user", ())

    def flips(before, now, made, index):
        return [SpecialCycle("period doubling", now.cycle, (0.0, 1.0), 0.0, index)] if index == 5 else []

    with monkeypatch.context() as patched:
        patched.setattr(sys.modules["steadyslip.nonlinear.orbits.tracer"], "changes", flips)
        patched.setattr(Tracer, "doubled", stop)
        partial = ss.cycles(damped.rig, between=between)
    assert (partial.doubled, partial.end) == (None, "interrupted by the user")
    assert partial["value"][-1] == pytest.approx(between[0], rel=1e-7)


def test_no_small_cycle_at_the_edge_is_no_traceback(damped, monkeypatch):
    """Nothing is found at the edge: simulation still leads to the stable cycles."""

    def fails(*_arguments):
        raise Failure("no convergence")

    monkeypatch.setattr(Tracer, "small", fails)
    branch = ss.cycles(damped.rig, between=(0.4 * damped.onset.value, 1.1 * damped.onset.value))
    (cycle,), (same,) = branch.at(0.5 * damped.onset.value), damped.at(0.5 * damped.onset.value)
    assert cycle.period == pytest.approx(same.period, rel=1e-9)
    monkeypatch.setattr(sys.modules["steadyslip.nonlinear.orbits.cycle_search"], "cycle_near", lambda *_: None)
    nothing = ss.cycles(damped.rig)
    assert (len(nothing), nothing.at(damped.onset.value)) == (0, ())
    assert "no small cycle was found" in nothing.end
    assert "no small cycle" in str(nothing)
    assert nothing.plot().lines
    assert nothing.to_dict()["cycles"] == []


def test_a_reason_is_kept_where_the_edge_fails(damped, monkeypatch):
    """No small cycle, and the sheet that simulation leads to breaks off before the edge: both are said."""
    onset, real = damped.onset, Tracer.branch_point

    def fails(*_arguments):
        raise Failure("no convergence")

    def known(self, shooting, point):
        found = real(self, shooting, point)
        if found.cycle.value > 0.9 * onset.value:
            raise Failure("a hole")
        return found

    monkeypatch.setattr(Tracer, "small", fails)
    monkeypatch.setattr(Tracer, "branch_point", known)
    branch = ss.cycles(damped.rig, between=(0.4 * onset.value, 1.1 * onset.value))
    assert branch.gaps[0] == 0
    assert "no small cycle was found" in branch.broken[0]
    assert "no small cycle was found" in str(branch)
    assert branch.to_dict()["gaps"][0] == {"before": 0, "end": branch.broken[0]}
    assert branch.plot().lines


def test_work_is_bounded_and_what_it_found_is_kept(monkeypatch):
    """A rig whose steps are tiny is not followed for minutes; as far as it goes, cycles are the same."""
    whole = ss.cycles(unit_rig("slip", 0.5, 0.6), most_points=60)
    monkeypatch.setattr(tracer_module, "MOST_STEPS", 20_000)
    part = ss.cycles(unit_rig("slip", 0.5, 0.6), most_points=60)
    assert 0 < len(part) < len(whole)
    taken, _, words = part.end.partition(" ")
    assert 0.01 < float(taken) < 0.2  # the first cycle's steps count before; the step that passes the limit is finished
    assert words.startswith("million steps of integration taken")
    assert [cycle.period for cycle in part] == list(part["period"])
    with pytest.raises(KeyError, match="did you mean 'period'"):
        part["perod"]
    np.testing.assert_array_equal(part["period"], whole["period"][: len(part)])


def test_files_and_figure(damped, tmp_path):
    data = damped.to_xarray()
    assert data.sizes["point"] == len(damped)
    assert data["stress_drop"].attrs["units"] == "Pa"
    damped.to_csv(tmp_path / "branch.csv")
    head = (tmp_path / "branch.csv").read_text().splitlines()[0]
    assert head.startswith("slider.stiffness (Pa/m),period (s)")
    ax = damped.plot()
    assert ax.get_xlabel() == "stiffness k (mPa/m)"
    assert "stable cycle" in ax.get_legend_handles_labels()[1]
    for end in (end for part in damped.bounds for end in part if end.cycle):  # both lines are marked where they end
        at = {(x, y) for line in ax.lines if line.get_marker() in "|x" for x, y in line.get_xydata()}
        ends = {(x, y) for line in ax.lines if line.get_linestyle() in "-" for x, y in line.get_xydata()[[0, -1]]}
        assert len(at & ends) == 2
        assert end.kind in ("range", "last cycle")
    plain = damped.to_dict()
    assert len(plain["cycles"]) == len(damped)
    assert plain["cycles"][0]["multipliers"][0] == [pytest.approx(1), 0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"along": "stifness"}, "stiffness"),
        ({"between": (1.0, 2.0)}, "must contain the edge"),
        ({"between": (2.0, 1.0)}, "low < high"),
        ({"amplitude": 3.0}, "up to 0.1"),
    ],
)
def test_bad_arguments_are_named(damped, options, message):
    with pytest.raises(ss.SteadyslipError, match=message):
        ss.cycles(damped.rig, **options)


def test_prescribed_normal_stress_has_no_cycles_of_its_own():
    contact = ss.laws.Prescribed(preload=5e6, amplitude=1e5, period=3.0)
    with pytest.raises(ss.NotAvailable, match="prescribed"):
        ss.cycles(ss.Slider(friction=rate_state(), contact=contact, stiffness=1e9, drive=ss.machine.SteadyDrive(1e-6)))


def test_command_line_writes_branch_and_thresholds(tmp_path):
    """Files by their ending, JSON that is JSON, and errors in words."""
    import json

    import xarray as xr

    from command import run

    inclined, stick_slip = (EXAMPLES / f"{name}.toml" for name in ("inclined-spring", "stick-slip"))
    files = [str(tmp_path / name) for name in ("b.nc", "b.csv", "b.svg")]
    found = run("cycles", stick_slip, "--between", "20 GPa/m", "30 GPa/m", *(w for f in files for w in ("-o", f)))
    assert found.returncode == 0, found.stderr
    assert "end of the range, 20 GPa/m" in found.stdout
    assert all(Path(file).stat().st_size > 500 for file in files)
    data = json.loads(run("cycles", stick_slip, "--between", "24 GPa/m", "30 GPa/m", "--json").stdout)
    assert data["cycles"][-1]["value"] == pytest.approx(24e9)
    kicks = json.loads(
        run("threshold", inclined, "--set", "stiffness=40 GPa/m", "--kick", "displacement", "--json").stdout
    )
    assert kicks[0]["unit"] == "m"
    assert kicks[0]["version"] == data["version"] == xr.open_dataset(files[0]).attrs["steadyslip"] == ss.__version__
    assert kicks[0]["bracket"][0] <= kicks[0]["size"] <= kicks[0]["bracket"][1]
    bad = run("threshold", inclined, "--kick", "shove")
    assert (bad.returncode, "unknown kick 'shove'" in bad.stderr) == (2, True)
    bad = run("cycles", stick_slip, "-o", str(tmp_path / "b.doc"), "--between", "24 GPa/m", "30 GPa/m")
    assert (bad.returncode, "allowed endings" in bad.stderr) == (2, True)
