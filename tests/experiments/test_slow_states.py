"""Records in which a second state of long slip distance, or a trend, explains what follows steps."""

import pytest

import lab_records as lab
import slow_states_at_random as campaign
import steadyslip as ss
from steadyslip.experiments.fitting import remedies
from steadyslip.experiments.fitting.words import slip_after_changes, warnings


@pytest.mark.parametrize(("what", "gains"), [("states", True), ("trend", False)])
def test_a_trend_is_not_taken_for_a_state_nor_the_state_for_it(what, gains):
    """With the trend a - b of the first was quoted 21 errors off."""
    one = next(campaign.drawn(what, 1, 1))
    fit = ss.fit(ss.lab_rig(one.law), one.record, trend=1)
    slow = remedies.slow_state(fit.plan, fit.ssq, fit.plan, fit.values)
    assert (slow.gain > remedies.STRONG_EVIDENCE) is gains
    assert slow.gain < -remedies.STRONG_EVIDENCE or gains
    assert any(own.name == "a - b" for own in fit.derived) is not gains
    assert fit["b"].determined is not gains
    if not gains:
        assert abs(campaign.deviation(fit, one.weakening)) < 3


@pytest.mark.slow
def test_a_state_that_fits_as_well_as_a_trend_leaves_a_less_b_open(monkeypatch):
    one = next(campaign.drawn("trend", 1, 1))
    near = remedies.Remedy("fit.states = 2, fit.trend = 0", 1.0, -5.9, 0.4, {"a - b": 0.0123})
    far = remedies.Remedy("fit.states = 2, fit.trend = 0", 1.0, -6.1, 0.4, {"a - b": 0.0123})
    from steadyslip.experiments.fitting import numbers

    for slow, is_open in ((near, True), (far, False)):
        monkeypatch.setattr(numbers, "slow_state", lambda *_, own=slow: own)
        fit = ss.fit(ss.lab_rig(one.law), one.record, trend=1)
        said = " ".join(warnings(fit))
        assert ("these data do not determine a - b" in said) is is_open
        assert ("fits as well (BIC +5.9), with a - b 0.012 in place of" in said) is is_open
        assert any(own.name == "a - b" for own in fit.derived) is not is_open


def test_the_range_of_slip_that_a_less_b_is_of_is_printed():
    """The load point moves at 5 um/s for 89.87 s after its change."""
    fit = ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, count=300))
    assert slip_after_changes(fit) == pytest.approx(5e-6 * 89.87, rel=0.01)
    assert "range           at most 450 um of slip after a change of rate; a - b lacks what" in str(fit)
    assert "a - b are those over at most 450 um of slip" in ss.experiments.step_table(fit).methods


def test_a_choice_is_listed_once():
    twice = [remedies.Remedy("fit.trend = 1", 1.0, gain, 0.4, {}) for gain in (7.0, 9.0, 8.0)]
    assert [one.gain for one in remedies.ranked(twice)] == [9.0]


@pytest.mark.campaign
def test_a_trend_and_a_state_at_random():
    """Four of each of what `slow_states_at_random` draws: none quotes a - b far off."""
    for what in ("states", "trend"):
        for one in campaign.drawn(what, 4, 2):
            fit = ss.fit(ss.lab_rig(one.law), one.record, trend=1)
            assert not abs(campaign.deviation(fit, one.weakening)) > 4
