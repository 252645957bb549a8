"""A small record, and the ways in which tests write it down and compare what was read."""

from __future__ import annotations

import numpy as np

import steadyslip as ss

ROWS = 60
HEADER = ("Time", "Load displacement", "Friction", "Normal stress")
UNITS = ("s", "um", "-", "MPa")
HEAD = "Time (s),Displacement (um),Friction,Normal stress (MPa)\n"


def columns():
    time = np.linspace(0.0, 30.0, ROWS)
    return time, 0.6 + 0.01 * np.sin(time), 10.0 + 0.0 * time, 1000 + 3.0 * time


def table():
    time, friction, normal, moved = columns()
    return [tuple(map(float, row)) for row in zip(time, moved, friction, normal, strict=True)]


def rows(separator, *cells):
    return "\n".join(separator.join(row) for row in zip(*cells, strict=True)) + "\n"


def plain(values, digits=6):
    return [f"{x:.{digits}f}" for x in values]


def read_as(tmp_path, text, **options):
    path = tmp_path / "odd.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return ss.read_record(path, **options)


def same_record(record, *, notes=""):
    time, friction, normal, moved = columns()
    np.testing.assert_allclose(record.time, time, atol=1e-9)
    np.testing.assert_allclose(record.friction, friction)
    np.testing.assert_allclose(record.normal, 1e6 * normal)
    np.testing.assert_allclose(record.displacement, 1e-6 * moved)
    assert notes in "\n".join(record.notes)


def check(record):
    time, friction, normal, moved = columns()
    np.testing.assert_allclose(record.time, time, atol=1e-4)
    np.testing.assert_allclose(record.friction, friction, atol=1e-5)
    np.testing.assert_allclose(record.normal, 1e6 * normal, rtol=1e-5)
    np.testing.assert_allclose(record.displacement, 1e-6 * moved, rtol=1e-5)
