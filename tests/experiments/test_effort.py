"""What a fit may cost: counted, the same on every machine, and said where it is used up."""

from __future__ import annotations

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting.effort import MODELS, Budget, Effort, work_of_search
from steadyslip.experiments.fitting.forward import Forward
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.kernels.layout import Setting


def test_work_is_that_of_the_slowest_of_eight_motions_side_by_side():
    budget = Budget()
    budget.spend(np.array([3.0, 9.0, 1.0]), 5)
    budget.spend(np.array([2.0] * 8 + [7.0]), 1)
    assert budget.spent == 9 * 5 + 2 + 7


def test_what_is_allowed_ends_with_the_budget():
    budget = Budget(100.0)
    first, second = budget.part(30.0), budget.part(1000.0)
    budget.spend(np.array([40.0]), 1)
    assert first()
    assert not second()
    budget.spend(np.array([60.0]), 1)
    assert second()
    assert first.was_met
    assert second.was_met


def test_motions_much_slower_than_those_that_ended_are_given_up():
    """With `growth`; the first has no other to be compared with."""
    plan = make_plan(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, count=300))
    z = plan.space().coordinates(np.array(list(lab.stepped().values.values())))[None]
    asked = plan.comparison(Effort(growth=0.7))
    assert np.all(np.isfinite(asked.model(z)[0]))
    steps = asked.parts[0].forward.slowest
    assert 0.7 * steps > 100
    assert not np.isfinite(asked.model(z + 1e-9)[0][0, -1])
    assert asked.parts[0].forward.slowest == steps
    assert np.all(np.isfinite(plan.comparison(Effort(growth=1.1)).model(z)[0]))


@pytest.fixture(scope="module")
def record():
    """Friction that is no law's: every start wanders, and none leads where others do."""
    found = lab.columns(lab.rig(), lab.STEP, count=150)
    walk = np.cumsum(np.random.default_rng(1).standard_normal(150))
    return ss.record_from_arrays(**found | {"friction": found["friction"] + 2e-3 * walk})


def test_a_search_ends_when_its_work_is_done(record, monkeypatch):
    """With any effort it ends, the same way each time; the fit says so, and more effort fits no worse."""
    spent = []
    spend = Budget.spend

    def counted(budget, steps, carried):
        spend(budget, steps, carried)
        spent.append(budget)

    monkeypatch.setattr(Budget, "spend", counted)
    effort = 5e-5
    fit = ss.fit(ss.lab_rig(states=2), record, effort=effort)
    assert fit.search.cut
    assert "effort" in " ".join(str(fit).split())
    assert fit.to_dict()["search"]["cut"]
    again = ss.fit(ss.lab_rig(states=2), record, effort=effort, threads=1)
    np.testing.assert_array_equal(again.coordinates, fit.coordinates)
    budget = max(spent, key=lambda one: one.spent)
    allowed = MODELS * effort * work_of_search(len(record), len(fit.names))
    once = 48 / 8 * 40 * len(record) * (1 + len(fit.names))  # what is under way when it is used up
    assert budget.total == pytest.approx(allowed)
    assert budget.spent < allowed + 8 * once
    longer = ss.fit(ss.lab_rig(states=2), record, effort=5 * effort)
    assert longer.ssq <= fit.ssq * (1 + 1e-9)


def test_a_search_without_an_end_has_no_errors():
    """Nor does it say that data do not determine, or advise what more of the search would do."""
    made = lab.record(lab.rig(), lab.STEP, 3, count=1500)
    fit = ss.fit(ss.lab_rig(), made, effort=5e-5)
    assert not fit.search.converged
    assert "no error: the search was stopped before it ended" in str(fit)
    assert "not determined" not in str(fit)
    assert not [one for one in fit.remedies if one.gain > 6]
    answers = ss.experiments
    for ask in (answers.bootstrap, answers.posterior, answers.normal_draws, lambda one: answers.profile(one, "a")):
        with pytest.raises(ss.NotAvailable, match="was stopped before it ended"):
            ask(fit)


def test_a_model_that_follows_from_no_start_is_refused(record, monkeypatch):
    monkeypatch.setattr(Forward, "run", lambda self, table, parameters, units, begin=None: np.full(
        (len(parameters), 1 + self.directions, len(table.times)), np.nan))  # fmt: skip
    with pytest.raises(ss.NotAvailable, match="from any start"):
        ss.fit(ss.lab_rig(), record)


def test_typical_fits_are_far_from_the_end_of_their_work(monkeypatch):
    work = []
    spend = Budget.spend
    monkeypatch.setattr(Budget, "spend", lambda self, *given: (spend(self, *given), work.append(self))[0])
    fit = ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, 3, count=400))
    assert not fit.search.cut
    assert "effort" not in str(fit)
    assert max(one.spent for one in work) < 0.02 * work_of_search(400, len(fit.names))


def test_a_motion_that_a_simpler_model_can_follow_is_not_given_up_in_a_richer_one(record):
    """Steps that a trial may take rise with the number of parameters."""
    most = []
    for rig in (ss.lab_rig(), ss.lab_rig(states=2)):
        plan = make_plan(rig, record)
        part = plan.comparison().parts[0]
        values = part.forward.values(np.array([[rig.value(name) for name in part.forward.names]]))
        settings = part.forward._settings(part.table(np.zeros((1, len(part.time_indices)))), values, 1)
        most.append(settings[0, Setting.MOST_STEPS])
    assert most[1] > 1.03 * most[0]


@pytest.mark.parametrize("effort", [0, -1, float("nan"), 1e9])
def test_effort_has_a_range(record, effort):
    with pytest.raises(ss.ParameterError, match="effort"):
        ss.fit(ss.lab_rig(), record, effort=effort)
