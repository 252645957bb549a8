"""Fits from files: one command from a record to a verdict, and messages that say exactly what is wrong."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

import lab_records as lab
import steadyslip as ss
from command import run
from steadyslip.experiments.spec import spec_from_text

BASALT = "examples/data/basalt_b819_velocity_step.txt"


@pytest.fixture(scope="module")
def fitted(tmp_path_factory):
    """Everything that one command writes."""
    folder = tmp_path_factory.mktemp("fit")
    outputs = [word for end in ("nc", "html", "json", "png") for word in ("-o", folder / f"fit.{end}")]
    done = run("fit", BASALT, "examples/fits/basalt.toml", *outputs)
    assert done.returncode == 0, done.stderr
    return folder, done.stdout


def test_from_a_record_to_estimates(fitted):
    folder, text = fitted
    assert "velocity step at 11676.4 s: 3.001 um/s to 10 um/s" in text
    assert "friction.d_c      9.464 ± 0.43 um" in text
    assert "steps back 1773 times" in text
    assert f"wrote {folder / 'fit.html'}" in text
    data = json.loads((folder / "fit.json").read_text())
    assert data["parameters"]["friction.a"]["value"] == pytest.approx(0.009204, rel=0.003)
    assert data["search"]["converged"] is True
    assert data["correlated"] is True
    page = (folder / "fit.html").read_text()
    assert page.count("<figure") == 3  # the fit, its one step, the estimates against each other
    assert len(page) <= 500_000
    assert "d_c = 9.4" in page
    assert (folder / "fit.png").stat().st_size > 10_000


def test_from_estimates_to_a_verdict(fitted):
    folder, _ = fitted
    done = run("analyze", "examples/double-direct-shear.toml", "--fit", folder / "fit.nc")
    assert done.stdout.startswith("Stable: steady sliding is stable with probability more than 99.9")
    assert "friction.b − friction.a" in done.stdout
    assert "With the best values\nSTABLE" in done.stdout
    done = run(
        "analyze", "examples/double-direct-shear.toml", "--fit", folder / "fit.nc", "--json", "--require-stable",
        "--set", "stiffness=0.5 GPa/m",
    )  # fmt: skip
    assert done.returncode == 1
    data = json.loads(done.stdout)
    assert data["prediction"]["probability_stable"] < 0.2
    assert data["prediction"]["dominant"] == "friction.b − friction.a"


@pytest.mark.parametrize(
    ("arguments", "messages"),
    [
        (["nothing.csv"], ["'nothing.csv': no such file"]),
        ([BASALT, "-o", "fit.doc"], ["allowed endings are .nc, .html, .json, .csv, .tex, .png, .svg, .pdf"]),
        ([BASALT, "-o", "no/such/folder/fit.nc"], ["there is no folder 'no/such/folder'"]),
        (["examples/fits/basalt.toml"], ["no record given"]),
        ([BASALT, "examples/fits/basalt.toml", "examples/fits/sepiolite.toml"], ["allowed: one"]),
        ([BASALT, "--set", "fit.trend=x"], ["fit.trend: got 'x'; allowed: a whole number from 0 to 6"]),
        ([BASALT, "--set", "fit.tend=1"], ["unknown key 'tend'; did you mean 'trend'?"]),
        ([BASALT, "--set", "record.normal=kPa"], ["is in MPa by its name, but the option says kPa"]),
        ([BASALT, "--set", "record.friction=Mu"], ["unknown column 'Mu'", "allowed: Time(s), "]),
        ([BASALT, "--set", "record.between=[0, 10]"], ["leaves 0 samples"]),
        ([BASALT, "--set", "friction.evolution=agin"], ["did you mean 'aging'?"]),
        ([BASALT, "--set", 'fit.free=["friction.q"]'], ["unknown parameter 'friction.q'"]),
    ],
)
def test_mistakes_end_with_one_message_and_status_2(arguments, messages):
    done = run("fit", *arguments)
    assert done.returncode == 2
    assert "Traceback" not in done.stderr
    for message in messages:
        assert message in done.stderr


def test_all_faults_of_the_file_of_a_fit_are_found_at_once():
    text = '[friction]\nevolutoin = "aging"\nb = "x"\n[fit]\ntrend = "a"\nfreee = ["a"]\n'
    text += '[record]\ntim = "x"\nbetween = 3\n'
    with pytest.raises(ss.RigFileError) as caught:
        spec_from_text(text)
    found = {(p.line, p.name) for p in caught.value.problems}
    assert found == {
        (2, "friction.evolutoin"), (3, "friction.b"), (5, "fit.trend"), (6, "fit.freee"), (8, "record.tim"),
        (9, "record.between"),
    }  # fmt: skip


def test_what_is_missing_is_fitted_and_what_is_given_is_not():
    spec = spec_from_text("[friction]\na = 0.01\n[slider]\nstiffness = '20 GPa/m'\n")
    assert set(spec.options["free"]) == {"friction.b", "friction.d_c", "friction.mu_ref"}
    spec = spec_from_text("[friction]\nnormal_memory = 'linker-dieterich'\n[fit]\nstates = 2\n")
    assert "friction.normal_memory.alpha" in spec.options["free"]
    assert "friction.states.2.d_c" in spec.options["free"]
    whole = spec_from_text(Path("examples/inclined-spring.toml").read_text())
    assert "free" not in whole.options
    record = lab.record(lab.rig(), lab.STEP)
    fit = spec_from_text(f"[friction]\nmu_ref = 0.62\nv_ref = '1 um/s'\n[slider]\nstiffness = {lab.STIFFNESS}\n").fit(
        [record]
    )
    assert set(fit.names) == {"friction.a", "friction.b", "friction.d_c"}


@pytest.mark.parametrize(
    ("fit", "names"),
    [
        ('free = ["a"]', ["friction.b", "friction.d_c", "slider.stiffness"]),
        ('free = ["a", "b", "d_c", "stiffness"]', []),
        ('fixed = ["slider.stiffness"]', ["slider.stiffness"]),
    ],
)
def test_a_parameter_without_value_is_fitted_or_refused(fit, names):
    """What stands in for a missing value must never be taken for one."""
    text = f"[friction]\n[fit]\n{fit}\n"
    if not names:
        assert spec_from_text(text).options["free"] == ["a", "b", "d_c", "stiffness"]
        return
    with pytest.raises(ss.RigFileError, match="has no value and is not fitted") as caught:
        spec_from_text(text)
    assert [p.name for p in caught.value.problems] == names


def test_without_normal_stress_a_stiffness_means_nothing():
    record = lab.record(lab.rig(), lab.STEP)
    bare = ss.record_from_arrays(record.time, friction=record.friction, displacement=record.displacement)
    with pytest.raises(ss.ParameterError, match="normal_stress = "):
        spec_from_text("[friction]\n").fit([bare])
    fit = spec_from_text("[friction]\n[contact]\nlaw = 'constant'\nsteady_normal_stress = '10 MPa'\n").fit([bare])
    assert fit.values["slider.stiffness"] == pytest.approx(lab.STIFFNESS, rel=0.05)


def test_laws_are_compared_and_records_fitted_together(tmp_path):
    for name, seed in (("one", 1), ("two", 2)):
        lab.record(lab.rig(), lab.STEP, seed, count=800).to_csv(tmp_path / f"{name}.csv")
    (tmp_path / "spec.toml").write_text(
        '[friction]\n[fit]\ncompare = ["slip", "aging"]\nseparate = ["friction.mu_ref"]\n'
    )
    files = [tmp_path / name for name in ("one.csv", "two.csv", "spec.toml")]
    listed = [tmp_path / name for name in ("table.csv", "table.tex")]
    done = run("fit", *files, "--json", "--bootstrap", "20", *(word for path in listed for word in ("-o", path)))
    assert done.returncode == 0, done.stderr
    data = json.loads(done.stdout)
    assert data["comparison"]["slip"]["weight"] > 0.99
    assert data["samples"] == 1600
    assert data["bootstrap"]["friction.a"]["error"] > 0
    assert [line["step"] for line in data["steps"]["lines"]] == ["velocity step", "velocity step", "all together"]
    assert len(listed[0].read_text().splitlines()) == 4
    assert "all together" in listed[1].read_text()


@pytest.mark.usefixtures("unpainted")
def test_reports_escape_what_came_from_outside():
    record = lab.record(lab.rig(), lab.STEP)
    fit = ss.fit(ss.lab_rig(), replace(record, source="<script>alert(1)</script>"))
    page = ss.report(fit, explorer=False).html
    assert "<script>" not in page
    assert "&lt;script&gt;" in page


def test_options_are_used_or_refused(fitted):
    folder, _ = fitted
    done = run("fit", BASALT, "examples/fits/basalt.toml", "--bootstrap", "1")
    assert done.returncode == 2
    assert "2 or more" in done.stderr
    done = run("analyze", "examples/double-direct-shear.toml", "--fit", folder / "fit.nc", "--branch", "1")
    assert done.returncode == 2
    assert "--branch" in done.stderr
    done = run("analyze", "examples/double-direct-shear.toml", "--fit", folder / "fit.nc", "--formula")
    assert "Critical stiffness\n  k_cr = " in done.stdout


def test_a_table_of_speeds_without_its_law_is_named(tmp_path):
    """Five rows are no record: the message was of a time column, or of a file without numbers."""
    table = tmp_path / "guide.csv"
    table.write_text("speed [mm/s];force [N]\n0.1;610\n0.5;500\n1;450\n5;400\n20;357\n")
    assert "is a table of friction over speed" in (said := run("fit", table).stderr)
    assert "--law lugre" in said
    assert "-o: a rig as .toml" in run("fit", table, "-o", tmp_path / "guide.toml").stderr
    assert "law: unknown friction law 'foo'" in run("fit", table, "--law", "foo").stderr
