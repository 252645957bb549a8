"""A protocol that was given is tested against the displacement of the load point that was measured."""

from __future__ import annotations

import re

import numpy as np
import pytest

import lab_records as lab
import steadyslip as ss
from steadyslip.experiments.fitting.planning import make_plan
from steadyslip.experiments.fitting.protocol_words import protocol_against_record

FAST, AT = 1e-5, 30.0
NOISE = 1e-7


def protocol(rate=FAST, at=AT):
    return ss.Protocol(
        pieces=(ss.protocol.VelocityStep(at=at, to=rate), ss.protocol.VelocityStep(at=45, to=lab.SLOW)), until=90.0
    )


def record(late=0.0, seed=0):
    """A record of `protocol()`, whose displacement a servo delays in the end by `late` (s), first order."""
    time = np.linspace(0, 90, 1500)
    moved = lab.SLOW * time
    for at, step in ((AT, FAST - lab.SLOW), (45, lab.SLOW - FAST)):
        since = np.clip(time - at, 0, None)
        moved += step * (since - (late * -np.expm1(-since / late) if late else 0.0))
    moved += NOISE * np.random.default_rng(seed).standard_normal(len(time))
    friction = 0.6 + 1e-3 * np.sin(time / 7)  # no fit follows: only the displacement is looked at
    return ss.record_from_arrays(time=time, friction=friction, displacement=moved, source="press")


def told(given, measured, times=()):
    part = make_plan(ss.lab_rig(), measured, protocol=given).comparison().parts[0]
    return protocol_against_record(part, np.array(times))


@pytest.mark.parametrize(
    ("given", "late", "said"),
    [
        (protocol(0.5 * FAST), 0.0, "from 30 to 45 s the protocol moves the load point at 5 um/s, but .* at 10 um/s"),
        (protocol(1.05 * FAST), 0.0, "from 30 to 45 s the protocol .* at 10.5 um/s, but .* at 10 um/s"),
        (protocol(at=29.5), 0.0, "change to 10 um/s at 29.5 s [45][09].* ms later: it came then, or a servo"),
        (protocol(at=30.2), 0.0, "change to 10 um/s at 30.2 s [12][09].* ms earlier: it came then;"),
        (protocol(), 0.3, "change to 10 um/s at 30 s [23][09].* ms later: the load point follows it late"),
    ],
)
def test_a_protocol_that_the_displacement_contradicts_is_told(given, late, said):
    text = told(given, record(late))
    assert re.search(said, text), text


def test_where_no_fit_follows_the_protocol_is_a_suspect():
    """A rate in mm for um: law and drive alone were named."""
    with pytest.raises(ss.NotAvailable, match=r"are the law and the protocol .*units.* those of the experiment"):
        ss.fit(ss.lab_rig("slip"), record(), protocol=protocol(1e3 * FAST), starts=4)


def test_a_protocol_that_the_displacement_confirms_is_not():
    assert not [seed for seed in range(60) if told(protocol(), record(seed=seed))]


def test_the_fit_says_so():
    step = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=60.13, to=5e-6),), until=150.0)
    wrong = ss.Protocol(pieces=(ss.protocol.VelocityStep(at=60.13, to=4e-6),), until=150.0)
    measured = lab.record(lab.rig(), step, count=300)
    for given, contradicted in ((step, False), (wrong, True)):
        said = " ".join(str(ss.fit(ss.lab_rig(), measured, protocol=given, starts=2)).split())
        assert ("the record's displacement moves at 5 um/s" in said) is contradicted
        assert "would fit the displacement as well" not in said
