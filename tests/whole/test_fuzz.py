"""A fixed sample of what `fuzz_rigs.py` tries by the thousand, and everything that it found once."""

import pytest

import fuzz_rigs
from steadyslip.files.specifications import rig_from_text


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.campaign
def test_mutated_rig_files_are_read_or_refused_with_one_message(seed):
    assert list(fuzz_rigs.files(60, f"fixed-{seed}", analyse=60)) == []


@pytest.mark.campaign
def test_combinations_have_an_answer_or_one_message():
    assert list(fuzz_rigs.combinations(16, "fixed")) == []


def test_the_judge_sees_faults():
    def fails():
        raise KeyError("over")

    def hangs():
        while True:
            pass

    assert fuzz_rigs.judged(fails).startswith("KeyError")
    assert fuzz_rigs.judged(hangs, seconds=0.2).startswith("more than 0.2 s")
    assert fuzz_rigs.judged(lambda: rig_from_text("a = [")) == ""
