"""The command line: answers, exit statuses, messages, and what it may load."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import steadyslip as ss
from command import run, without_laws_of_tests
from steadyslip.core.format import format_quantity

EXAMPLE = Path(__file__).parents[2] / "examples" / "inclined-spring.toml"


def test_the_module_is_the_command():
    """In a process of its own, which all other tests here spare."""
    command = [sys.executable, "-m", "steadyslip", "analyze", str(EXAMPLE), "--set", "contact.angle=x"]
    done = subprocess.run(command, capture_output=True, text=True, encoding="utf-8")
    same = run(*command[3:])
    assert (done.returncode, done.stdout, done.stderr) == (same.returncode, same.stdout, same.stderr)


def test_verdict_on_the_example():
    done = run("analyze", EXAMPLE)
    assert done.returncode == 0
    assert done.stdout.startswith("UNSTABLE: steady sliding at 1 um/s")
    assert "critical stiffness 29.07 GPa/m" in done.stdout
    assert done.stderr == ""


def test_json_has_what_other_programs_need():
    data = json.loads(run("analyze", EXAMPLE, "--json").stdout)
    assert data["stable"] is False
    assert data["steady"].pop("states") == {"Theta": 0.0, "theta": 1.0}
    stress = {"normal_stress": 5e6 / 0.3, "shear_stress": 3.5e6 / 0.3, "spring_stress": 3.5e6 / 0.3}
    assert data["steady"] == pytest.approx({"velocity": 1e-6, "friction": 0.7, **stress}, rel=1e-14)
    # kappa_cr of the paper's parameters at -45 degrees, theory 4
    assert data["critical_stiffness"] == pytest.approx(0.00174418604651163 * 5e6 / 0.3 / 1e-6, rel=1e-13)
    assert data["critical_angular_frequency"] == pytest.approx(0.189964754254, rel=1e-11)
    assert data["stable_stiffness"] == [[data["critical_stiffness"], None]]
    assert len(data["eigenvalues"]) == 2
    assert {row["parameter"] for row in data["boundaries"]} >= {"contact.angle", "friction.a", "slider.stiffness"}
    assert data["warnings"] == []


def test_locked_rig_is_answered_not_failed():
    done = run("analyze", EXAMPLE, "--set", "contact.angle=-60 deg", "--json")
    data = json.loads(done.stdout)
    assert done.returncode == 0
    assert data["stable"] is None
    assert "lock-up" in data["reason"]
    assert data["critical_stiffness"] is None


@pytest.mark.parametrize(
    ("change", "status"),
    [
        ("stiffness=40 GPa/m", 0),
        ("stiffness=9 GPa/m", 1),
        ("contact.angle=-60 deg", 1),
        ("stiffness=29069767441.860443", 1),
    ],
)
def test_require_stable(change, status):
    """On its edge to rounding a rig is not called stable where something depends on it."""
    assert run("analyze", EXAMPLE, "--require-stable", "--set", change).returncode == status


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["analyze", "missing.toml"], "no such file"),
        (["analyze", EXAMPLE, "--set", "contact.angel=3"], "did you mean 'angle'?"),
        (["analyze", EXAMPLE, "--set", "a=-1", "--set", "d_c=0"], "2 problems"),
        (["analyze", EXAMPLE, "--branch", "3"], "branch 3 does not exist"),
        (["analyze", EXAMPLE, "--set", "v_ref=1e-300", "--set", "preload=1e308"], "range of floating point"),
        (["analyze"], "Missing argument"),
        (["analyse", EXAMPLE], "No such command"),
    ],
)
def test_bad_input_is_one_message_and_status_2(arguments, words):
    done = run(*arguments)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr
    assert done.stdout == ""


def test_answers_come_in_the_units_of_the_file(tmp_path):
    text = EXAMPLE.read_text(encoding="utf-8")
    own = tmp_path / "rig.toml"
    own.write_text(text.replace('"5 MPa"', '"50 bar"').replace('"9 GPa/m"', '"90 bar/mm"'), encoding="utf-8")
    told = run("analyze", own).stdout
    assert "critical stiffness 290.7 bar/mm" in told
    assert "normal stress 166.7 bar" in told
    assert format_quantity(2e5, "Pa") == "200 kPa"  # whoever comes after the command is told as ever
    assert "slider.damping                0 Pa s/m" in told
    assert "critical stiffness 29.07 GPa/m" in run("analyze", EXAMPLE).stdout
    found, same = (json.loads(run("analyze", rig, "--json").stdout) for rig in (own, EXAMPLE))
    assert found.pop("reason") != same.pop("reason")
    assert found == same
    own.write_text(text.replace('"5 MPa"', '"50 bar"') + 'x = "1 MPa"', encoding="utf-8")
    assert "unknown key 'x'" in run("analyze", own).stderr


def test_formula_schema_version():
    assert "k_cr = " in run("analyze", EXAMPLE, "--formula").stdout
    parts = run("analyze", EXAMPLE.with_name("slow-axis.toml"), "--formula").stdout.partition("Critical stiffness\n")[2]
    assert [line.split(" = ")[0].strip() for line in parts.splitlines()] == ["k_cr + k_p", "f", "S"]
    assert max(map(len, parts.splitlines())) <= 120
    assert "log(v_0)" not in parts
    of_mass = run("analyze", EXAMPLE, "--along", "mass", "--set", "mass=1e9 kg/m^2").stdout
    assert "Edge in slider.mass\n  m_cr = " in of_mass
    wrong = run("analyze", EXAMPLE, "--along", "nonsense")
    assert (wrong.returncode, "unknown parameter 'nonsense'" in wrong.stderr) == (2, True)
    without = run("analyze", EXAMPLE, "--formula", "--set", "friction.normal_memory.law=prakash-clifton")
    assert "unknown key 'alpha'" in without.stderr
    two = run("analyze", EXAMPLE.with_name("two-states.toml"), "--formula")
    assert (two.returncode, "No formula" in two.stdout) == (0, True)
    with without_laws_of_tests():
        assert json.loads(run("schema").stdout) == ss.json_schema()
    assert run("--version").stdout.strip() == f"steadyslip {ss.__version__}"


def test_help_and_analyze_stay_light():
    """Start-up time comes from imports: neither may load plotting, compiling or table libraries."""
    code = (
        "import sys; from steadyslip.cli import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "heavy = {'numba','matplotlib','xarray','pandas','pint','pydantic','email','logging','multiprocessing'}\n"
        "heavy |= {'steadyslip.verdict.cures','numpy.ma','scipy.optimize','scipy.signal','scipy.special'}\n"
        "print(sorted(heavy & set(sys.modules)))"
    )
    for arguments in (["--help"], ["analyze", str(EXAMPLE), "--set", "contact.angle=-40 deg"]):
        done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
        assert done.stdout.splitlines()[-1] == "[]", done.stdout
    code = code.replace("'scipy.signal'", "'scipy.signal','sympy','numpy'")
    code += "; from steadyslip.core import version; assert not version.version.cache_info().currsize"  # reads all files
    done = subprocess.run([sys.executable, "-c", code, "--help"], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "[]", done.stdout


def test_no_object_is_left_to_the_last_garbage_collection():
    code = (
        "import atexit, gc\n"
        "atexit.register(lambda: print(len(gc.get_objects())))\n"
        "from steadyslip.cli import main\n"
        "main()\n"
    )
    done = subprocess.run([sys.executable, "-c", code, "--version"], capture_output=True, text=True, check=True)
    assert int(done.stdout.splitlines()[-1]) < 1000  # importing the commands alone makes tens of thousands


def test_a_command_is_made_alone_and_is_the_same(monkeypatch):
    from typer.testing import CliRunner

    from steadyslip.cli import program

    programs = []
    monkeypatch.setattr(program, "end", programs.append)
    monkeypatch.setattr(program.gc, "set_threshold", lambda most: None)
    for word in ("analyze", "--help", "analyse"):
        monkeypatch.setattr(sys, "argv", ["steadyslip", word])
        program.main()
    assert [len(one.registered_commands) for one in programs] == [1, len(program.COMMANDS), len(program.COMMANDS)]
    alone, whole = (CliRunner().invoke(one, ["analyze", "--help"]).output for one in programs[:2])
    assert alone == whole


STICK_SLIP = EXAMPLE.parent / "stick-slip.toml"


@pytest.mark.slow
def test_simulate_runs_the_protocol_of_the_file(tmp_path):
    done = run(
        "simulate", STICK_SLIP, "-o", tmp_path / "run.nc", "-o", tmp_path / "run.csv", "-o", tmp_path / "run.png"
    )
    assert done.returncode == 0, done.stderr
    assert "done at 500 s" in done.stdout
    assert "slip events" in done.stdout
    history = ss.load_history(tmp_path / "run.nc")
    assert history.rig == ss.read_rig(STICK_SLIP)
    assert len(history.protocol.pieces) == 2
    assert len((tmp_path / "run.csv").read_text().splitlines()) == len(history["t"]) + 1
    assert (tmp_path / "run.png").read_bytes().startswith(b"\x89PNG")


@pytest.mark.slow
def test_simulate_takes_pieces_and_changes():
    done = run(
        "simulate", EXAMPLE, "--set", "stiffness=32 GPa/m", "--until", "20 s", "--protocol",
        "velocity-step at=10s to='2 um/s'", "--initial", "v=1.1e-6", "--samples", "11", "--json",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    data = json.loads(done.stdout)
    assert data["status"] == "done"
    assert data["end"] == 20.0
    rig = ss.read_rig(EXAMPLE, ["stiffness=32 GPa/m"])
    same = ss.simulate(rig, ss.protocol.VelocityStep(at=10, to=2e-6), until=20, initial={"v": 1.1e-6})
    assert data["final"]["v"] == pytest.approx(same["v"][-1], rel=1e-9)
    assert data["units"]["v"] == "m/s"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "--until"),
        (["--until", "3 m"], "wrong dimension"),
        (["--until", "1 s", "--protocol", "velocity-stp at=1"], "did you mean 'velocity-step'"),
        (["--until", "1 s", "--initial", "v"], "NAME=NUMBER"),
        (["--until", "1 s", "--initial", "w=3"], "unknown variable"),
        (["--until", "1 s", "--method", "euler"], "unknown method"),
    ],
)
def test_simulate_says_what_is_wrong(arguments, words):
    done = run("simulate", EXAMPLE, *arguments)
    assert done.returncode == 2
    assert words in done.stderr
    assert "Traceback" not in done.stderr


# -- whatever becomes of the answer, one message and a status that says what it was


def shell(line: str, **options) -> subprocess.CompletedProcess[str]:
    line = line.replace("steadyslip", f"{sys.executable} -m steadyslip")
    return subprocess.run(["bash", "-c", line], capture_output=True, text=True, encoding="utf-8", **options)


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="a device of Linux")
@pytest.mark.parametrize("command", [f"analyze {EXAMPLE} --json", "--help"])
def test_an_answer_that_cannot_be_written_is_an_error(command):
    done = shell(f"steadyslip {command} > /dev/full")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "cannot write to the standard output: No space left" in done.stderr


def test_an_answer_that_nobody_can_get_is_none():
    done = shell(f"steadyslip analyze {EXAMPLE} --json >&-")
    assert (done.returncode, done.stderr) == (2, "error: there is no standard output to write the answer to\n")


def test_a_closed_pipe_is_no_error_message():
    done = shell(f"steadyslip analyze {EXAMPLE} --json | true; exit ${{PIPESTATUS[0]}}")
    assert (done.returncode, done.stderr) == (141, "")


def test_a_deleted_working_folder_is_said(tmp_path):
    gone = tmp_path / "gone"
    gone.mkdir()
    done = shell(f"cd {gone}; rmdir {gone}; steadyslip map {EXAMPLE} -o map.zarr")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "working folder" in done.stderr


def test_help_shows_brackets_as_they_are():
    assert "[map]" in run("sensitivity", "--help").stdout


def test_every_end_has_its_status(capsys, monkeypatch):
    from steadyslip.cli.ending import status_of
    from steadyslip.core import errors

    def ends(error):
        def command():
            raise error

        return status_of(command)

    monkeypatch.delenv("STEADYSLIP_DEBUG", raising=False)
    assert ends(errors.NotAvailable("no such thing")) == 2
    assert capsys.readouterr().err == "error: no such thing\n"
    assert ends(KeyboardInterrupt()) == 130
    assert ends(SystemExit(1)) == 1
    assert ends(MemoryError()) == 2
    assert "memory" in capsys.readouterr().err
    assert ends(KeyError("over")) == 70
    message = capsys.readouterr().err
    assert "fault of steadyslip" in message
    assert message.count("\n") == 1
    monkeypatch.setenv("STEADYSLIP_DEBUG", "1")
    with pytest.raises(KeyError):
        ends(KeyError("over"))


def test_a_changed_value_is_told_in_its_own_unit():
    shown = run("analyze", "examples/slow-axis.toml", "--set", "velocity=1.2 m/h").stdout
    assert shown.splitlines()[0].endswith("steady sliding at 1.2 m/h")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            ("cycles", EXAMPLE, "drive.kp"),
            "'drive.kp' is a word too many; to name the parameter that is varied write --along",
        ),
        (("analyze", EXAMPLE, "stiffness=3"), "'stiffness=3' is a word too many; to change a value write --set 'stiff"),
        (("cure", EXAMPLE, "x.html"), "'x.html' is a word too many; to write a file write -o x.html"),
        (("cure", EXAMPLE, "stiffness"), "'stiffness' is a word too many"),
    ],
)
def test_a_word_too_many_is_told_its_option(arguments, words):
    done = run(*arguments)
    assert done.returncode == 2
    assert words in done.stderr
    assert (";" in done.stderr) == (";" in words)


@pytest.mark.parametrize(
    "command",
    [("simulate", EXAMPLE, "--until", "1 s"), ("analyze", EXAMPLE), ("response", EXAMPLE, "--points", "3")],
)
def test_every_figure_can_be_as_wide_as_a_column_of_a_journal(tmp_path, command):
    run(*command, "-o", tmp_path / "wide.svg")
    run(*command, "-o", tmp_path / "narrow.svg", "--journal")
    wide, narrow = (
        float((tmp_path / name).read_text(encoding="utf-8").partition('width="')[2].partition("pt")[0])
        for name in ("wide.svg", "narrow.svg")
    )
    assert narrow == pytest.approx(85 / 25.4 * 72, abs=0.1)
    assert wide > 1.5 * narrow


def test_every_command_that_draws_knows_the_width_of_a_journal():
    from typer.main import get_command

    from steadyslip.cli import app

    for name, command in get_command(app).commands.items():
        options = {text: one for one in command.params for text in getattr(one, "opts", ())}
        draws = any(".pdf" in (getattr(one, "help", "") or "") for one in options.values())
        draws |= name in {"cycles", "map", "threshold"}
        assert ("--journal" in options) == draws, name
