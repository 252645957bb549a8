"""Verdicts as JSON-ready data: dicts, lists, numbers, text and None, in SI units."""

from __future__ import annotations

import math
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

from steadyslip.core.areas import total
from steadyslip.core.checks import as_data
from steadyslip.model.steady_results import SteadyMachine, SteadySliding
from steadyslip.verdict.support import support_stiffness

if TYPE_CHECKING:
    from steadyslip.linear.boundary import Margin
    from steadyslip.nonlinear.onset.hopf import Onset
    from steadyslip.verdict.findings import Findings

_UNITS = ("units", "area")
_LAST = ("judders", "boundaries", "warnings", "checked", "checks")


def as_dict(analysis: Findings) -> dict[str, Any]:
    """Verdict as JSON-ready dict in SI units, of a slider per unit area; NaN and infinite numbers become None."""
    common = common_numbers(analysis)
    first = ("version", "stable", "on_edge", "undamped", "reason")
    own = _of_machine if analysis.rig.in_forces else _of_slider
    data: dict[str, Any] = {
        **{name: common[name] for name in first if name in common},
        "steady": None if analysis.steady is None else _steady(analysis.steady),
        **own(analysis),
        **{name: value for name, value in common.items() if name not in _LAST},
        "onset": None if analysis.onset is None else onset_dict(analysis.onset),
        "kicks": [kick.to_dict() for kick in analysis.kicks],
        **{name: common[name] for name in _LAST},
    }
    if analysis.rig.area is not None:
        data["forces"] = _forces(analysis, analysis.rig.area)
    found: dict[str, Any] = finite(data)
    return found


def _steady(steady: SteadySliding | SteadyMachine) -> dict[str, Any]:
    """Steady sliding as dict of its fields, for a slider without `units` and `area`."""
    data = asdict(steady)
    return data if isinstance(steady, SteadyMachine) else {name: data[name] for name in data if name not in _UNITS}


def _of_machine(analysis: Findings) -> dict[str, Any]:
    """Entries for machines only: the leading mode, and why it grows."""
    return {
        "mode": analysis.mode and analysis.mode.to_dict(),
        "why_it_grows": analysis.origin and analysis.origin.to_dict(),
    }


def _of_slider(analysis: Findings) -> dict[str, Any]:
    """Entries for sliders only: critical and stable stiffnesses."""
    return {
        "critical_stiffness": analysis.critical_stiffness,
        "critical_side": analysis.critical_side,
        "critical_angular_frequency": analysis.critical_angular_frequency,
        "critical_axial_stiffness": analysis.critical_axial_stiffness,
        "stable_stiffness": [[low, high] for low, high in analysis.stable_stiffness],
        **_held_by(analysis),
    }


def _held_by(analysis: Findings) -> dict[str, Any]:
    """Entry ``held_by`` for a slider that a controller gain supports without a spring; empty otherwise.

    The critical and stable stiffnesses of the verdict then refer to a spring added beside that gain.
    """
    name = analysis.rig.gain_name()
    support = None if name is None or analysis.steady is None else support_stiffness(analysis)
    if support is None or support.name == "stiffness":
        return {}
    return {
        "held_by": {
            "parameter": name,
            "value": support.own,
            "critical": support.critical,
            "critical_side": support.side,
            "stable": [[low, high] for low, high in support.stable],
        }
        | total(support.critical, "Pa/m", analysis.rig.area)
    }


def common_numbers(found: Findings) -> dict[str, Any]:
    """Entries that verdicts on sliders and on machines have in common, as a dict; the order is that of the JSON."""
    late = {
        "characteristic_terms": [{"delay": h, "coefficients": list(c)} for h, c in found.characteristic_terms],
        "unstable_roots": found.unstable_roots,
    }
    return {
        "version": found.version,
        "stable": found.stable,
        "on_edge": found.on_edge,
        **({"undamped": True} if found.undamped else {}),
        "reason": found.reason,
        "eigenvalues": [[s.real, s.imag] for s in found.eigenvalues],
        "characteristic_polynomial": list(found.characteristic_polynomial),
        "routh": list(found.routh),
        "growth_rate": found.growth_rate,
        "period": found.period,
        "damping_ratio": found.damping_ratio,
        "time_to_halve": found.time_to_halve,
        "time_to_double": found.time_to_double,
        **({"unstable_loop": found.unstable_loop} if found.unstable_loop else {}),
        "judders": found.judders or None,
        "boundaries": [row for one in found.margins for row in _edges(one, found.rig.area_of(one.parameter))],
        "warnings": list(found.warnings),
        **as_data(found.checks),
        **(late if found.characteristic_terms or found.unstable_roots is not None else {}),
    }


def onset_dict(onset: Onset) -> dict[str, Any]:
    """Onset as JSON-ready dict; for a machine ``contact`` names the contact to which amplitudes refer."""
    own = {"contact": onset.contact} if onset.contact else {}
    return {
        "kind": onset.kind,
        "parameter": onset.along,
        "value": onset.value,
        "coefficient": finite(onset.coefficient),
        "coefficient_error": finite(onset.coefficient_error),
        "normalised_coefficient": finite(onset.normalised),
        "growth_slope": onset.growth_slope,
        "angular_frequency": onset.angular_frequency,
        "meaning": onset.meaning,
        **own,
    } | total(onset.value, onset.unit, onset.rig.area_of(onset.along))


def _edges(margin: Margin, area: float | None) -> list[dict[str, Any]]:
    """One dict per edge of a parameter; with an `area` (m²) totals are added to stresses (N beside Pa)."""
    return [
        {
            "parameter": edge.parameter,
            "unit": edge.unit,
            "value": edge.value,
            "bracket": list(edge.bracket),
            "kind": edge.kind,
            **({"contact": edge.contact} if edge.contact else {}),
            "angular_frequency": edge.angular_frequency,
            "stable": edge.stable,
            **({"no_root_grows": edge.quiet} if edge.quiet else {}),
            "own_value": margin.value,
            "distance": edge.value - margin.value,
            "relative_distance": (edge.value - margin.value) / abs(margin.value) if margin.value else None,
            "nearest": edge is margin.edge,
        }
        | total(edge.value, edge.unit, area)
        for edge in margin.edges
    ]


def _forces(analysis: Findings, area: float) -> dict[str, Any]:
    """Main results for the whole contact `area` (m²): forces (N) and stiffnesses (N/m)."""
    steady = analysis.steady
    return {
        "area": area,
        "normal_force": None if steady is None else steady.normal_stress * area,
        "friction_force": None if steady is None else steady.shear_stress * area,
        "critical_stiffness": None if analysis.critical_stiffness is None else analysis.critical_stiffness * area,
        "stable_stiffness": [[low * area, high * area] for low, high in analysis.stable_stiffness],
    }


def finite(data: Any) -> Any:
    """Copy of nested dicts and lists in which NaN and infinite floats are None; tuples become lists."""
    if isinstance(data, dict):
        return {name: finite(one) for name, one in data.items()}
    if isinstance(data, (list, tuple)):
        return [finite(one) for one in data]
    if isinstance(data, float):
        return float(data) if math.isfinite(data) else None
    return data
