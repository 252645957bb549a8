"""Examples in the pages run in a folder of their own beside a copy of `examples/`, and leave no laws behind."""

import os
import shutil
from pathlib import Path

import pytest

from steadyslip.laws import ContactLaw, FrictionLaw, NormalMemory

os.environ["MPLBACKEND"] = "Agg"


@pytest.fixture(autouse=True)
def _undisturbed(monkeypatch, tmp_path):
    shutil.copytree(Path(__file__).parents[1] / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    for family in (FrictionLaw, ContactLaw, NormalMemory):
        monkeypatch.setattr(family, "registry", dict(family.registry))
