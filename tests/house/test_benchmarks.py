"""Every script of benchmarks/ runs: what it measures moves on, and nobody runs them all."""

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = [
    path for path in sorted((ROOT / "benchmarks").glob("*.py")) if "__main__" in path.read_text(encoding="utf-8")
]


def test_every_script_has_a_quick_form():
    assert len(SCRIPTS) > 15
    assert [path.stem for path in SCRIPTS if "from quick import" not in path.read_text(encoding="utf-8")] == []


@pytest.mark.campaign
@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.stem)
def test_it_runs(script, tmp_path):
    done = subprocess.run(
        [sys.executable, script, "--quick"], cwd=tmp_path, capture_output=True, text=True, timeout=300,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip(), "nothing is printed"
    assert not re.search(r"\bnan\b", done.stdout), "a ratio of nothing is printed as a number"
