"""Tables as other programs leave them: merged headers, formulas, dates in columns, several runs in one file."""

from __future__ import annotations

import datetime

import numpy as np
import pytest

import steadyslip as ss

ROWS = 40
TIME = np.linspace(0.0, 20.0, ROWS)
NAMES = ("Time (s)", "Displacement (um)", "Friction", "Normal stress (MPa)")
COLUMNS = (TIME, 1000 + 3.0 * TIME, 0.6 + 0.01 * np.sin(TIME), 10.0 + 0.01 * TIME)
START = datetime.datetime(2024, 2, 28, 23, 59, 50)


def same(record):
    np.testing.assert_allclose(record.time, TIME, atol=1e-3)  # a sheet has ms
    np.testing.assert_allclose(record.friction, COLUMNS[2], rtol=1e-6)
    np.testing.assert_allclose(record.displacement, 1e-6 * COLUMNS[1], rtol=1e-6)
    np.testing.assert_allclose(record.normal, 1e6 * COLUMNS[3], rtol=1e-6)


def workbook(path, rows, more=(), merged=None):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in rows:
        book.active.append(row)
    if merged:
        book.active.merge_cells(merged)
    for name, other in more:
        sheet = book.create_sheet(name)
        for row in other:
            sheet.append(row)
    book.save(path)
    return path


def rows(change=lambda k, x: float(x)):
    return [[change(k, x) for k, x in enumerate(row)] for row in zip(*COLUMNS, strict=True)]


def german(k, x):
    return f"{x:,.6f}".translate(str.maketrans(",.", ".,"))


def moments(row):
    at = START + datetime.timedelta(seconds=row[0])
    return [at.date(), at.time(), *row[1:]]


@pytest.mark.parametrize(
    ("table", "options"),
    [
        ([["Basalt p1", None, None, None], NAMES, *rows()], {"merged": "A1:D1"}),
        ([[NAMES[0], "Load point"], ["", *NAMES[1:]], *rows()], {"merged": "A1:A2"}),
        ([NAMES, *rows(german)], {}),
        ([NAMES, *rows(lambda k, x: german(k, x) if k % 2 else float(x))], {}),
        ([["Date", "Time", *NAMES[1:]], *map(moments, rows())], {}),
        ([NAMES, *rows()], {"more": [("calibration", [["gain", "offset"], [1.0, 2.0]])]}),
    ],
    ids=["title", "merged header", "German texts", "some texts", "date and clock", "calibration"],
)
def test_workbooks_as_people_make_them(tmp_path, table, options):
    same(ss.read_record(workbook(tmp_path / "r.xlsx", table, **options)))


def test_formulas_without_values_are_told(tmp_path):
    table = [NAMES, *rows(lambda k, x: "=B2/D2" if k == 2 else float(x))]
    with pytest.raises(ss.NotAvailable, match="'Friction' holds formulas without their values"):
        ss.read_record(workbook(tmp_path / "r.xlsx", table))


def test_runs_of_the_same_columns_are_not_mixed(tmp_path):
    """The columns of the last group were taken, whichever was meant."""
    h5py = pytest.importorskip("h5py")
    savemat = pytest.importorskip("scipy.io").savemat
    with h5py.File(tmp_path / "r.h5", "w") as file:
        for k, run in enumerate(("first", "second")):
            for name, values in zip(NAMES, COLUMNS, strict=True):
                file[f"{run}/{name}"] = values + k
    run = dict(zip(("Time_s", "lp_disp_um", "mu", "sn_MPa"), COLUMNS, strict=True))
    savemat(tmp_path / "r.mat", {"first": run, "second": {name: values + 1 for name, values in run.items()}})
    for ending, kind in ((".h5", "groups"), (".mat", "structures")):
        with pytest.raises(ss.NotAvailable, match=f"in several {kind}; say which with table=: first, second"):
            ss.read_record(tmp_path / f"r{ending}")
        same(ss.read_record(tmp_path / f"r{ending}", table="first"))


def test_matrices_whose_columns_are_named_beside_them(tmp_path):
    """As MATLAB's importdata leaves them, and as an attribute of a dataset."""
    h5py = pytest.importorskip("h5py")
    savemat = pytest.importorskip("scipy.io").savemat
    savemat(tmp_path / "r.mat", {"p": {"data": np.array(COLUMNS).T, "colheaders": np.array(NAMES, dtype=object)}})
    same(ss.read_record(tmp_path / "r.mat"))
    with h5py.File(tmp_path / "r.h5", "w") as file:
        file.create_dataset("run/data", data=np.array(COLUMNS).T).attrs["columns"] = list(NAMES)
    same(ss.read_record(tmp_path / "r.h5"))


@pytest.mark.parametrize("kind", ["moments", "durations"])
def test_parquet_with_times_of_its_own_kind(tmp_path, kind):
    arrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    spans = (1e6 * TIME).astype("timedelta64[us]")
    times = np.datetime64(START) + spans if kind == "moments" else spans
    table = arrow.table(dict(zip(("Time", *NAMES[1:]), (times, *COLUMNS[1:]), strict=True)))
    parquet.write_table(table, tmp_path / "r.parquet")
    same(ss.read_record(tmp_path / "r.parquet"))


@pytest.mark.parametrize(
    ("begin", "told"),
    [(b"\xd0\xcf\x11\xe0", "save it as .xlsx"), (b"PK\x03\x04", "unpack an archive"), (b"\x1f\x8b", "unpack it"),
     (b"ARROW1", "save it as .parquet")],
)  # fmt: skip
def test_files_of_other_kinds_are_told_what_to_become(tmp_path, begin, told):
    (tmp_path / "r.dat").write_bytes(begin + bytes(100))
    with pytest.raises(ss.NotAvailable, match=told):
        ss.read_record(tmp_path / "r.dat")
