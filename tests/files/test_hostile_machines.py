"""A fixed sample of machine_files_at_random.py: spoiled machine files get a verdict or one message in words."""

import pytest

import steadyslip as ss
from machine_files_at_random import EXAMPLES, answer, trial

TEXT = {path.stem: path.read_text(encoding="utf-8") for path in EXAMPLES}


@pytest.mark.parametrize("number", [22, 61, 113, 129, 208, 258])
def test_a_spoiled_file_gets_one_clear_answer(number):
    trial(number)


@pytest.mark.slow
@pytest.mark.campaign
def test_spoiled_files_get_one_clear_answer():
    for number in range(1000, 1150):
        trial(number)


def _spoiled(name, *changes):
    text = TEXT[name]
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    return answer(text)


def test_each_fault_is_named_where_it_stands():
    """Number among tables, list for a word, line break in a name, key of another law, a link that only presses."""
    told = _spoiled("two-surfaces", ("[bodies.left]\n", "[bodies]\nleft = 3\n[bodies.other]\n"))
    assert "bodies.left: got 3; allowed: a table [bodies.left]" in told
    assert "unknown friction law []" in _spoiled("two-guides", ('law = "rate-state"', "law = []"))
    assert "links.'a\\nb': is not a valid name" in _spoiled("two-guides", ("links.belt", 'links."a\\nb"'))
    told = _spoiled("brake-pad", ('body = "pad"', 'body = "pad"\nloaded_by = "lining"'))
    assert told.endswith("'lining' pulls only away from the surface; allowed: a link along the slide")
    told = _spoiled("geared-servo", ('kd = "0.5 N s/mm"', 'tn = "1 s"'))
    assert "unknown key 'tn'; allowed: velocity, velocity_of, derivative," in told
    assert "body, measured, delay, kp, kd; it is a key of" in told
    told = _spoiled("brake-pad", ("bodies.pad", "bodies.None"), ('"pad"', '"None"'))
    assert told == _spoiled("brake-pad", ("bodies.pad", "bodies.other"), ('"pad"', '"other"'))
    told = _spoiled("telescope", ('"tube"]', '"ground"]'))
    assert "bodies.tube: floats" in told


def test_a_slip_rate_that_is_not_forward_is_told_of_its_contact():
    told = _spoiled("two-surfaces", ('body = "middle"\nagainst = "left"', 'body = "left"\nagainst = "middle"'))
    assert "contacts.first: its slip rate in steady sliding is -1e-05 m/s" in told
    assert "exchange body and against" in told


def test_floating_bodies_are_found_beside_wrong_numbers():
    told = _spoiled("feed-axis", ('stiffness = "120 N/um"\n', ""), ('"300 kg"', '"-300 kg"'))
    assert "bodies.table: floats: no chain of links with stiffness" in told
    assert "bodies.table.mass: got '-300 kg'" in told


def test_marks_of_order_and_empty_files():
    assert answer("\ufeff" + TEXT["two-guides"]).startswith("STABLE")
    with pytest.raises(ss.RigFileError, match=r"is empty; .* of a machine \[bodies.NAME\]"):
        ss.rig_from_text("\n \n")
