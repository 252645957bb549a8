"""A fixed sample of the campaign in fuzz_files.py: damaged and hostile files give an answer or one message."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

PROGRAM = Path(__file__).parents[1] / "helpers" / "fuzz_files.py"


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="every trial is a process with limits")
@pytest.mark.campaign
def test_damaged_and_hostile_files_are_an_answer_or_one_message():
    done = subprocess.run(
        [sys.executable, PROGRAM, "--trials", "36", "--seed", "7"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "36 trials, 0 wrong" in done.stdout
    for name in ("run.nc", "fit.nc", "population.nc", "map.zarr", "key-advance"):
        assert f"{name:<14}opened" in done.stdout
        assert name == "key-advance" or f"{name:<14}message" in done.stdout
