"""Pages of machines: what they say is what Python says, to rounding, and in the same words."""

import re
from pathlib import Path

import pytest

import steadyslip as ss
from explored import ExploredMachine, differences
from machines import at_random, two_mass
from steadyslip.explorer.assembly import parts
from steadyslip.explorer.equations import linear_part
from steadyslip.files.specifications.read import rig_from_text

MACHINES = Path(__file__).parents[1] / "examples" / "machines"
NAMES = sorted(path.stem for path in MACHINES.glob("*.toml"))


def example(name):
    return ss.read_rig(MACHINES / f"{name}.toml")


@pytest.mark.parametrize("name", NAMES)
def test_a_machine_is_judged_as_in_python(name):
    """Verdict, eigenvalues, mode in words, and the exact stable values of whatever enters linearly."""
    machine = example(name)
    explored = ExploredMachine(machine)
    assert differences(explored, machine, machine.of_kind("stiffness")) == []
    faster = machine.with_values({"drive.velocity": 5 * machine.value("drive.velocity")})
    assert differences(explored, faster) == []


@pytest.mark.campaign
@pytest.mark.parametrize("seed", range(40))
def test_machines_drawn_at_random_are_judged_as_in_python(seed):
    machine, _ = at_random(seed)
    gains = machine.of_kind("stiffness")
    assert differences(ExploredMachine(machine), machine, gains[:1]) == []


@pytest.mark.parametrize("changes", [
    {"contacts.mesh.friction.mu_ref": 3.0, "contacts.mesh.contact.angle": "80 deg"},
    {"contacts.mesh.contact.preload": 1e-3, "contacts.mesh.contact.angle": "-40 deg"},
    {"contacts.guide.friction.mu_ref": 2.0},
])  # fmt: skip
def test_contacts_that_press_on_each_other_slide_or_do_not_as_in_python(changes):
    machine = example("geared-servo").with_values(changes)
    assert differences(ExploredMachine(machine), machine) == []


def test_a_delay_is_refused_in_words():
    late = two_mass().with_values({"drive.delay": 0.01})
    with pytest.raises(ss.NotAvailable, match="delay is none; steadyslip analyze"):
        linear_part(late)


def test_a_machine_has_one_steady_sliding():
    with pytest.raises(ss.ParameterError, match="allowed: 0"):
        ss.explore(example("brake-pad"), branch=1)


def test_the_file_of_a_page_is_the_machine_to_the_last_digit():
    """The template, filled with other values, reads as the machine with these values."""
    machine = example("geared-servo")
    _, known = parts(machine, "geared", 0)
    values = [one["value"] * (1.1 if one["value"] else 1.0) for one in known["parameters"]]
    filled = re.sub(r"\{\{(\d+)\}\}", lambda place: repr(values[int(place[1])]), known["toml"])
    assert "{{" not in filled
    changes = {one["name"]: value for one, value in zip(known["parameters"], values, strict=True)}
    assert rig_from_text(filled) == machine.with_values(changes)
