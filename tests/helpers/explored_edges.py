"""Edges of a page beside Python's: the modules of a page in V8, without a document."""

import json
from importlib.resources import files

import steadyslip as ss
from javascript import Script
from steadyslip.explorer.assembly import MODULES, _data
from steadyslip.explorer.equations import linear_part
from steadyslip.kernels.printers import javascript
from steadyslip.linear.boundary import present_zeros
from steadyslip.linear.status import STABLE, UNSTABLE, on_edge, status
from steadyslip.model.point import operating_point

NEAR = 0.3  # share of a value within which no edge may be missing or invented
SHARE = 1e-6  # of a value: the same edge

_ASK = """
const rig = new Rig(data, programs);
function edgesAt(values, coarse) {
  rig.values = values;
  const found = data.parameters.map((_, i) => changes(rig, i, undefined, coarse));
  const page = { rig, found, answer: rig.assess(), rounded: Page.prototype.rounded, with: Page.prototype.with };
  const edges = edgesOf(page).map((edge) => ({ ...edge, words: beyondWords(edge, page) }));
  return { found, edges, status: page.answer.status };
}
"""


class Edges:
    """Results of the page of a rig at given values: edges of all parameters, and the list of nearest edges."""

    def __init__(self, rig):
        self.rig = rig
        text, facts = linear_part(rig)
        self.data = _data(rig, "rig", 0, facts, "")
        self.names = [one["name"] for one in self.data["parameters"]]
        self.home = [one["value"] for one in self.data["parameters"]]
        web = files("steadyslip.explorer.web")
        modules = [web.joinpath(f"{name}.js").read_text(encoding="utf-8") for name in MODULES]
        whole = javascript.as_script(javascript.runtime(), *modules)
        self.script = Script(f"{whole}\nconst programs = {text}, data = {json.dumps(self.data)};\n{_ASK}")

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
    point = operating_point(rig, None, present_zeros(rig))
    found = int(status(point))
    return found, found in (STABLE, UNSTABLE) and bool(on_edge(point))


def other_edges(page, values):
    """Differences of the page from Python at some values, in words, and its list of nearest edges."""
    own, told, wrong = page.own(values), page(values), []
    now, rounding = judged(own)
    for name, value, found in zip(page.names, values, told["found"], strict=True):
        here = next((one["above"] for one in found["edges"][::-1] if one["at"] < value), found["status"])
        if here != now and not rounding:
            wrong.append(f"the track of {name} has {here} at its own value for {now}")
    listed = {page.names[one["i"]]: one["at"] for one in told["edges"]}
    for margin in ss.margins(own):
        if margin.parameter in page.names:
            theirs, mine = margin.edge and margin.edge.value, listed.get(margin.parameter)
            size = max(abs(margin.value), 0.1) if margin.unit == "rad" else abs(margin.value)
            near = [one for one in (theirs, mine) if one is not None and abs(one - margin.value) <= NEAR * size]
            if near and (theirs is None or mine is None or abs(theirs - mine) > SHARE * size):
                wrong.append(f"{margin.parameter} = {margin.value!r}: {mine} for {theirs}")
    wrong += [f"no words: {one}" for one in told["edges"] if not one["words"] or "undefined" in one["words"]]
    return wrong, told["edges"]


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
        wrong += [f"after {page.names[edge['i']]} -> {edge['at']}: {one}" for one in found]
    return wrong
