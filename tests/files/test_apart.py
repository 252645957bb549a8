"""Functions in a process of its own: what they use, and how they end, is theirs alone."""

import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from steadyslip.core.errors import NotAvailable, ParameterError, Problem
from steadyslip.files import apart

HERE = "test_apart_jobs"
JOBS = """
import ctypes, os, time
import numpy as np
from steadyslip.core.errors import NotAvailable, ParameterError, Problem

def twice(values): return {"sum": sum(values), "reader": os.getpid()}, [2.0 * np.array(values), np.empty((0, 3))]
def grows(size): return {"reader": os.getpid(), "some": float(np.ones(size // 8)[0])}, []
def refused(): raise NotAvailable("no such thing")
def problems(): raise ParameterError([Problem("file", "is damaged", 7)], title="p1.csv")
def prints(): os.write(1, b"noise of a library"); print("more"); return {}, []
def greedy(): return {}, [np.ones(2**28)]
def breaks(): ctypes.string_at(0)
def busy():
    while True: pass
"""


@pytest.fixture
def asked(tmp_path, monkeypatch):
    (tmp_path / f"{HERE}.py").write_text(JOBS)
    monkeypatch.syspath_prepend(tmp_path)
    apart._end_all()  # one that does not know this folder
    yield lambda function, *arguments, seconds=30.0: apart.call(HERE, function, arguments, seconds)
    apart._end_all()


def test_answers_come_back(asked):
    about, (doubled, none) = asked("twice", [1.0, 2.5])
    assert about["sum"] == 3.5
    assert about["reader"] != os.getpid()
    np.testing.assert_array_equal(doubled, [2.0, 5.0])
    assert none.shape == (0, 3)
    assert asked("prints") == ({}, [])
    assert asked("twice", [1.0])[0]["reader"] != os.getpid()


@pytest.mark.skipif(not Path("/proc/self/status").exists(), reason="the system does not tell a process its own peak")
def test_a_reader_stays_whatever_its_parent_had(asked, tmp_path):
    """`getrusage` of a child begins with the peak of its parent, so that each file had a reader of its own."""
    program = f"""if True:
        import numpy as np
        from steadyslip.files import apart
        np.ones({apart.LASTING // 8 + 2**22})
        print(*(apart.call("{HERE}", "twice", [[1.0]], 30.0)[0]["reader"] for _ in range(3)))
    """
    found = subprocess.run(
        [sys.executable, "-c", program], env={**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    assert len(set(found.stdout.split())) == 1


def test_a_reader_that_has_grown_makes_place(asked):
    first, _ = asked("grows", apart.LASTING)
    again, _ = asked("twice", [1.0])
    assert again["reader"] != first["reader"]


def test_refusals_are_those_of_the_function(asked):
    with pytest.raises(NotAvailable, match=r"^no such thing$"):
        asked("refused")
    with pytest.raises(ParameterError, match=r"line 7: file: is damaged") as found:
        asked("problems")
    assert found.value.problems == (Problem("file", "is damaged", 7),)


@pytest.mark.slow
@pytest.mark.skipif(apart.resource is None, reason="there are no limits but the clock")
def test_what_takes_too_much_ends_alone(asked):
    with pytest.raises(apart.Ended, match="more than 1024 MiB"):
        asked("greedy")
    with pytest.raises(apart.Ended, match="more than 0 s"):
        asked("busy", seconds=0.2)
    with pytest.raises(apart.Ended, match="damaged"):
        asked("breaks")
    assert asked("twice", [1.0])[0]["sum"] == 1.0


@pytest.mark.slow
def test_the_clock_ends_what_no_limit_does(asked, monkeypatch):
    """As where the system has no limits of its own."""
    asked("twice", [1.0])
    monkeypatch.setattr(apart, "PATIENCE", 0.02)
    start = time.monotonic()
    with pytest.raises(apart.Ended, match="more than 20 s"):
        asked("busy", seconds=20.0)
    assert time.monotonic() - start < 15


def test_without_another_process_it_is_done_here(asked, monkeypatch):
    monkeypatch.setattr(sys, "executable", None)
    assert asked("twice", [1.0])[0]["reader"] == os.getpid()
