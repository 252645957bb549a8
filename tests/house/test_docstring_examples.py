"""Every public function has an example in its docstring, and it runs beside a copy of the examples."""

import doctest
import inspect
import shutil
from pathlib import Path

import matplotlib.pyplot as plt
import pytest
from matplotlib.figure import Figure

import steadyslip as ss
from public_names import public

ROOT = Path(__file__).parents[2]
FUNCTIONS = {name: thing for name, thing in public().items() if inspect.isfunction(thing)}
COMPARE = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE


def test_functions_are_many():
    assert len(FUNCTIONS) > 120


@pytest.mark.parametrize("name", FUNCTIONS)
def test_its_example_runs(name, tmp_path, monkeypatch):
    examples = doctest.DocTestParser().get_doctest(
        inspect.getdoc(FUNCTIONS[name]), {"ss": ss}, name, inspect.getsourcefile(FUNCTIONS[name]), 0
    )
    assert examples.examples, "no example"
    assert any(name.rpartition(".")[2] in one.source for one in examples.examples), "an example of something else"
    paint = Figure.savefig

    def savefig(self, to, **options):  # files are painted elsewhere
        Path(to).touch() if isinstance(to, str) else paint(self, to, **options)

    monkeypatch.setattr(Figure, "savefig", savefig)
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    said: list[str] = []
    failed = doctest.DocTestRunner(optionflags=COMPARE).run(examples, out=said.append).failed
    plt.close("all")
    assert not failed, "".join(said)
