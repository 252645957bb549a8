"""Sentences on the page of a rig are those of Python, letter by letter, and are written in Python alone."""

import ast
import re
from collections import defaultdict
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from explored import page_modules
from explored_edges import Edges, other_edges, written
from javascript import Script
from rigs_of_theory import LAWS, SIGMA, V0, rate_state, rig
from steadyslip.motion.events import ContactSlip
from steadyslip.motion.sentence import sentences
from steadyslip.motion.status import remedy
from steadyslip.reports.elements import typographic
from steadyslip.verdict import machine as machine_words, slider as slider_words

BRISTLES = ss.laws.LuGre(
    mu_coulomb=0.3, mu_static=0.4, v_stribeck=1e-3, bristle_stiffness=1e4, bristle_damping=800.0, viscous=80.0
)
HEAVY = ss.Slider(
    friction=BRISTLES,
    contact=ss.laws.LinearNormalStress(steady_normal_stress=1e5, b3=0.0),
    stiffness=1e6,
    mass=5e5,
    drive=ss.machine.SteadyDrive(1e-3),
)
RIGS = {
    "plain": rig(),
    "area": rig(area=0.01, contact=ss.laws.Lift(preload=SIGMA, lift=1e11, v_ref=V0)),
    "inclined": rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5)),
    "axial": rig(contact=ss.laws.Triaxial(confining_pressure=SIGMA, angle=0.5), stiffness=None, axial_stiffness=9e10),
    "lifted": rig(
        friction=rate_state(mu_ref=0.3, normal_memory=ss.laws.LinkerDieterich(alpha=0.9)),
        contact=ss.laws.InclinedSpring(preload=SIGMA, angle=1.2),
    ),
    "gain": rig(stiffness=None, drive=ss.machine.PD(V0, kp=4e9)),
    "integrated": rig(stiffness=None, drive=ss.machine.PID(V0, kp=9e9, ki=1e8), mass=1e3),
    "together": rig(stiffness=1e9, drive=ss.machine.PD(V0, kp=4e9, kd=1e9)),
    "two states": rig(friction=LAWS["two states"]),
    "heavy": HEAVY,
    "undamped": replace(HEAVY, friction=ss.laws.CoulombStribeck(mu_coulomb=0.3, mu_static=0.3, v_stribeck=1e-3)),
}
NEAR, FAR = 1.0003, 1e3  # times an edge; to three digits the first would be one


@cache
def page(name):
    return Edges(RIGS[name])


def compared(name, **changes):
    there = page(name)
    own = {there.own(there.home).resolve(key): value for key, value in changes.items()}
    values = [own.get(key, value) for key, value in zip(there.names, there.home, strict=True)]
    wrong, _ = other_edges(there, values)
    assert wrong == []
    told = there(values)
    return written(f"{told['headline']} {told['reason']}")


@pytest.mark.parametrize(("name", "stiffness"), [
    ("area", "stiffness"),
    ("gain", "kp"),
    *(pytest.param(*one, marks=pytest.mark.campaign) for one in (
        ("plain", "stiffness"), ("inclined", "stiffness"), ("axial", "axial_stiffness"), ("integrated", "kp"),
        ("together", "stiffness"), ("two states", "stiffness"),
    )),
])  # fmt: skip
def test_beside_and_on_an_edge_a_page_says_what_python_says(name, stiffness):
    (edge,) = [one.value for one in ss.boundary(RIGS[name], stiffness) if one.kind == "oscillatory"]
    for factor, words in ((1 / NEAR, "Unstable:"), (NEAR, "Stable:"), (1 / FAR, "Unstable:"), (FAR, "Stable:")):
        assert compared(name, **{stiffness: factor * edge}).startswith(words)
    text = compared(name, **{stiffness: edge})
    assert text.startswith("On the edge of stability to within rounding: ")
    assert "to within rounding the critical" in text
    assert text.endswith(
        "; neither verdict should be relied on: the least change of a number decides; give it a damping if it has none."
    )


@pytest.mark.parametrize(("name", "changes", "words"), [
    ("plain", {"b": 0.01}, "Sliding is stable at every stiffness."),
    ("plain", {"b": 0.01, "stiffness": 0.0}, "Without stiffness nothing restores the block's place"),
    ("plain", {"stiffness": 0.0}, "0 times the critical stiffness"),
    ("gain", {"b": 0.01}, "Sliding is stable at every drive proportional gain."),
    ("together", {"b": 0.01}, "whatever the stiffness beside it."),
    ("together", {"stiffness": 0.0}, "The drive proportional gain, 4 GPa/m, is"),
    ("lifted", {}, "No stiffness makes sliding stable."),
    ("heavy", {}, "below which sliding is stable."),
    ("heavy", {"b3": -1e7}, "the nearest edge of the stable set."),
    ("undamped", {}, "Neither verdict should be relied on: the least change of a number decides; give it a damping"),
    ("inclined", {"angle": -1.2}, "; the spring angle must be above -arccot μss = -55.01 deg (eq. 27)."),
    ("axial", {"angle": 1.2}, "; the saw-cut angle must be below"),
    ("area", {"drive.velocity": 1e-4}, "Lift-off. The motion takes away more normal force than the contact has"),
])  # fmt: skip
def test_away_from_edges_too(name, changes, words):
    text = compared(name, **changes)
    assert words in text
    assert text.startswith("On the edge") == ("restores" in words or "Neither" in words)


def pressed_on(angle, mu):
    law = ss.laws.RateState(a=0.01, b=0.012, d_c=1e-5, mu_ref=mu, v_ref=1e-3)
    return ss.machine.Surface(body="p", friction=law, contact=ss.laws.InclinedSpring(preload=100.0, angle=angle))


def test_of_contacts_that_press_on_each_other_a_page_names_the_one_that_python_names():
    """Whether they lock up or one lifts off, at angles and frictions drawn at random."""
    gripped = ss.Machine(
        bodies={"p": ss.machine.SlidingBody(mass=1.0)},
        links={"s": ss.machine.Spring(between=("drive", "p"), stiffness=1e5, damping=3.0)},
        contacts={"c": pressed_on(-0.5, 0.7), "d": pressed_on(-0.6, 0.8)},
        drive=ss.machine.Pull(velocity=1e-3),
    )
    there, chance, kinds = Edges(gripped), np.random.default_rng(2), set()
    for _ in range(60):
        values = list(there.home)
        for n, name in enumerate(there.names):
            if name.endswith("angle"):
                values[n] = chance.uniform(-1.5, 1.5)
            elif name.endswith(("mu_ref", "preload")):
                values[n] *= 10 ** chance.uniform(-1, 1)
        told = there.script(
            "(rig.values = values, reason({ ...rig.assess(), own: rig.linear.R }, data))", values=values
        )
        try:
            ss.steady_state(there.own(values))
        except ss.NoSteadySliding as absent:
            why = str(absent).removeprefix("no steady sliding: ")
            assert written(told) == written(f"{why[0].upper()}{why[1:]}.")
            kinds.add((absent.condition, absent.contact))
    assert kinds == {(kind, contact) for kind in ("lock-up", "lift-off") for contact in "cd"}


@pytest.mark.parametrize(("name", "many"), [("plain", 1), ("axial", 2), ("integrated", 0)])
def test_the_critical_value_is_told_as_in_the_rows_of_a_verdict(name, many):
    rows = dict(slider_words.stability_rows(ss.analyze(RIGS[name])))
    told = page(name).script("(rig.values = values, besides(rig.assess(), data))", values=list(page(name).home))
    expected = [f"{label.capitalize()}: {rows[label]}." for label in ("along the axis", "at the edge") if label in rows]
    assert written(told) == written("".join(f" {one}" for one in expected))
    assert len(expected) == many


def test_the_end_of_a_motion_is_told_as_in_a_run_of_python():
    """Its cause, with forces where the rig has an area; and what the verdict stable leaves open."""
    for name in ("plain", "area"):
        there = page(name)
        assert there.script("data.means") == slider_words.MEANS
        for status in ("contact lost", "stuck", "no velocity", "blow-up"):
            course = {"events": [], "status": status, "end": 2.0, "at": 1.0, "contacts": [{"v": [1.0], "floor": 0.0}]}
            told = there.script("outcome(course, data)", course=course)
            (cause,) = re.fullmatch(r".+? (?:the disturbance, )?at .+?: (.+)\.", told).groups()
            assert remedy(status, RIGS[name]).startswith(f"{cause}; ")
    assert "an oscillation." in machine_words.MEANS


@pytest.mark.parametrize("until", [60, 200])
def test_slip_events_that_have_come_to_an_end_are_told_as_in_python(until):
    rig = ss.read_rig("examples/inclined-spring.toml").with_values({"stiffness": 32e9})
    run = ss.simulate(rig, ss.protocol.VelocityStep(at=10, to=2e-6), until=until)
    events = [{"contact": "", "begin": one.begin, "end": one.end, "slip": one.slip, "drop": one.stress_drop,
               "every": one.recurrence if np.isfinite(one.recurrence) else None, "rings": [], "peak": one.peak_velocity,
               "sticks": False}
              for one in run.slip_events]  # fmt: skip
    course = {"events": events, "status": "done", "end": run.end, "at": 10.0,
              "contacts": [{"name": "", "v": [1.0], "floor": 0.0}]}  # fmt: skip
    told = page("plain").script("outcome(course, { ...data, area: null })", course=course)
    assert written(run.sentence.partition(" (")[0]) in written(told)
    assert ("and no more after" in told) == (until == 200)


def test_a_drop_on_a_body_that_turns_is_a_torque_as_in_python():
    rig = ss.read_rig("examples/machines/telescope.toml")
    there, (name,) = Edges(rig), rig.contacts
    last = ContactSlip(name, 2.0, 2.5, 0.5, 1e-4, 300.0, 1e-3, 2.1, 1.0, 0, np.nan)
    event = {"contact": name, "begin": last.begin, "end": last.end, "slip": last.slip, "drop": last.force_drop,
             "every": last.recurrence, "rings": [], "peak": last.peak_velocity, "sticks": True}  # fmt: skip
    (at,) = there.data["levers"]
    lever = there.home[there.names.index(f"contacts.{name}.radius")]
    assert at == f"contacts.{name}.radius"
    course = {"events": [event], "status": "done", "end": 3.0, "at": 1.0,
              "contacts": [{"name": name, "v": [1.0], "floor": 0.0, "lever": lever}]}  # fmt: skip
    told = there.script("outcome(course, data)", course=course)
    (sentence,) = sentences(rig, [Arrest(name)], [last]).values()
    assert written(f"torque drop {300 * lever:.4g} N m; {name} {sentence}") in written(told)


class Arrest:
    """Moment at which a contact is arrested between two slips."""

    kind, time = "arrest", 1.5

    def __init__(self, contact):
        self.contact = contact


SOURCE = Path(ss.__file__).parent
MANY = 5  # words in a row that make a sentence
NAMES = {
    "of the normal force at", "push of the load point", "step of the normal force", "step of the normal stress",
    "stiffness over critical k k", "a number with a unit", "in the unit that its",
}  # fmt: skip
"""Names of things, which both may have, and turns of phrase."""


def phrases(text):
    """All of its runs of `MANY` words that no punctuation parts."""
    words = re.findall(r"[A-Za-z']+|[.;:,]", text)
    runs = [words[i : i + MANY] for i in range(len(words) - MANY + 1)]
    return {" ".join(run).lower() for run in runs if all(word[0].isalpha() for word in run)} - NAMES


def strings_of_python(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    docs = {id(one.value) for one in ast.walk(tree) if isinstance(one, ast.Expr)}
    texts = (one for one in ast.walk(tree) if isinstance(one, ast.Constant) and id(one) not in docs)
    return [one.value for one in texts if isinstance(one.value, str)]


def strings_of_a_page(path):
    code = re.sub(r"/\*.*?\*/|(?<![:\"'`])//[^\n]*", "", path.read_text(encoding="utf-8"), flags=re.S)
    texts = re.findall(r'"([^"\n]*)"|`([^`]*)`', code)
    return [part for plain, template in texts for part in re.split(r"\$\{[^}]*\}", plain or template)]


def test_no_sentence_is_written_in_python_and_again_in_the_modules_of_a_page():
    known = defaultdict(set)
    for path in SOURCE.rglob("*.py"):
        for text in strings_of_python(path):
            for phrase in phrases(text):
                known[phrase].add(path.relative_to(SOURCE).as_posix())
    web = list((SOURCE / "explorer" / "web").glob("*.js"))
    twice = {
        (path.name, phrase, *known[phrase])
        for path in web
        for text in strings_of_a_page(path)
        for phrase in phrases(text)
        if phrase in known
    }
    assert len(known) > 5e3
    assert len(web) > 20
    assert not twice, "pass it as page data, as `page_reasons` is passed"


def test_powers_of_ten_are_written_as_in_documents_and_can_be_typed():
    """The page had −1.001e5 where the report has −1.001 × 10⁵."""
    page = Script(page_modules())
    for value, text in ((-100_123.0, "−1.001 × 10⁵"), (3.2e-7, "3.2 × 10⁻⁷"), (1e21, "1 × 10²¹")):
        assert page("digits(value)", value=value).replace("\u00a0", " ") == text
        assert page("parse(`${digits(value)} m`, 'm', 'm')", value=value) == float(f"{value:.4g}")
    assert typographic("-1.001e+05 1/s") == "−1.001 × 10⁵ 1/s"
