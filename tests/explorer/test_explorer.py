"""The explorer: its equations say in JavaScript what they say in Python, and its page holds what it promises."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
import sympy as sp
from hypothesis import assume, given, settings, strategies as st

import steadyslip as ss
from explored import Explored, compared, library, page_modules
from fuzz_rigs import DRIVES, FRICTION
from javascript import Script
from moved import motion_text
from rigs_of_theory import CONTACTS, ONE_MEMORY, SIGMA, V0, rate_state, rig
from steadyslip.core.dimensions import unit
from steadyslip.core.quantities import parse
from steadyslip.explorer.assembly import page_parts
from steadyslip.explorer.equations import _stable_set_programs, _verdict_values, linear_part
from steadyslip.explorer.minify import minify, minify_generated, share_numbers, shorten_names
from steadyslip.explorer.motion import OPTIONS, driver, motion_part
from steadyslip.explorer.programs import program
from steadyslip.explorer.variables import shorten_variables
from steadyslip.kernels.layout import Setting
from steadyslip.kernels.printers import javascript
from steadyslip.linear import crossing
from steadyslip.linear.polynomials import is_hurwitz, stable_set
from steadyslip.linear.roots import roots
from steadyslip.model.point import operating_point
from steadyslip.model.posed import well_posed
from steadyslip.model.reducing import reduce_model
from steadyslip.model.scales import natural_scales
from steadyslip.model.weights import eliminable
from steadyslip.motion.jobs import prepare
from users_laws import USERS, Turning

BAR = 1e-12


# -- polynomials

NUMBERS = st.floats(-3, 3, allow_nan=False, allow_subnormal=False)


@pytest.fixture(scope="module")
def script():
    return Script(library())


@settings(max_examples=60, deadline=None)
@given(real=st.lists(NUMBERS, max_size=3), pairs=st.lists(st.tuples(NUMBERS, st.floats(0.01, 3)), max_size=2))
def test_roots_are_those_that_a_polynomial_was_made_of(script, real, pairs):
    """Backward stable: the coefficients of the roots found are those given, to some units of the last place."""
    made = [*real, *(complex(a, b) for a, b in pairs), *(complex(a, -b) for a, b in pairs)]
    assume(all(abs(a - b) > 0.3 for i, a in enumerate(made) for b in made[:i]))
    c = np.atleast_1d(np.poly(made)).real[::-1]
    found = script("roots(c)", c=c)
    assert len(found) == len(c) - 1
    numbers = np.array([complex(s["re"], s["im"]) for s in found])
    again = np.atleast_1d(np.poly(numbers))[::-1]
    tiny = np.finfo(float).tiny  # below which numbers have fewer digits
    assert np.all(np.abs(again - c) <= 1e-12 * np.atleast_1d(np.poly(-np.abs(numbers))).real[::-1] + tiny)
    assert all(s["im"] == 0 or any(t["im"] == -s["im"] and t["re"] == s["re"] for t in found) for s in found)


def polynomial_programs(n, spare):
    """A Linear whose equations are two polynomials p and q of n + 1 coefficients, in the record R."""
    names = sp.symbols(f"c:{2 * n + 2}")
    model = SimpleNamespace(arguments=names)
    whole = program(model, "coefficients", names[: n + 1], then=lambda c: _verdict_values(c, spare, spare))
    several = _stable_set_programs(n, spare)
    text = "".join(javascript.text(one) for one in (whole, *several))
    facts = {"parameters": list(map(str, names)), "degree": n, "squares": len(several[0].stores) - 2, "closed": False,
             "contacts": [""], "searched": [False], "joint": False, "observed": []}  # fmt: skip
    return f"{text}const own = new Linear({{ coefficients, edges, onAxis, stableAt }}, {json.dumps(facts)});"


@pytest.mark.parametrize(("n", "spare"), [(2, 1), (3, 1), (4, 1), (5, 1), (4, 2), (5, 3)])
def test_polynomials_are_judged_as_in_python(n, spare):
    """Also where up to `spare` highest coefficients are zero, as without mass and damping."""
    rng = np.random.default_rng(n)
    script = Script(f"{library()}\n{polynomial_programs(n, spare)}")
    for _ in range(40):
        p, q = 10.0 ** rng.uniform(-4, 4, (2, n + 1)) * rng.choice([1, 1, 1, -1], (2, n + 1))
        q[n] = 0.0
        if rng.random() < 0.3 * spare:
            lost = n - int(rng.integers(spare))
            p[lost:] = q[lost:] = 0.0
        judged = script("own.set(all).ask('coefficients', n + 3).slice(n + 1)", all=[*p, *q], n=n)
        assert judged == [bool(is_hurwitz(p, spare)), bool(crossing.is_ill_posed(p, spare))]
        mine = np.array([complex(s["re"], s["im"]) for s in script("roots(p)", p=p)])
        truth = roots(p)
        truth = truth[np.isfinite(truth)]
        truth = truth[np.lexsort((-truth.imag, -truth.real))]
        assert np.all(np.abs(mine - truth) <= BAR * np.abs(truth))
        found, expected = script("own.stableSet(p, q)", p=p, q=q), stable_set(p, q, spare)
        intervals = np.array([[one["low"], one["high"]] for one in found["intervals"]]).reshape(-1, 2)
        kept = expected.intervals[np.isfinite(expected.intervals[:, 0])]
        assert np.allclose(intervals, kept, rtol=1e-10, atol=0)


@pytest.mark.parametrize("middle", [-1.0, -1e-6, 2e5])
def test_double_roots_keep_their_digits(script, middle):
    """Two equal roots beside a fast one: to half the digits only, were each found by itself."""
    c = np.poly([middle, middle, -1e3 * abs(middle)])[::-1]
    found = script("roots(c)", c=c)
    near = [s for s in found if abs(s["re"] / middle - 1) < 0.1]
    assert len(near) == 2
    assert all(abs(complex(s["re"], s["im"]) / middle - 1) < 1e-7 for s in near)
    assert abs((near[0]["re"] + near[1]["re"]) / (2 * middle) - 1) < 1e-12


# -- the verdict

ALL = [(f, c, m, d) for f in range(len(FRICTION)) for c in range(len(CONTACTS)) for m in (0.0, 1e6) for d in range(3)]
SAMPLE = [ALL[i] for i in np.random.default_rng(16).permutation(len(ALL))[:14]]


def agrees(apart):
    assert apart.verdicts[0] == apart.verdicts[1]
    assert apart.critical <= BAR
    assert apart.ends <= BAR
    assert apart.eigenvalues <= BAR


@pytest.mark.parametrize(("law", "contact", "mass", "drive"), SAMPLE)
def test_verdicts_are_those_of_python(law, contact, mass, drive):
    own = ss.Slider(friction=FRICTION[law], contact=CONTACTS[contact], stiffness=9e9, mass=mass, drive=DRIVES[drive])
    explored = Explored(own)
    for factor in (1.0, 0.01, 100.0):
        agrees(compared(explored, own.with_values({"stiffness": 9e9 * factor})))


def test_without_a_spring_both_say_whether_anything_grows():
    """One root is zero; weakening by velocity (b > a) makes another grow, strengthening leaves the place neutral."""
    own = rig(stiffness=0.0, radiation_damping=0.0).with_values({"a": 0.01, "b": 0.02})
    explored = Explored(own)
    for b, (status, edge) in ((0.02, (2, False)), (0.005, (2, True))):
        apart = compared(explored, own.with_values({"b": b}))
        agrees(apart)
        assert apart.verdicts[0][:2] == (status, edge)


@pytest.mark.parametrize("who", USERS)
def test_verdicts_on_users_laws_are_those_of_python(who):
    explored = Explored(USERS[who])
    for factor in (1.0, 0.01, 100.0):
        agrees(compared(explored, USERS[who].with_values({"stiffness": 9e9 * factor})))


def test_where_there_is_no_steady_sliding_it_says_so():
    locked = rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-1.0))
    found = Explored(locked)(locked)
    assert found["status"] == 0
    assert found["slope"] > 1
    agrees(compared(Explored(locked), locked))


def test_conditions_between_numbers_are_checked():
    crank = rig(contact=ss.laws.SliderCrank(preload=SIGMA, crank_angle=1.0, crank_radius=0.1, rod_length=0.3))
    explored = Explored(crank)
    place = json.loads(json.dumps(linear_part(crank)[1]))["parameters"].index("contact.rod_length")
    explored(crank)
    values = explored.script("Array.from(linear.R)")[:-1]
    values[place] = 0.05
    assert explored.script("linear.set(values).status()", values=values) == 3


def test_what_cannot_be_printed_is_refused_in_words():
    with pytest.raises(ss.NotAvailable, match=r"atan\(\.\.\.\)"):
        linear_part(rig(contact=Turning(preload=SIGMA)))


def test_variables_of_modules_are_shortened_and_nothing_else():
    """Properties, keys, methods, fields and text keep their names, of variables those in use elsewhere."""
    own = "const LIMIT=3;const sizes=(many,{length,kept=2})=>[...many,LIMIT,{kept,class:many.length,sizes(){}}];"
    own += "class Box{kept=LIMIT;get sizes(){return this.kept}async measured(text){return{sizes,text}}}\n"
    own += "for(const{kept}of known){const text=`kept ${sizes([LIMIT,{kept}])[0]} {text} ${kept}`;"
    own += "({kept:text,Box}=kept?.text)}"
    assert shorten_variables(own, {"known"}) == (
        "const b=3;const e=(d,{length:g,kept:a=2})=>[...d,b,{kept:a,class:d.length,sizes(){}}];"
        "class f{kept=b;get sizes(){return this.kept}async measured(c){return{sizes:e,text:c}}}\n"
        "for(const{kept:a}of known){const c=`kept ${e([b,{kept:a}])[0]} {text} ${a}`;({kept:c,Box:f}=a?.text)}"
    )


def test_shortened_code_says_the_same():
    """Comments, types and spaces go; what is within a line of code, and text in quotes, stays."""
    text = (
        "const a = 1; // one\n"
        '  /** @type {any} */ const b = "// @ /** x */";\n'
        "/**\n * Many\n * lines.\n */\n"
        "let c = (/** @type {any} */ (b)).d;\n"
    )
    assert minify(text) == 'const a=1;const b="// @ /** x */";let c=((b)).d;'
    nested = "const t = `a ${b ? `- ${c} ` : \" ; \"} , d`, r = e.replace(/ , \\//g, ' - ') + + 1 - -f;\n"
    assert minify(nested) == "const t=`a ${b?`- ${c} `:\" ; \"} , d`,r=e.replace(/ , \\//g,' - ')+ +1- -f;"
    sums = "    var t2 = ((R[0] * x) + R[1]);\n    var t3 = ((t2 - (x * x)) < (t2 * (x + 1)));\n"
    assert minify_generated(sums) == "var t2=R[0]*x+R[1],t3=t2-x*x<(t2*(x+1));"
    negative = "    var t1 = R[0] + (-R[1]) * x + (-1.0);\n    var t2 = (-x) - 20.0;\n"
    assert minify_generated(negative) == "var t1=R[0]-R[1]*x-1,t2=-x-20;"
    generated = "function f(R, x, y) {\n    var t1 = R[0] - (-2.5e-07);\n    y[0] = (t1 >= 0) ? t1 : (1 / x);\n}\n"
    assert minify_generated(generated) == "function f(R,x,y){var t1=R[0]-(-2.5e-07);y[0]=(t1>=0)?t1:1/x;}\n"


def test_names_of_generated_code_are_as_short_as_may_be():
    """Those that others know, and what JavaScript has, keep theirs; numbers with exponents hold no names."""
    text = "function far(R, x, y) {\nvar t1 = R[0], t20 = log(t1) - 1e-7;\ny[0] = Math.abs(t20 * t1) + t20;\n}\n"
    short = "function far(c, e, d) {\nvar a = c[0], b = log(a) - 1e-7;\nd[0] = Math.abs(b * a) + b;\n}\n"
    assert shorten_names(text, {"far", "log"}) == short


def test_long_numbers_that_functions_share_are_written_once():
    number = "1.221224509226641"
    text = f"(() => {{\nfunction f(R, x, y) {{\ny[0] = {' + '.join(4 * [number])} + 2.5;\n}}\n}})()"
    once = share_numbers(text)
    assert once.count(number) == 1
    script = Script(f"const y = [0]; ({once.replace('function f', 'return function f')})(0, 0, y)")
    assert script("y[0]") == sum(4 * [float(number)]) + 2.5
    assert share_numbers(text.replace("+ 1.2", "- 0.2", 1)).count(number) == 3, "few are as they were"


def test_no_two_parameters_of_a_part_are_called_the_same():
    own = next(one for one in FRICTION if len(getattr(one, "states", ())) > 1)
    known = page_parts(rig(friction=own), "A rig", 0)[1]["parameters"]
    called = [(one["name"].partition(".")[0], one["title"]) for one in known]
    assert len(set(called)) == len(called)
    titles = {"direct effect a", "evolution effect b₁", "evolution effect b₂"}
    assert {("friction", title) for title in titles} <= set(called)


# -- links and files

OWN = rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5), stiffness=9e9)
TEXT = st.text(max_size=200) | st.lists(
    st.tuples(st.sampled_from(["friction.a", "contact.angle", "slider.stiffness", "__proto__", "constructor", "a=b"]),
              st.text(max_size=20) | st.floats().map(repr)).map("=".join), max_size=5).map("&".join)  # fmt: skip


@pytest.fixture(scope="module")
def page_of_own():
    """The Rig of a page, as it is on the page."""
    known = page_parts(OWN, "A rig", 0)[1]
    return scripted(OWN, known), known


def scripted(own, known):
    made = f"const known = {json.dumps(known)};\nconst rig = new Rig(known, programs);"
    return Script(f"{page_modules()}\nconst programs = {linear_part(own)[0]};\n{made}")


@settings(max_examples=60, deadline=None)
@given(text=TEXT)
def test_links_bring_only_what_a_rig_may_have(page_of_own, text):
    """Whatever stands in an address: numbers of the rig's own parameters, inside their domains, or nothing at all."""
    script, known = page_of_own
    values = script("rig.fromHash('#' + text).values", text=text)
    names = [one["name"] for one in known["parameters"]]
    assert len(values) == len(names)
    OWN.with_values(dict(zip(names, values, strict=True)))  # raises where a value is not allowed
    said = [part.split("=") for part in text.split("&") if re.fullmatch(r"[^=]+=-?\d[\d.eE+-]*", part)]
    for one, value in zip(known["parameters"], values, strict=True):
        if value != one["value"]:
            assert float(value) in [float(number) for name, number in said if name == one["name"]]


@settings(max_examples=60, deadline=None)
@given(a=st.floats(1e-4, 1), k=st.floats(1e6, 1e13), psi=st.floats(-0.9, 1.4))
def test_links_and_files_keep_every_digit(page_of_own, a, k, psi):
    """The critical stiffness of the file that a page writes is that of its values, and a link brings all of them."""
    script, known = page_of_own
    own = OWN.with_values({"friction.a": a, "slider.stiffness": k, "contact.angle": psi})
    values = [float(own.value(one["name"])) for one in known["parameters"]]
    link, text = script("(rig.values = values, [rig.hash().slice(1), rig.toml()])", values=values)
    assert script("rig.fromHash(link)", link=link) == {"values": values, "left": []}
    again = ss.rig_from_text(text)
    assert again == own
    np.testing.assert_array_equal(ss.critical_stiffness(again), ss.critical_stiffness(own))  # NaN where there is none


WRITTEN = """[friction]   # written by hand
law = "rate-state"
a = 0.0145
b = 1.6e-2           # 0.0145 + 0.0015
d_c = "1e-3 mm"
mu_ref = 0.7
v_ref = "3.6 mm/h"
[contact]
law = "inclined-spring"
preload = 6000
angle = "-28.6 deg"
[slider]
stiffness = "9 N/um"
area = "20 cm^2"
[drive]
velocity = "86.4 mm/day"
"""


@pytest.fixture(scope="module")
def page_of_user():
    """The same of a user's file, in units of all kinds."""
    own = ss.rig_from_text(WRITTEN)
    known = page_parts(own, "A rig", 0, WRITTEN)[1]
    return scripted(own, known), known, own


VARIED = [f"friction.{name}" for name in ("a", "d_c", "v_ref")]
VARIED += ["contact.preload", "contact.angle", "slider.stiffness", "drive.velocity"]
SI = {"mm/day": "m/s", "N/um": "N/m", "deg": "rad", "cm^2": "m^2", "rpm": "rad/s", "mm/rev": "m/rad"}


@settings(max_examples=60, deadline=None)
@given(share=st.floats(0.5, 2), names=st.sets(st.sampled_from(VARIED)))
def test_files_of_users_keep_every_digit_and_every_word(page_of_user, share, names):
    """What has not changed stands there as it stood; what has, reads as it is on the page; so does what is typed."""
    script, known, own = page_of_user
    changed = own.with_values({name: share * own.value(name) for name in names})
    values = [float(changed.value(one["name"])) for one in known["parameters"]]
    text = script("(rig.values = values, rig.toml())", values=values)
    assert ss.rig_from_text(text) == changed
    for old, new in zip(WRITTEN.splitlines(), text.splitlines(), strict=True):
        assert old == new or (old.split(" = ")[0] == new.split(" = ")[0] and old.split("#")[1:] == new.split("#")[1:])
    typed = f"{share:.5g}"
    for name, si in SI.items():
        assert script("exactly(typed, size)", typed=typed, size=unit(name)[0]) == parse(f"{typed} {name}", si)
    for name in ("Nms/rad", "s/Nm", "kgcm²", "mm/Ns", "nm"):
        factor, exponents = script("unitOf(name)", name=name)
        assert (factor, tuple(exponents)) == (pytest.approx(unit(name)[0]), unit(name)[1])


# -- drawings

TURNS = """const box = { left: 60, top: 8, width: 290, height: 220 }, turns = [];
for (let i = 0; i < 200000; i++) turns.push(0.7 * i + 0.001 * Math.sin(i));
const square = straight(-1.1, 1.1), drawn = pathThrough(box, turns.map(Math.cos), turns.map(Math.sin), square, square);
const once = turns.slice(0, 9);"""


def test_a_path_that_goes_round_and_round_is_as_long_as_the_drawing_can_show():
    """Tens of thousands of turns over the same way would take a browser seconds at each repaint."""
    script = Script(f"{page_modules()}\n{TURNS}")
    path = script("drawn")
    assert len(path) < 60_000
    points = np.array([part.split() for part in re.findall(r"[\d.]+ [\d.]+", path)], dtype=float)
    angles = np.sort(np.arctan2((points[:, 1] - 118) / 100, (points[:, 0] - 205) / 131.8))
    assert np.diff(angles).max() < 0.05, "all of it is drawn"
    once = script("pathThrough(box, once.map(Math.cos), once.map(Math.sin), square, square)")
    assert once.count("M") == 1
    assert once.count("L") == 8


# -- motion

MOVING = {
    "massless": rig(stiffness=9e9, friction=rate_state(evolution=ss.laws.Aging())),
    "stick-slip": rig(friction=rate_state(evolution=ss.laws.Aging()), radiation_damping=1e4, stiffness=3e9),
    "with mass": rig(mass=1e3, stiffness=6e9),
    "controller": rig(stiffness=None, drive=ss.machine.PID(V0, kp=9e9, ki=1e8), mass=1e3),
    "regularised": rig(
        friction=ONE_MEMORY[2], contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-0.5), stiffness=1.2e10
    ),
    "solved": rig(friction=ONE_MEMORY[3], stiffness=2e10),
    "users' laws": USERS["both"].with_values({"stiffness": 2e10}),
}
DISTURBED = {
    "velocity": (2.0, ss.protocol.VelocityStep(at=1.0, to=2 * V0)),
    "push": (1e-7, ss.protocol.DisplacementStep(at=1.0, by=1e-7)),
    "normal": (2e5, ss.protocol.NormalStressStep(at=1.0, by=2e5)),
    "pull": (1e5, ss.protocol.DisturbanceStep(at=1.0, by=1e5)),
    "hold": (3.0, ss.protocol.Hold(at=1.0, duration=3.0)),
    "blow": (10.0, None),
}


def moved_on_a_page(own, kind, until, stop=""):
    """What the page's Motion makes of a disturbance, where its pauses take no time."""
    text, facts = motion_part(own, 0)
    base = f"{javascript.as_script(javascript.runtime(), driver())}\n{motion_text()}"
    made = f"new Motion({text}, {json.dumps(facts)}, {{ advance, observe }})"
    script = Script(f"{base}\nconst motion = {made};\nlet found = null;\nconst pause = async () => {{}};")
    if script.context is None:
        pytest.skip("Node starts anew for every question; this needs mini-racer")
    kept = [name for name in own.kept_zeros() if name not in facts["missing"]]
    point = operating_point(own, None, kept)
    asked = "{ disturbance: kind, size, at: 1, until }"
    run = f"motion.set(values, [sigma]).run({asked}, () => stop, pause).then((r) => (found = r))"
    asked = f"({run}, motion.refusal(kind))"
    values = [float(value) for value in point.arguments]
    assert (
        script(
            asked, values=values, sigma=float(point.sigma), kind=kind, size=DISTURBED[kind][0], until=until, stop=stop
        )
        == ""
    )
    return script("found")


@pytest.mark.parametrize("kind", [kind for kind, (_, piece) in DISTURBED.items() if piece])
@pytest.mark.parametrize("name", MOVING)
@pytest.mark.campaign
def test_a_page_moves_as_python_does(name, kind):
    """From the rig's numbers to slip events, all of it in JavaScript but the equations."""
    own, until = MOVING[name], 20.0
    found = moved_on_a_page(own, kind, until)
    runs = [ss.simulate(own, DISTURBED[kind][1], until=until, rtol=rtol) for rtol in (1e-6, 1e-9)]
    assert found["status"] == runs[0].status
    compare_runs(found, runs, until)


def compare_runs(found, runs, until):
    """Slip events and series of a page beside those of Python, whose own error the second run shows."""
    begins, exact = ([event.begin for event in run.slip_events] for run in runs)
    mine = [event["begin"] for event in found["events"]]
    assert len(mine) == len(begins) == len(exact)
    late = np.abs(np.array(begins) - exact).max(initial=0.0)
    assert np.abs(np.array(mine) - begins).max(initial=0.0) <= 10 * late + 1e-7 * until
    when = np.array([1.5, 0.3 * until, 0.6 * until])
    when = when[when < 0.99 * runs[1].end]
    for series, theirs in ((found["v"], "v"), (found["sigma"], "normal_stress"), (found["tau"], "shear_stress")):
        here = np.interp(when, found["times"], np.array(series, dtype=float))
        there = np.interp(when, runs[0]["t"], runs[0][theirs])
        truth = np.interp(when, runs[1]["t"], runs[1][theirs])
        assert np.all(np.abs(here - there) <= 10 * np.abs(there - truth) + 1e-2 * np.abs(truth))


def test_a_blow_changes_the_velocity_at_the_start():
    own, until = MOVING["with mass"], 10.0
    runs = [ss.simulate(own, until=until, rtol=rtol, initial={"v": 10 * V0}) for rtol in (1e-6, 1e-9)]
    compare_runs(moved_on_a_page(own, "blow", until), runs, until)
    with pytest.raises(AssertionError, match="needs a mass"):
        moved_on_a_page(MOVING["massless"], "blow", until)


@pytest.mark.parametrize("name", MOVING)
def test_scales_of_a_page_are_those_of_python(name):
    own = MOVING[name]
    text, facts = motion_part(own, 0)
    script = Script(f"{library()}\n{motion_text()}\nconst motion = new Motion({text}, {json.dumps(facts)}, null);")
    kept = [one for one in own.kept_zeros() if one not in facts["missing"]]
    point = operating_point(own, None, kept)
    reduction = reduce_model(point.model, eliminable(point))
    scales, _ = natural_scales(point, reduction)
    values = [float(value) for value in point.arguments]
    motion, settings = script(
        "[motion.set(values, [sigma]).scales, motion.settings]", values=values, sigma=float(point.sigma)
    )
    jobs = prepare(own, (), 1.0, {}, {}, OPTIONS)
    expected = jobs.tables(jobs.runner(1, True), 0, 1, True, True)[2][0]
    expected[Setting.GUESS] = 0.0
    np.testing.assert_allclose(settings, expected, rtol=1e-14)
    assert motion["x"] == pytest.approx(np.ravel(scales["x"])[0], rel=1e-14)
    assert motion["posed"] == bool(well_posed(point)[0])


def test_a_page_that_stops_a_motion_keeps_what_there_is():
    own = MOVING["stick-slip"]
    whole = moved_on_a_page(own, "velocity", 4000.0)
    cut = moved_on_a_page(own, "velocity", 4000.0, stop="stopped")
    assert cut["status"] == "stopped"
    assert 0 < cut["end"] < whole["end"]
    count = len(cut["events"])
    assert whole["events"][:count] == cut["events"]
    assert cut["times"] == whole["times"][: len(cut["times"])]
    assert moved_on_a_page(own, "velocity", 4000.0, stop="unwanted") is None


def test_a_push_through_a_dashpot_is_refused_as_in_python():
    own = rig(damping=1e6)
    with pytest.raises(ss.ParameterError, match="infinite force"):
        ss.simulate(own, DISTURBED["push"][1], until=2.0)
    with pytest.raises(AssertionError, match="infinite force"):
        moved_on_a_page(own, "push", 2.0)
