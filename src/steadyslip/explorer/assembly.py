"""Assembly of the self-contained HTML page of a rig: equations, numbers, modules and style."""

from __future__ import annotations

import html
import json
import math
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any, NamedTuple

import numpy as np

from steadyslip.core.areas import display_area, outside
from steadyslip.core.dimensions import unit
from steadyslip.core.errors import NotAvailable
from steadyslip.core.format import units_for
from steadyslip.core.palette import DARK, FORCED, LIGHT
from steadyslip.core.records import Address
from steadyslip.core.version import version
from steadyslip.core.written import display_names, in_written_units
from steadyslip.explorer.equations import linear_part
from steadyslip.explorer.machine_sketch import machine_sketch
from steadyslip.explorer.minify import (
    function_names,
    minify,
    minify_css,
    minify_generated,
    names_in,
    share_numbers,
    shorten_names,
)
from steadyslip.explorer.motion import DRIVER, driver, motion_part
from steadyslip.explorer.own_file import display_unit, own_file
from steadyslip.explorer.sketch import sketch
from steadyslip.explorer.variables import shorten_variables
from steadyslip.kernels.printers import javascript
from steadyslip.linear.boundary import REMOTE
from steadyslip.linear.linear_sets import linear_set
from steadyslip.linear.nearness import nearest_end
from steadyslip.linear.search import Search
from steadyslip.linear.status import STABLE, UNDAMPED, UNSTABLE, status
from steadyslip.machine.letters import label_of, letter_of
from steadyslip.machine.machine import Machine
from steadyslip.machine.slider import Slider
from steadyslip.model.point import OperatingPoint, operating_point
from steadyslip.model.range import require_range
from steadyslip.model.steady_results import ABSENT
from steadyslip.motion.sentence import JUDDERS, OVER, pull_words
from steadyslip.motion.status import causes
from steadyslip.verdict import machine as machine_words, slider as slider_words
from steadyslip.verdict.numbers import linear_numbers
from steadyslip.verdict.reasons import page_reasons
from steadyslip.verdict.words import BEYOND, EDGE_WORDS, EIGENVALUE_COLUMNS, HEADLINES, NO_PERIOD, PACE

MODULES = (
    "dom", "quantities", "polynomials", "modes", "nearness", "linear", "rig", "search", "words", "plot", "chart",
    "edges", "banner", "controls", "map", "locus", "facts", "mover", "sketch", "disturbances", "course", "view",
    "leaving", "presets", "page",
)  # fmt: skip
"""Modules of the page in `web/`, each after the modules that it imports."""
ENTRIES = ("mount", "render")
"""Functions of the modules that the page and its widget call."""
DEFAULTS = {
    "factor": 1.0, "low": 0, "high": None, "lowAllowed": False, "highAllowed": True, "whole": False,
    "allowed": "a finite number > 0",
}  # fmt: skip
"""Default entries of a parameter's data, which are left out of the data and stored once."""
WORKER_MODULES = ("motion",)
"""Modules of the worker; the page also sends it the runtime and the driver as text."""
WORKER_ENTRIES = ("Motion", "serve")
"""Names in `WORKER_MODULES` that the worker's own code uses."""
MOTION_KEYS = ("layout", "routines", "segments")
"""Entries of a kernel that `web/motion.js` uses besides its programs."""
POLICY = (
    "default-src 'none'; script-src 'unsafe-inline' blob:; style-src 'unsafe-inline'; img-src data:; worker-src blob:; "
    "base-uri 'none'; form-action 'none'"
)
"""Content security policy: no requests; workers and images come from the page itself."""


def page(rig: Slider | Machine, title: str, branch: int, text: str = "") -> str:
    """HTML text of the page of a rig; `text` is the text of its rig file, or empty."""
    return document(f"{title} – steadyslip", style(), fragment(rig, title, branch, text))


def document(title: str, styles: str, body: str) -> str:
    """Text of a self-contained HTML document."""
    return (
        '<!doctype html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{POLICY}">\n'
        '<meta name="viewport" content="width=device-width,initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>\nbody{{margin:0}}\n{styles}</style>\n</head>\n"
        f"<body>\n{body}</body>\n</html>\n"
    )


def style() -> str:
    """Style sheet of a `fragment`, minified, with the colours of `core.palette` as variables."""
    light, dark, forced = (
        "; ".join(f"--{role}: {colour}" for role, colour in roles.items()) for roles in (LIGHT, DARK, FORCED)
    )
    themes = (
        f".steadyslip {{ color-scheme: light; {light}; }}\n"
        f'@media screen {{ .steadyslip[data-theme="dark"] {{ color-scheme: dark; {dark}; }} }}\n'
        '@media screen and (prefers-color-scheme:dark) { .steadyslip:not([data-theme="light"]) '
        f"{{ color-scheme: dark; {dark}; }} }}\n"
        f"@media (forced-colors:active) {{ .steadyslip.steadyslip.steadyslip {{ {forced}; }} }}\n"
    )
    return minify_css(themes + _read_web("style.css"))


def fragment(rig: Slider | Machine, title: str, branch: int, text: str = "", theme: str = "") -> str:
    """HTML of the interactive page of a rig as a part of a document, which may have several.

    With the `text` of a rig file it shows values in the units of the file, and saves them with its comments. `theme` is
    "light" for documents with a light theme; by default the theme is that of the browser.

    Raises
    ------
    NotAvailable
        If an equation has a function without JavaScript equivalent, or numbers leave the range of floating point.
    """
    code, known = page_parts(rig, title, branch, text)
    shown = f' data-theme="{theme}"' if theme else ""
    return (
        f'<div class="steadyslip-root"{shown}></div>\n'
        f'<script type="application/json" class="steadyslip-data">{json_for_html(known)}</script>\n'
        f'<script>\n"use strict";(()=>{{\n{code}'
        "const place=document.currentScript.previousElementSibling;"
        "mount(place.previousElementSibling,JSON.parse(place.textContent),programs,library);\n"
        "})();\n</script>\n"
    )


def json_for_html(known: Mapping[str, Any]) -> str:
    """JSON text for a script element, with <, & and line separators escaped so that no data can end the element."""
    data = json.dumps(known, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    data = re.sub(r'(?<!\\)(":-?\d+)\.0(?=[,}])', r"\1", data)  # 2 for 2.0
    for letter in "<&\u2028\u2029":
        data = data.replace(letter, f"\\u{ord(letter):04x}")
    return data


def page_parts(rig: Slider | Machine, title: str, branch: int, file: str = "") -> tuple[str, dict[str, Any]]:
    """JavaScript of a page, which declares ``mount``, ``render``, ``programs`` and ``library``, and its data."""
    text, facts = linear_part(rig)
    machine, driven, moving, still = "null", "const advance = null, observe = null;", None, ""
    try:
        machine, moving = motion_part(rig, branch)
        driven = driver()
        if moving["parameters"] == facts["parameters"]:
            del moving["parameters"]  # `facts` has the parameters already
    except NotAvailable as refused:  # then the page shows the verdict without motion
        still = str(refused)
    script = _joined(MODULES, ENTRIES, text)
    engine = _minified(driven, DRIVER)
    worker = _joined(WORKER_MODULES, {*WORKER_ENTRIES, *names_in(engine)}, machine, driven) + engine
    known = _data(rig, title, branch, facts, file) | {
        "motion": moving,
        "still": still,
        "sketch": ways_of(rig).sketch(rig),
    }
    code = (
        f"{script}\nconst programs = {_minified(text, function_names(text))};\n"
        f"const library = () => {{\n{worker}\n"
        f"const machine = {_minified(machine, {*function_names(machine), *MOTION_KEYS})};\n"
        "const begin = (facts) => new Motion(machine, facts, { advance, observe });\nreturn { begin, serve };\n};\n"
    )
    return code, known


def _joined(names: Iterable[str], known: Iterable[str], *generated: str) -> str:
    """Minified modules of `web/` in one scope, with the runtime functions that modules and generated code need."""
    modules = [_read_web(f"{name}.js") for name in names]
    needed = javascript.runtime(*generated, *modules)
    return _shortened(javascript.as_script(needed, *modules), frozenset({*known, *javascript.runtime_names()}))


@cache
def _shortened(script: str, known: frozenset[str]) -> str:
    return shorten_variables(minify(script), known)


def _minified(generated: str, known: Iterable[str]) -> str:
    """Minified generated code; `known` are the names that modules of the page use."""
    whole = share_numbers(generated) if generated.startswith("(() => {") else generated
    return minify_generated(shorten_names(whole, {*known, *javascript.runtime_names()}))


def _read_web(name: str) -> str:
    return files("steadyslip.explorer.web").joinpath(name).read_text(encoding="utf-8")


@in_written_units
def _data(rig: Slider | Machine, title: str, branch: int, facts: Mapping[str, Any], text: str) -> dict[str, Any]:
    """Data of the page of a rig as JSON-ready dict: parameters, rig file, sentences, checks."""
    names = list(_variable_parameters(rig, facts))
    places = [names.index(name) if name in names else name for name in facts["parameters"]]
    point = operating_point(rig, None, rig.kept_zeros(), branch)
    hints = [one.contact.lock_up for one in rig.laws_by_contact().values()]
    axial, file = "slider.axial_stiffness", own_file(rig, names, text)
    return {
        "title": title,
        "version": version(),
        "branch": branch,
        "area": display_area("Pa", rig.area),
        "stiffnessArea": display_area("Pa/m", rig.area),
        "parameters": [_parameter(rig, name, branch) | file.source_fields(name) for name in names],
        "facts": {key: value for key, value in facts.items() if key != "parameters"},  # the page has these in `places`
        "places": places,
        "fixed": [float(np.asarray(value)) for value in point.arguments],
        "axial": names.index(axial) if axial in names else -1,
        "speed": "drive.velocity",
        "toml": file.pieces,
        "stiffness": ways_of(rig).compared(rig, names),
        **ways_of(rig).further(rig, facts),
        "headlines": {kind: words for kind, words in HEADLINES.items() if kind != "undecided"} | _NO_RIG,
        "absent": ABSENT | {"hints": [f"; {one}" if one else "" for one in hints], "unfit": _UNFIT},
        "remote": REMOTE,
        "written": _written_units(rig),
        "beyond": BEYOND | EDGE_WORDS,
        "pace": PACE,
        "columns": EIGENVALUE_COLUMNS,
        "aperiodic": NO_PERIOD,
        "judders": JUDDERS | {"recurrences": OVER},
        "ends": causes(rig),
        "usual": DEFAULTS,
        "checks": _checks(rig, names, branch),
    }


_NO_RIG = {"unknown": ("No such rig", ": numbers outside what a rig can have")}
"""Headline for values that can be entered on a page but are not allowed in a rig."""
_UNFIT = "a number leaves its range, or breaks a condition that several obey together"
_RESULT_UNITS = frozenset({"m", "m/s", "s", "Hz", "1/s", "rad/s", "Pa", "N", "N m", "Pa/m", "N/m", "N m/rad"})
"""SI units of the results on a page: motion, times, rates, stresses, forces, stiffnesses."""


def _written_units(rig: Slider | Machine) -> dict[str, list[tuple[str, float]]]:
    """Units of the rig's file that differ from SI units, as (name, size in SI units), by SI unit of a page's numbers.

    Units of friction per load are left out, because they are used for single parameters only.
    """
    used = {outside(one.role.unit, rig.area_of(name))[1] for name, one in rig.parameters().items()}
    units = {si: units_for(si, display_names()) for si in sorted(used | _RESULT_UNITS) if si != "1"}
    return {
        si: [(name, unit(name)[0]) for name in names]
        for si, names in units.items()
        if names and not any(" at " in name for name in names)
    }


def _slider_data(rig: Slider, facts: Mapping[str, Any]) -> dict[str, Any]:
    """Page data for sliders only: phrases for the reasons of verdicts."""
    return {"reasons": page_reasons(rig) | slider_words.AT_EDGE, "means": slider_words.MEANS}


def _stiffness(rig: Slider, names: list[str]) -> str | None:
    """Name of the stiffness whose stable values a slider's page shows; None for a rig without a stiffness."""
    stiffness = "slider.axial_stiffness" if "slider.axial_stiffness" in names else rig.stiffness_name()
    return stiffness if stiffness in names else None


def _machine_data(rig: Machine, facts: Mapping[str, Any]) -> dict[str, Any]:
    """Page data for machines only: indices of contact areas, names of radii, links that pull at contacts, phrases."""
    areas = [f"contacts.{name}.area" for name in rig.contacts]
    return {
        "areas": [facts["parameters"].index(name) if name in facts["parameters"] else -1 for name in areas],
        "phrases": {name: words for name, words in machine_words.PHRASES.items() if name not in BEYOND},
        "means": machine_words.MEANS,
        "pulls": {name: pull_words(rig, name) for name in rig.contacts},
        "levers": [f"contacts.{name}.radius" if rig.lever_at(name) is not None else "" for name in rig.contacts],
    }


def _checked_parameter(rig: Machine, names: list[str]) -> str | None:
    """Name of the parameter whose stable values the page compares with Python's: the first linear stiffness or gain."""
    point = operating_point(rig)
    stiff = (name for name in rig.of_kind("stiffness") if name in names)
    return next((name for name in stiff if linear_set(point, name) is not None), None) if point.exists else None


def _variable_parameters(rig: Slider | Machine, facts: Mapping[str, Any]) -> dict[str, Address]:
    """Parameters that a page can vary, by name: those that affect the verdict, also by replacing another parameter."""
    known = {*facts["parameters"], *rig.replaces}
    return {
        name: one
        for name, one in rig.parameters().items()
        if name in known and one.value is not None and not one.role.gauge
    }


def _parameter(rig: Slider | Machine, name: str, branch: int) -> dict[str, Any]:
    one = rig.parameters()[name]
    domain, value = one.role.domain, float(one.value or 0.0)
    factor, unit = display_unit(rig, one.role.unit)
    natural = Search(rig, name, rig.kept_zeros(), branch).natural_size()
    found = {
        "name": name,
        "title": label_of(rig, name),
        "letter": letter_of(rig, name),
        "doc": one.role.doc,
        "unit": unit,
        "factor": factor,
        "value": value,
        "natural": _rounded(natural, 4) if math.isfinite(natural) else 1.0,
        "low": domain.low if math.isfinite(domain.low) else None,
        "high": domain.high if math.isfinite(domain.high) else None,
        "lowAllowed": domain.low_allowed and not (one.role.adds_state and domain.low == 0),
        "highAllowed": domain.high_allowed,
        "whole": domain.whole,
        "allowed": domain.text,
    }
    return {key: value for key, value in found.items() if key not in DEFAULTS or value != DEFAULTS[key]}


def _rounded(value: float, digits: int) -> float:
    return float(f"{value:.{digits}g}")


def _checks(rig: Slider | Machine, names: list[str], branch: int) -> list[dict[str, Any]]:
    """Results of Python, with which the page compares its own, at the values of the rig and at some other values."""
    stiff = ways_of(rig).compared(rig, names)
    changes: list[dict[str, float]] = [{}]
    for name, factor in ((stiff, 0.1), (stiff, 10.0), ("drive.velocity", 3.0)):
        if name in names:
            changes.append({name: factor * float(rig.value(name) or 0.0)})
    found = []
    for change in changes:
        other = rig.with_values(change) if change else rig
        word = " and ".join(f"{name} = {value!r}" for name, value in change.items()) or "the rig itself"
        changed = {names.index(name): float(other.value(name) or 0.0) for name in change}
        found.append({"name": word, "values": changed, **_answer(other, branch, stiff)})
    return found


def _answer(rig: Slider | Machine, branch: int, bar: str | None) -> dict[str, Any]:
    point = operating_point(rig, None, rig.kept_zeros(), branch)
    answer: dict[str, Any] = {
        "status": int(status(point)),
        "critical": None,
        "eigenvalues": [],
    }
    require_range(point)
    if answer["status"] in (STABLE, UNSTABLE, UNDAMPED):
        with np.errstate(all="ignore"):
            answer["critical"], eigenvalues = ways_of(rig).judged(rig, point, bar)
        answer["eigenvalues"] = [[_rounded(s.real, 12), _rounded(s.imag, 12)] for s in eigenvalues]
    return answer


def _nearest_edge(rig: Machine, point: OperatingPoint, name: str | None) -> float | None:
    """Edge of the stable values of a parameter (SI) nearest to the rig's own value; None if there is none."""
    found = None if name is None else linear_set(point, name)
    if found is None or name is None or not np.any(found.changes):
        return None
    edges = found.edges[found.changes]
    return float(edges[nearest_end(edges, float(rig.value(name) or 0.0))])


def _judged_slider(rig: Slider, point: OperatingPoint, name: str | None) -> tuple[float | None, Sequence[complex]]:
    numbers = slider_words.numbers_of(rig, point)
    return numbers.get("critical_stiffness"), numbers["eigenvalues"]


def _judged_machine(rig: Machine, point: OperatingPoint, name: str | None) -> tuple[float | None, Sequence[complex]]:
    eigenvalues = linear_numbers(point)["eigenvalues"]
    return _nearest_edge(rig, point, name), eigenvalues


class _Ways(NamedTuple):
    """Functions of a page that differ between sliders and machines.

    Attributes
    ----------
    sketch : callable
        Returns the SVG of the rig.
    compared : callable
        Returns the name of the parameter whose stable values are compared with Python's, from the rig and the names of
        the page's parameters.
    further : callable
        Returns page data of this kind of rig, from the rig and the facts of its equations.
    judged : callable
        Returns the nearest edge in the compared parameter, and the eigenvalues, from the rig, its operating point and
        that parameter.
    """

    sketch: Callable[[Any], str]
    compared: Callable[[Any, list[str]], str | None]
    further: Callable[[Any, Mapping[str, Any]], dict[str, Any]]
    judged: Callable[[Any, OperatingPoint, str | None], tuple[float | None, Sequence[complex]]]


_OF_SLIDERS = _Ways(sketch, _stiffness, _slider_data, _judged_slider)
_OF_MACHINES = _Ways(machine_sketch, _checked_parameter, _machine_data, _judged_machine)


def ways_of(rig: Slider | Machine) -> _Ways:
    """Page functions for the kind of this rig."""
    return _OF_MACHINES if isinstance(rig, Machine) else _OF_SLIDERS
