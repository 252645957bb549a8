"""Protocols in rig files and in words: what is read is what was written, and what is wrong is said."""

import tomllib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from file_schema import file_schema
from protocols_at_random import protocols, spans
from steadyslip.files.specifications import piece_from_text, protocol_from_text, read_protocol, write_rig
from steadyslip.protocol import (
    DisturbanceStep,
    DisturbanceTable,
    LoadPointTable,
    NormalStressHarmonic,
    NormalStressPulse,
    NormalStressStep,
    NormalStressTable,
    Protocol,
    VelocityStep,
)

TEXT = (Path(__file__).parents[2] / "examples" / "inclined-spring.toml").read_text(encoding="utf-8")


# --- files ------------------------------------------------------------------------------------------


@given(protocols, st.one_of(st.none(), spans))
@settings(deadline=None, max_examples=50)
def test_every_protocol_comes_back_from_its_file(protocol, until):
    protocol = protocol + Protocol(until=until)
    rig = ss.rig_from_text(TEXT)
    text = ss.rig_to_text(rig, protocol)
    assert protocol_from_text(text) == protocol
    assert ss.rig_from_text(text) == rig
    file_schema().validate(tomllib.loads(text))
    alone = text[text.index("[protocol]") :]
    assert protocol_from_text(alone) == protocol


def test_a_file_without_protocol_has_none(tmp_path):
    path = tmp_path / "rig.toml"
    path.write_text(TEXT, encoding="utf-8")
    assert read_protocol(path) is None
    assert read_protocol(path, ["protocol.until=1 min"]) == Protocol(until=60)
    long = Protocol.of(LoadPointTable(time=np.arange(500), displacement=np.arange(500) * 1e-6))
    write_rig(ss.rig_from_text(TEXT), path, long)
    assert read_protocol(path) == long
    assert max(map(len, path.read_text("utf-8").splitlines())) < 120


EXPERIMENT = """
[protocol]
until = "200 s"
[[protocol.pieces]]
kind = "velocity-step"
at = "10 s"
to = "2 um/s"
[[protocol.pieces]]
kind = "normal-stress-table"
time = [0, "1 min"]
change = [0, "1 MPa"]
"""


def test_changes_reach_the_pieces():
    changes = ["protocol.pieces.1.to=3 um/s", "protocol.until=100 s", "pieces.2.change=[1, 2]", "stiffness=1e9"]
    found = protocol_from_text(TEXT + EXPERIMENT, changes=changes)
    assert found == Protocol(
        pieces=(VelocityStep(at=10, to=3e-6), NormalStressTable(time=(0, 60), change=(1, 2))), until=100
    )
    assert ss.rig_from_text(TEXT + EXPERIMENT, changes=changes).stiffness == 1e9


@pytest.mark.parametrize("area", [None, 2.0])
def test_with_an_area_stresses_are_forces(area):
    pieces = (
        NormalStressStep(at=1, by=3e6),
        DisturbanceTable(time=[0, 1], change=[1.0, 2.0]),
        NormalStressHarmonic(amplitude=1.0, period=1),
        DisturbanceStep(at=1, by=7.0),
        NormalStressPulse(at=1, by=7.0, duration=2),
    )
    rig = ss.rig_from_text(TEXT).with_values({"slider.area": area})
    text = ss.rig_to_text(rig, Protocol(pieces=pieces))
    assert protocol_from_text(text).pieces == pieces
    forces = text.replace("[2.0, 4.0]  # N", "[2.0, 4.0]").replace("[2.0, 4.0]", '["2 N", "2 Pa"]')
    assert ("[2.0, 4.0]" in text) == (area is not None)
    if area is not None:
        assert protocol_from_text(forces).pieces == pieces
        with pytest.raises(ss.RigFileError, match=r"value 1: '2 m' has the wrong dimension.*the rig has an area"):
            protocol_from_text(forces.replace("2 N", "2 m"))
        assert piece_from_text("normal-stress-step at=1 by=6e6", area) == pieces[0]
        assert piece_from_text("normal-stress-step at=1 by='3 MPa'", area) == pieces[0]


def test_all_problems_of_rig_and_protocol_at_once():
    text = TEXT.replace("a = 0.0145", "a = -1") + EXPERIMENT.replace('"10 s"', '"10 m"').replace(
        '"normal-stress-table"', '"normal-stres-table"'
    ) + "[[protocol.pieces]]\nkind = 'hold'\nat = 1\ndurration = 2\n[[protocol.pieces]]\nat = 1\n"  # fmt: skip
    start = TEXT.count("\n") + 1
    with pytest.raises(ss.RigFileError) as caught:
        ss.rig_from_text(text)
    found = {p.name: (p.line, p.message) for p in caught.value.problems}
    expected = {
        "friction.a": (None, "got -1"),
        "protocol.pieces.1.at": (start + 5, "wrong dimension"),
        "protocol.pieces.2.kind": (start + 8, "did you mean 'normal-stress-table'?"),
        "protocol.pieces.3.durration": (start + 14, "did you mean 'duration'?"),
        "protocol.pieces.4.kind": (start + 15, "missing; allowed: velocity-step"),
    }
    assert set(found) == set(expected)
    for name, (line, words) in expected.items():
        assert words in found[name][1]
        assert line in (None, found[name][0]), name


def test_a_bad_number_brings_no_second_problem():
    for words in ("velocity-harmonic amplitude=1 period=-1", "slide-hold-slide at=1 hold=1 slide=1 repeats=0"):
        with pytest.raises(ss.ParameterError) as caught:
            piece_from_text(words)
        assert len(caught.value.problems) == 1


@pytest.mark.parametrize(
    ("text", "name", "words"),
    [
        ("[protocol]\nuntil = -1", "protocol.until", "> 0"),
        ("[protocol]\nend = 1", "protocol.end", "unknown key 'end'"),
        ("[protocol]\npieces = 3", "protocol.pieces", "a list of tables, [[protocol.pieces]]"),
        ("[protocol]\npieces = [3]", "protocol.pieces", "a list of tables"),
        ("protocol = 3", "protocol", "a table [protocol]"),
        ("[protocoll]", "protocoll", "did you mean 'protocol'?"),
        ("[protocol]\npieces = [{kind = 3}]", "protocol.pieces.1.kind", "unknown protocol piece 3"),
        (EXPERIMENT.replace('[0, "1 min"]', "[0, 'x']"), "protocol.pieces.2.time", "'x' is not a quantity in s"),
        (EXPERIMENT.replace("[0, \"1 min\"]", "[0, -1]"), "protocol.pieces.2.time", "value 2: got -1.0 after 0.0"),
        (EXPERIMENT.replace("time = [0, \"1 min\"]", ""), "protocol.pieces.2.time", "a list of numbers in s"),
        (EXPERIMENT + "[[protocol.pieces]]\nkind='hold'\nat=5\nduration=1", "protocol.pieces.3", "starts at 5 s, bef"),
    ],
)  # fmt: skip
def test_each_mistake_in_a_file_has_a_clear_message(text, name, words):
    for whole in (TEXT + text,) if not text.startswith("protocol =") else (text + "\n" + TEXT,):
        with pytest.raises(ss.RigFileError) as caught:
            protocol_from_text(whole)
        found = {p.name: p.message for p in caught.value.problems}
        assert words in found[name], found
        assert all(p.line is not None for p in caught.value.problems)


# --- words ------------------------------------------------------------------------------------------


def test_pieces_from_words():
    assert piece_from_text("velocity-step at=10s to='2 um/s'") == VelocityStep(at=10, to=2e-6)
    assert piece_from_text("velocity-step 'to=2 um/s' at=10") == VelocityStep(at=10, to=2e-6)
    table = piece_from_text("normal-stress-table time=[0,1] change='[0, \"1 MPa\"]'")
    assert table == NormalStressTable(time=[0, 1], change=[0, 1e6])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "is empty; write KIND KEY=VALUE ..., KIND one of velocity-step, "),
        ("velocity-stp at=1", "did you mean 'velocity-step'?"),
        ("velocity-step at=10 um to=1", "um: is not KEY=VALUE"),
        ("velocity-step at=10m to=1", "at: '10m' has the wrong dimension"),
        ("velocity-step at=1", "to: missing (velocity from then on)"),
        ("velocity-step at=1 at=2 to=1", "at: is given twice"),
        ("velocity-step at=1 t=2 to=1", "t: unknown key 't'"),
        ("velocity-step at='1", "No closing quotation"),
        ("velocity-step at= to=1", "at=: is not KEY=VALUE"),
    ],
)
def test_bad_words(text, words):
    with pytest.raises(ss.ParameterError) as caught:
        piece_from_text(text)
    assert words in str(caught.value)
    assert "\n\n" not in str(caught.value)


def test_changes_may_come_from_a_generator(tmp_path):
    """They reach the rig and the protocol."""
    from steadyslip.cli.run_files import run_file

    path = tmp_path / "rig.toml"
    example = Path(__file__).parents[2] / "examples" / "inclined-spring.toml"
    path.write_text(example.read_text(encoding="utf-8") + "\n[protocol]\nuntil = 5\n", encoding="utf-8")
    with pytest.raises(ss.ParameterError, match=r"protocol\.until"):
        run_file(path, (text for text in ["stiffness=30 GPa/m", "protocol.until=-2"]))
