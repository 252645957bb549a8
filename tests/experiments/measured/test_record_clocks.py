"""Times of records: clocks and dates, none at all, stamps that are coarse, given twice or begin anew."""

from __future__ import annotations

import numpy as np
import pytest

import steadyslip as ss
from measured_columns import HEAD, ROWS, check, columns, plain, read_as, rows
from steadyslip.experiments.measured.formats.cells import moment, seconds_since_first


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


def test_a_clock_passes_midnight():
    np.testing.assert_array_equal(seconds_since_first(np.array([86399.0, 0.0, 1.0])), [0.0, 1.0, 2.0])


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


def test_a_clock_coarser_than_even_sampling_leaves_rates_alone():
    """Stamps in whole seconds, every 0.376 s: rates were 13 % off, because groups of three rows had one slope."""
    time = np.linspace(0.0, 150.0, 400)
    moved = 1e-6 * np.where(time < 60.13, time, 60.13 + 5 * (time - 60.13))
    record = ss.record_from_arrays(np.round(time), friction=0.6 + 0.001 * np.sin(time), displacement=moved)
    np.testing.assert_allclose(record.time - record.time[0], time, atol=0.4)
    assert record.initial_rate == pytest.approx(1e-6, rel=2e-3)
    assert [step.after for step in record.steps] == pytest.approx([5e-6], rel=2e-3)
    assert any("clock is coarser than the sampling (151 times for 400 rows)" in note for note in record.notes)


def test_a_clock_that_begins_anew_is_refused(tmp_path):
    """Half of the rows were left out, and the next that counted was a jump of everything."""
    time, friction, normal, moved = columns()
    text = HEAD + rows(",", plain(np.where(time > 15, time - 15, time)), plain(moved), plain(friction), plain(normal))
    with pytest.raises(ss.ParameterError, match=r"line 32: .* starts again, at 0\.25.* s after 14\.7.* for 29 rows"):
        read_as(tmp_path, text)


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
