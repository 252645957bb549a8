"""Tables that say what to do: declared once, read, written and described by a schema from there."""

import tomllib
from dataclasses import fields
from inspect import signature

import pytest
from hypothesis import given, settings, strategies as st

import steadyslip as ss
from file_schema import file_schema
from steadyslip.core.entries import Headings, Label, LabelledNumbers, Names, Option, Quantity, Span, Text, Whole
from steadyslip.core.records import Named, Part, Settings, is_required, role_of
from steadyslip.core.roles import Parameter, Placeholder, Series
from steadyslip.experiments.fitting.settings import FitSettings
from steadyslip.experiments.measured.columns import ROLES
from steadyslip.experiments.measured.settings import RecordSettings
from steadyslip.experiments.spec import TABLES as FIT_TABLES, spec_from_text
from steadyslip.files.specifications.read import read_contents
from steadyslip.files.specifications.write import table_text
from steadyslip.maps.plan.map_file import TABLE as MAP_TABLE
from steadyslip.maps.plan.measures import Measure

RIG = ss.rig_to_text(ss.lab_rig())
EVERY = (*FIT_TABLES, MAP_TABLE)
WORD = st.text("abcxyz_%é ", min_size=1, max_size=8)
NUMBER = st.floats(1e-6, 1e6)


def value_of(role):
    kinds = {
        Text: WORD, Names: st.lists(WORD, max_size=3).map(tuple), Label: WORD | st.integers(1, 9),
        Span: st.tuples(NUMBER, NUMBER), Quantity: NUMBER | st.just("1 GPa/m"),
        Series: st.lists(NUMBER, min_size=1, max_size=9).map(tuple),
        Headings: st.dictionaries(WORD, WORD | st.integers(1, 40) | st.tuples(WORD, WORD), min_size=1, max_size=3),
        LabelledNumbers: st.lists(NUMBER, max_size=3).map(tuple) | st.dictionaries(WORD, NUMBER, max_size=3),
    }  # fmt: skip
    if isinstance(role, Whole):
        return st.integers(role.low, 2**40 if role.high is None else role.high)
    if isinstance(role, Option):
        return st.sampled_from(role.choices)
    if isinstance(role, Parameter):
        whole = st.integers(1, 1000).map(float)
        return (
            whole
            if role.domain.whole
            else st.floats(max(role.domain.low, 0), min(role.domain.high, 1e6), exclude_min=True, exclude_max=True)
        )
    if isinstance(role, Named):
        one = record_of(role.family) | (st.lists(NUMBER, max_size=3).map(tuple) if role.listed else st.nothing())
        return st.dictionaries(st.sampled_from(["mass", "contact.angle", "protocol.pieces.1.to"]), one, max_size=2)
    if isinstance(role, Part) and role.by_name:
        return st.lists(st.sampled_from(["events", "threshold"]), unique=True).flatmap(
            lambda names: st.tuples(*[record_of(Measure.registry[name]) for name in names])
        )
    return record_of(role.family) if isinstance(role, Part) else kinds[type(role)]


@st.composite
def record_of(draw, family):
    chosen = {
        item.name: draw(value_of(role_of(item)))
        for item in fields(family) if is_required(item) or draw(st.booleans())
    }  # fmt: skip
    if family.short:  # neither a name nor a unit means nothing
        chosen.setdefault("column", 1)
    if "options" in chosen:
        chosen["compute"] = tuple(one.name for one in chosen["options"])
    if "points" in {item.name for item in fields(family)} and "fit" in {item.name for item in fields(family)}:
        chosen = {"points": 3} | chosen
        if chosen.get("fit") is not None:
            chosen = {key: one for key, one in chosen.items() if key not in ("over", "method")}
    return family(**chosen)


@pytest.mark.parametrize("section", EVERY, ids=lambda s: s.name)
@given(st.data())
@settings(max_examples=25, deadline=None)
def test_every_table_comes_back_from_its_text(section, data):
    table = data.draw(record_of(section.family))
    text = table_text(f"[{section.name}]", table, [], section.name, None)
    found = read_contents(RIG + text, "test", (), EVERY)
    faults = [p for p in found.problems if p.name != "map"]  # missing where it is not the one written
    assert faults == []
    again = found.further[section.name]
    assert plain(again) == plain(table)
    file_schema().validate(tomllib.loads(RIG + text))


def plain(value):
    """Records and tuples as dicts and lists: lists of values stay as a file has them."""
    if isinstance(value, (Settings, Measure)):
        return {item.name: plain(getattr(value, item.name)) for item in fields(value)}
    if isinstance(value, dict):
        return {name: plain(one) for name, one in value.items()}
    return [plain(one) for one in value] if isinstance(value, (tuple, list)) else value


FAULTS = {
    "fit": {
        "trend = 9": "allowed: a whole number from 0 to 6",
        "trend = true": "allowed: a whole number from 0 to 6",
        "loss = 'soft'": "did you mean 'soft-l1'?",
        "drive = 'protocol'": "allowed: commanded, smoothed, measured",
        "width = 0": "allowed: a finite number above 0",
        "width = '1 um'": "wrong dimension",
        "free = 3": "allowed: a list of names",
        "free = [1]": "allowed: a list of names",
        "errors = 'none'": "allowed: auto, correlated, independent",
        "offset = 1": "allowed: true or false",
        "states = 0": "allowed: a whole number from 1",
        "windos = true": "did you mean 'windows'?",
    },
    "population": {
        "scale = 0": "allowed: a number above 0, up to 100",
        "draws = 99": "allowed: a whole number from 100",
        "values = 'hot'": "got 'hot'",
        "condition = 3": "allowed: a text",
        "parameters = [3]": "allowed: a list of names",
    },
    "record": {
        "between = [1]": "allowed: [start, end] in s",
        "between = ['1 m', 2]": "wrong dimension",
        "area = '3 mm'": "wrong dimension; expected a quantity in m^2",
        "normal_stress = -1": "allowed: a finite number > 0",
        "decimate = 3": "allowed: a whole number >= 50",
        "shear = 0": "allowed: a name, or a number from 1",
        "normal = { colum = 'x' }": "did you mean 'column'?",
        "skip_bad_lines = 'yes'": "allowed: true or false",
        "times = 't'": "did you mean 'time'?",
    },
    "map": {
        "compute = 3": "allowed: a list of names",
        "chunk = 0": "allowed: a whole number from 1",
        "over.angle = { from = 1, to = 2 }": "missing (number of values)",
        "over.angle = { from = 1, to = 2, points = 2, spacing = 'logg' }": "did you mean 'log'?",
        "over.angle = { from = true, to = 2, points = 2 }": "text with a unit",
        "over.angle = 3": "a list of values",
        "samples.method = 'sobl'": "did you mean 'sobol'?",
        "samples.seed = -1": "allowed: a whole number from 0",
        "samples = 3": "allowed: a table",
        "status = 3": "unknown key 'status'",
        "cunk = 3": "did you mean 'chunk'?",
        "threshold.kick = 'velocty'": "did you mean 'velocity'?",
    },
}


@pytest.mark.parametrize(
    ("name", "line", "message"), [(name, *one) for name, lines in FAULTS.items() for one in lines.items()]
)
def test_each_fault_is_named_with_its_line_and_refused_by_the_schema(name, line, message):
    text = f"{RIG}[{name}]\n{line}\n"
    read = ss.map_from_text if name == "map" else spec_from_text
    with pytest.raises(ss.RigFileError) as caught:
        read(text)
    found = [p for p in caught.value.problems if message in p.message]
    assert found, str(caught.value)
    assert found[0].name.startswith(f"{name}.")
    assert found[0].line == text.count("\n")
    assert file_schema().is_valid(tomllib.loads(text)) == ("wrong dimension" in message)  # which no schema knows


def test_all_faults_of_all_tables_come_at_once():
    lines = [
        "[friction]",
        "a = 'x'",
        "[slidr]",
        "[record]",
        "tim = 1",
        "between = 3",
        "[fit]",
        "trend = 9",
        "fre = 'a'",
    ]
    with pytest.raises(ss.RigFileError) as caught:
        spec_from_text("\n".join(lines))
    assert [(p.line, p.name) for p in caught.value.problems] == [
        (2, "friction.a"), (3, "slidr"), (5, "record.tim"), (6, "record.between"), (8, "fit.trend"), (9, "fit.fre"),
    ]  # fmt: skip


def test_what_is_changed_is_given():
    plain_spec = spec_from_text("[friction]\n")
    assert not any((plain_spec.v_ref_given, plain_spec.contact_given))
    assert isinstance(plain_spec.rig.drive.velocity, Placeholder)
    changes = ["v_ref=2 um/s", "contact.steady_normal_stress=3 MPa", "velocity=3 um/s"]
    spec = spec_from_text("[friction]\n", "spec", changes)
    assert (spec.rig.friction.v_ref, spec.rig.drive.velocity) == (2e-6, 3e-6)
    assert spec.v_ref_given
    assert spec.contact_given
    assert not isinstance(spec.rig.drive.velocity, Placeholder)


def test_a_contact_without_stress_says_nothing_of_the_stress():
    """What stands in for it must not be taken for a measured one."""
    assert not spec_from_text("[friction]\n[contact]\nlaw = 'constant'\n").contact_given
    assert spec_from_text("[friction]\n[contact]\nlaw = 'constant'\npreload = '1 MPa'\n").contact_given


def test_columns_may_be_written_short_or_long():
    text = "[friction]\n[record]\nshear = {}\n"
    for short, long in (
        ("'Fs'", {"shear": "Fs"}), ("3", {"shear": 3}), ("['Fs', 'kN']", {"shear": {"column": "Fs", "unit": "kN"}}),
        ("{ column = 'Fs', unit = 'kN' }", {"shear": {"column": "Fs", "unit": "kN"}}),
        ("{ unit = 'kN' }", {"shear": {"column": None, "unit": "kN"}}),
    ):  # fmt: skip
        assert spec_from_text(text.format(short)).record.arguments() == long


def test_whatever_a_record_is_read_with_may_stand_in_a_file():
    words = {*signature(ss.read_record).parameters} - {"path", "columns"} | {*ROLES, "decimate"}
    of_machines = {"columns", "averages"}
    readers = (ss.experiments.read_motion, ss.experiments.read_frequency_response)
    assert of_machines <= {name for one in readers for name in signature(one).parameters}
    assert {item.name for item in fields(RecordSettings)} == words | of_machines
    own = {"states", "windows", "compare"}  # of the file; the others are arguments of fit
    assert {item.name for item in fields(FitSettings)} - own <= {*signature(ss.fit).parameters}


def test_a_record_is_per_unit_area_whatever_the_area_of_the_rig():
    spec = spec_from_text("[friction]\n[slider]\narea = '2 m^2'\n[record]\nnormal_stress = 3e6\n")
    assert spec.record.normal_stress == 3e6


def test_a_key_in_another_table_is_told_where_it_belongs():
    with pytest.raises(ss.RigFileError) as caught:
        spec_from_text("[friction]\ntrend = 1\n[fit]\nbetween = [1, 2]\n")
    found = {p.name: p.message for p in caught.value.problems}
    assert found == {
        "friction.trend": "unknown key 'trend' here; it is a key of [fit]",
        "fit.between": "unknown key 'between' here; it is a key of [record]",
    }
