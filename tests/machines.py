"""Machines of theory 11 and others, for tests."""

import numpy as np

import steadyslip as ss


def rate_state(f, slope, r, mu=0.6, load=1.0, **further):
    """Friction with theory's f, S and r at unit velocity under a load."""
    return ss.RateState(a=f / load, b=(f - slope) / load, d_c=1 / r, mu_ref=mu, v_ref=1.0, **further)


def coulomb(mu):
    return ss.CoulombStribeck(mu_coulomb=mu, mu_static=mu, v_stribeck=1.0)


def surface(body, friction, load=1.0, **further):
    return ss.Surface(body=body, friction=friction, contact=ss.Constant(preload=load), **further)


def two_mass(kp=1.0, kd=0.1, measured=None, friction=None):
    """The feed axis of theory 11."""
    return ss.Machine(
        bodies={"motor": ss.SlidingBody(mass=2.0), "table": ss.SlidingBody(mass=5.0)},
        links={"screw": ss.Spring(between=("motor", "table"), stiffness=100.0, damping=0.5)},
        contacts={"guide": surface("table", friction or rate_state(0.5, -0.3, 1.0))},
        drive=ss.PositionPD(velocity=1.0, body="motor", measured=measured, kp=kp, kd=kd),
    )


def two_blocks(k, second_slope, coupling):
    """Two blocks on a common load point, coupled by a spring."""
    return ss.Machine(
        bodies={"one": ss.SlidingBody(mass=0.1), "two": ss.SlidingBody(mass=0.1)},
        links={
            "first": ss.Spring(between=("drive", "one"), stiffness=k),
            "second": ss.Spring(between=("drive", "two"), stiffness=k),
            "between": ss.Spring(between=("one", "two"), stiffness=coupling),
        },
        contacts={
            "one": surface("one", rate_state(2.0, -0.5, 1.0)),
            "two": surface("two", rate_state(2.0, second_slope, 1.0)),
        },
        drive=ss.Pull(velocity=1.0),
    )


def brake(friction, k1=1.0, press=1.0):
    """Mode coupling of theory 11: stiffness k1 along the slide, k2 = 1.2 normal, coupled by k12 = 0.3."""
    to = ("drive", "pad")
    return ss.Machine(
        bodies={"pad": ss.PlanarBody(mass=1.0, press=press)},
        links={
            "arm": ss.Spring(between=to, stiffness=k1 - 0.3),
            "lining": ss.Spring(between=to, stiffness=0.1, direction="normal"),
            "caliper": ss.Spring(between=to, stiffness=0.6, angle=np.pi / 4),
        },
        contacts={"disc": ss.Surface(body="pad", friction=friction, contact=ss.Compliant(normal_stiffness=0.8))},
        drive=ss.Pull(velocity=1.0),
    )


def three_bodies():
    """Motor, screw and table with a carriage on two guides: the machine whose speed is measured."""
    deep = {"normal_memory": ss.LinkerDieterich(alpha=0.2, sigma_ref=1.0)}
    return ss.Machine(
        bodies={
            "motor": ss.RotatingBody(inertia=0.5),
            "table": ss.SlidingBody(mass=5.0),
            "head": ss.SlidingBody(mass=1.0),
        },
        links={
            "screw": ss.Screw(between=("motor", "table"), lead=0.5, stiffness=100.0, damping=0.5),
            "column": ss.Spring(between=("table", "head"), stiffness=300.0, damping=0.2),
            "hose": ss.Spring(between=("ground", "table"), damping=0.3),
        },
        contacts={
            "left": surface("table", rate_state(0.5, -0.3, 1.0)),
            "right": surface("table", rate_state(0.4, -0.1, 2.0, **deep)),
            "seal": surface("head", rate_state(0.1, 0.05, 1.0)),
        },
        drive=ss.RotaryPD(velocity=2.0, body="motor", kp=2.0, kd=0.3),
    )
