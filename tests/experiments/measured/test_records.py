"""Records: whatever comes in is read, or refused with the reason; nothing is mended without a note."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings, strategies as st

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.loading.kinks import load_course
from steadyslip.experiments.loading.pressing import oscillation
from steadyslip.experiments.measured.columns import split_name
from steadyslip.experiments.measured.record import bin_starts


@pytest.fixture(scope="module")
def clean():
    return lab.columns(lab.rig(), lab.STEP, 400)


def write(path, table, header, mark=",", form="%.10g"):
    np.savetxt(path, np.column_stack(table), form, mark, header=header, comments="")
    return path


def same(record, clean):
    np.testing.assert_allclose(record.time, clean["time"], rtol=1e-8)
    np.testing.assert_allclose(record.friction, clean["friction"], rtol=1e-8)
    np.testing.assert_allclose(record.displacement - record.displacement[0], clean["displacement"], atol=1e-13)
    np.testing.assert_allclose(record.normal, clean["normal"], rtol=1e-8)


@pytest.mark.parametrize(
    ("header", "mark"),
    [
        ("Time(s)\tDispl(microns)\tFriction\tNormal_stress(MPa)", "\t"),
        ("time_s,load point displacement [um],mu,sigma_n (MPa)", ","),
        ("Elapsed time;lp_disp_um;COF;Effective_Normal_stress(MPa)", ";"),
        ("t x_lp_um friction normal_MPa", " "),
        ("# time (s)  load displacement (um)  friction  normal stress (MPa)", " "),
        ("t[s] x[um] mu[-] sigma[MPa]", " "),
        ("t/s x/um mu/1 sigma/MPa", " "),
    ],
)
def test_columns_are_found_by_their_names(tmp_path, clean, header, mark):
    table = [clean["time"], 1e6 * clean["displacement"], clean["friction"], 1e-6 * clean["normal"]]
    path = write(tmp_path / "r.txt", table, header, mark)
    given = {"displacement": "x_lp_um"} if "x_lp" in header else {}
    same(ss.read_record(path, **given), clean)


def test_a_column_named_d_is_a_displacement_only_as_a_small_letter_with_a_length(tmp_path, clean):
    table = [clean["time"], 1e6 * clean["displacement"], clean["friction"]]
    found = [ss.read_record(write(tmp_path / "r.csv", table, f"t[s],{name},mu")) for name in ("d[um]", "D[um]", "D")]
    assert [record.displacement is not None for record in found] == [True, False, False]
    both = write(tmp_path / "r.csv", [*table[:2], *table[1:]], "t[s],x[mm],disp[um],mu")
    assert ss.read_record(both).displacement[-1] == pytest.approx(clean["displacement"][-1])


@pytest.mark.parametrize(
    ("units", "odd"),
    [
        (("ms", "um", "MPa"), ""),
        (("ms", "m", "MPa"), "the load point moves"),
        (("ms", "mm", "MPa"), "the load point moves"),
        (("s", "um", "MPa"), "samples come every"),
        (("ms", "um", "kPa"), "the normal stress is"),
    ],
)
def test_a_column_in_another_unit_raises_a_word(tmp_path, clean, units, odd):
    table = [1e3 * clean["time"], 1e6 * clean["displacement"], clean["friction"], 1e-6 * clean["normal"]]
    head = "time[{}],disp[{}],mu,normal[{}]".format(*units)
    notes = ss.read_record(write(tmp_path / "r.csv", table, head)).notes
    found = [note for note in notes if "unusual in a laboratory" in note]
    assert found[-1:] == [note for note in found if odd and note.startswith(odd)][-1:]


def test_a_line_of_units_below_the_names(tmp_path, clean):
    table = [clean["time"], 1e6 * clean["displacement"], clean["friction"], 1e-6 * clean["normal"]]
    path = write(tmp_path / "r.csv", table, "Time,Displacement,Friction,Normal stress\ns,um,-,MPa")
    same(ss.read_record(path), clean)


def test_without_a_header_columns_have_numbers(tmp_path, clean):
    table = [clean["time"], 1e6 * clean["displacement"], clean["friction"], 1e-6 * clean["normal"]]
    path = tmp_path / "r.dat"
    np.savetxt(path, np.column_stack(table), "%.10g")
    columns = {"time": (1, "s"), "displacement": (2, "um"), "friction": 3, "normal": {"column": 4, "unit": "MPa"}}
    same(ss.read_record(path, **columns), clean)


def test_decimal_commas(tmp_path, clean):
    table = np.column_stack([clean["time"], 1e6 * clean["displacement"], clean["friction"], 1e-6 * clean["normal"]])
    lines = [";".join(f"{x:.10g}".replace(".", ",") for x in row) for row in table]
    path = tmp_path / "r.csv"
    path.write_text("Time(s);Displ(um);Friction;Normal(MPa)\n" + "\n".join(lines))
    record = ss.read_record(path)
    same(record, clean)
    assert any("decimal comma" in note for note in record.notes)


def test_friction_is_shear_over_normal_stress_and_forces_have_an_area(tmp_path, clean):
    force = clean["normal"] * 0.01
    table = [clean["time"], 1e3 * clean["displacement"], 1e-3 * clean["friction"] * force, 1e-3 * force]
    path = write(tmp_path / "r.csv", table, "time (s),load point (mm),shear force (kN),normal force (kN)")
    record = ss.read_record(path, area="100 cm^2", displacement="load point (mm)")
    same(record, clean)
    np.testing.assert_allclose(record.shear, clean["friction"] * clean["normal"], rtol=1e-8)
    assert any("computed as shear over normal" in note for note in record.notes)


def test_hdf5_matlab_and_parquet(tmp_path, clean):
    import h5py
    import pyarrow
    import pyarrow.parquet
    from scipy.io import savemat

    with h5py.File(tmp_path / "r.h5", "w") as file:
        group = file.create_group("run7")
        stored = {
            "time": (clean["time"], "s"),
            "load_disp": (1e6 * clean["displacement"], "um"),
            "friction": (clean["friction"], "1"),
            "normal": (1e-6 * clean["normal"], "MPa"),
        }
        for name, (values, unit) in stored.items():
            group[name] = values
            group[name].attrs["units"] = unit
        group["other"] = np.zeros(7)
    record = ss.read_record(tmp_path / "r.h5", table="run7")
    same(record, clean)
    assert any("left out" in note and "other" in note for note in record.notes)
    named = {"time_s": clean["time"], "disp_um": 1e6 * clean["displacement"], "friction": clean["friction"],
             "normal_MPa": 1e-6 * clean["normal"]}  # fmt: skip
    savemat(tmp_path / "r.mat", {"data": named})
    same(ss.read_record(tmp_path / "r.mat", table="data"), clean)
    pyarrow.parquet.write_table(pyarrow.table(named), tmp_path / "r.parquet")
    same(ss.read_record(tmp_path / "r.parquet"), clean)


def test_velocity_alone_is_integrated_and_reported(clean):
    run = ss.simulate(lab.rig(), lab.STEP, times=clean["time"], events=False)
    record = ss.record_from_arrays(clean["time"], friction=clean["friction"], velocity=run["load_velocity"])
    assert record.integrated
    assert any("integrated" in note for note in record.notes)
    np.testing.assert_allclose(record.displacement, clean["displacement"], atol=2e-6)


def spoiled(clean, rng):
    """The same rows with one of each kind of fault."""
    table = np.column_stack([clean["time"], clean["friction"], clean["normal"], clean["displacement"]])
    rows = [*table[:50], table[40], *table[50:100], [np.nan, 0.6, 1e7, 0.0], *table[100:200], table[199], *table[200:]]
    return np.array(rows)


def test_every_mended_row_is_reported(clean):
    rows = spoiled(clean, None)
    record = ss.record_from_arrays(rows[:, 0], friction=rows[:, 1], normal=rows[:, 2], displacement=rows[:, 3])
    same(record, clean)
    notes = "\n".join(record.notes)
    assert "1 row without a number in time left out (lines 102" in notes
    assert "1 row whose time goes back left out (lines 51" in notes
    assert "1 row repeats the time" in notes


def test_gaps_and_back_steps_are_reported(clean):
    keep = np.ones(len(clean["time"]), dtype=bool)
    keep[200:260] = False
    moved = clean["displacement"].copy()
    moved[100] -= 5e-6
    record = ss.record_from_arrays(
        clean["time"][keep], friction=clean["friction"][keep], normal=1e7, displacement=moved[keep]
    )
    notes = "\n".join(record.notes)
    assert "1 gaps in time" in notes
    assert "steps back 1 times" in notes
    assert "sampling is not uniform" in notes


def faults(path, **options):
    with pytest.raises(ss.SteadyslipError) as caught:
        ss.read_record(path, **options)
    return str(caught.value)


def test_what_is_wrong_with_a_file_is_said(tmp_path, clean):
    table = [clean["time"], 1e6 * clean["displacement"], clean["friction"], 1e-6 * clean["normal"]]
    good = "Time(s),Displ(um),Friction,Normal_stress(MPa)"
    path = write(tmp_path / "r.csv", table, good)
    text = path.read_text().splitlines()
    (tmp_path / "cut.csv").write_text("\n".join([*text[:-1], text[-1][:12]]))
    message = faults(tmp_path / "cut.csv")
    assert "line 401: " in message
    assert "columns where 4 are expected" in message or "column where 4 are expected" in message
    record = ss.read_record(tmp_path / "cut.csv", skip_bad_lines=True)
    assert len(record) == 399
    assert any("1 damaged lines left out: 401" in note for note in record.notes)
    mixed = [*text[:200], text[200].rpartition(",")[0] + ",19969 kPa", *text[201:]]
    (tmp_path / "mixed.csv").write_text("\n".join(mixed))
    message = faults(tmp_path / "mixed.csv")
    assert "line 201" in message
    assert "'19969 kPa' in column 'Normal_stress(MPa)'" in message
    missing = write(tmp_path / "missing.csv", table[:2], "Time(s),Displ(um)")
    message = faults(missing)
    assert "no column for friction" in message
    assert "'Displ(um)'" in message
    assert "is in MPa by its name, but the option says kPa" in faults(path, normal="kPa")
    assert "is in um; expected a quantity in s" in faults(path, time="Displ(um)")
    assert "unknown column 'Frictoin'; did you mean 'Friction'?" in faults(path, friction="Frictoin")
    assert "unknown column role" in faults(path, frction="Friction")
    unitless = write(tmp_path / "unitless.csv", table, "Time(s),Displacement,Friction,Normal stress")
    message = faults(unitless)
    assert "'Displacement' has no unit" in message
    assert "'Normal stress' has no unit" in message
    pascal = write(
        tmp_path / "pa.csv", [table[0], table[2] * 2e7, table[3]], "Time(s),Shear stress(MPa),Normal stress(MPa)"
    )
    assert "which no contact has" in faults(pascal)
    assert "no such file" in faults(tmp_path / "nothing.csv")
    assert "is a folder" in faults(tmp_path)
    (tmp_path / "words.txt").write_text("nothing but words\nand more of them\n")
    assert "no lines of numbers" in faults(tmp_path / "words.txt")
    (tmp_path / "image.txt").write_bytes(b"\x89PNG\0\0\0")
    assert "is not text" in faults(tmp_path / "image.txt")
    (tmp_path / "r.h5").write_bytes(b"no HDF5")
    assert "as HDF5" in faults(tmp_path / "r.h5")
    two = write(tmp_path / "two.csv", [*table, table[3]], good + ",Other_normal(MPa)")
    assert "several columns could be it" in faults(two)


def test_loss_of_contact_is_refused_unless_cut_away(tmp_path, clean):
    normal = clean["normal"].copy()
    normal[:10] = -5.0
    table = [clean["time"], clean["friction"] * clean["normal"], normal]
    path = write(tmp_path / "r.csv", table, "time(s),shear(Pa),normal(Pa)")
    assert "must be > 0 (compression)" in faults(path)
    record = ss.read_record(path, between=(10, "140 s"))
    assert record.time[0] >= 10
    assert "leaves 0 samples" in faults(path, between=(1000, 2000))


@given(
    st.sampled_from(["s", "ms", "min", "um", "mm", "MPa", "kPa", "kN"]),
    st.sampled_from(["{}({})", "{} [{}]", "{}_{}", "{}, {}"]),
)
def test_units_in_names(unit, form):
    head, found = split_name(form.format("column", unit))
    assert head == "column"
    assert found == unit


# -- steps


@settings(max_examples=30, deadline=None)
@example(0.21875, 100.0, 0.001953125, 300)  # the slow piece is lost in the noise
@given(
    st.floats(0.2, 0.8), st.sampled_from([0.1, 0.3, 1.5, 3.0, 10.0, 100.0]), st.floats(0, 3e-3), st.integers(300, 3000)
)
def test_a_velocity_step_is_found_where_it_is(share, ratio, noise, count):
    time = np.linspace(0.0, 100.0, count)
    moved = np.where(time < 100 * share, time, 100 * share + ratio * (time - 100 * share))
    noisy = moved + noise * np.ptp(moved) * np.random.default_rng(1).standard_normal(count)
    found = load_course(time, noisy).changes
    bend = abs(ratio - 1) * min(share, 1 - share) * 100
    if bend < 20 * noise * np.ptp(moved):
        return  # lost in the noise
    assert len(found) == 1
    assert found[0].time == pytest.approx(100 * share, abs=0.5 + 40 * noise * np.ptp(moved) / abs(ratio - 1))
    if found[0].before == 0:  # a rate that its own noise does not tell from rest is a hold
        error = noise * np.ptp(moved) * np.sqrt(12 / (share * count)) / (100 * share)
        assert 5 * error > 1.0
        assert found[0].after == pytest.approx(ratio, rel=0.02)
        return
    assert found[0].after / found[0].before == pytest.approx(ratio, rel=0.02 + 20 * noise * max(ratio, 1 / ratio))


def test_holds_ramps_pulses_and_oscillations_have_names():
    record = lab.record(lab.rig(), lab.HOLD)
    assert [s.kind for s in record.steps] == ["hold", "reslide", "velocity step"]
    record = lab.record(lab.rig(alpha=0.3), lab.PULSED)
    assert [s.kind for s in record.steps] == ["velocity step", "normal-stress step", "normal-stress step"]
    time = np.linspace(0, 100, 2000)
    wave = oscillation(time, 1e7 + np.where(time > 20, 2e5 * np.sin(time), 0.0))
    assert wave.period == pytest.approx(2 * np.pi, rel=0.02)
    assert wave.amplitude == pytest.approx(2e5, rel=0.05)
    ramp = np.cumsum(np.interp(time, [0, 40, 45, 100], [1.0, 1.0, 10.0, 10.0])) * (time[1] - time[0])
    (step,) = load_course(time, ramp).changes
    assert step.time == pytest.approx(40, abs=3)
    assert step.after / step.before == pytest.approx(10, rel=0.02)


def test_the_steps_of_real_records():
    basalt = ss.read_record("examples/data/basalt_b819_velocity_step.txt")
    (step,) = basalt.steps
    assert step.time == pytest.approx(11676.3, abs=1)
    assert (step.before, step.after) == pytest.approx((3e-6, 10e-6), rel=0.02)
    assert any("steps back" in note for note in basalt.notes)
    sepiolite = ss.read_record("examples/data/sepiolite_013_velocity_step.txt")
    (step,) = sepiolite.steps
    assert (step.before, step.after) == pytest.approx((0.2e-6, 2e-6), rel=0.02)


# -- what a record can do


def test_decimation_keeps_transients():
    record = lab.record(lab.rig(), lab.STEP, count=5000)
    few = record.decimated(300)
    assert 250 <= len(few) <= 320
    after = (few.time > 60) & (few.time < 65)
    assert np.median(np.diff(few.time[after])) < 0.3 * np.median(np.diff(few.time))
    starts = bin_starts(record, 300)
    means = [part.mean() for part in np.split(record.friction, starts[1:])]
    np.testing.assert_allclose(few.friction, means, rtol=1e-12)


def test_detrending_finds_the_trend():
    record = lab.record(lab.rig(), lab.STEP, noise=1e-5)
    share = record.displacement / record.displacement[-1]
    tilted = ss.record_from_arrays(
        record.time, friction=record.friction + 0.01 * share, normal=lab.STRESS, displacement=record.displacement
    )
    np.testing.assert_allclose(np.diff(tilted.detrended().friction[::50]), np.diff(record.friction[::50]), atol=2e-4)
    with pytest.raises(ss.ParameterError, match="order"):
        record.detrended(0)


def test_windows_cut_a_record_at_its_steps():
    record = lab.record(lab.rig(alpha=0.3), lab.PRESSED)
    first, second = record.windows()
    assert [s.kind for s in first.steps] == ["velocity step"]
    assert [s.kind for s in second.steps] == ["normal-stress step"]
    with pytest.raises(ss.NotAvailable, match="no steps"):
        record.between(1, 50).windows()


def test_a_record_written_is_read_again(tmp_path):
    record = lab.record(lab.rig(), lab.STEP, count=300)
    record.to_csv(tmp_path / "r.csv")
    again = ss.read_record(tmp_path / "r.csv")
    for name in ("time", "friction", "normal", "displacement"):
        np.testing.assert_allclose(getattr(again, name), getattr(record, name), rtol=1e-11)
    assert not record.time.flags.writeable


def test_two_columns_of_one_name_are_told_apart_by_number(tmp_path, clean):
    """The first was read whichever number was given."""
    table = [clean["time"], clean["friction"] + 1, clean["displacement"], clean["normal"], clean["friction"]]
    path = write(tmp_path / "twice.csv", table, "t (s),mu,load displacement (m),normal (Pa),mu")
    same(ss.read_record(path, friction=5), clean)


def test_a_trend_needs_room_between_steps(clean):
    slow = np.where(np.arange(400) // 15 % 2 == 0, 1e-6, 5e-6)
    time = np.arange(400.0)
    moved = np.concatenate([[0], np.cumsum(slow[1:])])
    record = ss.record_from_arrays(time=time, friction=0.6 + 1e-5 * time, displacement=moved, normal=clean["normal"])
    with pytest.raises(ss.NotAvailable, match="a trend cannot be separated"):
        record.detrended()


def test_standing_values_may_be_numbers_of_numpy():
    rig = ss.lab_rig("aging", v_ref=np.float64(2e-6), states=np.int64(2), stiffness=np.float64(1e10))
    assert rig.friction.v_ref == 2e-6
    assert rig.stiffness == 1e10
    assert len(rig.friction.states) == 2
    with pytest.raises(ss.ParameterError, match=r"v_ref: .* wrong dimension"):
        ss.lab_rig(v_ref="1 MPa")


def test_a_value_that_is_set_is_not_fitted():
    from steadyslip.experiments.spec import spec_from_text

    for name in ("stiffness", "slider.stiffness"):
        spec = spec_from_text("[friction]\nevolution = 'slip'\n", "spec", [f"{name}=2 GPa/m"])
        assert spec.rig.stiffness == 2e9
        assert "slider.stiffness" not in spec.options["free"]
        assert "friction.a" in spec.options["free"]
