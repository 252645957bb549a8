"""Whatever is thrown at it: a verdict or one clear message, never a traceback, never NaN as an answer."""

import json
import math
import re
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st

import steadyslip as ss
from steadyslip.files.specifications import protocol_from_text
from steadyslip.protocol.segments import pack

EXAMPLE = Path(__file__).parents[2] / "examples" / "inclined-spring.toml"
TEXT = EXAMPLE.read_text(encoding="utf-8")
EXPERIMENT = """
[protocol]
until = "200 s"
[[protocol.pieces]]
kind = "slide-hold-slide"
at = "10 s"
hold = 2
slide = "1 s"
factor = 2
repeats = 3
[[protocol.pieces]]
kind = "normal-stress-table"
time = [0, "1 min"]
change = [0, "1 MPa"]
[[protocol.pieces]]
kind = "disturbance-harmonic"
amplitude = 3
period = "2 s"
phase = "90 deg"
until = 100
"""

values = st.one_of(
    st.floats(),
    st.floats(min_value=1e-300, max_value=1e300),
    st.integers(-(10**30), 10**30),
    st.booleans(),
    st.text(max_size=8),
    st.sampled_from(
        ["5 MPa", "1e999 m", "-3 deg", "1 um/s", "nan", "inf Pa", "1/0", "5 m^999999", "10 10", "µ", "1 kg**", ""]
    ),
    st.sampled_from(["{}", "[]", "1979-05-27", "{law='none'}", "[[1]]"]),
)


def toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float):
        return (
            "nan"
            if math.isnan(value)
            else "inf"
            if value == math.inf
            else "-inf"
            if value == -math.inf
            else repr(value)
        )
    return str(value) if isinstance(value, int) or str(value)[:1] in "{[1" else json.dumps(value)


def judged(text: str) -> None:
    """A rig or one message; and a rig has a verdict or one message."""
    try:
        analysis = ss.analyze(ss.rig_from_text(text, "rig.toml"))
    except ss.SteadyslipError as error:
        message = str(error)
    else:
        message = str(analysis)
        json.loads(analysis.to_json())
        assert analysis.stable in (True, False, None)
        assert analysis.reason
        assert not re.findall(r"\bnan\b", message.lower())
    assert message


@given(st.data())
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore::steadyslip.core.errors.UnitWarning")  # numbers without a unit are asked about
def test_any_value_anywhere(data):
    lines = TEXT.splitlines()
    keys = [i for i, line in enumerate(lines) if re.match(r"\w+ =", line)]
    for i in data.draw(st.lists(st.sampled_from(keys), min_size=1, max_size=3)):
        lines[i] = f"{lines[i].split('=')[0]}= {toml(data.draw(values))}"
    judged("\n".join(lines))


@given(st.data())
@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.too_slow])
def test_any_value_anywhere_in_a_protocol(data):
    """A protocol that can be cut into segments of finite numbers, or one message."""
    lines = EXPERIMENT.splitlines()
    keys = [i for i, line in enumerate(lines) if re.match(r"\w+ =", line)]
    for i in data.draw(st.lists(st.sampled_from(keys), min_size=1, max_size=3)):
        lines[i] = f"{lines[i].split('=')[0]}= {toml(data.draw(values))}"
    try:
        segments = pack(protocol_from_text("\n".join(lines)), 1e-6, 200.0)
    except ss.SteadyslipError:
        return
    assert all(np.all(np.isfinite(getattr(segments, item.name))) for item in fields(segments))


@given(st.data())
@settings(max_examples=40, deadline=None)
@pytest.mark.campaign
def test_any_damage_to_the_text(data):
    text = TEXT + EXPERIMENT
    for _ in range(data.draw(st.integers(1, 4))):
        at = data.draw(st.integers(0, len(text)))
        to = data.draw(st.integers(at, min(len(text), at + 30)))
        text = text[:at] + data.draw(st.text(max_size=5)) + text[to:]
    judged(text)


@given(st.data())
@settings(max_examples=30, deadline=None)
@pytest.mark.campaign
def test_any_size_of_any_parameter(data):
    """Thirty decades to each side: an answer, or the message that floating point ends."""
    rig = ss.read_rig(EXAMPLE)
    names = [name for name, a in rig.parameters().items() if a.value]
    name = data.draw(st.sampled_from(names))
    value = rig.value(name) * 10 ** data.draw(st.floats(-30, 30))
    try:
        changed = rig.with_values({name: value, "mass": data.draw(st.sampled_from([0.0, 1.0, 1e20]))})
    except ss.ParameterError:
        return
    judged(ss.rig_to_text(changed))


@pytest.mark.parametrize(
    "change",
    ["b=1e300", "a=1e-300", "alpha=1e250", "preload=1e-300", "d_c=1e-300", "stiffness=1e305", "velocity=1e-200"],
)
@pytest.mark.filterwarnings("ignore::steadyslip.core.errors.UnitWarning")  # numbers without a unit are asked about
def test_extremes(change):
    judged_rig = ss.read_rig(EXAMPLE, [change])
    judged(ss.rig_to_text(judged_rig))


def test_an_onset_lost_in_rounding_is_left_out():
    text = TEXT.replace("alpha = 0.56", "alpha = 1e17")
    assert text != TEXT
    judged(text)
