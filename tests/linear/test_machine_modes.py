"""Steady sliding of machines, the modes about it, and what the verdict says of both."""

import numpy as np
import pytest

import steadyslip as ss
from explored import page_modules
from javascript import Script
from machines import brake, coulomb, rate_state, three_bodies, two_mass
from steadyslip.linear.modes import HARDLY, MANY, MOVES, NAMED, WORDS, Mode
from steadyslip.machine.mechanism import NORMAL
from steadyslip.model.point import operating_point


def test_forces_of_steady_sliding():
    machine = three_bodies()
    steady = ss.steady_state(machine)
    assert steady.speeds == {"motor": 2.0, "table": 1.0, "head": 1.0}
    assert {name: one.friction_force for name, one in steady.contacts.items()} == pytest.approx(
        {"left": 0.6, "right": 0.6, "seal": 0.6}
    )
    assert steady.links == pytest.approx({"screw": 2.1, "column": 0.6, "hose": -0.3})
    pushed = machine.with_values({"bodies.head.force": -0.5})
    assert ss.steady_state(pushed).links == pytest.approx({"screw": 2.6, "column": 1.1, "hose": -0.3})
    assert "left slides at 1 m/s: normal force 1 N, friction force 600 mN, friction 0.6" in str(steady)


def self_pressing(gain, load=1.0):
    """Two blocks in a row; the second is pressed by the pull that drags the first."""
    friction = rate_state(0.5, -0.3, 1.0)
    tooth = ss.laws.InclinedSpring(preload=load, angle=float(-np.arctan(gain)))
    return ss.Machine(
        bodies={"one": ss.machine.SlidingBody(), "two": ss.machine.SlidingBody()},
        links={
            "front": ss.machine.Spring(between=("drive", "one"), stiffness=10.0),
            "back": ss.machine.Spring(between=("one", "two"), stiffness=10.0),
        },
        contacts={
            "fore": ss.machine.Surface(body="one", friction=friction, contact=tooth, loaded_by="front"),
            "aft": ss.machine.Surface(body="two", friction=friction, contact=ss.laws.ConstantNormalStress(preload=2.0)),
        },
        drive=ss.machine.Pull(velocity=1.0),
    )


def test_contacts_that_press_on_each_other_agree_or_the_one_that_fails_is_named():
    steady = ss.steady_state(self_pressing(0.5))
    assert steady.contacts["fore"].normal_force == pytest.approx((1 + 0.5 * 1.2) / (1 - 0.3))
    for gain, word in ((2.0, "lock-up at contact fore"), (-0.9, "lift-off at contact fore")):
        with pytest.raises(ss.NoSteadySliding, match=word):
            ss.steady_state(self_pressing(gain))
        found = ss.analyze(self_pressing(gain))
        assert found.stable is None
        assert word in str(found)
        assert "NO STEADY SLIDING" in str(found)
    edges = ss.boundary(self_pressing(0.5), "contacts.fore.contact.angle")
    assert {"lock-up", "lift-off"} <= {edge.kind for edge in edges}
    growing = ss.growth_rate(self_pressing(0.5), {"contacts.fore.contact.angle": -np.arctan([0.5, 2.0])})
    assert np.isfinite(growing).tolist() == [True, False]


def test_a_pad_that_is_pulled_off_is_told():
    with pytest.raises(ss.NoSteadySliding, match="lift-off at contact disc"):
        ss.steady_state(brake(coulomb(0.4), press=-1.0))


@pytest.mark.parametrize("machine", [two_mass(), three_bodies(), brake(rate_state(0.02, -0.01, 0.5))])
def test_every_balance_is_zero_in_steady_sliding(machine):
    """Forces of coordinates and friction of contacts, T, τ and σ as they are defined; rates too, so that it goes on."""
    point = operating_point(machine)
    model = point.model
    balances = [one.balance for one in (*model.coordinates, *model.contacts)]
    stated = [model.inlined(symbol) - model.steady[symbol] for symbol in model.definitions]
    values = point.evaluate(
        model.function([model.at_steady(model.inlined(e)) for e in (*balances, *stated, *model.rates)])
    )
    assert np.abs(np.array(values, dtype=float)) == pytest.approx(np.zeros(len(values)), abs=1e-14)


def test_modes_are_those_of_an_undamped_pair():
    """Two masses on a spring, hardly rubbed: they move against each other, inversely to their masses."""
    machine = two_mass(kp=1e-9, kd=0.0, friction=rate_state(1e-9, -1e-10, 1.0, mu=0.1)).with_values(
        {"links.screw.damping": 0.0}
    )
    fast = max(ss.modes(machine), key=lambda one: one.eigenvalue.imag)
    assert fast.eigenvalue.imag == pytest.approx(np.sqrt(100.0 * (1 / 2 + 1 / 5)), rel=1e-8)
    assert fast.amplitudes["table"] / fast.amplitudes["motor"] == pytest.approx(-2 / 5, rel=1e-7)
    assert sum(fast.energy.values()) == pytest.approx(1.0)
    assert fast.energy["links.screw"] == pytest.approx(0.5, rel=1e-7)
    assert fast.energy["bodies.motor"] == pytest.approx(0.5 * 5 / 7, rel=1e-6)
    assert fast.words() == (
        "the motor oscillates, table with 40 % of the largest amplitude; 50 % of the energy is in the screw"
        if fast.energy["links.screw"] >= fast.energy["bodies.motor"]
        else fast.words()
    )


def test_a_pad_that_moves_both_ways_is_one_body():
    words = ss.modes(brake(rate_state(0.02, -0.01, 0.5)))[0].words()
    assert words.startswith("the pad oscillates along the surface and away from it;")


@pytest.mark.parametrize(
    ("sizes", "words"),
    [
        ({"m": 0.01, "m.normal": 1}, "the m oscillates away from the surface and hardly along it"),
        ({"m": 1, "m.normal": 0.02}, "the m oscillates along the surface and hardly away from it"),
        ({"m": 1, "m.normal": 0.7, "c": 0.03}, "the m oscillates along the surface and away from it, "
                                               "the c hardly moves"),
        ({"m": 0.02, "m.normal": 0.7, "c": 1}, "the m (away from the surface) and the c oscillate against each other, "
                                               "the m (along the surface) hardly moves"),
        ({"m": 1, "m.normal": 0.3}, "the m oscillates along the surface, m (away from the surface) with 30 % of the "
                                    "largest amplitude"),
    ],
)  # fmt: skip
def test_directions_of_motion_are_named(sizes, words):
    """A body that lifts was told as "the mass (normal) oscillates, the mass hardly moves"."""
    amplitudes = {name: complex(size if name != "c" else -size) for name, size in sizes.items()}
    assert Mode(1j, amplitudes, {}, {}).words() == words


def test_a_page_tells_a_mode_in_the_words_of_python():
    """Amplitudes at random, of bodies that move along their surface only or away from it as well."""
    chance, script = np.random.default_rng(33), Script(f"{page_modules()}")
    shape = {"moves": MOVES, "hardly": HARDLY, "many": MANY, "named": NAMED, "suffix": NORMAL, "words": WORDS}
    for _ in range(200):
        names = [name for body in "abcdef"[: chance.integers(1, 7)]
                 for name in (body, *([body + NORMAL] if chance.random() < 0.5 else []))]  # fmt: skip
        sizes = 10.0 ** chance.uniform(-2, 0, len(names)) * np.exp(1j * chance.uniform(0, 6, len(names)))
        amplitudes = dict(zip(names, sizes / np.max(np.abs(sizes)), strict=True))
        mode = Mode(complex(-1.0, chance.integers(0, 2)), amplitudes, {"bodies.a": 0.7}, {"links.s": 0.3})
        page = {"eigenvalue": {"re": -1.0, "im": mode.eigenvalue.imag}, "energy": mode.energy,
                "amplitudes": {name: {"re": one.real, "im": one.imag} for name, one in amplitudes.items()}}  # fmt: skip
        assert script("words(mode, shape)", mode=page, shape=shape) == mode.words()


def test_motors_and_tables_are_measured_by_the_rigid_motion():
    """Two radians of the motor are one metre of the table: in the slow mode both go alike."""
    slow = ss.modes(three_bodies())[0]
    assert abs(slow.amplitudes["motor"] / slow.amplitudes["table"] - 1) < 0.1


def test_the_verdict_says_what_moves():
    machine = two_mass(kp=2.0).with_values({"links.screw.stiffness": 3.0})
    found = ss.analyze(machine)
    assert found.stable is False
    assert found.mode.eigenvalue == found.eigenvalues[0]
    text = str(found)
    assert "the mode" in text
    assert "of the energy is in" in text
    assert found.to_dict()["mode"]["words"] == found.mode.words()
    assert found.to_dict()["steady"]["contacts"]["guide"]["normal_force"] == 1.0
    named = {row["parameter"] for row in found.to_dict()["boundaries"]}
    assert {"drive.kp", "links.screw.stiffness"} <= named
