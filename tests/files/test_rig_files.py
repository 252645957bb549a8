"""Rig files: what is read is what was written, and everything wrong is said at once."""

import math
import os
import subprocess
import sys
import tomllib
from dataclasses import fields
from pathlib import Path

import jsonschema
import pytest
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from command import run
from file_schema import file_schema
from steadyslip.core.entries import Option
from steadyslip.core.errors import SHOWN
from steadyslip.core.roles import Parameter, Role
from steadyslip.files.specifications import protocol_from_text
from steadyslip.files.specifications.layout import own_fields, sections
from steadyslip.files.specifications.toml import key_lines, line_of
from steadyslip.protocol import Piece

EXAMPLE = Path(__file__).parents[2] / "examples" / "inclined-spring.toml"
TEXT = EXAMPLE.read_text(encoding="utf-8")


def problems(text: str, *changes: str) -> dict[str, tuple[int | None, str]]:
    with pytest.raises(ss.RigFileError) as caught:
        ss.rig_from_text(text, "rig.toml", changes)
    return {p.name: (p.line, p.message) for p in caught.value.problems}


def test_example_is_the_paper_rig():
    rig = ss.read_rig(EXAMPLE)
    assert rig == ss.Slider(
        friction=ss.laws.RateState(
            a=0.0145,
            b=0.016,
            d_c=1e-6,
            mu_ref=0.7,
            v_ref=1e-6,
            evolution=ss.laws.Slip(),
            normal_memory=ss.laws.LinkerDieterich(alpha=0.56),
        ),
        contact=ss.laws.InclinedSpring(preload=5e6, angle=-math.pi / 4),
        stiffness=9e9,
        drive=ss.machine.SteadyDrive(1e-6),
    )


@st.composite
def law_of(draw, family):
    """A random valid-looking record of a registered law; None where the values contradict each other."""
    law = draw(st.sampled_from(sorted(family.registry.values(), key=lambda c: c.name)))
    try:
        return law(**draw(arguments_of(law)))
    except ss.ParameterError:
        return None


@st.composite
def arguments_of(draw, law):
    chosen = {}
    for item, role in own_fields(law):
        if item.default is None and draw(st.booleans()):
            continue
        if isinstance(role, Parameter):
            low = max(role.domain.low, -1e3) if math.isfinite(role.domain.low) else -1e3
            high = min(role.domain.high, 1e3)
            chosen[item.name] = draw(st.floats(low, high, exclude_min=True, exclude_max=True))
        elif isinstance(role, Option):
            chosen[item.name] = draw(st.sampled_from(role.choices))
        elif role.many:
            members = draw(st.lists(arguments_of(role.family), max_size=3))
            chosen[item.name] = tuple(role.family(**m) for m in members)
        elif (inner := draw(law_of(role.family))) is not None:
            chosen[item.name] = inner
    return chosen


@given(st.data())
@settings(max_examples=80, deadline=None)
def test_every_rig_comes_back_from_its_file(data):
    chosen = {s.name: data.draw(law_of(s.family)) for s in sections() if s.family is not ss.Slider}
    own = data.draw(arguments_of(ss.Slider)) | {"area": None}
    try:
        rig = ss.Slider(**chosen, **own)
    except ss.ParameterError:
        return
    text = ss.rig_to_text(rig)
    assert ss.rig_from_text(text) == rig
    file_schema().validate(tomllib.loads(text))


def test_schema_is_valid_and_refuses_what_the_reader_refuses():
    schema = ss.json_schema()
    jsonschema.Draft202012Validator.check_schema(schema)
    validator = jsonschema.Draft202012Validator(schema)
    for bad in (
        TEXT.replace("a = 0.0145", "a = -1"),
        TEXT.replace("angle =", "angel ="),
        TEXT.replace('"slip"', '"slop"'),
    ):
        with pytest.raises(jsonschema.ValidationError):
            validator.validate(tomllib.loads(bad))
        problems(bad)


def test_all_problems_at_once_with_lines_and_hints():
    text = """[friction]
law = "rate-state"
a = -1
b = nan
d_c = "0 um"
mu_ref = 0.7
v_ref = "1 um"
evolution = "slipp"
[contact]
law = "inclined-spring"
preload = "5 m"
anlge = "-45 deg"
angle = "95 deg"
[slider]
stiffnes = 1
mass = inf
[drive]
velocity = "0 m/s"
[driv]
"""
    found = problems(text)
    expected = {
        "friction.a": (3, "got -1; allowed: a finite number > 0"),
        "friction.b": (4, "got nan"),
        "friction.d_c": (5, "got '0 um'"),
        "friction.v_ref": (7, "wrong dimension; expected a quantity in m/s"),
        "friction.evolution": (8, "did you mean 'slip'?"),
        "contact.preload": (11, "wrong dimension; expected a quantity in Pa"),
        "contact.anlge": (12, "did you mean 'angle'?"),
        "contact.angle": (13, "between -90 deg and 90 deg"),
        "slider.stiffnes": (15, "did you mean 'stiffness'?"),
        "slider.mass": (16, "got inf"),
        "drive.velocity": (18, "> 0"),
        "driv": (19, "did you mean 'drive'?"),
    }
    for name, (line, words) in expected.items():
        assert found[name][0] == line, name
        assert words in found[name][1], (name, found[name])
    assert set(found) - set(expected) == set()


@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        ("", "rig.toml", "is empty"),
        ("# only a comment", "friction", "missing table"),
        ("[friction", "rig.toml", "is not TOML"),
        ("friction = 3", "friction", "allowed: a table [friction]"),
        (
            TEXT.replace('law = "rate-state"', ""),
            "friction.law",
            "allowed: coulomb, coulomb-stribeck, lugre, rate-state",
        ),
        (TEXT.replace('law = "rate-state"', "law = 3"), "friction.law", "unknown friction law 3"),
        (TEXT.replace("b = 0.0160", ""), "friction.b", "give b and d_c (one state) or a list of states"),
        (TEXT.replace("alpha = 0.56", ""), "friction.normal_memory.alpha", "missing"),
        (TEXT.replace('preload = "5 MPa"', ""), "contact.preload", "give preload or steady_normal_stress"),
        (TEXT.replace('stiffness = "9 GPa/m"', ""), "slider.stiffness", "missing"),
        (TEXT + "control = 'pidd'", "drive.control", "did you mean 'pid'?"),
        (TEXT + "law = 'pd'", "drive.law", 'did you mean control = "pd"?'),
        (TEXT + "kd = 1", "drive.kd", 'it is a key of control = "pd" or "pid"'),
        (TEXT.replace("rate-state", "slip"), "friction.law", 'write law = "rate-state" and evolution = "slip"'),
        (TEXT.replace("a = 0.0145", "a = [1, 2]"), "friction.a", "got [1, 2]"),
        (TEXT.replace("a = 0.0145", "a = true"), "friction.a", "got True"),
        (TEXT.replace("a = 0.0145", 'a = "1 zork"'), "friction.a", "not a unit"),
        (TEXT.replace("[contact]", "states = 3\n[contact]"), "friction.normal_memory.states", "unknown key"),
        (TEXT.replace('evolution = "slip"', "states = 3"), "friction.states", "a list of tables"),
    ],
)
def test_each_mistake_has_a_clear_message(text, name, words):
    found = problems(text)
    assert name in found
    assert words in found[name][1], found[name]


def test_contradictions_are_reported_beside_bad_values():
    text = TEXT.replace('preload = "5 MPa"', "").replace('angle = "-45 deg"', "angle = 2")
    assert {"contact.preload", "contact.angle"} <= set(problems(text))


@pytest.mark.parametrize(
    "make",
    [
        lambda folder: folder / "missing.toml",
        lambda folder: folder,
        lambda folder: _written(folder, b"\xff\xfe\x00"),
        lambda folder: _written(folder, b""),
    ],
)
def test_unreadable_files(tmp_path, make):
    path = make(tmp_path)
    with pytest.raises(ss.RigFileError, match=r"no such file|is a folder|is not UTF-8|is empty"):
        ss.read_rig(path)


def _written(folder, content):
    path = folder / "rig.toml"
    path.write_bytes(content)
    return path


def test_a_byte_order_mark_is_no_obstacle(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(TEXT, encoding="utf-8-sig")
    assert ss.read_rig(path) == ss.read_rig(EXAMPLE)


def test_changes_override_and_complete_the_file():
    rig = ss.rig_from_text(TEXT, changes=["contact.angle=10 deg", "stiffness='2 GPa/m'", "mass=3", "evolution=aging"])
    assert rig.contact.angle == pytest.approx(math.radians(10), rel=1e-15)
    assert (rig.stiffness, rig.mass, type(rig.friction.evolution)) == (2e9, 3.0, ss.laws.Aging)
    rig = ss.rig_from_text(
        TEXT.replace("a = 0.0145", ""), changes=["friction.a=0.01", "friction.normal_memory.alpha=.1"]
    )
    assert (rig.friction.a, rig.friction.normal_memory.alpha) == (0.01, 0.1)
    rig = ss.rig_from_text(TEXT, changes=["friction.evolution=nagata", "friction.c_nagata=0.02"])
    assert rig.friction.evolution == ss.laws.Nagata(c_nagata=0.02)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ("contact.angel=1", "did you mean 'angle'?"),
        ("angel=1", "unknown parameter 'angel'"),
        ("contact.angle", "write NAME=VALUE"),
        ("contact.angle=", "write NAME=VALUE"),
        ("contact.angle=5 MPa", "wrong dimension"),
        ("friction.states.1.b=3", "unknown|list of tables|cannot be set"),
        ("protocol.pieces.1.to=3", "a list of tables, [[protocol.pieces]]"),
        ("protocol.end=3", "unknown key 'end'; did you mean 'until'? allowed: until, pieces"),
    ],
)
def test_bad_changes(change, words):
    message = " ".join(m for _, m in problems(TEXT, change).values())
    assert any(word in message for word in words.split("|")), message


@pytest.mark.parametrize(
    ("changes", "begins"),
    [
        (["friction.normal_memory=foo"], "changes (--set): friction.normal_memory.law: unknown"),
        (["evolution=foo", "mass=x"], "changes (--set): 2 problems"),
        (["contact.law=foo"], "changes (--set): contact.law: unknown"),
    ],
)
def test_a_fault_of_a_change_is_not_said_to_be_the_file_s(changes, begins):
    with pytest.raises(ss.RigFileError) as caught:
        ss.rig_from_text(TEXT, "rig.toml", changes)
    assert str(caught.value).startswith(begins)
    assert all(one.line is None for one in caught.value.problems)
    with pytest.raises(ss.RigFileError) as caught:
        ss.rig_from_text(TEXT.replace("b = 0.0160", "b = 'x'"), "rig.toml", changes)
    first, *_, last = str(caught.value).splitlines()
    assert first.startswith("rig.toml: ")
    assert last.endswith("(of the changes (--set))")


def test_with_an_area_the_file_is_in_newtons():
    text = TEXT.replace("[slider]", '[slider]\narea = "20 cm^2"\nmass = 4').replace('"9 GPa/m"', '"18 MN/m"')
    rig = ss.rig_from_text(text.replace('"5 MPa"', '"10 kN"'))
    assert rig.contact.preload == pytest.approx(5e6, rel=1e-15)
    assert rig.stiffness == pytest.approx(9e9, rel=1e-15)
    assert rig.mass == pytest.approx(2000, rel=1e-15)
    assert rig.friction == ss.read_rig(EXAMPLE).friction
    assert ss.rig_from_text(text).contact.preload == 5e6  # a stress is unambiguous too
    again = ss.rig_from_text(ss.rig_to_text(rig))
    for name, address in rig.parameters().items():
        if address.value is None:
            assert again.value(name) is None
            continue
        assert again.value(name) == pytest.approx(address.value, rel=1e-15)
    found = problems(text.replace('"18 MN/m"', '"18 m"'))
    assert "N/m" in found["slider.stiffness"][1]
    for wrong in ("0", '"nothing"', "-1"):  # and nothing is said of forces that are right with an area
        found = problems(text.replace('"20 cm^2"', wrong))
        assert list(found) == ["slider.area"]
        assert "m^2" in found["slider.area"][1]


def test_a_law_without_name_cannot_be_written():
    class Nameless(ss.laws.FrictionLaw):
        pass

    rig = ss.Slider(
        friction=Nameless(),
        contact=ss.laws.ConstantNormalStress(preload=1e6),
        stiffness=1e9,
        drive=ss.machine.SteadyDrive(1e-6),
    )
    with pytest.raises(ss.ParameterError, match="has no name"):
        ss.rig_to_text(rig)


def test_opening_a_file_runs_no_code_from_it():
    assert "unknown friction law" in problems(TEXT.replace('"rate-state"', '"os.system"'))["friction.law"][1]


def test_lines_of_keys():
    lines = key_lines('[a]\nb = 1 # c = 2\n\n[[a.list]]\nx = 1\n[[a.list]]\n"x" = 2\n[c.d]\ne.f = 3\n')
    assert lines == {"a": 1, "a.b": 2, "a.list": 4, "a.list.1": 4, "a.list.1.x": 5, "a.list.2": 6, "a.list.2.x": 7,
                     "c.d": 8, "c.d.e.f": 9}  # fmt: skip
    assert line_of("a.b.inline", lines) == 2
    assert line_of("nowhere.x", lines) is None


def test_every_parameter_has_unit_and_meaning():
    for family in [s.family for s in sections() if s.family is not ss.Slider] + [Piece]:
        for law in family.registry.values():
            for item in fields(law):
                role = item.metadata["steadyslip"]
                assert role.doc
                assert isinstance(role, Role)


def test_a_law_of_an_installed_package_is_found_by_its_entry_point(tmp_path):
    """In a process of its own, with a package that exists on its path only."""
    (tmp_path / "my_laws.py").write_text(
        "import steadyslip as ss\nclass Mine(ss.laws.RateState, name='my-law'):\n    'A law from elsewhere.'\n"
    )
    info = tmp_path / "my_laws-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: my-laws\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[steadyslip.laws]\nmy-law = my_laws:Mine\n")
    rig = tmp_path / "rig.toml"
    rig.write_text(TEXT.replace('"rate-state"', '"my-law"'), encoding="utf-8")
    command = [sys.executable, "-m", "steadyslip", "analyze", str(rig)]
    on_path = os.environ | {"PYTHONPATH": str(tmp_path)}
    done = subprocess.run(command, capture_output=True, encoding="utf-8", env=on_path)
    assert done.stdout.startswith("UNSTABLE"), done.stderr
    without = run("analyze", rig)
    assert without.returncode == 2
    assert "unknown friction law 'my-law'" in without.stderr
    assert "entry points 'steadyslip.laws'" in without.stderr
    drive = problems(TEXT.replace("[drive]", '[drive]\ncontrol = "odd"'))["drive.control"][1]
    assert drive == "unknown control 'odd'; allowed: steady, pd, pid"
    (tmp_path / "my_laws.py").write_text("import nonsense_that_is_not_there")
    broken = subprocess.run(command, capture_output=True, encoding="utf-8", env=on_path)
    assert broken.returncode == 2
    assert "cannot be loaded" in broken.stderr
    assert "Traceback" not in broken.stderr


@settings(max_examples=100, deadline=None)
@given(
    area=st.floats(1e-9, 1e3),
    numbers=st.tuples(*[st.floats(1e-6, 1e300)] * 4),
    change=st.lists(st.floats(-1e9, 1e9), min_size=2, max_size=2),
)
def test_rigs_with_an_area_come_back_to_the_last_bit(area, numbers, change):
    """Totals are written; where a total would not divide to the same number, the number per unit area is."""
    preload, stiffness, mass, damping = numbers
    friction = ss.laws.RateState(a=0.01, b=0.02, d_c=1e-6, mu_ref=0.6, v_ref=1e-6)
    rig = ss.Slider(
        friction=friction, contact=ss.laws.ConstantNormalStress(preload=preload), stiffness=stiffness, mass=mass,
        radiation_damping=damping, area=area, drive=ss.machine.SteadyDrive(1e-6),
    )  # fmt: skip
    protocol = ss.Protocol(
        pieces=(
            ss.protocol.NormalStressStep(at=1.0, by=change[0]),
            ss.protocol.NormalStressTable(time=(0.0, 1.0), change=tuple(change)),
        ),
        until=2.0,
    )
    text = ss.rig_to_text(rig, protocol)
    assert ss.rig_from_text(text) == rig
    assert protocol_from_text(text) == protocol


def test_a_message_has_an_end():
    """A file can be wrong in thousands of places; nobody reads more than a page of them."""
    text = '[friction]\nlaw = "rate-state"\na = 0.01\nmu_ref = 0.6\nv_ref = 1e-6\n' + "[[friction.states]]\n" * 500
    with pytest.raises(ss.RigFileError) as caught:
        ss.rig_from_text(text, "rig.toml")
    shown = str(caught.value)
    assert len(caught.value.problems) > 500
    assert len(shown) < 20_000
    assert f"{len(caught.value.problems)} problems" in shown
    assert f"... and {len(caught.value.problems) - SHOWN} more" in shown
