"""Ctrl-C: what there is is kept, half of something is never taken for the whole, and a command says how far it came."""

import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import lab_records as lab
import steadyslip as ss
from rigs_of_theory import rig
from steadyslip import cli, reproduce as reproducing
from steadyslip.cli.run_files import write_history
from steadyslip.experiments.answers import laws, predict as predicting, uncertainty
from steadyslip.experiments.fitting import forward, search
from steadyslip.files import output
from steadyslip.maps.sensitivity import LEAST
from steadyslip.nonlinear.kicks.spans import INTERRUPTED


@pytest.fixture(scope="module")
def fitted():
    told = []
    found = ss.fit(
        ss.lab_rig(v_ref="1 um/s"), lab.record(lab.rig(), lab.STEP, 0), progress=lambda *words: told.append(words)
    )
    assert {what for what, _, _ in told} == {"searching", "refining"}
    assert [starts for _, starts, _ in told] == sorted(starts for _, starts, _ in told)
    assert told[-1][2] == pytest.approx(found.rms, rel=1e-3)
    return found


def once_more(function, times):
    """The function, interrupted after so many calls."""
    left = [times]

    def called(*arguments, **options):
        left[0] -= 1
        if left[0] < 0:
            raise KeyboardInterrupt
        return function(*arguments, **options)

    return called


def test_half_of_the_runs_of_a_fit_are_no_fit(monkeypatch):
    monkeypatch.setattr(search, "FIRST_STARTS", 16)  # more than one thread runs at once
    monkeypatch.setattr(forward, "run_many", lambda *arguments, **options: False)  # as it answers Ctrl-C
    with pytest.raises(KeyboardInterrupt):
        ss.fit(ss.lab_rig(), lab.record(lab.rig(), lab.STEP, 0))


def test_bootstrap_keeps_the_refits_that_are_done(fitted, monkeypatch):
    whole = ss.experiments.bootstrap(fitted, 96, threads=1)
    with monkeypatch.context() as patch:
        patch.setattr(uncertainty, "minimise", once_more(uncertainty.minimise, 2))
        found = ss.experiments.bootstrap(fitted, 96, threads=1)
    assert (len(whole), whole.interrupted) == (96, False)
    assert (len(found), found.interrupted) == (64, True)
    np.testing.assert_array_equal(found["friction.a"], whole["friction.a"][:64])
    assert "stopped before all were done" in str(found)
    assert "stopped" not in str(whole)
    monkeypatch.setattr(uncertainty, "minimise", once_more(uncertainty.minimise, 0))
    with pytest.raises(KeyboardInterrupt, match="before the first refits"):
        ss.experiments.bootstrap(fitted, 96)


def test_laws_that_are_fitted_are_compared(fitted, monkeypatch):
    monkeypatch.setattr(laws, "search_fit", once_more(lambda *_, **__: fitted, 2))
    found = ss.compare_laws(ss.lab_rig(), fitted.plan.records, ("slip", "aging", "prz"))
    assert set(found.fits) == {"slip", "aging"}
    assert (found.interrupted, found.left_out) == (True, ("prz",))
    assert "stopped before these were fitted: prz" in str(found)
    monkeypatch.setattr(laws, "search_fit", once_more(lambda *_, **__: fitted, 1))
    with pytest.raises(KeyboardInterrupt):
        ss.compare_laws(ss.lab_rig(), fitted.plan.records, ("slip", "aging", "prz"))


def test_predictions_leave_kicks_out(fitted, monkeypatch):
    def interrupted(target, vary, *_, **__):
        size = np.full(len(next(iter(vary.values()))), np.nan)
        return _Brackets(size), (), {}

    monkeypatch.setattr(predicting, "threshold_brackets", interrupted)
    found = ss.predict(rig(stiffness=2e10), fitted, kick=("velocity", "displacement"))
    assert (found.left_out, found.thresholds) == (("velocity", "displacement"), {})
    assert "stopped" in str(found)


class _Brackets:
    def __init__(self, size):
        self.size, self.beyond = size, np.full(len(size), INTERRUPTED)


@pytest.mark.parametrize("blocks", [1, 5])
def test_sensitivity_of_the_points_that_are_done(blocks):
    calls = []

    def stiff(one):
        calls.append(one)
        if len(calls) == blocks * 4 * 32 - 10:  # in the last of so many blocks of 32 sets of d + 2 points
            signal.raise_signal(signal.SIGINT)
        return one.stiffness * one.value("friction.a")

    over = {"stiffness": (1e9, 1e10), "friction.a": (0.01, 0.02)}
    before = signal.getsignal(signal.SIGINT)
    if blocks * 32 < LEAST:
        with pytest.raises(KeyboardInterrupt, match="after 32 of 1024 sets of points"):
            ss.sensitivity(rig(), over, stiff, points=1024)
    else:
        found = ss.sensitivity(rig(), over, stiff, points=1024)
        assert (found.interrupted, found.points["stiff"]) == (True, 128)
        assert "stopped: these are the shares by 128 sets" in str(found)
    assert signal.getsignal(signal.SIGINT) is before


def test_sensitivity_does_not_depend_on_blocks(monkeypatch):
    over = {"friction.a": (0.010, 0.014), "friction.b": (0.015, 0.02)}
    one = ss.sensitivity(rig(), over, points=256)
    monkeypatch.setattr(sys.modules[ss.maps.Sensitivity.__module__], "BLOCK", 1000)
    other = ss.sensitivity(rig(), over, points=256)
    for name in one.total:
        np.testing.assert_array_equal(one.total[name], other.total[name])


def test_figures_that_are_written_are_named(tmp_path, monkeypatch):
    monkeypatch.setattr(reproducing, "paper_table", once_more(None, 0))
    monkeypatch.setattr(reproducing, "FIGURES", reproducing.FIGURES[:1])
    with pytest.raises(KeyboardInterrupt, match=r"these files are written: fig1\.png, fig1\.svg"):
        reproducing.reproduce(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"fig1.png", "fig1.svg"}


def half_a_figure(*arguments, **_):
    path = next(given for given in arguments if isinstance(given, (str, Path)))
    Path(path).write_text("half of")
    raise KeyboardInterrupt


def half_a_table(titles, rows):
    yield from titles
    yield next(iter(rows))
    raise KeyboardInterrupt


@pytest.mark.parametrize(("ending", "owner", "writer", "begun"), [
    (".csv", output, "chain", half_a_table), (".png", Figure, "savefig", half_a_figure),
])  # fmt: skip
def test_a_file_that_was_there_stays_whole_until_the_new_one_is(ending, owner, writer, begun, monkeypatch, tmp_path):
    run = ss.simulate(rig(), until=1.0)
    path = tmp_path / f"run{ending}"
    path.write_text("the last run")
    monkeypatch.setattr(owner, writer, begun)
    with pytest.raises(KeyboardInterrupt):
        write_history(run, path)
    assert [found.read_text() for found in tmp_path.iterdir()] == ["the last run"]


@pytest.mark.parametrize("words", ["", "after 3 of 9"])
def test_a_command_that_is_stopped_says_so(words, monkeypatch, capsys, tmp_path):
    def stopped(*_, **__):
        raise KeyboardInterrupt(words)

    monkeypatch.setattr(reproducing, "reproduce", stopped)
    monkeypatch.setattr("sys.argv", ["steadyslip", "reproduce", str(tmp_path)])
    with pytest.raises(SystemExit) as left:
        cli.main()
    assert left.value.code == 130
    assert capsys.readouterr().err == f"stopped: {words or 'before there was an answer'}\n"
