"""Every example loads, is judged as its comments say, and comes back from its own text."""

import tomllib
from pathlib import Path

import jsonschema
import pytest

import steadyslip as ss

EXAMPLES = sorted((Path(__file__).parents[1] / "examples").glob("*.toml"))
VERDICTS = {
    "double-direct-shear": True,
    "inclined-spring": False,
    "lead-screw": False,
    "slow-axis": False,
    "strengthening-gouge": True,
    "triaxial": False,
}


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda p: p.stem)
def test_example(path):
    rig = ss.read_rig(path)
    assert ss.analyze(rig).stable is VERDICTS[path.stem]
    jsonschema.validate(tomllib.loads(path.read_text(encoding="utf-8")), ss.json_schema())
    again = ss.rig_from_text(ss.rig_to_text(rig))
    for name, address in rig.parameters().items():
        assert again.value(name) == (
            address.value if address.value is None else pytest.approx(address.value, rel=1e-15)
        )


def test_every_example_has_a_verdict():
    assert {p.stem for p in EXAMPLES} == set(VERDICTS)
