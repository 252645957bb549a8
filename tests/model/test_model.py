"""The Model answers: once each, for several contacts where it says so; operating points check arrays in one place."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr

import steadyslip as ss
from steadyslip.core.caching import HasCache, cached
from steadyslip.core.expressions import derivative
from steadyslip.model import build_model, reduction as reduction_module
from steadyslip.model.linearisation import characteristic_coefficients, linearise
from steadyslip.model.point import operating_point
from steadyslip.model.posed import well_posed
from steadyslip.model.reducing import reduce_model
from steadyslip.model.scales import natural_scales, scale_rows
from steadyslip.model.variational import with_sensitivities
from steadyslip.model.weights import weights
from steadyslip.motion.engine import Call
from steadyslip.motion.jobs import Options, prepare
from steadyslip.nonlinear.kicks.settled import rest_of
from structure_work_at_random import drawn

ROCK = ss.laws.RateState(a=0.01, b=0.015, d_c=1e-5, mu_ref=0.6, v_ref=1e-6)
RIG = ss.Slider(
    friction=ROCK, contact=ss.laws.ConstantNormalStress(preload=5e6), stiffness=2e9, drive=ss.machine.SteadyDrive(1e-6)
)
INCLINED = replace(RIG, contact=ss.laws.InclinedSpring(preload=5e6, angle=0.3))


class Oracle(HasCache):
    def __init__(self):
        self.asked = 0


@cached
def twice(whom, number, add=0):
    whom.asked += 1
    return 2 * number + add


def test_a_question_is_asked_once_and_its_answer_does_not_travel():
    one, other = Oracle(), Oracle()
    assert [twice(one, 3), twice(one, 3), twice(one, 4), twice(one, 3, add=1)] == [6, 6, 8, 7]
    assert (one.asked, other.asked) == (3, 0)
    back = pickle.loads(pickle.dumps(one))
    assert twice(back, 3) == 6
    assert back.asked == 4


def test_models_are_shared_and_keep_what_they_were_asked():
    model = build_model(RIG)
    assert build_model(replace(RIG, stiffness=7e9)) is model
    assert linearise(model) is linearise(model)
    assert characteristic_coefficients(model) is characteristic_coefficients(build_model(RIG))


def test_variables_say_what_they_are():
    rig = replace(RIG, mass=1e6, drive=ss.machine.PID(1e-6, kp=1e8, ki=1e6))
    model = build_model(rig)
    assert [(v.name, v.kind) for v in model.variables] == [
        ("x", "slip"), ("v", "velocity"), ("Theta", "memory"), ("integral", "integral")
    ]  # fmt: skip
    assert model.memory == model.contact.memory
    assert [item.name for item in model.integrals] == ["integral"]
    assert model.gain == model.parameters["drive.kp"]
    assert model.with_role("evolution effect") == ("friction.b",)


def test_inlined_leaves_no_stress():
    model = build_model(INCLINED)
    assert not model.inlined(model.contact.balance).free_symbols & set(model.definitions)


def test_a_point_checks_arrays_by_name_and_shape():
    point = operating_point(RIG, {"stiffness": np.array([1e9, 2e9]), "friction.a": np.array([[0.01], [0.02], [0.03]])})
    assert point.shape == (3, 2)
    assert point.sigma == pytest.approx(5e6)
    wrong = {"stiffness": [1e9, -1.0], "friction.a": [[0.01]] * 3, "nothing": 1.0}
    with pytest.raises(ss.ParameterError) as caught:
        operating_point(RIG, wrong)
    assert {problem.name for problem in caught.value.problems} == {"slider.stiffness", "nothing"}
    with pytest.raises(ss.ParameterError, match="do not broadcast"):
        operating_point(RIG, {"stiffness": [1e9, 2e9], "friction.a": [0.01, 0.02, 0.03]})
    named = xr.DataArray([1e9, 2e9], dims="k")
    with pytest.raises(ss.ParameterError, match="bare array beside DataArrays"):
        operating_point(RIG, {"stiffness": named, "friction.a": [0.01, 0.02]})


def test_a_part_of_a_point_is_the_point_of_a_part():
    angles = np.linspace(-0.6, 0.6, 7)
    whole = operating_point(INCLINED, {"contact.angle": angles})
    part = whole.part(np.array([5, 1]))
    again = operating_point(INCLINED, {"contact.angle": angles[[5, 1]]})
    assert np.array_equal(part.sigma, again.sigma)
    assert part.shape == again.shape == (2,)
    assert [p.size for p in whole.pieces(3)] == [3, 3, 1]
    assert np.array_equal(np.concatenate([p.sigma for p in whole.pieces(3)]), whole.sigma)


# -- several contacts


def two_blocks(masses=False, **second):
    """Two blocks in a row: springs from each to the load point, and one between them."""
    friction = RIG.friction
    surface = ss.machine.Surface(body="one", friction=friction, contact=ss.laws.ConstantNormalStress(preload=5e6))
    mass = 1e4 if masses else 0.0
    return ss.Machine(
        bodies={"one": ss.machine.SlidingBody(mass=mass), "two": ss.machine.SlidingBody(mass=mass)},
        links={
            "first": ss.machine.Spring(between=("drive", "one"), stiffness=2e9),
            "second": ss.machine.Spring(between=("drive", "two"), stiffness=2e9),
            "between": ss.machine.Spring(between=("one", "two"), stiffness=BETWEEN),
        },
        contacts={"one": surface, "two": replace(surface, body="two", **second)},
        drive=ss.machine.Pull(velocity=RIG.drive.velocity),
    )


BETWEEN = 0.7e9


@pytest.mark.parametrize("masses", [False, True])
def test_two_contacts_have_the_eigenvalues_of_their_modes(masses):
    """Alike blocks move together as one block does, and against each other as one block on k + 2 k_between."""
    found = np.sort_complex(ss.eigenvalues(two_blocks(masses)))
    modes = [ss.eigenvalues(replace(RIG, mass=1e4 if masses else 0.0, stiffness=k)) for k in (2e9, 2e9 + 2 * BETWEEN)]
    expected = np.concatenate(modes)
    assert found == pytest.approx(np.sort_complex(expected[np.isfinite(expected)]), rel=1e-8)
    with pytest.raises(ss.NotAvailable, match="2 contacts"):
        _ = build_model(two_blocks(masses)).contact


def test_each_contact_has_its_own_steady_normal_stress():
    """An operating point knows all of them, over varied parameters and in parts; what needs one contact says so."""
    loads = np.array([3e6, 5e6, 7e6])
    point = operating_point(two_blocks(), {"contacts.two.contact.preload": loads})
    assert point.sigmas[0] == pytest.approx(5e6, rel=1e-15)
    assert point.sigmas[1] == pytest.approx(loads, rel=1e-15)
    pair = [contact.sigma_ss for contact in point.model.contacts]
    assert point.evaluate(point.model.function([pair[1] / pair[0]]))[0] == pytest.approx(loads / 5e6)
    last = point.part(slice(1, 3))
    assert np.array_equal(last.sigmas[1], point.sigmas[1][1:])
    assert reduce_model(point.model).form == "eliminated"
    assert np.array_equal(well_posed(point), [True, True, True])
    for ask in (lambda: point.sigma, lambda: point.all_stresses()):
        with pytest.raises(ss.NotAvailable, match="2 contacts"):
            ask()


def test_answers_are_the_same_for_everybody():
    """An answer that is kept cannot be changed by the one who got it: the next one would get something else."""
    point = operating_point(RIG)
    scales, _ = natural_scales(point, reduce_model(point.model))
    with pytest.raises(TypeError, match="item assignment"):
        scales["x"] = 2.0
    for array in (well_posed(point), weights(point).direct, *weights(point).decay):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 2.0


def lugre():
    return ss.laws.LuGre(mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e5, bristle_damping=10)


def test_scales_of_few_rigs_are_those_of_many():
    """Few are reckoned one by one."""
    friction = ss.laws.RateState(
        a=0.01, b=0.014, d_c=1e-5, mu_ref=0.6, v_ref=1e-6, normal_memory=ss.laws.LinkerDieterich(alpha=0.3)
    )
    for rig in (RIG, replace(RIG, friction=friction), replace(RIG, mass=10.0), replace(RIG, friction=lugre())):
        point = operating_point(rig, {"stiffness": np.geomspace(1e-3, 1e12, 20)})
        reduction = reduce_model(point.model)
        table, unknown = scale_rows(point, reduction)
        assert table.shape == (20, len(reduction.names))
        for i in range(20):
            own, alone = scale_rows(point.part(slice(i, i + 1)), reduction)
            np.testing.assert_array_equal(np.append(own[0], alone), np.append(table[i], unknown[i]))


def test_kicks_leave_the_scales_of_motion_alone():
    """Steps of a run are those of before, whatever was asked of the rig in between."""
    a_rig = replace(RIG, friction=lugre(), stiffness=9e9, mass=1e6)

    def run():
        return ss.simulate(a_rig, ss.protocol.VelocityStep(at=0.0, to=2e-6), until=0.05)["v"].tobytes()

    before = run()
    jobs = prepare(a_rig, (), 1.0, {}, {}, Options())
    rest_of(jobs, np.array([1e-6, 3e-3]), np.zeros(2))
    assert run() == before
    scales, _ = natural_scales(jobs.point, jobs.reduction)
    assert [np.size(scale) for scale in scales.values()] == [1] * len(scales)


def test_tables_of_other_lengths_do_not_reach_the_kernel():
    """Machine code reads where it is told to: too few rows would be somebody else's memory."""
    jobs = prepare(RIG, (), 1.0, {"stiffness": np.full(4, 2e9)}, {}, Options())
    machine = jobs.runner(1, dense=False)
    tables = jobs.tables(machine, 0, 4, False, False)
    with pytest.raises(ValueError, match="rows for 4 jobs"):
        Call(machine, (*tables[:2], tables[2][:3], tables[3]), 4, np.empty(0))


def test_sensitivities_are_differentiated_only_where_something_moves_them(monkeypatch):
    """Of n + n² + n variables nearly all pairs have derivative zero; each cost a visit of the whole expression."""
    reduction = reduce_model(build_model(drawn(3)[0]))
    extended, n, asked = with_sensitivities(reduction), len(reduction.state), []
    monkeypatch.setattr(reduction_module, "derivative", lambda e, x: asked.append(e) or derivative(e, x))
    matrix = extended.jacobian()
    assert len(matrix) == n * (n + 2)
    assert len(asked) < 0.5 * len(matrix) ** 2
    rates, state = extended.rates, extended.state
    chance = np.random.default_rng(1)
    for i, k in chance.integers(0, len(matrix), (200, 2)):
        moved = rates[i].has(state[k]) or any(one.has(state[k]) for one in extended.residuals)
        assert moved or matrix[i][k] == 0
    for j in range(n):  # each column moves by the matrix itself
        rows, columns = slice(n * (j + 1), n * (j + 2)), slice(n * (j + 1), n * (j + 2))
        assert [row[columns] for row in matrix[rows]] == reduction.jacobian()
