"""Records in which the pore pressure is stepped: what drains into the contact, how fast, and what is measured of it."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.spec import spec_from_text

DRAINAGE, ALPHA, PORE, BY = 0.12, 0.3, 3e6, 0.4e6
MOMENTS = (60.41, 100.21, 130.41)
FREE = ("friction.a", "friction.b", "friction.d_c", "friction.normal_memory.alpha", "contact.drainage",
        "slider.stiffness")  # fmt: skip


def rig(**changes):
    own = {"suction": 0.0, "drainage": DRAINAGE, "slip_distance": 1e-5, "v_ref": lab.SLOW} | changes
    return replace(lab.rig(alpha=ALPHA), contact=ss.laws.PoreFluid(steady_normal_stress=lab.STRESS, **own))


@cache
def columns(count=500):
    """What an experiment with drainage shows: the total normal stress, and the pressure of the pump."""
    inject, press, draw = MOMENTS
    pieces = (ss.protocol.VelocityStep(at=30.13, to=3e-6), ss.protocol.InjectionStep(at=inject, by=BY),
              ss.protocol.NormalStressStep(at=press, by=BY), ss.protocol.InjectionStep(at=draw, by=-BY))  # fmt: skip
    time = np.linspace(0.0, 180.0, count)
    run = ss.simulate(rig(), ss.Protocol(pieces=pieces, until=180.0), times=time, rtol=1e-10, events=False)
    pore = PORE + BY * ((time > inject) & (time <= draw))
    total = lab.STRESS + PORE + BY * (time > press)
    return {"time": time, "shear": run["shear_stress"], "normal": total, "pore_pressure": pore,
            "displacement": run["load_displacement"]}  # fmt: skip


@cache
def record(noise=lab.NOISE):
    own = dict(columns())
    own["shear"] = own["shear"] + noise * lab.STRESS * np.random.default_rng(1).standard_normal(len(own["time"]))
    return ss.record_from_arrays(**own)


def truth(plan):
    space = plan.space()
    known = {name: one.value for name, one in rig().parameters().items()}
    known |= {f"step.{k}.at": at for k, at in enumerate(MOMENTS, start=2)}
    return space.coordinates(np.array([known[one.parameter] for one in space.unknowns]))


def test_friction_is_shear_over_the_effective_stress():
    own = columns()
    found = record(0.0)
    np.testing.assert_allclose(found.normal, own["normal"] - own["pore_pressure"])
    np.testing.assert_allclose(found.total_normal, own["normal"])
    np.testing.assert_allclose(found.friction, own["shear"] / found.normal)
    assert [step.kind for step in found.steps] == [
        "velocity step", "pore-pressure step", "normal-stress step", "pore-pressure step"
    ]  # fmt: skip
    assert found.pressure_changes
    assert found.stress_changes
    assert not lab.record(lab.rig(), lab.STEP, count=300).pressure_changes


def test_the_pressure_drains_as_in_the_simulator():
    """Another kernel than that of fits made the record; nothing but rounding and tolerances may be between them."""
    plan = make_plan(rig(), record(0.0), FREE)
    seen, _ = replace(plan, rtol=1e-9).comparison().model(truth(plan)[None])
    np.testing.assert_allclose(seen[0], record(0.0).friction, rtol=0, atol=2e-9)


def test_derivatives_are_derivatives():
    plan = replace(make_plan(rig(), record(0.0), FREE), rtol=1e-9)
    comparison, z = plan.comparison(), truth(plan)
    _, slopes = comparison.model(z[None])
    for i in range(len(z)):
        ends = [comparison.model((z + step * np.eye(len(z))[i])[None])[0][0] for step in (1e-5, -1e-5)]
        np.testing.assert_allclose((ends[0] - ends[1]) / 2e-5, slopes[0, i], rtol=0, atol=1e-7)


def test_a_pressure_that_acts_at_once_is_the_limit_of_fast_drainage():
    dry = replace(rig(), contact=ss.laws.ConstantNormalStress(steady_normal_stress=lab.STRESS))
    at_once = make_plan(dry, record(0.0), FREE[:4])
    errors = []
    for drainage in (10.0, 40.0):
        plan = make_plan(rig(drainage=drainage), record(0.0), FREE[:4])
        seen, wanted = (one.comparison().model(truth(one)[None])[0][0] for one in (plan, at_once))
        errors.append(float(np.sqrt(np.mean((seen - wanted) ** 2))))
    assert errors[1] < 0.4 * errors[0]
    assert errors[0] < 0.1 * float(np.sqrt(np.mean((wanted - record(0.0).friction) ** 2)))


def test_a_file_that_says_nothing_finds_the_drainage(tmp_path):
    record().to_csv(tmp_path / "pore.csv")
    said = spec_from_text('[friction]\nnormal_memory = "linker-dieterich"\n')
    fit = said.fit([said.read(tmp_path / "pore.csv")])
    for name, wanted in {"drainage": DRAINAGE, "alpha": ALPHA, "a": lab.TRUTH["a"], "d_c": lab.TRUTH["d_c"]}.items():
        assert abs(fit[name].value - wanted) < 4 * fit[name].error, name
    assert "1 of normal stress and 2 of pore pressure" in " ".join(str(fit).split())
    assert fit["drainage"].error < 0.03 * DRAINAGE
    fit.save(tmp_path / "fit.nc")
    again = ss.load_fit(tmp_path / "fit.nc")
    assert str(again) == str(fit)
    np.testing.assert_array_equal(again.comparison.model(again.coordinates[None])[0][0], fit.model)


@pytest.mark.campaign
def test_pores_are_asked_for_where_the_contact_has_none():
    fit = ss.fit(ss.lab_rig(normal_memory="linker-dieterich"), record(), starts=9)
    assert "has no pores; where drainage takes time, fit its rate" in " ".join(str(fit).split())
    with pytest.raises(ss.ParameterError, match="changes the pore pressure; allowed: 'commanded'"):
        ss.fit(rig(), record(), drive="measured")


@pytest.mark.parametrize("drive", ["commanded", "measured"])
def test_a_rig_with_pores_takes_records_without_their_pressure(drive):
    """Kernels of contacts with pores have an input more, which the table of such a record lacks."""
    own = lab.columns(lab.rig(alpha=ALPHA), lab.PRESSED, 300)
    made = ss.record_from_arrays(**own)
    wet, dry = (
        make_plan(one, made, FREE[:4], drive=drive).comparison().parts[0] for one in (rig(), lab.rig(alpha=ALPHA))
    )
    values = np.array([[0.011, 0.0145, 12e-6, ALPHA, 0.62]])
    seen = [
        part.without_derivatives.run(part.inputs.table(np.array([[140.41]])), values, values)[0, 0]
        for part in (wet, dry)
    ]
    np.testing.assert_allclose(seen[0], seen[1], rtol=0, atol=1e-7)


@pytest.mark.parametrize("name", ["Pore pressure (MPa)", "pp_MPa", "pore_fluid_pressure [MPa]", "Porendruck (MPa)"])
def test_columns_of_it_are_known_by_name(tmp_path, name):
    own = columns()
    rows = np.column_stack([own["time"], own["displacement"] * 1e6, own["shear"] / 1e6, own["normal"] / 1e6,
                            own["pore_pressure"] / 1e6])  # fmt: skip
    path = tmp_path / "record.csv"
    head = f"time (s),load displacement (um),shear stress (MPa),normal stress (MPa),{name}"
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    np.testing.assert_allclose(ss.read_record(path).pore_pressure, own["pore_pressure"])


def test_columns_without_a_known_name_are_told(tmp_path):
    """A pressure whose name says nothing is left out, as a temperature is, with a note; given its role, it is read."""
    own, path = columns(), tmp_path / "pore.csv"
    cells = [own["time"], own["shear"] / 1e6, own["normal"] / 1e6, own["pore_pressure"] / 1e6, 20 + 0 * own["time"]]
    head = "Time (s),Shear stress (MPa),Normal stress (MPa),P downstream (MPa),Temperature (degC)"
    np.savetxt(path, np.column_stack(cells), delimiter=",", header=head, comments="", fmt="%.12g")
    found = ss.read_record(path)
    assert found.pore_pressure is None
    assert "left out: 'P downstream (MPa)', 'Temperature (degC)'; to use a column give its role" in str(found)
    named = ss.read_record(path, pore_pressure="P downstream (MPa)")
    np.testing.assert_allclose(named.pore_pressure, own["pore_pressure"])
    assert "left out: 'Temperature (degC)'" in str(named)
