"""Documents whose figures are made but not painted, which takes most of their time; for tests of everything else."""

import pytest
from matplotlib.figure import Figure


@pytest.fixture
def unpainted(monkeypatch):
    monkeypatch.setattr(Figure, "savefig", lambda self, to, **_: to.write('<svg viewBox="0 0 9 9"></svg>'))
