"""One HTML file from one rig: equations, numbers, modules and style put together; it asks for nothing from outside."""

from __future__ import annotations

import html
import json
import math
from collections.abc import Iterable, Mapping
from importlib.resources import files
from typing import Any

import numpy as np

from steadyslip.core.errors import NotAvailable
from steadyslip.core.records import Address
from steadyslip.explorer.equations import linear_part
from steadyslip.explorer.machine_sketch import machine_sketch
from steadyslip.explorer.motion import DRIVER, driver, motion_part
from steadyslip.explorer.narrow import dense, functions_of, narrow, narrow_style, renamed, shared
from steadyslip.explorer.own_file import outside_of, own_file
from steadyslip.explorer.sketch import sketch
from steadyslip.kernels.printers import javascript
from steadyslip.linear.boundary import present_zeros
from steadyslip.linear.linear_sets import linear_set
from steadyslip.linear.search import Search
from steadyslip.linear.status import STABLE, UNSTABLE, status
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.range import require_range
from steadyslip.model.sliding import ABSENT
from steadyslip.verdict.analyze import numbers_of
from steadyslip.verdict.machine import PHRASES
from steadyslip.verdict.numbers import linear_numbers
from steadyslip.verdict.reasons import page_reasons
from steadyslip.verdict.words import BEYOND, HEADLINES, REMOTE

MODULES = (
    "dom", "quantities", "polynomials", "modes", "linear", "rig", "search", "words", "plot", "chart", "edges", "banner",
    "controls", "map", "locus", "facts", "mover", "sketch", "disturbances", "course", "view", "leaving", "page",
)  # fmt: skip
"""Modules of the page, each after those that it imports."""
USUAL = {"factor": 1.0, "low": None, "high": None, "lowAllowed": False, "highAllowed": False, "whole": False}
"""What parameters are unless they say otherwise; `web/rig.js` has the same."""
LIBRARY = ("motion",)
"""Modules that a worker needs too, with the runtime and the driver: the page hands it their text."""
KEYS = ("layout", "routines", "segments")
"""Of a machine's motion, what `web/motion.js` asks for beside its programs."""
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' blob:; style-src 'unsafe-inline'; img-src data:; worker-src blob:; "
    "base-uri 'none'; form-action 'none'"
)
"""What the page may ask for: nothing but itself; workers and pictures are made of its own text."""


def page(rig: Slider | Machine, title: str, branch: int, text: str = "") -> str:
    """The text of the file; `text` is that of the file which the rig came from, if there is one."""
    return document(f"{title} – steadyslip", style(), fragment(rig, title, branch, text))


def document(title: str, styles: str, body: str) -> str:
    """A file that asks for nothing from outside."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>\nbody {{ margin: 0; }}\n{styles}</style>\n</head>\n"
        f"<body>\n{body}</body>\n</html>\n"
    )


def style() -> str:
    """The style of a `fragment`."""
    return narrow_style(_web("style.css"))


def fragment(rig: Slider | Machine, title: str, branch: int, text: str = "") -> str:
    """The explorer as a part of a document; several may be in one.

    With the `text` of the file that the rig came from, it shows values in the units of that, and saves it with its
    comments.

    Raises
    ------
    NotAvailable
        If an equation contains what cannot be printed as JavaScript, or numbers leave the range of floating point.
    """
    code, known = parts(rig, title, branch, text)
    return (
        '<div class="steadyslip-root"></div>\n'
        f'<script type="application/json" class="steadyslip-data">{safe(known)}</script>\n'
        f'<script>\n"use strict";\n(() => {{\n{code}'
        "const place = document.currentScript.previousElementSibling;\n"
        "mount(place.previousElementSibling, JSON.parse(place.textContent), programs, library);\n"
        "})();\n</script>\n"
    )


def safe(known: Mapping[str, Any]) -> str:
    """Data as JSON that may stand in a document: nothing in a rig can end the element that its data are in."""
    data = json.dumps(known, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    for letter in "<>&\u2028\u2029":
        data = data.replace(letter, f"\\u{ord(letter):04x}")
    return data


def parts(rig: Slider | Machine, title: str, branch: int, file: str = "") -> tuple[str, dict[str, Any]]:
    """The code of a page, which declares ``mount``, ``render``, ``programs`` and ``library``, and its data."""
    text, facts = linear_part(rig)
    machine, driven, moving, still = "null", "const advance = null, observe = null;", None, ""
    try:
        machine, moving = motion_part(rig, branch)
        driven = driver()
        if moving["parameters"] == facts["parameters"]:
            del moving["parameters"]  # said once
    except NotAvailable as refused:  # the verdict can be shown all the same
        still = str(refused)
    modules = [_web(f"{name}.js") for name in MODULES]
    library = [_web(f"{name}.js") for name in LIBRARY]
    script = narrow(javascript.as_script(javascript.runtime(), *modules))
    worker = narrow(javascript.as_script(javascript.runtime(), *library)) + _short(driven, DRIVER)
    known = _data(rig, title, branch, facts, file) | {
        "motion": moving,
        "still": still,
        "sketch": sketch(rig) if isinstance(rig, Slider) else machine_sketch(rig),
    }
    code = (
        f"{script}\nconst programs = {_short(text, functions_of(text))};\n"
        f"const library = () => {{\n{worker}\nconst machine = {_short(machine, {*functions_of(machine), *KEYS})};\n"
        "const begin = (facts) => new Motion(machine, facts, { advance, observe });\nreturn { begin, serve };\n};\n"
    )
    return code, known


def _short(generated: str, known: Iterable[str]) -> str:
    """Generated code, of which modules of the page know some names."""
    whole = shared(generated) if generated.startswith("(() => {") else generated
    return dense(renamed(whole, {*known, *javascript.runtime_names()}))


def _web(name: str) -> str:
    return files("steadyslip.explorer.web").joinpath(name).read_text(encoding="utf-8")


def _data(rig: Slider | Machine, title: str, branch: int, facts: Mapping[str, Any], text: str) -> dict[str, Any]:
    """Everything about a rig but its equations."""
    from steadyslip import __version__

    names = list(_varied(rig, facts))
    places = [names.index(name) if name in names else -1 for name in facts["parameters"]]
    point = operating_point(rig, None, present_zeros(rig), branch)
    axial, file = "slider.axial_stiffness", own_file(rig, names, text)
    return {
        "title": title,
        "version": __version__,
        "branch": branch,
        "area": rig.area if isinstance(rig, Slider) else None,
        "parameters": [_parameter(rig, name, branch) | file.told(name) for name in names],
        "facts": dict(facts),
        "places": places,
        "fixed": [float(np.asarray(value)) for value in point.arguments],
        "axial": names.index(axial) if axial in names else -1,
        "speed": "drive.velocity",
        "toml": file.pieces,
        **(_of_machine(rig, names, facts) if isinstance(rig, Machine) else _of_slider(rig, names)),
        "headlines": {kind: first + rest for kind, (first, rest) in HEADLINES.items() if kind != "undecided"},
        "absent": ABSENT,
        "remote": REMOTE,
        "beyond": BEYOND,
        "checks": _checks(rig, names, branch),
    }


def _of_slider(rig: Slider, names: list[str]) -> dict[str, Any]:
    """What a page says of sliders alone: the parameter of the bar, why they are stable or not."""
    return {"stiffness": _stiffness(rig, names), "reasons": page_reasons(rig)}


def _stiffness(rig: Slider, names: list[str]) -> str | None:
    """The parameter that the bar of a slider is about."""
    stiffness = "slider.axial_stiffness" if "slider.axial_stiffness" in names else rig.stiffness_name()
    return stiffness if stiffness in names else None


def _of_machine(rig: Machine, names: list[str], facts: Mapping[str, Any]) -> dict[str, Any]:
    """What a page says of machines alone: the parameter by which it is checked, areas of contacts, phrases."""
    areas = [f"contacts.{name}.area" for name in rig.contacts]
    return {
        "stiffness": _checked(rig, names),
        "areas": [facts["parameters"].index(name) if name in facts["parameters"] else -1 for name in areas],
        "phrases": {name: words for name, words in PHRASES.items() if name not in BEYOND},
    }


def _checked(rig: Machine, names: list[str]) -> str | None:
    """The first stiffness or gain that enters linearly: the page compares its stable values with Python's."""
    point = operating_point(rig)
    stiff = (name for name in rig.of_kind("stiffness") if name in names)
    return next((name for name in stiff if linear_set(point, name) is not None), None) if point.exists else None


def _varied(rig: Slider | Machine, facts: Mapping[str, Any]) -> dict[str, Address]:
    """The parameters that a page can vary: those in the equations that matter to the verdict.

    An axial stiffness stands in place of that along the sliding.
    """
    known = set(facts["parameters"])
    if isinstance(rig, Slider):
        known = known - {"slider.stiffness"} | {"slider.axial_stiffness"}
        if rig.axial_stiffness is None and rig.stiffness is not None:
            known |= {"slider.stiffness"}
    return {
        name: one
        for name, one in rig.parameters().items()
        if name in known and one.value is not None and not one.role.gauge
    }


def _parameter(rig: Slider | Machine, name: str, branch: int) -> dict[str, Any]:
    one = rig.parameters()[name]
    domain, value = one.role.domain, float(one.value or 0.0)
    factor, unit = outside_of(rig, one.role.unit)
    natural = Search(rig, name, present_zeros(rig), branch).natural_size() if value == 0 else abs(value)
    group, label = _group(rig, name)
    told = {
        "name": name,
        "group": group,
        "label": label,
        "doc": one.role.doc,
        "unit": unit,
        "factor": factor,
        "value": value,
        "natural": natural if math.isfinite(natural) else 1.0,
        "low": domain.low if math.isfinite(domain.low) else None,
        "high": domain.high if math.isfinite(domain.high) else None,
        "lowAllowed": domain.low_allowed and not (one.role.adds_state and domain.low == 0),
        "highAllowed": domain.high_allowed,
        "whole": domain.whole,
        "allowed": domain.text,
    }
    return {key: value for key, value in told.items() if key not in USUAL or value != USUAL[key]}


_MEMBERS = {"bodies": "body", "links": "link", "contacts": "contact"}


def _group(rig: Slider | Machine, name: str) -> tuple[str, str]:
    """The heading that a parameter stands below, and what it is called there."""
    kind, _, rest = name.partition(".")
    if isinstance(rig, Machine) and kind in _MEMBERS:
        member, _, own = rest.partition(".")
        return f"{_MEMBERS[kind]} {member}", own
    return kind, _label(name, rig.parameters())


def _label(name: str, names: Iterable[str]) -> str:
    """A name below the heading of its part: the last word, or all behind the part where several end so."""
    part, _, rest = name.partition(".")
    last = name.rpartition(".")[2]
    alike = [one for one in names if one.partition(".")[0] == part and one.rpartition(".")[2] == last]
    return last if len(alike) == 1 else rest


def _checks(rig: Slider | Machine, names: list[str], branch: int) -> list[dict[str, Any]]:
    """Answers of Python at the rig's own numbers and at some others, for the page to compare."""
    stiff = _stiffness(rig, names) if isinstance(rig, Slider) else _checked(rig, names)
    changes: list[dict[str, float]] = [{}]
    for name, factor in ((stiff, 0.1), (stiff, 10.0), ("drive.velocity", 3.0)):
        if name in names:
            changes.append({name: factor * float(rig.value(name) or 0.0)})
    found = []
    for change in changes:
        other = rig.with_values(change) if change else rig
        word = " and ".join(f"{name} = {value!r}" for name, value in change.items()) or "the rig itself"
        found.append({"name": word, **_answer(other, names, branch, stiff)})
    return found


def _answer(rig: Slider | Machine, names: list[str], branch: int, bar: str | None) -> dict[str, Any]:
    point = operating_point(rig, None, present_zeros(rig), branch)
    answer: dict[str, Any] = {
        "values": [float(rig.value(name) or 0.0) for name in names],
        "status": int(status(point)),
        "critical": None,
        "eigenvalues": [],
    }
    require_range(point)
    if answer["status"] in (STABLE, UNSTABLE):
        with np.errstate(all="ignore"):
            numbers = numbers_of(rig, point) if isinstance(rig, Slider) else linear_numbers(point)
        answer["critical"] = numbers.get("critical_stiffness") if isinstance(rig, Slider) else _end(rig, point, bar)
        answer["eigenvalues"] = [[s.real, s.imag] for s in numbers["eigenvalues"]]
    return answer


def _end(rig: Machine, point: OperatingPoint, name: str | None) -> float | None:
    """The end of the stable values of a parameter that is nearest to its own."""
    found = None if name is None else linear_set(point, name)
    if found is None or name is None or not np.any(found.changes):
        return None
    edges = found.edges[found.changes]
    return float(edges[np.argmin(np.abs(edges - float(rig.value(name) or 0.0)))])
