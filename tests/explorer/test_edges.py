"""Edges that a page finds: those of Python, however narrow the windows between them are, and each has its words."""

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
import users_laws
from explored_edges import Edges, drawn, judged, other_edges, walked
from machines import block, undamped_at_random
from rigs_of_theory import SIGMA, V0, rate_state, rig
from steadyslip.linear.status import ABSENT, STABLE, UNDAMPED, UNSTABLE
from steadyslip.verdict.words import BEYOND

EXAMPLES = Path(__file__).parents[2] / "examples"
NAMES = sorted(
    str(path.relative_to(EXAMPLES).with_suffix(""))
    for path in (*EXAMPLES.glob("[!h]*.toml"), *EXAMPLES.glob("machines/*"))
)


@cache
def page(name):
    file = EXAMPLES / f"{name}.toml"
    return Edges(ss.read_rig(file), file)


def changed(name, **values):
    """Values of the page of an example, some of which are others; dots in names are double underscores."""
    own = {key.replace("__", "."): value for key, value in values.items()}
    found = page(name)
    return [own.get(key, value) for key, value in zip(found.names, found.home, strict=True)]


def test_an_edge_that_is_pressed_hides_no_other():
    """The rig is a thousandth beside the edge of the lining; that of the caliper, 2.3 % away, is in the list."""
    pad = page("machines/brake-pad")
    (edge,) = [one for one in pad(pad.home)["edges"] if pad.names[one["i"]] == "links.lining.stiffness"]
    values = changed("machines/brake-pad", links__lining__stiffness=edge["landing"])
    wrong, edges = other_edges(pad, values)
    assert wrong == []
    listed = {pad.names[one["i"]]: one["at"] / values[one["i"]] - 1 for one in edges}
    assert listed["links.caliper.stiffness"] == pytest.approx(0.023, abs=1e-3)
    assert listed["links.lining.stiffness"] == pytest.approx(-1e-3, abs=1e-4)


@pytest.mark.parametrize(("name", "parameter", "other", "range_", "tenth"), [
    ("brake-pad", "links.caliper.angle", "bodies.pad.press", (2e3, 16e3), 0.01),  # edges of two kinds meet
    ("telescope", "contacts.bearing.radius", "contacts.bearing.friction.mu_coulomb", (5e-3, 6.5e-3), 0.1),  # of one
])  # fmt: skip
def test_a_window_is_found_until_it_closes(name, parameter, other, range_, tenth):
    """As another parameter rises, down to .002 and less; it closes as two lines cross, or as a parabola ends."""
    there = page(f"machines/{name}")
    i, k = there.names.index(parameter), there.names.index(other)

    def at(value):
        return [value if j == k else one for j, one in enumerate(there.home)]

    def windows(value):
        edges = there.script("(rig.values = values, changes(rig, i)).edges", values=at(value), i=i)
        return [(one["at"], two["at"]) for one, two in pairwise(edges)]

    low, high = range_
    while high - low > 1e-9 * low:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if windows(middle) else (low, middle)
    ((begin, end),) = windows(low)
    assert 0 < end - begin < 2e-3
    ((wide, far),) = windows(low * (1 - 1e-3))
    ((begin, end),) = windows(low * (1 - 1e-5))
    assert (end - begin) / (far - wide) == pytest.approx(tenth, rel=0.25)  # the last is not seen
    beside = 1e-2 * (end - begin)
    rigs = [there.own(at(low * (1 - 1e-5))).with_values({parameter: x}) for x in (begin - beside, 0.5 * (begin + end))]
    assert {judged(one)[0] for one in rigs} == {STABLE, UNSTABLE}


@pytest.mark.parametrize("name", ["inclined-spring", "machines/telescope"])
def test_while_a_hand_moves_a_slider_the_nearest_edges_are_those_at_rest(name):
    """Fewer samples then tell of the same edges, to the width of a pixel."""
    there, values = page(name), page(name).home
    moving, resting = there(values, coarse=True)["edges"], there(values)["edges"]
    seen, found = ({one["i"]: one["at"] for one in edges} for edges in (moving, resting))
    assert seen == pytest.approx(found, rel=1e-4)


def test_every_kind_of_edge_has_the_words_of_python():
    """Also where what is asked for words is not what the list says."""
    there = page("inclined-spring")
    as_page = "{ rig, answer: { status: now }, with: (i, x) => rig.values }"
    words = f"beyondWords({{ i: 0, at: data.parameters[0].value, beyond, behind }}, {as_page})"
    for beyond, now, allowed in (
        (STABLE, UNSTABLE, {"becomes stable"}),
        (UNSTABLE, STABLE, {BEYOND[kind] for kind in ("oscillatory", "divergence", "ill-posed")}),
        (ABSENT, STABLE, {BEYOND[kind] for kind in ("lock-up", "lift-off", "no solution")}),
        (UNSTABLE, ABSENT, {"slides steadily, but unstable"}),
    ):
        assert there.script(words, beyond=beyond, now=now, behind=there.home[0]) in allowed
    kinds = {one["words"] for one in there(there.home)["edges"]}
    assert {"it locks up", "becomes stable"} <= kinds


def test_a_curve_that_has_died_out_has_no_slope():
    """Its slope is a power up to e^700 times an exponential of zero; a page that clips that is unstable from 548."""
    law = ss.laws.LuGre(
        mu_coulomb=0.3, mu_static=0.4, v_stribeck=100.0, bristle_stiffness=0.1, bristle_damping=1e-3, viscous=0.01,
        stribeck_exponent=2.0,
    )  # fmt: skip
    load, drive = ss.laws.ConstantNormalStress(preload=1.0), ss.machine.SteadyDrive(357.0)
    there = Edges(ss.Slider(friction=law, contact=load, stiffness=1e-3, mass=1e-3, drive=drive))
    i = there.names.index("friction.stribeck_exponent")
    for exponent in (500.3, 546.8, 549.3, 551.3):
        values = [exponent if n == i else one for n, one in enumerate(there.home)]
        assert there.script("rig.status(i, x)", i=i, x=exponent) == STABLE == judged(there.own(values))[0]


def test_beside_lock_up_growth_is_told_as_in_python():
    """A thousandth beyond the edge in a or b the pair that crossed is real already; it began as an oscillation."""
    memory = ss.laws.PrakashClifton()
    gripped = rig(
        friction=rate_state(normal_memory=memory), contact=ss.laws.SelfEnergising(preload=SIGMA, gain=0.4),
        stiffness=9e9, drive=ss.machine.PD(V0, kp=2e10, kd=1e9),
    )  # fmt: skip
    there = Edges(gripped)
    (locks,) = [one for one in there(there.home)["edges"] if there.names[one["i"]] == "friction.mu_ref"]
    values = [locks["landing"] if i == locks["i"] else one for i, one in enumerate(there.home)]
    wrong, edges = other_edges(there, values)
    assert wrong == []
    words = {there.names[one["i"]]: one["words"] for one in edges}
    assert words["friction.a"] == words["friction.b"] == BEYOND["oscillatory"]


def test_edges_far_from_a_value_are_found_near_its_natural_size():
    """Python searches six decades to each side of both."""
    there = Edges(users_laws.USERS["contact law"])
    (edge,) = [one["at"] for one in there(there.home)["edges"] if there.names[one["i"]] == "contact.share"]
    assert edge == pytest.approx(ss.boundary(there.rig, "contact.share")[0].value, rel=1e-9)
    assert edge > 1e6 * there.rig.value("contact.share")


def test_thin_parts_of_a_track_are_seen_and_leave_the_own_place():
    """Widened parts stay between their neighbours, and the place of the rig keeps its colour."""
    there, chance = page("inclined-spring"), np.random.default_rng(5)
    for _ in range(200):
        cuts = np.sort(np.concatenate([chance.uniform(0, 1, 2), 0.5 + chance.normal(0, 2e-3, 2)]))
        ends = [0.0, *cuts.tolist(), 1.0]
        parts = [{"from": a, "to": b, "status": 1 + n % 2} for n, (a, b) in enumerate(pairwise(ends))]
        own = float(chance.choice([0.5, chance.uniform(0, 1)]))
        seen = there.script("visible(parts, own)", parts=parts, own=own)
        colour = [next(one["status"] for one in row if own <= one["to"]) for row in (parts, seen)]
        assert colour[0] == colour[1]
        assert [one["from"] for one in seen[1:]] == [one["to"] for one in seen[:-1]]
        assert all(one["to"] >= one["from"] for one in seen)


@pytest.mark.parametrize("seed", range(4))
def test_statuses_of_undamped_machines_are_those_of_python(seed):
    """At values drawn at random, and from a hundredth to 1e-12 beside every edge of growth (theory 13)."""
    machine, chance, seen = undamped_at_random(seed), np.random.default_rng(seed), set()
    there = Edges(machine)
    shares = [(there.names[i], 10 ** chance.normal(0, 0.4)) for i in chance.integers(0, len(there.names), 60)]
    tried = [(name, share * machine.value(name)) for name, share in shares]
    for name in there.names:
        edges = [one.value for one in ss.boundary(machine, name) if one.kind == "coupling"]
        tried += [(name, edge * (1 + h)) for edge in edges for h in (1e-2, -1e-2, 1e-6, -1e-6, 1e-12, -1e-12)]
    for name, value in tried:
        i = there.names.index(name)
        if there.allowed(i, value):
            found = there.script("rig.status(i, x)", i=i, x=value)
            assert found == judged(machine.with_values({name: value}))[0], (name, value)
            seen.add(found)
    assert UNDAMPED in seen


@pytest.mark.parametrize("seed", [1, *(pytest.param(seed, marks=pytest.mark.campaign) for seed in range(2, 8))])
def test_edges_of_growth_are_those_of_python(seed):
    there = Edges(undamped_at_random(seed))
    assert walked(there, np.random.default_rng(seed), presses=1) == []


def test_a_page_tells_where_nothing_damps_what_python_tells():
    """Beside the edge of Hoffmann & Gaul; a machine that is damped by its friction beyond 0 is stable there."""
    there = Edges(block())
    told = {}
    for mu in (0.5, 1.0284051669940213 * (1 - 1e-9), 1.1):
        values = [mu if name.endswith("mu_coulomb") else one for name, one in zip(there.names, there.home, strict=True)]
        wrong, edges = other_edges(there, values)
        assert wrong == []
        told[mu] = there(values)["headline"], {there.names[one["i"]].split(".")[-1]: one["words"] for one in edges}
    first, near, beyond = told.values()
    assert first[0].startswith("Undamped: no disturbance of steady sliding at 1 m/s grows, and none dies out")
    assert first[1]["mu_coulomb"] == "two oscillations couple and one grows"
    assert near[1]["mu_coulomb"] == "on the edge"
    assert beyond[0].startswith("Unstable")
    assert beyond[1]["mu_coulomb"] == "no disturbance grows"
    viscous = there.names.index("contacts.belt.friction.viscous")
    assert there(there.home)["found"][viscous]["status"] == STABLE  # not that of its end, 0
    assert [there.script("rig.status(i, x)", i=viscous, x=x) for x in (0.0, 0.1, 3.0)] == [UNDAMPED, STABLE, UNSTABLE]
    rough = [0.9 if name.endswith("mu_coulomb") else one for name, one in zip(there.names, there.home, strict=True)]
    assert there(rough)["found"][viscous] | {"low": 0, "high": 0} == {
        "edges": [],
        "status": UNSTABLE,
        "low": 0,
        "high": 0,
    }


def test_a_window_of_growth_is_found_until_it_closes():
    """In a stiffness, as friction falls: its ends are those of Python, less than .003 apart."""
    there = Edges(block())
    i, k = (there.names.index(name) for name in ("links.one.stiffness", "contacts.belt.friction.mu_coulomb"))

    def window(mu):
        values = [mu if j == k else one for j, one in enumerate(there.home)]
        return [one["at"] for one in there.script("(rig.values = values, changes(rig, i)).edges", values=values, i=i)]

    low, high = 0.01, 0.5
    while high - low > 1e-9 * low:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if window(middle) else (middle, high)
    mu = high * (1 + 1e-7)
    begin, end = window(mu)
    assert 0 < end - begin < 3e-3
    found = [one.value for one in ss.boundary(block().with_values({"mu_coulomb": mu}), "links.one.stiffness")]
    assert [begin, end] == pytest.approx(found, rel=1e-6)


@pytest.mark.campaign
@pytest.mark.parametrize("name", NAMES)
def test_edges_of_pages_are_those_of_python(name):
    """At values drawn at random, and beside an edge that is pressed then, with reasons and words."""
    assert walked(page(name), np.random.default_rng(len(name)), presses=1) == []


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(2))
def test_pages_of_random_sliders_and_machines_answer_as_python(seed):
    """A sample of what `tests/helpers/explored_edges.py` draws."""
    chance = np.random.default_rng(seed)
    name, there = drawn(chance)
    assert walked(there, chance, presses=1) == [], name
