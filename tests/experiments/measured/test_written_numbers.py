"""Numbers as people write them: decimal commas, thousands set off, bars and quotes; what cannot be told is refused."""

from __future__ import annotations

import numpy as np
import pytest

import steadyslip as ss

ROWS = 60


def columns():
    time = np.linspace(0.0, 30.0, ROWS)
    return time, 0.6 + 0.01 * np.sin(time), 10.0 + 0.0 * time, 1000 + 3.0 * time


def german(x, digits):
    return f"{x:,.{digits}f}".translate(str.maketrans(",.", ".,"))


def french(x, digits):
    return f"{x:,.{digits}f}".translate(str.maketrans(",.", "\u202f,"))


def english(x, digits):
    return f"{x:,.{digits}f}"


def pointed(x, digits):
    return f"{x:.{digits}f}"


def quoted(x, digits):
    return f'"{english(x, digits)}"'


def text_of(written, separator, ends=("", "")):
    """A record with displacements and normal stresses on both sides of a thousand."""
    time, friction, _, moved = columns()
    table = [(time, 2), (moved - 50.0, 2), (friction, 4), (np.linspace(998.7, 1009.2, ROWS), 1)]
    rows = [[written(x, digits) for x in column] for column, digits in table]
    names = ["Time (s)", "Displacement (um)", "Friction", "Normal stress (kPa)"]
    return "\n".join(f"{ends[0]}{separator.join(row)}{ends[1]}" for row in [names, *zip(*rows, strict=True)]) + "\n"


@pytest.mark.parametrize("separator", [";", "\t", "|", " | "])
@pytest.mark.parametrize("written", [german, french, english, pointed, quoted])
def test_numbers_are_read_however_they_are_written(tmp_path, written, separator):
    (tmp_path / "r.txt").write_text(text_of(written, separator), encoding="utf-8")
    record = ss.read_record(tmp_path / "r.txt")
    time, friction, _, moved = columns()
    np.testing.assert_allclose(record.time, np.round(time, 2), atol=1e-9)
    np.testing.assert_allclose(record.displacement, 1e-6 * np.round(moved - 50.0, 2), rtol=1e-9)
    np.testing.assert_allclose(record.friction, np.round(friction, 4), rtol=1e-9)
    np.testing.assert_allclose(record.normal, 1e3 * np.round(np.linspace(998.7, 1009.2, ROWS), 1), rtol=1e-9)
    notes = " ".join(record.notes)
    assert ("thousands are set off in column 'Displacement (um)'" in notes) == (written is not pointed)
    assert ("decimal comma" in notes) == (written in (german, french))


def test_a_table_as_markdown_and_thousands_between_commas(tmp_path):
    lines = text_of(english, " | ", ("| ", " |")).splitlines()
    (tmp_path / "r.md").write_text("\n".join([lines[0], "|---|:---:|---:|---|", *lines[1:]]))
    assert ss.read_record(tmp_path / "r.md").normal[-1] == pytest.approx(1009.2e3)
    (tmp_path / "quoted.csv").write_text(text_of(quoted, ","))
    assert ss.read_record(tmp_path / "quoted.csv").normal[-1] == pytest.approx(1009.2e3)
    (tmp_path / "torn.csv").write_text(text_of(english, ","))
    with pytest.raises(ss.ParameterError, match="do commas divide thousands as well as columns"):
        ss.read_record(tmp_path / "torn.csv")
    (tmp_path / "torn.txt").write_text(text_of(french, "  ").replace("\u202f", " "))
    with pytest.raises(ss.ParameterError, match="do blanks divide thousands as well as columns"):
        ss.read_record(tmp_path / "torn.txt")


@pytest.mark.parametrize(
    ("change", "told"),
    [(("998.7", "998,7"), "'1,009.2' has a decimal point and '998,7' a decimal comma"),
     (("0.6000", "0,6000"), "column 'Friction': '0.5901' has a decimal point and '0,6000'")],
)  # fmt: skip
def test_numbers_that_could_be_either_are_refused(tmp_path, change, told):
    text = text_of(english, ";")
    assert change[0] in text
    (tmp_path / "r.txt").write_text(text.replace(*change))
    with pytest.raises(ss.ParameterError, match=told):
        ss.read_record(tmp_path / "r.txt")
    rows = [f"{t},0;{1.5 + 0.001 * t:.3f};0,6" for t in range(10, 40)]
    (tmp_path / "vague.txt").write_text("\n".join(["Time (s);Displacement (um);Friction", *rows, "40.5;1.540;0,6"]))
    with pytest.raises(
        ss.ParameterError, match=r"'1\.510' in column .Displacement .*divide thousands, or is it decimal"
    ):
        ss.read_record(tmp_path / "vague.txt")
