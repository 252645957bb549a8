"""What a fit says of a machine, and which experiment would say more."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss

# -- to the question


def test_predictions_carry_the_uncertainty():
    """Against the linear propagation of theory: k_cr = σ(b − a)/d_c."""
    fit = lab.stepped()
    kcr = (fit.values["friction.b"] - fit.values["friction.a"]) * lab.STRESS / fit.values["friction.d_c"]
    rig = lab.rig().with_values({"slider.stiffness": kcr, "friction.v_ref": lab.SLOW})
    found = ss.predict(rig, fit)
    assert found.probability_stable == pytest.approx(0.5, abs=0.06)
    low, _, middle, _, high = found.quantiles(found.critical_stiffness)
    assert middle == pytest.approx(kcr, rel=0.005)
    gradient = np.array([{"friction.a": -fit.values["friction.a"], "friction.b": 0.01}.get(n, 0.0) for n in fit.names])
    gradient /= fit.values["friction.b"] - fit.values["friction.a"]
    gradient[fit.index("d_c")] = -1.0
    relative = np.sqrt(gradient @ fit.covariance @ gradient)
    assert (high - low) / kcr == pytest.approx(2 * 1.96 * relative, rel=0.1)
    assert found.dominant in found.shares
    assert "Not decided by the records" in str(found)
    stiff = ss.predict(rig.with_values({"slider.stiffness": 3 * kcr}), fit)
    assert stiff.probability_stable == 1
    assert str(stiff).startswith("Stable")
    assert stiff.to_dict()["safety"][2] == pytest.approx(3, rel=0.01)


@pytest.mark.slow
def test_kick_thresholds_are_predicted():
    fit = lab.stepped()
    found = ss.predict(lab.rig(), ss.experiments.bootstrap(fit, 8), kick="velocity")
    single = ss.threshold(found.rig, "velocity").size
    _, _, middle, _, _ = np.quantile(found.thresholds["velocity"], [0.025, 0.16, 0.5, 0.84, 0.975])
    assert middle == pytest.approx(single, rel=0.1)


def test_a_prediction_keeps_the_memory_of_normal_stress_that_the_fit_has_not():
    rig = lab.rig(alpha=0.4)
    found = ss.predict(replace(rig, contact=ss.laws.InclinedSpring(preload=8e6, angle=0.2)), lab.stepped())
    assert found.rig.value("friction.normal_memory.alpha") == 0.4
    moved = ss.predict(rig, lab.stepped(), transfer=["slider.stiffness"])
    assert moved.rig.stiffness == lab.stepped().values["slider.stiffness"]
    with pytest.raises(ss.ParameterError, match="was not fitted"):
        ss.predict(rig, lab.stepped(), transfer=["slider.mass"])


# -- design of experiments


def test_promised_precision_is_what_a_fit_has():
    rig = lab.rig()
    promise = ss.experiments.precision(rig, lab.STEP, noise=lab.NOISE, samples=1000)
    for name, error in promise.errors.items():
        assert error == pytest.approx(lab.stepped().errors[name], rel=0.1)


def test_the_best_experiment_comes_first():
    found = ss.experiments.best_protocol(lab.rig(alpha=0.4), fixed=["slider.stiffness"], samples=1500)
    errors = [one.errors[found.parameter] for one in found.found.values()]
    assert errors == sorted(errors)
    assert found.best != "step"
    assert not found.found["step and velocity step"].unidentified
    assert found.parameter == "friction.normal_memory.alpha"
    assert str(found).splitlines()[1].split()[0] in found.best


def test_which_parameter_an_experiment_is_for():
    """That which friction's law calls its share of a change of stress; where there is none, it has to be said."""
    rig = lab.rig()
    with pytest.raises(ss.ParameterError, match=r"parameter: missing; allowed: .*friction\.a.*\(free parameters\)"):
        ss.experiments.best_protocol(rig, {"one": lab.STEP}, until=80.0, samples=100)
