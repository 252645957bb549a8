"""Random examples, which tests are slow, and how long each takes.

Tests of a folder of src/steadyslip are in the folder of the same name here; those that go through several of them are
in whole, those of documents, packaging and the code itself in house. What tests share is in helpers, with the oracles
and the scripts that try random things without end; numbers found elsewhere are in reference.

Fresh random examples on a developer's machine, fewer and the same ones every time in continuous integration.

Tests marked ``campaign`` do a fixed part of what scripts do by the thousand: random rigs and files against a second
route, killed processes, repeated fits. So do the parameters of a test beyond its first `LONG` CPU seconds, and a test
that takes longer by itself. A run of the whole leaves them out, ``-m campaign`` runs them; CI does both, and what is
asked for by file or name runs in full. ``-m "not slow"`` leaves out what is beyond `QUICK`.

slow.txt lists those tests: how many of their parameters are quick, and how many belong to a run of the whole.
``pytest --measure -n 0`` runs everything and writes that list anew, from CPU seconds with those of processes that were
waited for.
"""

import gc
import os
import sys
from itertools import accumulate
from pathlib import Path

import pytest
from hypothesis import settings

settings.register_profile("ci", derandomize=True, deadline=None, max_examples=40)
if os.environ.get("CI"):
    settings.load_profile("ci")

SLOW = Path(__file__).with_name("slow.txt")
QUICK, LONG = 0.3, 0.7
"""CPU seconds that a test, with all of its parameters, may take before the rest of them is slow, and of campaigns: so
the quick tests take half a minute on two cores, and the whole four."""


def pytest_addoption(parser):
    parser.addoption("--measure", action="store_true", help="write which tests are slow to tests/slow.txt; with -n 0")


def pytest_collection_modifyitems(items):
    left = {test: [int(quick), int(whole)] for test, quick, whole in _listed()}
    for item in items:
        if item.get_closest_marker("campaign") or "browser" in item.fixturenames:
            item.add_marker(pytest.mark.slow)  # a browser works in processes of its own, whose seconds are not measured
        counts = left.get(item.nodeid.partition("[")[0], [])
        for place, mark in enumerate((pytest.mark.slow, pytest.mark.campaign)[: len(counts)]):
            if not counts[place]:
                item.add_marker(mark)
            counts[place] -= counts[place] > 0


def _listed():
    """Tests of slow.txt, and their counts of parameters that are quick and that belong to a run of the whole."""
    return [line.rsplit(" ", 2) for line in SLOW.read_text(encoding="utf-8").splitlines()]


def pytest_collection_finish():
    """Formulas make objects by the million, and modules live on: garbage is looked for less often, and not in those."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(100_000, 20, 20)


def pytest_sessionfinish():
    """Pytest looks for garbage five times at the end: once is enough to find what was left open."""
    gc.unfreeze()
    gc.collect()
    gc.freeze()


@pytest.fixture(scope="session")
def browser():
    """One browser for all: a second one beside it is refused."""
    from browser import chromium, driver

    path = chromium()
    with driver() as playwright:
        opened = playwright.chromium.launch(executable_path=path, args=["--no-sandbox"])
        yield opened
        opened.close()


@pytest.fixture(autouse=True)
def _closed_figures():
    """Close all pyplot figures after a test, so that they cause no warning in another one."""
    yield
    if (pyplot := sys.modules.get("matplotlib.pyplot")) is not None:
        pyplot.close("all")


@pytest.fixture
def unpainted(monkeypatch):
    """Figures are made but not painted, which takes most of their time; for tests of everything else."""
    from matplotlib.figure import Figure

    def savefig(self, to, **_):
        text = '<svg viewBox="0 0 9 9"></svg>'
        to.write(text) if hasattr(to, "write") else Path(to).write_text(text, encoding="utf-8")

    monkeypatch.setattr(Figure, "savefig", savefig)


def pytest_configure(config):
    if config.getoption("--measure"):
        config.pluginmanager.register(_Measured(), "measured")
    elif config.args_source is config.ArgsSource.TESTPATHS and not config.option.markexpr:
        config.option.markexpr = "not campaign"


class _Measured:
    """CPU seconds of every test."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = {}

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item):
        before = _cpu()
        done = yield
        self.seconds[item.nodeid] = _cpu() - before
        return done

    def pytest_sessionfinish(self):
        """Tests that did not run keep their line."""
        ran = {name.partition("[")[0] for name in self.seconds}
        others = [" ".join(line) for line in _listed() if line[0] not in ran]
        SLOW.write_text("\n".join([*sorted([*others, *slow_ones(self.seconds)]), ""]), encoding="utf-8")

    def pytest_terminal_summary(self, terminalreporter):
        terminalreporter.section(f"{sum(self.seconds.values()):.0f} CPU seconds, the largest")
        for name in sorted(self.seconds, key=self.seconds.__getitem__, reverse=True)[:40]:
            terminalreporter.line(f"{self.seconds[name]:8.2f} {name}")


def slow_ones(seconds: dict[str, float]) -> list[str]:
    """Tests that take longer than `QUICK`, and how many parameters they have until then and until `LONG`."""
    groups: dict[str, list[float]] = {}
    for name, own in seconds.items():
        groups.setdefault(name.partition("[")[0], []).append(own)
    counts = {test: [sum(used <= most for used in accumulate(own)) for most in (QUICK, LONG)]
              for test, own in groups.items()}  # fmt: skip
    return sorted(f"{test} {quick} {whole}" for test, (quick, whole) in counts.items() if quick < len(groups[test]))


def _cpu() -> float:
    import resource  # not on Windows

    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)
