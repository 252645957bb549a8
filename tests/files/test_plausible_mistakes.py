"""Mistakes that one makes when a data sheet becomes a rig file: each is answered once, with what to write instead."""

import re

import pytest

import steadyslip as ss
from toleranced import AXIS

MISTAKES = {
    "a mass for a force": ('"2.56..3.84 kN"', '"320 kg"', "a mass presses with its weight"),
    "a decimal comma": ('"0.11 ± 20 %"', "0,11", "0,11 has a decimal comma: write 0.11"),
    "a decimal comma before a unit": ('"0.5 mm/min"', '"0,5 mm/min"', "has a decimal comma: write 0.5"),
    "a law by its curve": ('"lugre"', '"stribeck"', "did you mean 'coulomb-stribeck'"),
    "a key in another language": ("mass =", "masse =", "did you mean 'mass'"),
    "a share without its sign": ('"2.56..3.84 kN"', '"3.2 kN ± 20"', "write '± 20 %'"),
    "no load named": ('"125000 ± 20 % 1/m"', '"400 N/um"', "name the load that it is of: '400 N/um at 3.2 kN'"),
    "no contact area": ('area = "200 cm^2"\n', "", "add the contact's area"),
    "a unit on a pure number": ("0.8", '"0.8 mm"', "expected a number without unit"),
    "a full stop behind a unit": ('"0.5 mm/min"', '"0.5 mm/min."', "'mm/min.' is not a unit"),
    "a force for a coefficient": (
        'mu_coulomb = "0.11 ± 20 %"',
        'mu_coulomb = "350 N"',
        "expected a number without unit",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_answered_by_what_to_write(mistake):
    right, wrong, answer = MISTAKES[mistake]
    text = AXIS.replace(right, wrong, 1)
    assert text != AXIS
    with pytest.raises(ss.RigFileError, match=re.escape(answer)) as raised:
        ss.rig_from_text(text)
    assert "Traceback" not in str(raised.value)
