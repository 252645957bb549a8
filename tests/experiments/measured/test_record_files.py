"""Kinds of files that laboratories have in their folders: XLOOK, Excel, TDMS, MATLAB, netCDF."""

from __future__ import annotations

import struct

import numpy as np
import pytest

import steadyslip as ss
from measured_columns import HEADER, ROWS, UNITS, columns, same_record, table


def xlook(kind, order=">", channels=32, header=">"):
    """The bytes that XLOOK writes, typed from the description of its format."""
    time, friction, normal, moved = columns()
    table = [("Lp_Disp", "mic", moved), ("Shr_stress", "MPa", friction * normal), ("Nor_stress", "MPa", normal),
             ("Time", "sec", time)]  # fmt: skip
    raw = b"p9999".ljust(20, b"\0") + struct.pack(f"{header}iiii", ROWS, len(table), 0, 0)
    for name, unit, _ in table:
        raw += name.encode().ljust(13, b"\0") + unit.encode().ljust(13, b"\0") + struct.pack(">f", 1.0)
        raw += b"".ljust(50, b"\0") + struct.pack(">i", ROWS)
    for _ in range(channels - len(table)):
        raw += b"no_val".ljust(13, b"\0") + bytes(71)
    return raw + b"".join(np.asarray(values).astype(order + kind).tobytes() for *_, values in table)


@pytest.mark.parametrize(
    "layout",
    [("f4", ">"), ("f8", ">"), ("f8", "<"), ("f4", ">", 16), ("f4", "<", 16, "<"), ("f8", "<", 16)],
)
def test_xlook_files_are_read(tmp_path, layout):
    path = tmp_path / "p9999"
    path.write_bytes(xlook(*layout))
    record = ss.read_record(path)
    time, friction, normal, moved = columns()
    np.testing.assert_allclose(record.time, time, rtol=1e-6)
    np.testing.assert_allclose(record.friction, friction, rtol=1e-6)
    np.testing.assert_allclose(record.normal, 1e6 * normal, rtol=1e-6)
    np.testing.assert_allclose(record.displacement, 1e-6 * moved, rtol=1e-6)
    assert any("XLOOK" in note for note in record.notes)


@pytest.mark.parametrize("counted", [True, False])
@pytest.mark.parametrize("large", [10, 10**6])
def test_xlook_texts_are_read(tmp_path, monkeypatch, counted, large):
    """With and without the column that counts rows, which has no name; large ones are parsed by NumPy."""
    monkeypatch.setattr("steadyslip.experiments.measured.formats.text.LARGE", large)
    time, friction, normal, moved = columns()
    about = [("LP_Disp", "micron", moved), ("Nor_stress", "MPa", normal), ("Time", "sec", time), ("mu", ".", friction)]
    heads = [[f"col {k}" for k in range(1, 5)], *zip(*(one[:2] for one in about), strict=True), [f"{ROWS} recs"] * 4]
    lines = [f"number of records = {ROWS}", *("     " + "".join(f"{cell:12s}" for cell in row) for row in heads)]
    for k, row in enumerate(zip(*(one[2] for one in about), strict=True)):
        lines.append((f"{k:5d} " if counted else "") + " ".join(f"{x:15.9g}" for x in row))
    path = tmp_path / "p1.txt"
    path.write_text("\n".join(lines) + "\n")
    record = ss.read_record(path)
    np.testing.assert_allclose(record.time, time, rtol=1e-8)
    np.testing.assert_allclose(record.friction, friction, rtol=1e-8)
    np.testing.assert_allclose(record.normal, 1e6 * normal, rtol=1e-8)
    np.testing.assert_allclose(record.displacement, 1e-6 * moved, rtol=1e-8)


def test_a_damaged_xlook_file_is_refused(tmp_path):
    whole = xlook("f4")
    for damaged in (whole[:-3], whole[: len(whole) // 2], whole + b"\0"):
        (tmp_path / "p1").write_bytes(damaged)
        with pytest.raises(ss.NotAvailable, match=r"damaged XLOOK file.*copy it again"):
            ss.read_record(tmp_path / "p1")


def workbook(path, rows, *, title="p1", more=()):
    from openpyxl import Workbook

    book = Workbook()
    for name, content in [(title, rows), *more]:
        sheet = book.active if name == title else book.create_sheet(name)
        sheet.title = name
        for row in content:
            sheet.append(list(row))
    book.save(path)


@pytest.mark.parametrize(
    "above",
    [[("Experiment", "p1"), (), HEADER, UNITS], [tuple(f"{n} ({u})" for n, u in zip(HEADER, UNITS, strict=True))]],
)
def test_workbooks(tmp_path, above):
    workbook(tmp_path / "r.xlsx", [*above, *table()], more=[("notes", [("made by", "hand")])])
    same_record(ss.read_record(tmp_path / "r.xlsx"))
    same_record(ss.read_record(tmp_path / "r.xlsx", table="p1"))


def test_workbooks_with_clocks_gaps_and_words(tmp_path):
    import datetime

    start = datetime.datetime(2024, 2, 28, 23, 59, 50)
    rows = [(start + datetime.timedelta(seconds=row[0]), *row[1:]) for row in table()]
    rows[7] = (*rows[7][:2], "n/a", rows[7][3])
    rows[9] = (*rows[9][:2], "broken", rows[9][3])
    names = ("Uhrzeit", "Weg (um)", "Reibwert", "Normalspannung (MPa)")
    workbook(tmp_path / "r.xlsx", [names, *rows])
    record = ss.read_record(tmp_path / "r.xlsx")
    assert len(record) == ROWS - 2
    np.testing.assert_allclose(record.time, np.delete(columns()[0], [7, 9]), atol=1e-3)  # a sheet has ms
    assert any("1 cells that are no numbers" in note for note in record.notes)


def test_a_workbook_with_several_tables_asks_which(tmp_path):
    workbook(tmp_path / "r.xlsx", [HEADER, UNITS, *table()], more=[("p2", [HEADER, UNITS, *table()])])
    with pytest.raises(ss.NotAvailable, match=r"several sheets.*p1, p2"):
        ss.read_record(tmp_path / "r.xlsx")
    with pytest.raises(ss.NotAvailable, match="has no sheet 'p3'; it has p1, p2"):
        ss.read_record(tmp_path / "r.xlsx", table="p3")
    same_record(ss.read_record(tmp_path / "r.xlsx", table="p2"))


@pytest.mark.parametrize("ending", [".xlsx", ".tdms", ".nc", ".mat", ".parquet", ".h5"])
def test_a_damaged_file_is_one_message(tmp_path, ending):
    path = tmp_path / f"r{ending}"
    for content in (b"", b"PK\x03\x04 nothing", b"TDSm" + bytes(60), b"CDF\x01" + b"\xff" * 40, b"not at all"):
        path.write_bytes(content)
        with pytest.raises(ss.NotAvailable, match="r"):
            ss.read_record(path)


@pytest.mark.parametrize("timed", [True, False])
def test_tdms(tmp_path, timed):
    """With a channel of times, or with the sampling interval that LabVIEW notes for a waveform."""
    from nptdms import ChannelObject, TdmsWriter

    time, friction, normal, moved = columns()
    about = {} if timed else {"wf_increment": float(time[1]), "wf_start_offset": 0.0}
    named = {"Load displacement": (moved, "um"), "Friction": (friction, ""), "Normal stress": (normal, "MPa")}
    channels = [ChannelObject("run", n, v, {**about, "unit_string": u}) for n, (v, u) in named.items()]
    if timed:
        channels.append(ChannelObject("run", "Time", time, {"unit_string": "s"}))
    with TdmsWriter(tmp_path / "r.tdms") as writer:
        writer.write_segment(channels)
    same_record(ss.read_record(tmp_path / "r.tdms"), notes="" if timed else "sampling interval")
    same_record(ss.read_record(tmp_path / "r.tdms", table="run"))
    with pytest.raises(ss.NotAvailable, match="has no group 'other'; it has run"):
        ss.read_record(tmp_path / "r.tdms", table="other")


def test_structures_and_matrices_of_matlab(tmp_path):
    from scipy.io import savemat

    time, friction, normal, moved = columns()
    data = {"time_s": time, "lp_disp_um": moved, "mu": friction, "sigma_n_MPa": normal}
    savemat(tmp_path / "s.mat", {"p1": {"about": "a run", "data": data}, "other": np.arange(5.0)})
    same_record(ss.read_record(tmp_path / "s.mat"))
    same_record(ss.read_record(tmp_path / "s.mat", table="p1.data"))
    with pytest.raises(ss.NotAvailable, match=r"has no variable 'p2'; it has .*p1.data"):
        ss.read_record(tmp_path / "s.mat", table="p2")
    savemat(tmp_path / "m.mat", {"m": np.column_stack([time, moved, friction, normal])})
    mapping = {"time": 1, "displacement": (2, "um"), "friction": 3, "normal": {"column": 4, "unit": "MPa"}}
    same_record(ss.read_record(tmp_path / "m.mat", **mapping))


def test_classic_netcdf_and_saved_runs(tmp_path):
    import netCDF4

    with netCDF4.Dataset(tmp_path / "r.nc", "w", format="NETCDF3_CLASSIC") as file:
        file.createDimension("row", ROWS)
        for name, unit, values in zip(HEADER, UNITS, np.transpose(table()), strict=True):
            variable = file.createVariable(name.replace(" ", "_"), "f8", ("row",))
            variable.units = unit
            variable[:] = values
    same_record(ss.read_record(tmp_path / "r.nc"))


# -- arrays of structures and cells, in both kinds of MATLAB's files


def in_matlab_7_3(path, variables):
    """What MATLAB writes with ``-v7.3``: HDF5 with the class of each object; matrices with rows for columns.

    A dictionary is a structure, a list of dictionaries an array of them, any other list a cell array.
    """
    h5py = pytest.importorskip("h5py")

    def of_class(item, name):
        item.attrs["MATLAB_class"] = np.bytes_(name)
        return item

    def put(file, group, name, value):
        if isinstance(value, dict):
            own = of_class(group.create_group(name), "struct")
            for field, one in value.items():
                put(file, own, field, one)
        elif isinstance(value, list) and isinstance(value[0], dict):
            own = of_class(group.create_group(name), "struct")
            for field in value[0]:
                own.create_dataset(field, data=references(file, [one[field] for one in value]))
        elif isinstance(value, list):
            of_class(group.create_dataset(name, data=references(file, value)), "cell")
        elif isinstance(value, str) and not value:
            of_class(group.create_dataset(name, data=np.zeros(2, "u8")), "char").attrs["MATLAB_empty"] = 1
        elif isinstance(value, str):
            of_class(group.create_dataset(name, data=np.array([[ord(c)] for c in value], "u2")), "char")
        else:
            of_class(group.create_dataset(name, data=np.atleast_2d(np.asarray(value, float).T)), "double")

    def references(file, values):
        hidden, found = file.require_group("#refs#"), []
        for value in values:
            own = f"r{len(hidden)}"
            put(file, hidden, own, value)
            found.append(hidden[own].ref)
        return np.array(found, dtype=h5py.ref_dtype)[:, None]

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            put(file, file, name, value)
    with path.open("r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def in_matlab_5(path, variables):
    from scipy.io import savemat

    def plain(value):
        if isinstance(value, list) and isinstance(value[0], dict):
            members = np.empty((1, len(value)), dtype=[(field, object) for field in value[0]])
            for k, one in enumerate(value):
                members[0, k] = tuple(one.values())
            return members
        if isinstance(value, list):
            cells = np.empty((1, len(value)), dtype=object)
            cells[0, :] = value
            return cells
        return {key: plain(one) for key, one in value.items()} if isinstance(value, dict) else value

    savemat(path, {name: plain(value) for name, value in variables.items()})


BOTH = pytest.mark.parametrize("write", [in_matlab_5, in_matlab_7_3])


@BOTH
def test_an_array_of_structures_a_row_in_each(tmp_path, write):
    names = ("time_s", "lp_disp_um", "mu", "sn_MPa")
    write(tmp_path / "r.mat", {"rec": [dict(zip(names, row, strict=True)) for row in table()], "gain": 2.0})
    same_record(ss.read_record(tmp_path / "r.mat"))


@BOTH
def test_an_array_of_structures_a_run_in_each(tmp_path, write):
    time, friction, normal, moved = columns()
    run = {"time_s": time, "lp_disp_um": moved, "mu": friction, "sn_MPa": normal}
    other = {name: values + 1 for name, values in run.items()}
    write(tmp_path / "r.mat", {"exp": [{"about": "first", "d": run}, {"about": "second", "d": other}]})
    with pytest.raises(ss.NotAvailable, match=r"say which with table=: exp\(1\).d, exp\(2\).d"):
        ss.read_record(tmp_path / "r.mat")
    for which in ("exp(1)", "exp(1).d"):
        same_record(ss.read_record(tmp_path / "r.mat", table=which))
    assert ss.read_record(tmp_path / "r.mat", table="exp(2)").friction[0] == pytest.approx(friction[0] + 1)


@BOTH
def test_channels_in_an_array_of_structures(tmp_path, write):
    time, friction, normal, moved = columns()
    channels = [{"name": name, "unit": unit.strip("-"), "data": values}
                for name, unit, values in zip(HEADER, UNITS, (time, moved, friction, normal), strict=True)]  # fmt: skip
    write(tmp_path / "r.mat", {"p1": {"channels": channels, "made": "by hand"}})
    same_record(ss.read_record(tmp_path / "r.mat"))


@BOTH
def test_cells_with_names_beside_them(tmp_path, write):
    time, friction, normal, moved = columns()
    names = [f"{name} ({unit})" for name, unit in zip(HEADER, UNITS, strict=True)]
    write(tmp_path / "c.mat", {"data": [time, moved, friction, normal], "names": names})
    same_record(ss.read_record(tmp_path / "c.mat"))
    write(tmp_path / "m.mat", {"data": np.column_stack([time, moved, friction, normal]), "names": names})
    same_record(ss.read_record(tmp_path / "m.mat"))


def in_groups(path, groups):
    from nptdms import ChannelObject, TdmsWriter

    with TdmsWriter(path) as writer:
        channels = [ChannelObject(g, n, v, {"unit_string": u}) for g, n, v, u in groups]
        writer.write_segment(channels)


def test_tdms_of_several_groups(tmp_path):
    time, friction, normal, moved = columns()
    own = list(zip(HEADER, (time, moved, friction, normal), UNITS, strict=True))
    run = [("run", *one) for one in own]
    in_groups(tmp_path / "r.tdms", [*run, ("slow", "Temperature", np.ones(7), "degC")])
    same_record(ss.read_record(tmp_path / "r.tdms"), notes="left out: slow")
    in_groups(tmp_path / "r.tdms", [(f"group {k}", *one) for k, one in enumerate(own)])
    same_record(ss.read_record(tmp_path / "r.tdms"))
    in_groups(tmp_path / "r.tdms", [*run, *(("again", name, values + 1, unit) for name, values, unit in own)])
    with pytest.raises(ss.NotAvailable, match=r"several groups; say which with table=: run, again|again, run"):
        ss.read_record(tmp_path / "r.tdms")
    in_groups(tmp_path / "r.tdms", [(g, n, v[:-1] if n == HEADER[1] else v, u) for g, n, v, u in run])
    record = ss.read_record(tmp_path / "r.tdms")
    assert len(record) == ROWS - 1
    assert any("59 to 60 values long; cut to the shortest" in note for note in record.notes)


def test_workbooks_with_a_table_beside_the_record(tmp_path):
    beside = [("Area (cm2)", 25.0), ("gain", 2.0), *[(None, None)] * (ROWS - 1)]
    head = tuple(f"{name} ({unit})" for name, unit in zip(HEADER, UNITS, strict=True))
    wide = [(*row, None, *more) for row, more in zip([head, *table()], beside, strict=True)]
    workbook(tmp_path / "r.xlsx", wide)
    same_record(ss.read_record(tmp_path / "r.xlsx"), notes="hardly any numbers were left out: G")
    workbook(tmp_path / "r.xlsx", [UNITS, HEADER, *table()])
    same_record(ss.read_record(tmp_path / "r.xlsx"))
