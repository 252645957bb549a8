"""Machines whose velocities, frictions or accelerations are found together, no one of them alone."""

import steadyslip as ss
from machines import rate_state, surface

ALPHA = {"normal_memory": ss.laws.LinkerDieterich(alpha=0.2, sigma_ref=1.0)}
SMOOTH = [rate_state(0.3, 0.1, 1.0, regularised=True), rate_state(0.2, -0.05, 2.0, regularised=True)]
WEDGED = [rate_state(0.02, -0.01, 1.0, mu=0.4, **ALPHA), rate_state(0.03, 0.01, 2.0, mu=0.3, **ALPHA)]
GAINS = (0.3, 0.2)


def machine(masses, links, contacts):
    return ss.Machine(
        bodies={name: ss.machine.SlidingBody(mass=mass) for name, mass in masses.items()},
        links={
            f"{a}-{b}": ss.machine.Spring(between=(a, b), stiffness=k, damping=c) for (a, b), (k, c) in links.items()
        },
        contacts=contacts,
        drive=ss.machine.Pull(velocity=1.0),
    )


def two_smooth(mass=0.0, dashpot=0.4, laws=SMOOTH):
    links = {("drive", "one"): (0.5, 0.0), ("drive", "two"): (0.4, 0.0), ("one", "two"): (0.3, dashpot)}
    contacts = {"first": surface("one", laws[0]), "second": surface("two", laws[1])}
    return machine({"one": mass, "two": mass}, links, contacts)


def wedges(**bodies):
    """Two self-energising contacts with memory of normal stress, on one body or on two."""
    names = list(bodies)
    links = {("drive", names[-1]): (1.0, 0.1)} | ({(names[1], names[0]): (3.0, 0.1)} if len(names) > 1 else {})
    contacts = {
        name: ss.machine.Surface(body=body, friction=own, contact=ss.laws.SelfEnergising(preload=1.0, gain=gain))
        for name, body, own, gain in zip(("left", "right"), (names[0], names[-1]), WEDGED, GAINS, strict=True)
    }
    return machine(bodies, links, contacts)


def heavy_footed():
    """Two blocks whose normal stress feels their acceleration, with memory of it: no acceleration has a closed form."""
    links = {("drive", "one"): (0.5, 0.1), ("one", "two"): (0.3, 0.2)}
    contacts = {
        name: ss.machine.Surface(body=body, friction=own, contact=ss.laws.LinearNormalStress(preload=1.0, b0=b0))
        for name, body, own, b0 in (("first", "one", WEDGED[0], 0.1), ("second", "two", WEDGED[1], -0.05))
    }
    return machine({"one": 1.0, "two": 2.0}, links, contacts)
