"""Verdict, sentences and edges of pages beside Python's: the modules of a page in V8, without a document.

    python tests/helpers/explored_edges.py 100 1              # 100 settings, seed 1, in V8
    python tests/helpers/explored_edges.py 20 1 --browser     # and every listed edge pressed in Chromium

Settings are those of the pages of all examples, of sliders with any laws (users' too) and of random machines; each is
read at values drawn at random and where listed edges were pressed. Printed is every difference, and how many settings,
edges and refusals there were.
"""

import argparse
import json
import math
import re
import tempfile
import time
import warnings
from functools import cache
from itertools import product
from pathlib import Path

import numpy as np

import steadyslip as ss
import users_laws
from browser import chromium, driver
from explored import page_modules
from explored_pages import Visit
from javascript import Script
from machines import at_random
from rigs_of_theory import CONTACTS, LAWS, V0, rig
from steadyslip.core.format import typeset
from steadyslip.core.written import display_units
from steadyslip.explorer.assembly import _data
from steadyslip.explorer.equations import linear_part
from steadyslip.linear.status import ABSENT, STABLE, UNDAMPED, UNSTABLE, on_edge, status
from steadyslip.model.point import operating_point
from steadyslip.verdict.causes import ILL_POSED, why_always_stable, why_never_stable
from steadyslip.verdict.words import edge_rows, headline, is_undecided

EXAMPLES = Path(__file__).parents[2] / "examples"
NEAR = 0.3  # share of a value within which no edge may be missing or invented
SHARE = 1e-6  # of a value: the same edge

_ASK = """
const rig = new Rig(data, programs);
function edgesAt(values, coarse) {
  rig.values = values;
  const found = data.parameters.map((_, i) => changes(rig, i, undefined, coarse));
  const page = { rig, found, answer: rig.assess(), rounded: Page.prototype.rounded, with: Page.prototype.with };
  const texts = ({ i, at }) => [values[i], at].map((x) => told(data.parameters[i], x, apart(values[i], at)));
  const edges = edgesOf(page).map((edge) => ({ ...edge, words: edgeWords(edge, page), told: texts(edge) }));
  const { answer } = page, banner = { data, page }, { told: full, speed } = Banner.prototype;
  const first = answer.status === UNKNOWN ? "" : headline(answer, speed.call(banner, answer), data);
  const why = data.phrases ? full.call(banner, answer, edges[0]) : reason(answer, data);
  return {
    found, edges, status: answer.status, onEdge: answer.onEdge, headline: first, reason: why,
    growth: answer.illPosed ? Infinity : answer.eigenvalues[0]?.re ?? null,
  };
}
"""


class Edges:
    """Results of the page of a rig at given values: edges of all parameters, and the list of nearest edges.

    With the `file` of the rig the page tells values in its units.
    """

    def __init__(self, rig, file=None):
        self.rig = rig
        text, facts = linear_part(rig)
        self.data = _data(rig, "rig", 0, facts, "" if file is None else file.read_text(encoding="utf-8"))
        self.names = [one["name"] for one in self.data["parameters"]]
        self.home = [one["value"] for one in self.data["parameters"]]
        self.script = Script(f"{page_modules()}\nconst programs = {text}, data = {json.dumps(self.data)};\n{_ASK}")

    def __call__(self, values, coarse=False):
        """`found` of each parameter, `edges` as listed with their words, and the `status`."""
        return self.script("edgesAt(values, coarse)", values=list(values), coarse=coarse)

    def own(self, values):
        """The rig of Python with the values of a page."""
        return self.rig.with_values(dict(zip(self.names, values, strict=True)))

    def allowed(self, i, value):
        return self.script("inside(data.parameters[i], value)", i=i, value=value)

    def at_random(self, chance):
        """Values of which up to three are changed, by a factor of two or so."""
        values = list(self.home)
        for i in chance.choice(len(values), min(len(values), int(chance.integers(0, 4))), replace=False):
            other = values[i] * float(10 ** chance.normal(0, 0.3))
            if self.allowed(int(i), other):
                values[i] = other
        return values


def judged(rig):
    """Status of a rig in Python, and whether rounding decides on it."""
    point = operating_point(rig, None, rig.kept_zeros())
    found = int(status(point))
    return found, found in (STABLE, UNSTABLE) and bool(on_edge(point))


def in_python(found, is_machine):
    """First line and reason of an analysis as a page writes them: without causes, which it does not have."""
    why = found.reason
    if found.stable is not None and not is_machine:
        why = why.removesuffix(why_always_stable(found) or ":").removesuffix(why_never_stable(found) or ":")
        why = ILL_POSED if found.growth_rate == math.inf else why
    return [written(text) for text in (headline(found, capitals=False), f"{why[0].upper()}{why[1:]}.")]


def written(text):
    """Text with the typography of pages, but for signs and powers of ten, which are those of computers: 2e5."""
    plain = re.sub(r"\s×\s10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", lambda found: f"e{found[1].translate(_POWERS)}", typeset(text))
    return plain.replace("−", "-")


_POWERS = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")


def same_text(mine, theirs):
    """True for equal texts, but for the last of four digits: halves are rounded up in JavaScript, to even in Python."""
    mine, theirs = ([one, ""] if one[:1].isalpha() else one.split(" ", 1) for one in (written(mine), written(theirs)))
    if mine == theirs or mine[1:] != theirs[1:]:
        return mine == theirs
    return math.isclose(float(mine[0]), float(theirs[0]), rel_tol=1.001e-3)


def other_edges(page, values):
    """Differences of the page from Python at some values, in words, and its list of nearest edges."""
    own = page.own(values)
    with display_units(own.written_in):
        return _other_edges(page, values, own)


def _other_edges(page, values, own):
    """The same, told in the units of the rig's file."""
    told, wrong = page(values), []
    found = ss.analyze(own)
    if is_undecided(found):
        return wrong, told["edges"]
    undamped = found.undamped and found.on_edge
    now = ABSENT if found.stable is None else STABLE if found.stable else UNDAMPED if undamped else UNSTABLE
    if (now, found.on_edge) != (told["status"], told["onEdge"]):
        wrong.append(f"status {told['status']}, on edge {told['onEdge']} for {now}, {found.on_edge}")
    growth = found.growth_rate
    if growth is not None and now != ABSENT and not found.on_edge:
        mine = told["growth"]
        if mine is None or not np.isclose(mine, growth, rtol=SHARE, atol=0):
            wrong.append(f"growth {mine} for {growth}")
    for name, value, along in zip(page.names, values, told["found"], strict=True):
        here = next((one["above"] for one in along["edges"][::-1] if one["at"] < value), along["status"])
        if here != now and ((undamped and value) or not found.on_edge):
            wrong.append(f"the track of {name} has {here} at its own value for {now}")
    wrong += other_lists(page, found, told["edges"])
    is_machine = isinstance(own, ss.Machine)
    sentences = list(zip((told["headline"], told["reason"]), in_python(found, is_machine), strict=True))
    wrong += [f"{mine!r} for {theirs!r}" for mine, theirs in sentences[is_machine:] if written(mine) != theirs]
    return wrong, told["edges"]


def other_lists(page, found, edges):
    """Differences of the list of nearest edges from that of an analysis: places, words, values and order."""
    listed, wrong = {page.names[one["i"]]: one for one in edges}, []
    order = []
    for margin in found.margins:
        if margin.parameter not in page.names:
            continue
        theirs, mine = margin.edge and margin.edge.value, listed.get(margin.parameter)
        size = max(abs(margin.value), 0.1) if margin.unit == "rad" else abs(margin.value)
        places = [one for one in (theirs, mine and mine["at"]) if one is not None]
        if not any(abs(one - margin.value) <= NEAR * size for one in places):
            continue
        if len(places) < 2 or abs(places[0] - places[1]) > SHARE * size:
            wrong.append(f"{margin.parameter} = {margin.value!r}: {mine and mine['at']} for {theirs}")
            continue
        order.append(margin.parameter)
        _, value, edge, _, words = map(written, edge_rows(found, margin)[0])
        second, other = next((edge.value for edge in margin.about[1:]), math.nan), mine.get("other", math.nan)
        near = any(abs(one - margin.value) <= NEAR * size for one in (second, other))
        if near and not abs(second - other) <= SHARE * size:
            wrong.append(f"{margin.parameter}: the other edge {other} for {second}")
        texts = [*mine["told"], mine["words"]]
        if not all(map(same_text, texts, (value, edge, words))):
            wrong.append(f"{margin.parameter}: {texts} for {[value, edge, words]}")
    mine = [page.names[one["i"]] for one in edges if page.names[one["i"]] in order]
    if mine != order:
        wrong.append(f"the order {mine} for {order}")
    return wrong + [f"no words: {one}" for one in edges if not one["words"] or "undefined" in one["words"]]


def walked(page, chance, presses):
    """Differences at values drawn at random, and behind edges of the list that are pressed one after the other."""
    values = page.at_random(chance)
    wrong, edges = other_edges(page, values)
    for _ in range(presses):
        if not edges:
            break
        edge = edges[int(chance.integers(len(edges)))]
        values = [edge["landing"] if i == edge["i"] else one for i, one in enumerate(values)]
        found, edges = other_edges(page, values)
        wrong += [f"after {page.names[edge['i']]} -> {edge['at']!r}: {one}" for one in found]
    return wrong


def read_in_browser(visit):
    """First line, reason and list of nearest edges (name, text) of a page that is open."""
    rows = visit.page.locator(".edges li")
    listed = rows.evaluate_all("all => all.map((one) => [one.firstChild.dataset.name, one.textContent])")
    return visit.sentence(), visit.reason(), dict(listed)


def pressed(page, chance, browser, file):
    """Differences of a page in a browser from V8 and from Python, at values drawn at random, each listed edge pressed.

    Returns them in words, and how many edges were pressed.
    """
    home = page.at_random(chance)
    wrong, edges = other_edges(page, home)
    ss.explore(page.rig).save(file)
    changed = [
        f"{name}={value!r}" for name, value, own in zip(page.names, home, page.home, strict=True) if value != own
    ]
    with Visit(browser, file, f"#{'&'.join(changed)}") as visit:
        for edge in [None, *edges]:
            values = home
            if edge is not None:
                name = page.names[edge["i"]]
                values = [edge["landing"] if i == edge["i"] else one for i, one in enumerate(home)]
                visit.page.locator(f'.edges button[data-name="{name}"]').evaluate("one => one.click()")
                wrong += [f"after {name} -> {edge['at']!r}: {one}" for one in other_edges(page, values)[0]]
            wrong += [
                f"in the browser at {values}: {one}" for one in _other_texts(page(values), page, read_in_browser(visit))
            ]
            if values != home:
                visit.page.get_by_role("button", name="undo").click()
        if "undefined" in visit.page.inner_text("body"):
            wrong.append("undefined in the browser")
    return wrong, len(edges)


def _other_texts(told, page, seen):
    """Texts of a page in V8 that are not in the browser."""
    first, why, listed = seen
    texts = {page.names[one["i"]]: (one["told"][1].replace(" ", "\xa0"), one["words"]) for one in told["edges"]}
    reason = told["reason"].replace("\xa0", " ")  # as the browser gives the text that it shows
    wrong = [] if first == told["headline"] and why.startswith(reason) else [f"{first} {why} for {told}"]
    wrong += [] if texts.keys() == listed.keys() else [f"edges of {sorted(listed)} for {sorted(texts)}"]
    for name in texts.keys() & listed.keys():
        wrong += [f"{name}: {text!r} not in {listed[name]!r}" for text in texts[name] if text not in listed[name]]
    return wrong


PAGES = sorted(path for path in EXAMPLES.glob("*.toml") if path.stem != "hunting-axis")
PAGES += sorted(EXAMPLES.glob("machines/*.toml"))
SLIDERS = list(product(LAWS.values(), (*CONTACTS, users_laws.CONTACT), (0.0, 1e6)))
DRIVES = ss.machine.SteadyDrive(V0), ss.machine.PD(V0, kp=2e10, kd=1e9), ss.machine.PID(V0, kp=2e10, kd=1e9, ki=1e9)


@cache
def example(path):
    return Edges(ss.read_rig(path), Path(path))


def drawn(chance):
    """Page of an example, of a slider of any laws or of a random machine, with a name for it."""
    which = chance.integers(3)
    if which == 0:
        path = PAGES[int(chance.integers(len(PAGES)))]
        return path.stem, example(path)
    if which == 1:
        law, contact, mass = SLIDERS[n := int(chance.integers(len(SLIDERS)))]
        area = 0.01 if chance.random() < 0.3 else None
        drive = DRIVES[m := int(chance.integers(len(DRIVES)))]
        made = rig(friction=law, contact=contact, mass=mass, stiffness=9e9, area=area, drive=drive)
        return f"slider {n}, drive {m}, area {area}", Edges(made)
    seed = int(chance.integers(10**6))
    return f"machine {seed}", Edges(at_random(seed)[0])


def campaign(many, seed, presses, browser):
    """Print every difference; how many settings were read, edges pressed, and pages refused in words."""
    chance = np.random.default_rng(seed)
    counts = dict.fromkeys(("settings", "pressed", "other", "refused"), 0)
    folder = Path(tempfile.mkdtemp())
    for _ in range(many):
        name = ""
        try:
            name, page = drawn(chance)
            if browser:
                found, count = pressed(page, chance, browser, folder / "rig.html")
            else:
                found, count = walked(page, chance, presses), presses
        except ss.NotAvailable as refused:
            counts["refused"] += 1
            print(f"{name}: refused, {str(refused)[:150]}", flush=True)
            continue
        counts["settings"] += 1
        counts["pressed"] += count
        counts["other"] += bool(found)
        for one in found:
            print(f"{name}: {one}", flush=True)
        if counts["settings"] % 10 == 0:
            print(counts, f"{time.process_time():.0f} CPU s", flush=True)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("many", type=int)
    parser.add_argument("seed", type=int)
    parser.add_argument("--presses", type=int, default=1, help="listed edges pressed one after the other")
    parser.add_argument("--browser", action="store_true", help="every listed edge is pressed, in Chromium")
    given = parser.parse_args()
    warnings.simplefilter("error")
    if given.browser:
        with driver() as playwright:
            opened = playwright.chromium.launch(executable_path=chromium(), args=["--no-sandbox"])
            campaign(given.many, given.seed, given.presses, opened)
    else:
        campaign(given.many, given.seed, given.presses, None)
