"""Machines in files: what is wrong with them, all at once; back and forth; units; what is not offered yet."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from command import run
from file_schema import file_schema
from machines import brake, rate_state, surface, three_bodies, two_blocks, two_mass
from steadyslip.core.format import format_quantity

EXAMPLES = sorted((Path(__file__).parents[2] / "examples" / "machines").glob("*.toml"))
AXIS = EXAMPLES[0].with_name("feed-axis.toml")
TEXT = AXIS.read_text(encoding="utf-8")


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_verdict_is_that_of_the_comment(path):
    """One comment of each example reads '# Verdict: stable; stable for drive.kp above 1 N/m.' or the like."""
    pattern = r"^# Verdict: (\w+); stable for (\S+) (above|below) (.+)\.$"
    verdict, name, side, value = re.search(pattern, path.read_text("utf-8"), re.M).groups()
    machine = ss.read_rig(path)
    analysis = ss.analyze(machine)
    assert verdict == {True: "stable", False: "unstable"}[analysis.stable]
    assert analysis.warnings == ()
    (edge,) = ss.boundary(machine, name)
    assert edge.stable == side
    assert format_quantity(edge.value, edge.unit, area=machine.area_of(name)) == value
    if "compliant" not in path.read_text("utf-8"):  # there the normal force depends on every stiffness
        ((low, high),) = ss.stable_values(machine, name)
        assert edge.value == (low if side == "above" else high)


@pytest.mark.parametrize("text", [TEXT, AXIS.parents[1].joinpath("inclined-spring.toml").read_text(encoding="utf-8")])
def test_tables_of_fits_and_maps_are_read_past(text):
    further = '\n[fit]\nfree = ["x"]\n[record]\ntime = "s"\n[population]\n[map]\n'
    assert ss.rig_from_text(text + further) == ss.rig_from_text(text)
    with pytest.raises(ss.SteadyslipError, match=r"no effect here: the table \[fit\] is read by what fits records"):
        ss.rig_from_text(text + further, changes=["fit.free=y"])


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_examples_keep_to_the_schema_and_come_back_from_their_own_text(path):
    file_schema().validate(tomllib.loads(path.read_text(encoding="utf-8")))
    machine = ss.read_rig(path)
    text = ss.rig_to_text(machine)
    assert ss.rig_from_text(text) == machine
    file_schema().validate(tomllib.loads(text))


@pytest.mark.parametrize(
    "machine", [two_mass(), two_blocks(1.0, -0.1, 0.2), three_bodies(), brake(rate_state(1, 0, 1))]
)
def test_machines_made_in_python_come_back(machine):
    assert ss.rig_from_text(ss.rig_to_text(machine)) == machine


def test_forces_and_stresses_of_a_contact():
    """Without an area a contact is in forces and a stress is refused; with one, text may be either."""
    force = ss.read_rig(AXIS)
    spread = ss.rig_from_text(TEXT.replace('body = "table"  ', 'area = "50 cm^2"\nbody = "table"  '))
    text = TEXT.replace('body = "table"  ', 'area = "50 cm^2"\nbody = "table"  ').replace('"3 kN"', '"600 kPa"')
    for other in (spread, ss.rig_from_text(text)):
        assert other.value("preload") == pytest.approx(6e5)
        assert ss.eigenvalues(other) == pytest.approx(ss.eigenvalues(force), rel=1e-9)
    with pytest.raises(ss.RigFileError) as caught:
        ss.rig_from_text(text.replace('"50 cm^2"', "0"))
    assert [problem.name for problem in caught.value.problems] == ["contacts.guide.area"]
    with pytest.raises(ss.RigFileError, match="wrong dimension; expected a quantity in N,"):
        ss.rig_from_text(TEXT.replace('"3 kN"', '"600 kPa"'))
    with pytest.raises(ss.RigFileError, match=r"for example '2 kg'; it is the weight of 30.58 kg"):
        ss.rig_from_text(TEXT.replace('"300 kg"', '"300 N"'))


WRONG = """
[bodies.motor]
mass = "2 kg"
[bodies.table]
mass = "-5 kg"
[bodies.stray]
[links.screw]
between = ["motor", "tabel"]
stiffness = "100 N/m"
[links.loop]
between = ["motor", "motor"]
stiffness = "1 N/m"
[contacts.guide]
body = "tble"
[contacts.guide.friction]
law = "rate-state"
a = 0.01
b = 0.02
d_c = "1 um"
mu_ref = 0.1
v_ref = "1 um/s"
[contacts.guide.contact]
law = "constant"
[drive]
control = "pd"
velocity = "1 um/s"
body = "moter"
kp = "1 N/m"
"""


def test_everything_that_is_wrong_with_a_file_comes_at_once():
    with pytest.raises(ss.RigFileError) as caught:
        ss.rig_from_text(WRONG)
    found = {(p.name, p.line) for p in caught.value.problems}
    assert found == {
        ("bodies.table.mass", 5), ("links.screw.between", 8), ("links.loop.between", 11), ("contacts.guide.body", 14),
        ("contacts.guide.contact.preload", 22), ("drive.body", 27), ("bodies.stray", 6),
    }  # fmt: skip
    text = str(caught.value)
    for piece in (
        "did you mean 'table'?",
        "to itself",
        "give preload or steady_normal_stress",
        "did you mean 'motor'?",
    ):
        assert piece in text


ROCK, BOTH = rate_state(1, 0, 1), ("motor", "table")
STRUCTURE = {
    "floats": (two_mass(), {"links": {"screw": ss.machine.Spring(between=("motor", "table"), damping=1.0)}},
    "bodies.table"),
    "float": (two_mass(), {"bodies": {**two_mass().bodies, "stray": ss.machine.SlidingBody()}}, "bodies.stray"),
    "unknown body": (two_mass(), {"contacts": {"guide": surface("shelf", rate_state(1, 0, 1))}}, "contacts.guide.body"),
    "cannot slide on itself": (
        two_mass(), {"contacts": {"g": surface("table", rate_state(1, 0, 1), against="table")}}, "contacts.g.against"),
    "do not slide": (
        two_mass(), {"contacts": {"g": surface("table", rate_state(1, 0, 1), against="motor")}}, "contacts.g"),
    "write 'rotary-pd'": (
        two_mass(), {"bodies": {"motor": ss.machine.RotatingBody(), "table": ss.machine.SlidingBody()}},
        "drive.control"),
    "does not; kinds of link for these ends: 'spring'": (
        two_mass(), {"links": {"screw": ss.machine.Screw(between=BOTH, lead=1.0, stiffness=1.0)}},
        "links.screw.between"),
    'exchange the two: between = ["motor", "table"]': (
        three_bodies(), {"links": {**three_bodies().links, "screw": ss.machine.Screw(
            between=("table", "motor"), lead=0.4, stiffness=1.0)}}, "links.screw.between"),
    "write control = 'rotary-steady' in [drive]": (
        three_bodies(), {"links": {**three_bodies().links, "shaft": ss.machine.Shaft(
            between=("drive", "motor"), stiffness=1.0)}, "drive": ss.machine.Pull(velocity=1.0)},
            "links.shaft.between"),
    "unknown body 'tble'": (
        two_mass(), {"drive": ss.machine.PositionPD(velocity=1.0, velocity_of="tble", body="motor", kp=1.0)},
        "drive.velocity_of"),
    "cannot move away from the surface": (
        two_mass(), {"links": {"screw": ss.machine.Spring(between=BOTH, stiffness=1.0, angle=0.1)}}, "links.screw"),
    "unknown link 'belt'": (
        two_mass(), {"contacts": {"g": surface("table", ROCK, loaded_by="belt")}}, "contacts.g.loaded_by"),
    "needs a body that moves away": (
        two_mass(), {"contacts": {"g": ss.machine.Surface(body="table", friction=rate_state(1, 0, 1),
                                                  contact=ss.laws.Compliant(normal_stiffness=1.0))}},
                                                  "contacts.g.contact"),
    "has no support": (
        brake(ROCK), {"contacts": {"disc": surface("pad", ROCK)},
                      "links": {"arm": ss.machine.Spring(between=("drive", "pad"), stiffness=1.0)}}, "bodies.pad"),
    "slip is radius times": (
        three_bodies(), {"contacts": {"g": surface("motor", rate_state(1, 0, 1))}}, "contacts.g.radius"),
    "needs at least one": (two_mass(), {"contacts": {}}, "contacts"),
    "stands still": (
        two_mass(), {"bodies": {**two_mass().bodies, "post": ss.machine.SlidingBody()},
                     "links": {**two_mass().links, "bolt": ss.machine.Spring(between=("ground", "post"),
                     stiffness=1.0)},
                     "drive": ss.machine.PositionPD(velocity=1.0, body="motor", measured="post", kp=1.0)},
                     "drive.measured"),
    "contradict each other": (
        three_bodies(), {"links": {**three_bodies().links,
                                   "second": ss.machine.Screw(between=("motor", "head"), lead=0.4, stiffness=1.0)}},
                                   "links"),
}  # fmt: skip


@pytest.mark.parametrize("words", STRUCTURE)
def test_a_machine_that_does_not_hang_together_says_where(words):
    machine, changes, name = STRUCTURE[words]
    fields = {key: getattr(machine, key) for key in ("bodies", "links", "contacts", "drive")} | changes
    with pytest.raises(ss.ParameterError, match=re.escape(words)) as caught:
        ss.Machine(**fields)
    assert name in {problem.name for problem in caught.value.problems}


def test_names_must_fit_into_dotted_names():
    for name in ("a.b", "1st", "", "x" * 50):
        with pytest.raises(ss.ParameterError, match="is not a valid name"):
            ss.Machine(bodies={name: ss.machine.SlidingBody()}, contacts={}, drive=ss.machine.Pull(velocity=1.0))
    with pytest.raises(ss.ParameterError, match=r"bodies\.ground"):
        ss.Machine(bodies={"ground": ss.machine.SlidingBody()}, contacts={}, drive=ss.machine.Pull(velocity=1.0))


def test_a_sliders_contact_cannot_be_compliant():
    with pytest.raises(ss.ParameterError, match="describe the rig as a machine"):
        ss.Slider(
            friction=rate_state(1, 0, 1),
            contact=ss.laws.Compliant(normal_stiffness=1.0),
            stiffness=1.0,
            drive=ss.machine.SteadyDrive(1.0),
        )


def test_loops_that_contradict_each_other_are_refused_for_arrays_too():
    machine = three_bodies()
    closed = ss.Machine(
        bodies=machine.bodies, contacts=machine.contacts, drive=machine.drive,
        links={**machine.links, "second": ss.machine.Screw(between=("motor", "head"), lead=0.5, stiffness=1.0)},
    )  # fmt: skip
    with pytest.raises(ss.ParameterError, match="contradict each other"):
        ss.eigenvalues(closed, {"links.second.lead": [0.5, 0.6]})


# --- the command line -------------------------------------------------------------------------------


def test_analyze_from_the_command_line():
    done = run("analyze", str(AXIS), "--set", "links.screw.stiffness='5 N/um'")
    assert done.returncode == 0
    assert "UNSTABLE" in done.stdout
    assert "the mode" in done.stdout
    data = json.loads(run("analyze", str(AXIS), "--json").stdout)
    assert data["stable"] is True
    assert data["steady"]["contacts"]["guide"]["normal_force"] == pytest.approx(3000.0)
    assert data["mode"]["words"]
    assert {row["unit"] for row in data["boundaries"] if row["parameter"] == "drive.kp"} == {"N m s/rad"}
    assert run("analyze", str(AXIS), "--require-stable").returncode == 0


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("links.belt.stiffness=1", "unknown parameter 'links.belt.stiffness'"),
        ("bodies.table.mass='5 m'", "bodies.table.mass"),
        ("stiffness=-1", "links.screw.stiffness"),
    ],
)
def test_changes_that_are_wrong(change, said):
    done = run("analyze", str(AXIS), "--set", change)
    assert done.returncode == 2
    assert said in done.stderr
    assert "Traceback" not in done.stderr


COMMANDS = [("analyze", "--branch", "1")]


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_what_machines_do_not_have_yet_is_refused_in_one_line(command, tmp_path):
    done = run(command[0], str(AXIS), *command[1:], folder=tmp_path)
    assert not list(tmp_path.iterdir())
    assert done.returncode == 2
    assert "machine" in done.stderr
    assert done.stderr.count("\n") == 1
    assert "Traceback" not in done.stderr


CALLS = [
    lambda m: ss.critical_stiffness(m),
    lambda m: ss.stable_stiffness(m), lambda m: ss.small_signal(m),
    lambda m: ss.safety_factor(m),
]  # fmt: skip


@pytest.mark.parametrize("call", range(len(CALLS)))
def test_functions_that_machines_do_not_have_yet(call):
    with pytest.raises(ss.SteadyslipError, match=r"[Mm]achine"):
        CALLS[call](two_mass())


@pytest.mark.usefixtures("unpainted")
def test_results_of_machines_can_be_shown_in_notebooks_and_documents():
    machine = two_mass()
    for result in (machine, ss.analyze(machine), ss.steady_state(machine), ss.modes(machine)[0]):
        assert "table" in result._repr_html_()
        assert "table" in ss.report(result).html
    assert "1 N<" in machine._repr_html_().replace("\xa0", " ")  # a preload, not 1 Pa


FEED = """
[bodies.motor]
motion = "rotation"
inertia = "40 kg cm^2"
[bodies.table]
mass = "300 kg"
[links.screw]
kind = "screw"
between = ["motor", "table"]
lead = "10 mm/rev"
stiffness = "120 N/um"
[contacts.guide]
body = "table"
[contacts.guide.friction]
law = "lugre"
mu_coulomb = 0.1
mu_static = 0.15
v_stribeck = "1 mm/s"
bristle_stiffness = "1e5 1/m"
[contacts.guide.contact]
law = "constant"
preload = "3 kN"
[drive]
control = "rotary-pd"
body = "motor"
kp = "600 N m/rad"
velocity = "500 mm/min"
velocity_of = "table"
"""


def test_the_feed_of_any_body_is_the_velocity_of_its_drive(tmp_path):
    fed = ss.rig_from_text(FEED)
    turned = ss.rig_from_text(FEED.replace('velocity_of = "table"', "").replace("500 mm/min", "50 rev/min"))
    assert fed.drive.velocity == pytest.approx(turned.drive.velocity, rel=1e-14)
    assert fed.speeds()["table"] == pytest.approx(0.5 / 60, rel=1e-14)
    assert fed.with_values({"drive.velocity": turned.drive.velocity}) == turned
    (file := tmp_path / "axis.toml").write_text(FEED)
    assert ss.read_rig(file, ["drive.velocity=250 mm/min"]).speeds()["table"] == pytest.approx(0.25 / 60)
    assert ss.rig_from_text(ss.rig_to_text(fed)) == fed


def test_protocols_move_the_body_whose_feed_was_given():
    """In the file, in words and in texts of Python, columns too; numbers without a unit in Python are the drive's."""
    pieces = """
[[protocol.pieces]]
kind = "velocity-step"
at = "1 s"
to = "600 mm/min"
[[protocol.pieces]]
kind = "load-point-table"
time = [2, 3]
displacement = ["0 mm", "5 mm"]
"""
    fed = ss.rig_from_text(FEED)
    step = ss.piece_from_text("velocity-step at=1s to='600 mm/min'", machine=fed)
    read, column = ss.protocol_from_text(FEED + pieces).pieces
    assert read == step
    assert step.to == pytest.approx(1.2 * fed.drive.velocity)
    assert column.displacement == pytest.approx([0.0, np.pi])
    given, own = (ss.protocol.VelocityStep(at=0.1, to=one) for one in ("600 mm/min", step.to))
    one, other = (ss.simulate(fed, piece, until=0.2, times=[0.15, 0.2])["table.v"] for piece in (given, own))
    np.testing.assert_allclose(one, other, rtol=1e-9)
    assert not np.allclose(one, fed.speeds()["table"], rtol=1e-2)
    with pytest.raises(ss.ParameterError, match=r"got 6.28319 rad/s; allowed here: a number in m/s"):
        ss.simulate(fed, ss.protocol.VelocityStep(at=0.1, to="60 rpm"), until=0.2)


def test_hunting_is_told_of_the_body_whose_feed_was_given():
    dry = 'law = "coulomb"\nmu_coulomb = 0.1\nmu_static = 0.15\n[contacts.guide.contact]'
    held = re.sub(r'law = "lugre".*?\[contacts\.guide\.contact\]', dry, FEED, flags=re.S).replace(
        "500 mm/min", "0 mm/min"
    )
    fed = ss.hunt(ss.rig_from_text(held), ss.protocol.DisplacementStep(at=0, by="1 mm"), until=0.5)
    turned = ss.rig_from_text(held.replace('velocity_of = "table"', "").replace("0 mm/min", "0 rpm"))
    own = ss.hunt(turned, ss.protocol.DisplacementStep(at=0, by="36 deg"), until=0.5)
    ratio = 0.01 / (2 * np.pi)
    assert (fed.unit, own.unit) == ("m", "rad")
    np.testing.assert_allclose(fed.error, ratio * own.error, rtol=1e-9, atol=1e-12)
    assert fed.highest == pytest.approx(ratio * own.highest)
    assert [one.ends for one in fed.strokes] == pytest.approx([ratio * one.ends for one in own.strokes])


def test_a_verdict_tells_the_speed_of_the_body_whose_feed_was_given():
    fed = ss.rig_from_text(
        FEED.replace("600 N m/rad", "20 N m/rad").replace("1 mm/s", "3 mm/s") + 'kd = "0.1 N m s/rad"'
    )
    edge = next(one for one in ss.analyze(fed).margins if one.parameter == "drive.velocity").edge.value
    feed = f"{edge / fed.drive.velocity * 500:.4g} mm/min"
    for rig, speed in (
        (fed, "500 mm/min"),
        (fed.with_values({"drive.velocity": 2 * fed.drive.velocity}), "1000 mm/min"),
    ):
        text = str(ss.analyze(rig))
        assert text.splitlines()[0].endswith(f"steady sliding at {speed}")
        assert re.search(rf"drive\.velocity +{speed} +-> {feed} ", text)
        assert "rad/s" not in text


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('velocity_of = "table"', "", "'motor' turns; for that of another body write velocity_of = \"table\""),
        ("500 mm/min", "50 rev/min", "'50 rev/min' has the wrong dimension; expected a quantity in m/s"),
        ("rotary-pd", "pd", "got 'pd', but 'motor' turns; write 'rotary-pd'"),
        ('"table"\n', '"tabel"\n', "did you mean 'table'?"),
        ('["motor", "table"]', '["table", "motor"]', 'exchange the two: between = ["motor", "table"]'),
    ],
)
def test_a_mistake_in_a_feed_is_answered_in_one_sentence(old, new, words):
    with pytest.raises(ss.RigFileError, match=re.escape(words)) as caught:
        ss.rig_from_text(new.join(FEED.rsplit(old, 1)))
    assert len(caught.value.problems) == 1


def test_a_feed_where_nothing_moves_is_refused():
    post = FEED.replace("[contacts.guide]", '[bodies.post]\n[links.bolt]\nbetween = ["ground", "post"]\n'
                        'stiffness = "1 N/m"\n[contacts.guide]').replace('of = "table"', 'of = "post"')  # fmt: skip
    with pytest.raises(ss.RigFileError, match="'post' stands still in steady sliding"):
        ss.rig_from_text(post)
