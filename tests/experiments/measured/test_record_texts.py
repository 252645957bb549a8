"""Texts as people and programs write them: names in other languages, large ones, lines beside the table, signs."""

from __future__ import annotations

import numpy as np
import pytest

import steadyslip as ss
from measured_columns import HEAD, check, columns, plain, read_as, rows
from steadyslip.experiments.measured.clean import without_placeholders
from steadyslip.experiments.measured.columns import guess_role as role, split_name


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
        ("Friction", "friction"), ("frottement", "friction"),
    ],
)  # fmt: skip
def test_names_in_several_languages(name, expected):
    assert role(*split_name(name)) == expected


@pytest.mark.parametrize(
    "names",
    ["Tiempo (s),Desplazamiento (um),Coeficiente de fricción,Esfuerzo normal (MPa)",
     "Tempo (s),Spostamento (um),Attrito,Sforzo normale (MPa)"],
)  # fmt: skip
def test_names_in_spanish_and_italian(tmp_path, names):
    time, friction, normal, moved = columns()
    check(read_as(tmp_path, names + "\n" + rows(",", plain(time), plain(moved), plain(friction), plain(normal))))


def test_unicode_text_fortran_exponents_and_quoted_names(tmp_path):
    time, friction, normal, moved = columns()
    table = rows("\t", plain(time), plain(moved), plain(friction), plain(normal))
    check(read_as(tmp_path, HEAD.replace(",", "\t").encode("utf-16") + table.encode("utf-16-le")))
    fortran = [[f"{x:.7E}".replace("E", "D") for x in column] for column in (time, moved, friction, normal)]
    check(read_as(tmp_path, HEAD + rows(",", *fortran)))
    quoted = '"Time (s)","Way, total","Friction","Normal stress (MPa)"\n'.replace("Way, total", "Way")
    text = quoted + rows(",", plain(time), plain(moved), plain(friction), plain(normal))
    check(read_as(tmp_path, text, displacement=("Way", "um")))


def test_large_plain_text_is_read_like_small_text(tmp_path, monkeypatch):
    """NumPy's reader for large files and our own for all others find the same."""
    from steadyslip.experiments.measured.formats import text

    rng = np.random.default_rng(3)
    rows = np.column_stack([0.01 * np.arange(3000), rng.uniform(0.5, 0.7, 3000), rng.uniform(9, 11, 3000)])
    np.savetxt(
        tmp_path / "r.txt", rows, "%.9g", header="about it\nTime(s)\tFriction\tNormal_stress(MPa)", delimiter="\t"
    )
    plain = ss.read_record(tmp_path / "r.txt")
    monkeypatch.setattr(text, "LARGE", 1000)
    monkeypatch.setattr(text, "SAMPLE_BYTES", 4000)
    monkeypatch.setattr(text, "_numbers", None)  # is not asked
    fast = ss.read_record(tmp_path / "r.txt")
    for name in ("time", "friction", "normal"):
        np.testing.assert_array_equal(getattr(fast, name), getattr(plain, name))
    assert fast.notes == plain.notes


def test_a_large_text_with_a_damaged_line_names_it(tmp_path, monkeypatch):
    from steadyslip.experiments.measured.formats import text

    monkeypatch.setattr(text, "LARGE", 1000)
    lines = ["Time (s),Friction,Normal stress (MPa)", *(f"{0.1 * k:.6g},0.6,10" for k in range(9000))]
    lines[8000] = "800,0.6"
    (tmp_path / "r.csv").write_text("\n".join(lines))
    with pytest.raises(ss.ParameterError, match="line 8001: file: 2 columns where 3 are expected"):
        ss.read_record(tmp_path / "r.csv")


# -- what stands beside the table, or in place of numbers

LINES = (HEAD + rows(",", *(plain(columns()[k]) for k in (0, 3, 1, 2)))).splitlines()
NAMED, MEASURES, STARTED = (
    "Time,Displacement,Friction,Normal stress",
    "s,um,-,MPa",
    "Acquisition: Timed,,,,Time:,1.5,Sec",
)


def changed(places, column, cell):
    """The lines with some cells of a column changed."""
    found = [line.split(",") for line in LINES]
    for place in places:
        found[place][column] = cell
    return [",".join(cells) for cells in found]


@pytest.mark.parametrize(
    ("lines", "note"),
    [
        ([NAMED, MEASURES, "raw,raw,computed,computed", *LINES[1:]], ""),
        ([MEASURES, NAMED, *LINES[1:]], ""),
        (["1,2,3,4", "calibration", *LINES], ""),
        ([*LINES[:31], LINES[0], *LINES[31:]], "the header is repeated within the table (line 32)"),
        ([STARTED, NAMED, MEASURES, *LINES[1:31], "", STARTED.replace("1.5", "9"), NAMED, MEASURES, *LINES[31:]],
         "the header is repeated within the table (line 35)"),
        ([*LINES, "", "End of test", "Operator: Müller"], "left out below the table, from line 63: 'End of test'"),
        ([*LINES, "Average,1089.25,0.6,10.3"], "'Average,1089.25,0.6,10.3'"),
        ([*LINES, "*** END ***", "\x1a"], "left out below the table"),
        ([f"{LINES[0]},Event", *(f"{line},{'' if k < 50 else 1}" for k, line in enumerate(LINES[1:]))], ""),
    ],
    ids=["a line about columns", "units above names", "a line of numbers above", "header again", "blocks", "footer",
         "means", "end marks", "an empty column"],
)  # fmt: skip
def test_lines_that_are_not_of_the_table(tmp_path, lines, note):
    record = read_as(tmp_path, "\n".join(lines))
    check(record)
    assert note in "\n".join(record.notes)


def test_words_in_the_middle_of_a_table_are_damage(tmp_path):
    with pytest.raises(ss.ParameterError, match="line 32: file: 1 column where 4 are expected: 'pump failed'"):
        read_as(tmp_path, "\n".join([*LINES[:31], "pump failed", *LINES[31:]]))


@pytest.mark.parametrize("cell", ["-9999", "-999.25", "9.9E37", "1e30", "missing", "#DIV/0!", "", "***"])
@pytest.mark.parametrize("column", [1, 2, 3])
def test_what_stands_for_no_number(tmp_path, cell, column):
    places = [20, 21, 50]
    record = read_as(tmp_path, "\n".join(changed(places, column, cell)))
    np.testing.assert_allclose(record.friction, np.delete(columns()[1], np.array(places) - 1), atol=1e-5)
    assert any("3 rows without a number" in note for note in record.notes)
    if cell[-1:].isdigit():
        assert any("marks a missing value" in note for note in record.notes)


def test_a_record_that_passes_such_a_number_keeps_it():
    time = np.arange(900.0, 1100.0)
    values = np.where(time == 1000, 999.0, time)
    notes = []
    assert without_placeholders(values, "x", notes) is values
    assert without_placeholders(np.repeat([999.0, 0.0], 50), "command", notes)[0] == 999.0
    assert not notes


@pytest.mark.parametrize("name", ["Displacement", "Friction", "Normal stress"])
def test_signs_that_count_the_other_way(tmp_path, name):
    """Compression as negative stress, a load point that moves to smaller readings, friction against them."""
    column = NAMED.split(",").index(name)
    lines = [line.split(",") for line in LINES[1:]]
    for cells in lines:
        cells[column] = f"-{cells[column]}"
    record = read_as(tmp_path, "\n".join([LINES[0], *map(",".join, lines)]))
    np.testing.assert_allclose(record.friction, columns()[1], atol=1e-5)
    np.testing.assert_allclose(np.diff(record.displacement), 1e-6 * np.diff(columns()[3]), atol=1e-11)
    assert any("sign" in note for note in record.notes)


@pytest.mark.parametrize("decimal", [".", ","])
@pytest.mark.parametrize(("times", "segments"), [("One", 1), ("One", 2), ("No", 1), ("Multi", 1)])
def test_labview_texts(tmp_path, decimal, times, segments):
    time, friction, normal, moved = columns()
    about = ["LabVIEW Measurement", "Writer_Version\t2", f"Decimal_Separator\t{decimal}", f"X_Columns\t{times}",
             "***End_of_Header***", ""]  # fmt: skip
    names = {"One": "X_Value\tDisplacement\tFriction\tNormal stress", "No": "\tDisplacement\tFriction\tNormal stress",
             "Multi": "X_Value\tDisplacement\tX_Value\tFriction\tX_Value\tNormal stress"}[times]  # fmt: skip
    head = ["Channels\t3", "Samples\t60\t60\t60", "Y_Unit_Label\tum\t\tMPa", f"Delta_X{3 * f'{chr(9)}{time[1]:.9f}'}",
            "***End_of_Header***", f"{names}\tComment"]  # fmt: skip
    if times == "Multi":
        head[2] = "Y_Unit_Label\tum\t\t\t\tMPa"
    clock = plain(time) if times != "No" else [""] * len(time)
    cells = [plain(moved), plain(friction), plain(normal)]
    beside = [clock, cells[0], clock, cells[1], clock, cells[2]] if times == "Multi" else [clock, *cells]
    body = [line.replace(".", decimal) for line in rows("\t", *beside).splitlines()]
    cut = 30 if segments == 2 else len(body)
    text = "\r\n".join([*about, *head, *body[:cut], *([*head, *body[cut:]] if segments == 2 else [])])
    check(read_as(tmp_path, text))
