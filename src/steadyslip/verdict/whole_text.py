"""Whole text of a verdict: headline, reason, facts, nearest edges, checks, meaning, warnings."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING

from steadyslip.core.checks import in_words
from steadyslip.verdict import machine, slider
from steadyslip.verdict.words import (
    disturbance,
    headline,
    margin_table,
    onset_words,
    stable_speeds,
    threshold_words,
)

if TYPE_CHECKING:
    from steadyslip.verdict.findings import Findings


def verdict_text(analysis: Findings) -> str:
    """Whole verdict on a rig as text, about 100 columns wide."""
    lines = [headline(analysis), *textwrap.wrap(analysis.reason, 98, initial_indent="  ", subsequent_indent="  "), ""]
    for name, text in facts(analysis):
        lines += textwrap.wrap(f"{name:<15} {text}", 100, subsequent_indent=" " * 16)
    lines += margin_table(analysis)
    lines += ["", *textwrap.wrap(in_words(analysis.checks), 100, subsequent_indent="  ")] if analysis.checks else []
    meant = meaning(analysis)
    lines += ["", *(line for one in meant for line in textwrap.wrap(one, 120))] if meant else []
    for text in analysis.warnings:
        lines += ["", *textwrap.wrap(f"Warning: {text}", 100, subsequent_indent="  ")]
    return "\n".join(line for i, line in enumerate(lines) if line or (i and lines[i - 1]))


def facts(analysis: Findings) -> list[tuple[str, str]]:
    """Rows (label, text) on steady sliding, small disturbances, what is stable, onset and kicks."""
    if analysis.steady is None:
        return stable_speeds(analysis)
    own = machine if analysis.rig.in_forces else slider
    rows = [*own.sliding_rows(analysis), ("a disturbance", disturbance(analysis))]
    rows += [("the controller", words.removeprefix("the controller "))] if (words := analysis.unstable_loop) else []
    rows += own.stability_rows(analysis)
    rows += stable_speeds(analysis)
    rows += [("onset", onset_words(analysis.onset))] if analysis.onset else []
    return rows + [("a kick", threshold_words(kick)) for kick in analysis.kicks]


def meaning(analysis: Findings) -> list[str]:
    """Lines on the limits of a verdict "stable", and on what an unstable rig does instead."""
    if analysis.stable is None or analysis.on_edge:
        return []
    found: list[str] = (machine if analysis.rig.in_forces else slider).meaning(analysis)
    return found
