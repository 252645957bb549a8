"""Table of steps: each alone and all together, in numbers that other programs read, and beside a calibration."""

import csv
from dataclasses import replace

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss

TWICE = ss.Protocol(
    pieces=(ss.protocol.VelocityStep(at=60.13, to=5e-6), ss.protocol.NormalStressStep(at=120.2, by=0.1 * lab.STRESS)),
    until=200.0,
)


@pytest.fixture(scope="module")
def joint():
    rig = lab.rig(alpha=0.3)
    records = [lab.record(rig, protocol, seed=i) for i, protocol in enumerate((TWICE, lab.HOLD))]
    guess = ss.lab_rig(normal_memory="linker-dieterich")
    return ss.fit(guess, records, calibrated="40 GPa/m", fixed=["alpha"])


@pytest.fixture(scope="module")
def table(joint):
    return ss.experiments.step_table(joint)


def test_every_step_is_fitted_alone_and_all_together(joint, table, tmp_path):
    assert [line.step.kind for line in table.lines[:-1]] == [
        "velocity step", "normal-stress step", "hold", "velocity step"
    ]  # fmt: skip
    assert table.joint is joint
    assert not table.left_out
    until = table.steps[0].plan.records[0].time[-1]
    assert 119 < until < 120.2  # until the next step
    part = joint.plan.records[0].windows(after=until - table.lines[0].step.time)[0]
    alone = ss.fit(joint.plan.rig, part, fixed=["alpha"], calibrated=4e10)
    assert table.steps[0].values == alone.values
    table.to_csv(tmp_path / "t.csv")
    rows = list(csv.DictReader((tmp_path / "t.csv").read_text().splitlines()))
    assert len(rows) == 5
    first = rows[0]
    rates = [float(first[f"rate {when} (m/s)"]) for when in ("before", "after")]
    assert rates == pytest.approx([1e-6, 5e-6], rel=1e-2)
    assert float(first["displacement (m)"]) == pytest.approx(60.13e-6, rel=1e-2)
    assert float(first["normal stress (Pa)"]) == pytest.approx(lab.STRESS, rel=1e-2)
    assert float(first["a (1)"]) == pytest.approx(alone.values["friction.a"], rel=1e-7)
    assert float(first["a error (1)"]) == pytest.approx(alone.errors["friction.a"], rel=1e-7)
    assert rows[1]["step"] == "normal-stress step to 11 MPa"
    assert rows[-1]["rate after (m/s)"] == ""
    assert table.to_dict()["lines"][-1]["estimates"]["d_c"]["value"] == joint.values["friction.d_c"]


def test_a_memory_of_normal_stress_is_held_where_it_has_no_effect(tmp_path):
    """Free, a velocity step left alpha open, and with it a critical stiffness; the line of a step says where it was."""
    protocol = ss.Protocol(
        pieces=(
            ss.protocol.NormalStressStep(at=60.2, by=0.1 * lab.STRESS),
            ss.protocol.VelocityStep(at=120.13, to=5e-6),
        ),
        until=180.0,
    )
    fit = ss.fit(ss.lab_rig(normal_memory="linker-dieterich"), lab.record(lab.rig(alpha=0.3), protocol, seed=3))
    table = ss.experiments.step_table(fit)
    pressed, driven = table.lines[:2]
    assert pressed.normal_stress == pytest.approx(lab.STRESS, rel=1e-5)
    assert "normal_memory.alpha" not in driven.estimates()
    assert driven.fit.plan.rig.value("friction.normal_memory.alpha") == fit["alpha"].value
    assert driven.estimates()["k_c"].determined
    assert "changes of normal stress alone" not in " ".join(table.to_dict()["lines"][1]["warnings"])
    assert " & rms & " in table.latex_text()


def _short(noise=4e-4):
    """A record whose last step is followed by too little slip for b and d_c."""
    protocol = ss.Protocol(
        pieces=(ss.protocol.VelocityStep(at=60.13, to=5e-6), ss.protocol.VelocityStep(at=90.21, to=1e-6)), until=94.0
    )
    return lab.record(lab.rig(), protocol, seed=5, noise=noise, count=1200)


def test_warnings_are_notes_below_the_printed_table(tmp_path):
    """They were comments of the file, so that a reader of the paper saw stars alone."""
    table = ss.experiments.step_table(ss.fit(ss.lab_rig(), _short()))
    told = table.to_dict()["lines"][1]["warnings"]
    assert table.notes == told
    assert told
    text = table.latex_text()
    numbers = ",".join(str(k) for k in range(1, 1 + len(told)))
    assert f"velocity step$^{{{numbers}}}$ & " in text
    _, below = text.split(r"\end{tabular}")
    assert below.count("$^{") == len(told)
    assert "determine them only in combination" in below
    assert "%" not in below.replace(r"\%", "")
    assert "Values in parentheses are not determined" in table.methods
    assert "Notes to the table give the warnings of these fits" in table.methods
    table.to_csv(tmp_path / "t.csv")
    rows = [*csv.DictReader((tmp_path / "t.csv").read_text().splitlines())]
    assert told[0] in rows[1]["warnings"]


def test_a_later_step_begins_as_the_step_before_left_it(tmp_path):
    """With a free beginning of its own, and its end halfway to the next step, hardly a slow step had b and d_c."""
    pieces = tuple(
        ss.protocol.VelocityStep(at=at, to=to) for at, to in ((30.13, 1e-5), (42.2, 1e-6), (72.17, 1e-5), (84.1, 1e-6))
    )
    rig = lab.rig()
    record = lab.record(rig, ss.Protocol(pieces=pieces, until=114.0), seed=2, count=2300)
    fit = ss.fit(ss.lab_rig(), record, ["a", "b", "d_c", "stiffness"])
    table = ss.experiments.step_table(fit, starts=24)
    for line in table.lines[:-1]:
        for name in ("friction.a", "friction.b", "friction.d_c", "slider.stiffness"):
            one = line.fit[name]
            assert one.determined
            assert abs(one.value - rig.value(name)) < 3.5 * one.error
    before, after = (line.fit for line in table.lines[1:3])
    begun = after.plan.beginning(0)
    where = int(np.argmin(np.abs(before.plan.records[0].time - after.plan.records[0].time[0])))
    part = before.comparison.parts[0]
    states = part.states(before.space.values(before.coordinates[None]))
    assert states["friction"][0] == pytest.approx(before.model, abs=1e-7)
    rate = after.plan.loading[0].load.first
    own = before.rig(0).with_values({"drive.velocity": rate})
    assert begun.values["friction"] == pytest.approx(
        states["friction"][0, where] - ss.steady_state(own).friction, abs=1e-7
    )
    assert begun.values["Theta"] == pytest.approx(
        states["Theta"][0, where] + np.log(rate / own.value("v_ref")), abs=1e-6
    )
    assert "as the step before left friction" in " ".join(str(after).split())
    assert "Later steps begin with friction and state as the step before left them" in table.methods
    after.save(tmp_path / "step.nc")
    again = ss.load_fit(tmp_path / "step.nc")
    assert again.plan.beginnings == after.plan.beginnings
    assert again.values == after.values
    assert np.array_equal(
        again.comparison.model(again.coordinates[None])[0], after.comparison.model(after.coordinates[None])[0]
    )


def test_latex_and_methods(joint, table, tmp_path):
    table.to_latex(tmp_path / "t.tex")
    text = (tmp_path / "t.tex").read_text()
    body = [line for line in text.splitlines() if line.endswith(r"\\")]
    assert len({line.count("&") for line in body}) == 1
    assert len(body) == 6
    assert r"$d_{c}$ (\textmu m)" in body[0]
    one = joint["d_c"]
    digits = 1 - int(np.floor(np.log10(1e6 * one.error)))
    assert rf"${1e6 * one.value:.{digits}f} \pm {1e6 * one.error:.{digits}f}$" in body[-1]
    for line, printed in zip(table.lines, body[1:], strict=False):  # a step at 11676.4 s was printed at 11680
        if line.step is not None:
            assert float(printed.split(" & ")[2]) == pytest.approx(line.step.time, rel=1e-6)
    assert table.methods in text.splitlines()[0]
    assert "slip law, 1 state, linker-dieterich memory of normal stress" in table.methods
    assert "4 steps were fitted alone" in table.methods


def test_the_first_column_is_a_less_b(joint, table, tmp_path):
    """Stiffness, a, b and d_c took the width of a printed table, and long names of steps left two columns."""
    table.to_csv(tmp_path / "t.csv")
    head = (tmp_path / "t.csv").read_text().splitlines()[0].split(",")
    assert head[head.index("rms (1)") + 1 :][:4] == ["a - b (1)", "a - b error (1)", "a (1)", "a error (1)"]
    assert r" & rms & $a - b$ & $a$ & $b$ & $d_{c}$ (\textmu m) & $k$ " in table.latex_text()
    first = ss.experiments.step_table(
        ss.fit(joint.plan.rig, joint.plan.records[1], ["stiffness", "d_c", "a", "b"]), starts=9
    )
    for one in (table, first):
        lines = str(one).splitlines()
        assert lines[0].split()[:3] == ["a", "-", "b"]
        assert "d_c" in lines[0].split()
        for line, row in zip(one.lines, lines[1:], strict=False):
            ratio = next(own for own in line.fit.derived if own.name == "a - b")
            assert f" {ratio.shown()}  " in row


def test_a_calibrated_stiffness_stands_beside_the_fitted_one(joint, tmp_path):
    ratio = next(one for one in joint.derived if one.name == "k/k_cal")
    assert ratio.value == pytest.approx(joint.values["slider.stiffness"] / 40e9, rel=1e-12)
    assert ratio.error / ratio.value == pytest.approx(joint.errors["slider.stiffness"] / joint["stiffness"].value)
    assert any("of the calibrated one" in warning for warning in joint.to_dict()["warnings"])
    joint.save(tmp_path / "fit.nc")
    assert ss.load_fit(tmp_path / "fit.nc").derived == joint.derived


def test_records_without_steps_are_refused():
    record = lab.record(lab.rig(), ss.Protocol(pieces=(), until=60.0), 1)
    fit = ss.fit(ss.lab_rig(), record, ["mu_ref"])
    with pytest.raises(ss.ParameterError, match="no steps"):
        ss.experiments.step_table(fit)


def test_a_later_step_is_fitted_alike_at_any_reference_velocity():
    """Beside the first rate of the record, the state was bounded within .03 e-folds, and a was 4 errors off."""
    protocol = ss.Protocol(
        pieces=tuple(ss.protocol.VelocityStep(at=at, to=to) for at, to in ((15, 1e-5), (30, 1e-6), (50, 3e-6))),
        until=70.0,
    )
    record = lab.record(lab.rig(), protocol, seed=3, count=2800)
    tables = [
        ss.experiments.step_table(ss.fit(ss.lab_rig().with_values({"v_ref": v_ref}), record))
        for v_ref in (1e-6, 1.0003e-6)
    ]
    for one, other in zip(*(table.steps for table in tables), strict=True):
        for name in ("friction.a", "friction.d_c", "slider.stiffness", "initial.Theta"):
            if name in one.values and one[name].determined:
                assert other.values[name] == pytest.approx(one.values[name], abs=0.2 * one.errors[name])


def test_a_printed_table_fits_a_terminal_and_the_csv_has_all(tmp_path):
    records = [
        replace(lab.record(lab.rig(), lab.STEP, seed, count=400), source=f"{'long ' * 12}p{seed}.csv")
        for seed in (1, 2)
    ]
    options = {"separate": ["mu_ref", "stiffness"], "calibrated": lab.STIFFNESS, "starts": 9}
    table = ss.experiments.step_table(ss.fit(ss.lab_rig(), records, **options), starts=9)
    text = str(table)
    lines = text.splitlines()
    assert max(map(len, lines)) <= 120
    assert lines[0].split() == ["a", "-", "b", "a", "d_c"]
    for line, row in zip(table.lines, lines[1:], strict=False):
        assert f"{line.fit['a'].value:.4g} ± " in row
        assert " weakens" in row
    plain = " ".join(text.split())
    for one in (*table.joint.estimates, *table.joint.derived):
        assert one.name.startswith("step.") or one.shown() in plain
    table.to_csv(tmp_path / "t.csv")
    head = (tmp_path / "t.csv").read_text().splitlines()[0]
    assert all(f"{name} (" in head for name in ("mu_ref@1", "k@2", "k/k_cal@1", "k_c", "a - b"))
