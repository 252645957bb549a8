"""The model of an experiment: the same motion as the simulator's, and derivatives that are derivatives."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting.effort import Effort
from steadyslip.experiments.fitting.forward import Forward
from steadyslip.experiments.fitting.input_tables import MeasuredInputs, Sharp, sharp_changes
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.kernels.experiment import ExperimentProgram
from steadyslip.kernels.runner import Runner
from steadyslip.model.reducing import reduce_model
from steadyslip.motion.jobs import Jobs

CONSTANT = ss.laws.ConstantNormalStress(steady_normal_stress=lab.STRESS)


def plan_of(rig, made_by, count=1200, uniform=True, **options):
    columns = lab.columns(rig, made_by, count, uniform)
    record = ss.record_from_arrays(**columns)
    return make_plan(rig, record, **options), columns


def truth(plan, rig, jumps=()):
    space = plan.space()
    known = {name: a.value for name, a in rig.parameters().items()}
    return space, space.coordinates(np.array([*(known[n] for n in plan.free), *jumps]))


@pytest.mark.parametrize("drive", ["commanded", "measured"])
@pytest.mark.parametrize("uniform", [True, False])
@pytest.mark.parametrize(
    ("protocol", "alpha", "jumps"),
    [
        (lab.STEP, None, ()),
        (lab.HOLD, None, ()),
        (lab.PRESSED, 0.4, (140.41,)),
        (lab.PULSED, 0.4, (120.2, 160.5)),
    ],
)
def test_records_drive_the_model_as_the_protocol_did(protocol, alpha, jumps, uniform, drive):
    """Steps fall between samples: nothing of them may be smeared over the sampling interval."""
    rig = lab.rig(alpha=alpha)
    plan, columns = plan_of(rig, protocol, uniform=uniform, drive=drive)
    space, z = truth(plan, rig, jumps)
    assert len(space) == len(plan.free) + len(jumps)
    seen, _ = replace(plan, rtol=1e-9).comparison().model(z[None])
    np.testing.assert_allclose(seen[0], columns["friction"], rtol=0, atol=2e-9)


def test_an_oscillating_normal_stress_is_followed_between_samples():
    rig = lab.rig(alpha=0.4)
    plan, columns = plan_of(rig, lab.SHAKEN, uniform=False)
    _, z = truth(plan, rig)
    seen, _ = replace(plan, rtol=1e-9).comparison().model(z[None])
    np.testing.assert_allclose(seen[0], columns["friction"], rtol=0, atol=3e-5)  # noise is 2e-4


@pytest.mark.parametrize("protocol", [lab.STEP, lab.HOLD, lab.PULSED, lab.SHAKEN])
def test_a_protocol_drives_the_model_too(protocol):
    rig = lab.rig(alpha=0.4)
    plan, columns = plan_of(rig, protocol, protocol=protocol)
    _, z = truth(plan, rig)
    seen, _ = replace(plan, rtol=1e-9).comparison().model(z[None])
    np.testing.assert_allclose(seen[0], columns["friction"], rtol=0, atol=1e-6 if protocol is lab.SHAKEN else 2e-9)


def differences(comparison, z):
    """Central differences of the model, with an estimate of their error from two steps."""
    found = []
    for i in range(len(z)):
        ends = []
        for step in (1e-3, 2e-3):
            moved = np.tile(z, (2, 1))
            moved[:, i] += [step, -step]
            seen = comparison.model(moved)[0]
            ends.append((seen[0] - seen[1]) / (2 * step))
        found.append((4 * ends[0] - ends[1]) / 3)
    return np.array(found)


@pytest.mark.parametrize(
    ("rig", "protocol", "jumps", "options"),
    [
        (lab.rig(), lab.STEP, (), {"trend": 1}),
        (lab.rig(alpha=0.4), lab.PULSED, (120.2, 160.5), {}),
        (lab.two_states(), lab.STEP, (), {}),
    ],
)
def test_sensitivities_are_derivatives(rig, protocol, jumps, options):
    plan, _ = plan_of(rig, protocol, 600, **options)
    space = plan.space()
    known = {name: a.value for name, a in rig.parameters().items()}
    values = [known.get(u.parameter, 0.002) for u in space.unknowns if not u.parameter.startswith("step")]
    order = [u.parameter.startswith("step") for u in space.unknowns]
    full = np.empty(len(space))
    full[np.array(order)], full[~np.array(order)] = jumps, values
    z = space.coordinates(full)
    comparison = replace(plan, rtol=1e-11).comparison()
    _, jacobian = comparison.model(z[None])
    wanted = differences(comparison, z)
    size = np.max(np.abs(wanted), axis=1, keepdims=True)
    np.testing.assert_allclose(jacobian[0] / size, wanted / size, rtol=0, atol=3e-4)


def test_free_times_of_a_protocol_have_sensitivities():
    rig = lab.rig(alpha=0.4)
    names = ["friction.a", "protocol.pieces.1.at", "protocol.pieces.2.at"]
    plan, _ = plan_of(rig, lab.PRESSED, 900, free=names, fixed=["friction.mu_ref"], protocol=lab.PRESSED)
    space = plan.space()
    z = space.coordinates(np.array([0.011, 60.13, 140.41]))
    comparison = replace(plan, rtol=1e-11).comparison()
    _, jacobian = comparison.model(z[None])
    step = 1e-4
    for i in (1, 2):
        moved = np.tile(z, (2, 1))
        moved[:, i] += [step, -step]
        seen = comparison.model(moved)[0]
        slope = (seen[0] - seen[1]) / (2 * step)
        np.testing.assert_allclose(jacobian[0, i], slope, rtol=0, atol=2e-3 * np.max(np.abs(slope)))


RIGS = {
    "slip": lab.rig(),
    "prz": lab.rig(ss.laws.PRZ()),
    "nagata": lab.rig(ss.laws.Nagata(c_nagata=0.01)),
    "linker-dieterich": lab.rig(ss.laws.Aging(), alpha=0.3),
    "prakash-clifton": replace(
        lab.rig(), friction=replace(lab.rig().friction, normal_memory=ss.laws.PrakashClifton(direct_share=0.6))
    ),
    "regularised": replace(lab.rig(), friction=replace(lab.rig().friction, regularised=True)),
    "two states": lab.two_states(),
    "radiation damping": replace(lab.rig(), radiation_damping=1e10),
    "inclined": replace(lab.rig(), contact=ss.laws.InclinedSpring(preload=8e6, angle=0.3)),
    "triaxial": ss.Slider(
        friction=lab.rig().friction, contact=ss.laws.Triaxial(confining_pressure=5e6, angle=0.5), axial_stiffness=4e10,
        drive=ss.machine.SteadyDrive(lab.SLOW),
    ),
    "with mass": replace(lab.rig(), mass=1e3),
}  # fmt: skip


@pytest.mark.parametrize("name", RIGS)
def test_every_law_contact_and_regime(name, monkeypatch):
    """On the texts themselves, not compiled: the simulator's motion, and derivatives in every parameter."""
    monkeypatch.setattr(
        Jobs, "runner", lambda jobs, lanes, dense: Runner(jobs.reduction, jobs.choice(lanes, dense), plain=True)
    )
    rig = RIGS[name]
    times = np.linspace(0.0, 14.0, 20)
    pieces = [ss.protocol.VelocityStep(at=4.0, to=2e-6)]
    run = ss.simulate(rig, pieces, until=14.0, times=times, rtol=1e-10, events=False)
    free = [n for n in make_plan(rig, _bare(run), protocol=pieces).free if n in rig.parameters()]
    if name in ("inclined", "triaxial"):
        free.append("contact.angle")
    forward = Forward(rig, free, rtol=1e-8, effort=Effort(threads=1))
    reduction = reduce_model(forward.model, None)
    forward.program = ExperimentProgram(reduction, forward.size, forward.program.method, plain=True)
    inputs = make_plan(rig, _bare(run), free=free, protocol=pieces).comparison().parts[0].inputs
    values = np.array([[float(rig.value(n)) for n in free]])
    units = np.maximum(np.abs(values), 1e-3)
    table = inputs.table(np.empty((1, 0)))
    found = forward.run(table, values, units)[0]
    np.testing.assert_allclose(found[0], run["friction"], rtol=0, atol=1e-6)
    for i in (0, 2, len(free) - 1):
        ends = []
        for sign in (1e-4, -1e-4):
            moved = values.copy()
            moved[0, i] += sign * units[0, i]
            ends.append(forward.run(table, moved, units)[0, 0])
        slope = (ends[0] - ends[1]) / 2e-4
        scale = max(np.max(np.abs(slope)), 1e-6)
        np.testing.assert_allclose(found[1 + i] / scale, slope / scale, rtol=0, atol=5e-3, err_msg=free[i])


def _bare(run):
    return ss.record_from_arrays(run["t"], friction=run["friction"], normal=run["normal_stress"])


def test_lanes_do_not_know_of_each_other():
    rig = lab.rig()
    plan, _ = plan_of(rig, lab.STEP, 500)
    _, z = truth(plan, rig)
    comparison = plan.comparison()
    many = z + 0.05 * np.random.default_rng(0).standard_normal((19, len(z)))
    together = comparison.model(many)[0]
    alone = np.array([comparison.model(row[None])[0][0] for row in many])
    np.testing.assert_array_equal(together, alone)


def test_a_lane_that_blows_up_harms_no_other():
    rig = lab.rig()
    plan, _ = plan_of(rig, lab.STEP, 500)
    space, z = truth(plan, rig)
    soft = z.copy()
    soft[space_index(space, "slider.stiffness")] -= 4.0
    seen, _ = plan.comparison().model(np.array([z, soft, z]))
    assert np.all(np.isfinite(seen[[0, 2]]))
    assert not np.all(np.isfinite(seen[1]))
    np.testing.assert_array_equal(seen[0], seen[2])
    assert plan.comparison().misfit(soft[None])[0] == np.inf


def space_index(space, name):
    return [u.name for u in space.unknowns].index(name)


def test_no_steady_sliding_to_start_from_is_no_crash():
    rig = replace(lab.rig(), contact=ss.laws.InclinedSpring(preload=8e6, angle=0.3))
    record = ss.record_from_arrays(
        np.linspace(0, 10, 50),
        friction=np.full(50, 0.6),
        displacement=np.interp(np.arange(50), [0, 25, 49], [0, 5e-6, 2e-5]),
    )
    plan = make_plan(rig, record, free=["contact.angle"], fixed=["friction.mu_ref"])
    seen, _ = plan.comparison().model(plan.space().coordinates(np.array([[0.3], [-1.2]])))
    assert np.all(np.isfinite(seen[0]))
    assert np.all(np.isnan(seen[1]))


def test_sharp_changes_are_those_that_stand_out():
    record = ss.record_from_arrays(**lab.columns(lab.rig(alpha=0.4), lab.PULSED))
    sharp = sharp_changes(record)
    assert [low <= t <= high for (low, high), t in zip(sharp.jumps, (120.2, 160.5), strict=True)] == [True, True]
    (kink,) = sharp.kinks
    assert kink[2] == pytest.approx(60.13, abs=1e-6)
    assert sharp_changes(lab.record(lab.rig(alpha=0.4), lab.SHAKEN, uniform=False)).jumps == ()
    basalt = ss.read_record("examples/data/basalt_b819_velocity_step.txt")
    assert sharp_changes(basalt) == Sharp()


def test_tables_pass_through_every_sample():
    record = ss.record_from_arrays(**lab.columns(lab.rig(alpha=0.4), lab.PULSED, 800, uniform=False))
    pressed = record.normal - record.normal[0]
    inputs = MeasuredInputs(record, sharp_changes(record), pressed)
    table = inputs.table(np.array([[120.2, 160.5]]))
    rows = table.segments[0]
    moved = np.cumsum((rows[:, 3] + 0.5 * rows[:, 6] * (rows[:, 1] - rows[:, 0])) * (rows[:, 1] - rows[:, 0]))
    at_samples = np.isin(rows[:, 1], table.times)
    assert np.sum(at_samples) == len(record) - 1
    np.testing.assert_allclose(moved[at_samples], record.displacement[1:] - record.displacement[0], rtol=1e-9)
    np.testing.assert_allclose(rows[1:, 0], rows[:-1, 1], rtol=1e-12)
    ends = rows[:, 5] + rows[:, 8] * (rows[:, 1] - rows[:, 0])
    np.testing.assert_allclose(ends[at_samples], pressed[1:], atol=1e-6)


def test_a_sample_at_a_step_shows_what_comes_after_it():
    rig = lab.rig(alpha=0.4)
    steps = ss.Protocol(
        pieces=(ss.protocol.VelocityStep(at=20.0, to=3e-6), ss.protocol.NormalStressStep(at=50.0, by=5e5)), until=80.0
    )  # fmt: skip
    plan, columns = plan_of(rig, steps, count=81, protocol=steps)
    assert {20.0, 50.0} <= set(columns["time"])
    _, z = truth(plan, rig)
    seen, _ = replace(plan, rtol=1e-9).comparison().model(z[None])
    np.testing.assert_allclose(seen[0], columns["friction"], rtol=0, atol=2e-9)
    assert columns["friction"][50] < columns["friction"][49] - 0.02
