"""What laboratories have in their folders: XLOOK's binaries, clocks and dates, names in other languages."""

from __future__ import annotations

import struct

import numpy as np
import pytest

import steadyslip as ss
from steadyslip.experiments.measured.columns import _guessed_role as role, split_name
from steadyslip.experiments.measured.moments import from_the_first, moment

ROWS = 60


def columns():
    time = np.linspace(0.0, 30.0, ROWS)
    return time, 0.6 + 0.01 * np.sin(time), 10.0 + 0.0 * time, 1000 + 3.0 * time


def xlook(kind, order=">"):
    """The bytes that XLOOK writes, typed from the description of its format."""
    time, friction, normal, moved = columns()
    table = [("Lp_Disp", "mic", moved), ("Shr_stress", "MPa", friction * normal), ("Nor_stress", "MPa", normal),
             ("Time", "sec", time)]  # fmt: skip
    raw = b"p9999".ljust(20, b"\0") + struct.pack(">iiii", ROWS, len(table), 0, 0)
    for name, unit, _ in table:
        raw += name.encode().ljust(13, b"\0") + unit.encode().ljust(13, b"\0") + struct.pack(">f", 1.0)
        raw += b"".ljust(50, b"\0") + struct.pack(">i", ROWS)
    for _ in range(32 - len(table)):
        raw += b"no_val".ljust(13, b"\0") + bytes(71)
    return raw + b"".join(np.asarray(values).astype(order + kind).tobytes() for *_, values in table)


@pytest.mark.parametrize(("kind", "order"), [("f4", ">"), ("f8", ">"), ("f8", "<")])
def test_xlook_files_are_read(tmp_path, kind, order):
    path = tmp_path / "p9999"
    path.write_bytes(xlook(kind, order))
    record = ss.read_record(path)
    time, friction, normal, moved = columns()
    np.testing.assert_allclose(record.time, time, rtol=1e-6)
    np.testing.assert_allclose(record.friction, friction, rtol=1e-6)
    np.testing.assert_allclose(record.normal, 1e6 * normal, rtol=1e-6)
    np.testing.assert_allclose(record.displacement, 1e-6 * moved, rtol=1e-6)
    assert any("XLOOK" in note for note in record.notes)


def test_a_damaged_xlook_file_is_refused(tmp_path):
    (tmp_path / "p1").write_bytes(xlook("f4")[:-3])
    with pytest.raises(ss.NotAvailable, match="not text"):
        ss.read_record(tmp_path / "p1")


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("00:00:01.5", 1.5),
        ("23:59:59", 86399.0),
        ("12:00:00,25", 43200.25),
        ("1970-01-02T00:00:00Z", 86400.0),
        ("1970-01-01 02:00:00.5+02:00", 0.5),
        ("2024-02-30T00:00:00", None),
        ("12:61:00", None),
        ("12.5", None),
    ],
)
def test_clocks_and_dates(text, seconds):
    assert moment(text) == seconds


def test_a_clock_passes_midnight():
    np.testing.assert_array_equal(from_the_first(np.array([86399.0, 0.0, 1.0])), [0.0, 1.0, 2.0])


@pytest.mark.parametrize("start", ["23:59:50", "2024-02-28T23:59:50"])
def test_records_with_clocks(tmp_path, start):
    time, friction, normal, moved = columns()
    first = moment(start)
    lines = ["Uhrzeit;Vorschub (mm);Reibwert;Normalspannung (MPa)"]
    for t, f, n, x in zip(time, friction, normal, moved, strict=True):
        clock = (first + t) % 86400
        text = f"{int(clock // 3600):02d}:{int(clock % 3600 // 60):02d}:{clock % 60:09.6f}"
        if "T" in start:
            text = f"2024-02-{28 if first % 86400 + t < 86400 else 29}T{text}"
        lines.append(";".join([text, *(str(v).replace(".", ",") for v in (x / 1e3, f, n))]))
    (tmp_path / "r.csv").write_text("\n".join(lines))
    record = ss.read_record(tmp_path / "r.csv")
    np.testing.assert_allclose(record.time, time, atol=2e-6)
    np.testing.assert_allclose(record.friction, friction)
    np.testing.assert_allclose(record.displacement, 1e-6 * moved)
    assert any("times of day" in note for note in record.notes)


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("Zeit (s)", "time"), ("Versuchszeit [s]", "time"), ("temps (s)", "time"), ("Timestamp", "time"),
        ("Weg (mm)", "displacement"), ("Verschiebung (um)", "displacement"), ("lp_disp_um", "displacement"),
        ("Vertikalweg (mm)", None), ("Geschwindigkeit (mm/s)", "velocity"), ("Normalspannung (MPa)", "normal"),
        ("Normalkraft (kN)", "normal"), ("contrainte normale (MPa)", "normal"),
        ("Effective_Normal_stress(MPa)", "normal"),
        ("Schubspannung (MPa)", "shear"), ("Scherkraft (kN)", "shear"), ("Reibkraft (N)", "shear"),
        ("Reibwert", "friction"), ("Reibungskoeffizient", "friction"), ("Reibung", "friction"),
        ("Friction", "friction"),         ("frottement", "friction"),
    ],
)  # fmt: skip
def test_names_in_several_languages(name, expected):
    assert role(*split_name(name)) == expected
