"""Machines in motion: equations typed by hand and how they are solved, and the rates of motion."""

import numpy as np
import sympy as sp
from scipy.integrate import solve_ivp

import steadyslip as ss
from machines import rate_state, surface
from steadyslip.model.point import operating_point
from steadyslip.model.reducing import reduce_model
from steadyslip.model.reduction import TIME
from steadyslip.model.weights import eliminable

TIMES = np.linspace(0.0, 20.0, 201)

FINE = {"rtol": 1e-10}


def radau(right, start, times):
    done = solve_ivp(right, (0.0, times[-1]), start, method="Radau", t_eval=times, rtol=1e-9, atol=1e-11)
    assert done.success
    return done.y


def agree(history, name, values, size=1.0):
    assert np.max(np.abs(history[name] - values)) < 2e-6 * size


def law(machine, contact="guide"):
    own = machine.contacts[contact]
    return own.friction, own.contact.preload


def friction(own, load, v, theta):
    """Rate and state in terms of Θ = ln(v* θ/d_c), the slip law of the fixtures."""
    return load * (own.mu_ref + own.a * np.log(v / own.v_ref) + own.b * theta)


def aging(own, v, theta):
    return -v / own.d_c * (np.log(v / own.v_ref) + theta)


def two_tables(**changes):
    """Two tables on one belt, each on its own guide; the second one's law goes through rest."""
    return ss.Machine(
        bodies={"front": ss.machine.SlidingBody(mass=1.0), "back": ss.machine.SlidingBody(mass=1.0)},
        links={
            "belt": ss.machine.Spring(between=("drive", "front"), stiffness=5.0, damping=0.2),
            "bar": ss.machine.Spring(between=("front", "back"), stiffness=8.0, damping=0.2),
        },
        contacts={
            "dry": surface("front", rate_state(0.3, 0.1, 1.0), load=2.0),
            "oiled": surface("back", rate_state(0.1, 0.05, 1.0, regularised=True), load=1.0),
        },
        drive=ss.machine.Pull(velocity=1.0),
    )


def slopes_of_motion(machine):
    """Jacobian of the rates of motion in steady sliding, and the rates there."""
    point = operating_point(machine)
    model, reduction = point.model, reduce_model(point.model, eliminable(point))
    at = dict(model.steady) | dict.fromkeys((*reduction.channels[1:], TIME, *reduction.slopes), sp.Integer(0))
    for one in reduction.slidings:
        if one.variable is not None:
            at[one.variable.w] = one.variable.w_of_v.xreplace(model.steady)
    wanted = [*(e for row in reduction.jacobian() for e in row), *reduction.rates]
    numbers = point.evaluate(model.function(sp.sympify(e).xreplace(at) for e in wanted))
    n = len(reduction.state)
    values = np.array([float(value) for value in numbers])
    return values[: n * n].reshape(n, n), values[n * n :], reduction
