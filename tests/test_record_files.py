"""What laboratories have in their folders: XLOOK's binaries, clocks and dates, names in other languages."""

from __future__ import annotations

import struct

import numpy as np
import pytest

import steadyslip as ss
from steadyslip.experiments.measured.columns import guessed_role as role, split_name
from steadyslip.experiments.measured.formats.moments import from_the_first, moment

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
        ("Friction", "friction"), ("frottement", "friction"),
    ],
)  # fmt: skip
def test_names_in_several_languages(name, expected):
    assert role(*split_name(name)) == expected


def same_record(record, *, notes=""):
    time, friction, normal, moved = columns()
    np.testing.assert_allclose(record.time, time, atol=1e-9)
    np.testing.assert_allclose(record.friction, friction)
    np.testing.assert_allclose(record.normal, 1e6 * normal)
    np.testing.assert_allclose(record.displacement, 1e-6 * moved)
    assert notes in "\n".join(record.notes)


def workbook(path, rows, *, title="p1", more=()):
    from openpyxl import Workbook

    book = Workbook()
    for name, content in [(title, rows), *more]:
        sheet = book.active if name == title else book.create_sheet(name)
        sheet.title = name
        for row in content:
            sheet.append(list(row))
    book.save(path)


HEADER = ("Time", "Load displacement", "Friction", "Normal stress")
UNITS = ("s", "um", "-", "MPa")


def table():
    time, friction, normal, moved = columns()
    return [tuple(map(float, row)) for row in zip(time, moved, friction, normal, strict=True)]


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


@pytest.mark.parametrize(
    ("kept", "options", "note"),
    [
        (("x", "mu", "sn"), {"rate": "3 um/s"}, "over the given rate, 3 um/s"),
        (("x", "mu", "sn"), {"sampling": 30 / (ROWS - 1)}, "a row every"),
        (("x", "v", "mu", "sn"), {}, "over its own rate"),
    ],
)
def test_records_without_time(tmp_path, kept, options, note):
    time, friction, normal, moved = columns()
    found = {"x": ("lp_disp_um", moved), "v": ("velocity (um/s)", 3.0 + 0 * time), "mu": ("friction", friction),
             "sn": ("normal stress (MPa)", normal)}  # fmt: skip
    rows = np.column_stack([found[name][1] for name in kept])
    header = ",".join(found[name][0] for name in kept)
    scale = columns()[0][-1] / (moved[-1] - moved[0])
    np.savetxt(tmp_path / "r.csv", rows, delimiter=",", header=header, comments="")
    record = ss.read_record(tmp_path / "r.csv", **options)
    expected = time if "sampling" in options else (moved - moved[0]) / 3.0
    np.testing.assert_allclose(record.time, expected, rtol=1e-12, atol=1e-9)
    assert any(note in one for one in record.notes), scale


def test_without_time_the_message_says_what_would_do(tmp_path):
    np.savetxt(
        tmp_path / "r.csv", np.column_stack(columns()[1:]), delimiter=",", header="friction,sn_MPa,x_um", comments=""
    )
    with pytest.raises(ss.ParameterError, match=r"give sampling .*, or rate"):
        ss.read_record(tmp_path / "r.csv")
    with pytest.raises(ss.ParameterError, match="sampling: got"):
        ss.read_record(tmp_path / "r.csv", sampling=-1)


# -- stamps


def record_at(stamps):
    """A load point at 3 um/s, sampled every 10 ms, whatever the clock says."""
    true = 0.01 * np.arange(len(stamps))
    return ss.record_from_arrays(stamps, friction=0.6 + 0.001 * true, normal=1e7, displacement=3e-6 * true)


def test_a_clock_coarser_than_the_sampling_is_spread():
    true = 0.01 * np.arange(600)
    record = record_at(np.floor(true * 10 + 1e-9) / 10)
    np.testing.assert_allclose(record.time, true, atol=1e-9)
    assert record.steps == ()
    assert any("600 rows share a time" in note for note in record.notes)


def test_a_stamp_given_twice_for_the_next_is_put_right():
    true = 0.01 * np.arange(600)
    stamps = true.copy()
    stamps[300] = stamps[299]
    record = record_at(stamps)
    np.testing.assert_allclose(record.time, true, atol=1e-9)
    assert record.steps == ()


def test_a_row_written_twice_is_one():
    true = 0.01 * np.arange(600)
    twice = np.sort(np.concatenate([np.arange(600), [77, 300, 300]]))
    record = ss.record_from_arrays(
        true[twice], friction=0.6 + 0.001 * true[twice], normal=1e7, displacement=3e-6 * true[twice]
    )
    np.testing.assert_array_equal(record.time, true)
    assert record.steps == ()
    assert any("3 rows repeat the time" in note for note in record.notes)


# -- large records


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
    monkeypatch.setattr(text, "LOOKED_AT", 4000)
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


def test_means_take_the_place_of_many_samples():
    """White noise: the mean of n is worth n. Nothing is averaged across a step, and what is linear stays so."""
    rng = np.random.default_rng(5)
    time = 0.01 * np.arange(20_000)
    moved = 3e-6 * time + 7e-6 * np.maximum(time - 80.0, 0.0)
    noise = 1e-3 * rng.standard_normal(len(time))
    record = ss.record_from_arrays(time, friction=0.6 + noise, normal=1e7, displacement=moved)
    few = record.decimated(500)
    assert 490 <= len(few) <= 520
    assert few.worth.sum() == pytest.approx(len(record), rel=0.1)  # whiteness itself is told from the noise
    np.testing.assert_allclose(few.displacement, 3e-6 * few.time + 7e-6 * np.maximum(few.time - 80.0, 0.0), rtol=1e-9)
    assert np.average(few.friction, weights=few.worth) == pytest.approx(np.mean(record.friction), abs=2e-6)
    spread = np.std((few.friction - 0.6) * np.sqrt(few.worth))
    assert spread == pytest.approx(1e-3, rel=0.15)
    assert few.loading is record.loading
    assert [step.time for step in few.steps] == [step.time for step in record.steps]


@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
def test_worth_of_means_of_noise_that_lasts(memory):
    """The deviation of means times the root of their worth is that of single samples, whatever the noise remembers."""
    from scipy.signal import lfilter

    rng = np.random.default_rng(6)
    noise = lfilter([1e-3 * np.sqrt(1 - memory**2)], [1, -memory], rng.standard_normal(100_000))
    time = 0.01 * np.arange(len(noise))
    few = ss.record_from_arrays(time, friction=0.6 + noise, normal=1e7, displacement=3e-6 * time).decimated(3000)
    late = few.time > 100
    spread = np.std((few.friction[late] - 0.6) * np.sqrt(few.worth[late]))
    assert spread == pytest.approx(np.std(noise), rel=0.1)


@pytest.mark.parametrize(
    ("role", "change", "told"),
    [
        ("time", lambda t: 0 * t + 3.0, "was the clock running"),
        ("time", lambda t: 1e-100 * t, "was the clock running"),
        ("normal", lambda s: 1e160 * s, "normal: line .*1e\\+167.* in SI units; allowed: sizes up to 1e\\+60"),
        ("displacement", lambda x: 1e300 * x, "displacement: line .* in SI units"),
    ],
)
def test_a_stuck_clock_and_absurd_numbers_are_told(tmp_path, role, change, told):
    time, friction, normal, moved = columns()
    table = {"time": time, "friction": friction, "normal": normal, "displacement": moved}
    table[role] = change(table[role])
    path = tmp_path / "record.txt"
    head = "time(s) friction normal(MPa) displacement(um)"
    np.savetxt(path, np.column_stack(list(table.values())), header=head, comments="")
    with pytest.raises(ss.ParameterError, match=told):
        ss.read_record(path)


# -- odd but honest texts


def rows(separator, *cells):
    return "\n".join(separator.join(row) for row in zip(*cells, strict=True)) + "\n"


def plain(values, digits=6):
    return [f"{x:.{digits}f}" for x in values]


HEAD = "Time (s),Displacement (um),Friction,Normal stress (MPa)\n"


def read_as(tmp_path, text, **options):
    path = tmp_path / "odd.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return ss.read_record(path, **options)


def check(record):
    time, friction, normal, moved = columns()
    np.testing.assert_allclose(record.time, time, atol=1e-4)
    np.testing.assert_allclose(record.friction, friction, atol=1e-5)
    np.testing.assert_allclose(record.normal, 1e6 * normal, rtol=1e-5)
    np.testing.assert_allclose(record.displacement, 1e-6 * moved, rtol=1e-5)


def test_dates_and_clocks_in_columns_of_their_own_across_midnight(tmp_path):
    """As German loggers export: two columns, decimal commas, day before month; the date goes on at midnight."""
    time, friction, normal, moved = columns()
    clock = [
        f"{int(86390 + t) // 3600 % 24:02d}:{int(86390 + t) // 60 % 60:02d}:{(86390 + t) % 60:07.4f}" for t in time
    ]
    dates = ["31.12.2023" if t < 10 else "01.01.2024" for t in time]
    cells = [clock, plain(1e-3 * moved), plain(friction), plain(normal)]
    text = rows(";", dates, *([c.replace(".", ",") for c in column] for column in cells))
    record = read_as(tmp_path, "Datum;Uhrzeit;Weg in mm;Reibwert;Normalspannung in MPa\n" + text)
    check(record)
    assert any("are those of the dates in 'Datum'" in note for note in record.notes)


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("31.12.1970 00:00:01,5", 364 * 86400 + 1.5),
        ("12/31/1970 11:00:00 PM", 364 * 86400 + 23 * 3600.0),
        ("31/12/1970 12:00:00 am", 364 * 86400.0),
        ("12:30:00 pm", 45000.0),
        ("1:00:00", 3600.0),
        ("32.12.1970 00:00:00", None),
        ("1.5", None),
        ("02.03", None),
    ],
)
def test_dates_as_people_write_them(text, seconds):
    assert moment(text) == seconds


def test_unicode_text_fortran_exponents_and_quoted_names(tmp_path):
    time, friction, normal, moved = columns()
    table = rows("\t", plain(time), plain(moved), plain(friction), plain(normal))
    check(read_as(tmp_path, HEAD.replace(",", "\t").encode("utf-16") + table.encode("utf-16-le")))
    fortran = [[f"{x:.7E}".replace("E", "D") for x in column] for column in (time, moved, friction, normal)]
    check(read_as(tmp_path, HEAD + rows(",", *fortran)))
    quoted = '"Time (s)","Way, total","Friction","Normal stress (MPa)"\n'.replace("Way, total", "Way")
    text = quoted + rows(",", plain(time), plain(moved), plain(friction), plain(normal))
    check(read_as(tmp_path, text, displacement=("Way", "um")))


@pytest.mark.parametrize(
    "names",
    ["Tiempo (s),Desplazamiento (um),Coeficiente de fricción,Esfuerzo normal (MPa)",
     "Tempo (s),Spostamento (um),Attrito,Sforzo normale (MPa)"],
)  # fmt: skip
def test_names_in_spanish_and_italian(tmp_path, names):
    time, friction, normal, moved = columns()
    check(read_as(tmp_path, names + "\n" + rows(",", plain(time), plain(moved), plain(friction), plain(normal))))


def test_a_clock_that_begins_anew_is_refused(tmp_path):
    """Half of the rows were left out, and the next that counted was a jump of everything."""
    time, friction, normal, moved = columns()
    text = HEAD + rows(",", plain(np.where(time > 15, time - 15, time)), plain(moved), plain(friction), plain(normal))
    with pytest.raises(ss.ParameterError, match=r"line 32: the clock begins anew, 0\.25.* s after 14\.7.* for 29 rows"):
        read_as(tmp_path, text)


def test_a_clock_coarser_than_even_sampling_leaves_rates_alone():
    """Stamps in whole seconds, every 0.376 s: rates were 13 % off, because groups of three rows had one slope."""
    time = np.linspace(0.0, 150.0, 400)
    moved = 1e-6 * np.where(time < 60.13, time, 60.13 + 5 * (time - 60.13))
    record = ss.record_from_arrays(np.round(time), friction=0.6 + 0.001 * np.sin(time), displacement=moved)
    np.testing.assert_allclose(record.time - record.time[0], time, atol=0.4)
    assert record.initial_rate == pytest.approx(1e-6, rel=2e-3)
    assert [step.after for step in record.steps] == pytest.approx([5e-6], rel=2e-3)
    assert any("clock is coarser than the sampling (151 times for 400 rows)" in note for note in record.notes)
