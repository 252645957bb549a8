"""The paper's numbers and figures, written by one call."""

import csv
import math

import matplotlib
import numpy as np
import pytest

import steadyslip as ss
from steadyslip.reproduce import FIGURES, OutputError, PaperFigure, paper_rig, paper_table, reproduce
from steadyslip.units import deg

matplotlib.use("Agg")

# theory, section 4, as printed there: quantity, number, digits after the leading one
PRINTED = {
    "κ_cr at ψ = −45°": "0.00174418604651",
    "κ_cr at ψ = −30°": "0.00163190533807",
    "κ_cr at ψ = 0°": "0.0015",
    "κ_cr at ψ = 30°": "0.00138782355738",
    "κ_cr at ψ = 45°": "0.00131578947368",
    "β d_c/v0 at ψ = −45°": "0.189964754254",
    "β d_c/v0 at ψ = 0°": "0.321633760451",
    "β d_c/v0 at ψ = 45°": "0.392765798889",
    "m*_cr1": "0.003625",
    "m*_cr2 at ψ = 15°": "0.1002584584",
    "m*_cr2 at ψ = 45°": "0.02951785714",
}


@pytest.fixture(scope="module")
def table():
    return paper_table()


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    return reproduce(tmp_path_factory.mktemp("paper") / "a" / "b")


def test_the_paper_rig_has_the_papers_parameters():
    rig = paper_rig(30 * deg)
    assert [rig.value(n) for n in ("a", "b", "d_c", "mu_ref", "alpha")] == [0.0145, 0.0160, 1e-6, 0.7, 0.56]
    assert [rig.value(n) for n in ("preload", "v_ref", "velocity")] == [5e6, 1e-6, 1e-6]
    assert rig.value("angle") == 30 * deg
    assert rig.friction.evolution == ss.laws.Slip()
    assert rig.friction.normal_memory.name == "linker-dieterich"


def test_every_number_agrees(table):
    assert len(table) >= 15
    for row in table:
        # motion is read a short time after a step, and from an orbit of finite size
        assert row.difference < (5e-4 if row.source.startswith("Fig.") else 1e-10), row
    assert {row.source for row in table if row.source.startswith("Fig.")} == {"Fig. 1", "Fig. 2", "Fig. 5"}


def test_the_numbers_are_those_printed(table):
    found = {row.quantity: row.found for row in table}
    for quantity, text in PRINTED.items():
        half_a_digit = 0.5 * 10.0 ** -len(text.partition(".")[2])
        assert abs(found[quantity] - float(text)) <= half_a_digit * (1 + 1e-3), quantity


def test_the_expected_numbers_are_those_of_the_closed_forms(table):
    """The literals against `steadyslip.paper`, so that neither can be mistyped."""
    expected = {row.quantity: row.expected for row in table if row.source.startswith("eq.")}
    law = {"a": 0.0145, "b": 0.0160, "mu_ss": 0.7, "alpha": 0.56}
    degrees = {f"ψ = {d}°".replace("-", "−"): d * deg for d in (-45, -30, 0, 15, 30, 45)}
    checked = 0
    for quantity, value in expected.items():
        angle = next((a for text, a in degrees.items() if text in quantity.split(", ")[0]), None)
        m_star = 0.01 if "m* =" in quantity else 0.0
        if quantity.startswith("κ_cr"):
            ours = ss.paper.inclined_dimensionless_stiffness(**law, angle=angle, m_star=m_star)
        elif quantity.startswith("β"):
            ours = math.sqrt(ss.paper.inclined_frequency_squared(**law, d_c=1, v0=1, angle=angle, m_star=m_star))
        elif quantity.startswith("m*_cr2"):
            ours = ss.paper.mass_of_no_stiffness(a=0.0145, mu_ss=0.7, alpha=0.56, angle=angle)
        elif quantity == "m*_cr1":
            ours = ss.paper.mass_of_equal_stiffness(a=0.0145, mu_ss=0.7, alpha=0.56)
        elif quantity == "lock-up angle":
            ours = ss.paper.lock_up_angle(0.7) / deg
        else:
            continue
        assert value == pytest.approx(ours, rel=32 * np.finfo(float).eps, abs=0), quantity
        checked += 1
    assert checked == len(expected) - 1


def test_the_table_prints_itself(table):
    lines = str(table).splitlines()
    assert len(lines) == len(table) + 1
    assert "κ_cr at ψ = −45°" in str(table)


def test_files_are_written_into_a_new_folder(written, table):
    figures = [f"fig{number}.{kind}" for number in (1, 2, 5, 6, 7) for kind in ("png", "svg")]
    assert [path.name for path in written] == [*figures, "paper-numbers.md", "paper-numbers.csv"]
    assert written[0].read_bytes().startswith(b"\x89PNG")
    assert "<svg" in written[1].read_text(encoding="utf-8")
    assert len(written[-2].read_text(encoding="utf-8").splitlines()) == len(table) + 2
    with written[-1].open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [float(row["steadyslip"]) for row in rows] == [row.found for row in table]


def test_a_second_run_writes_the_same_bytes(written, tmp_path, monkeypatch):
    """Of figures that are drawn in different ways."""
    monkeypatch.setattr("steadyslip.reproduce.FIGURES", FIGURES[::2])
    first = {path.name: path.read_bytes() for path in written}
    again = reproduce(str(tmp_path / "two"))
    assert len(again) == 2 * len(FIGURES[::2]) + 2
    for path in again:
        assert path.read_bytes() == first[path.name], path.name


def test_a_folder_that_cannot_be_written_is_said(tmp_path):
    blocked = tmp_path / "file"
    blocked.write_text("in the way", encoding="utf-8")
    for folder in (blocked, blocked / "inside"):
        with pytest.raises(OutputError, match="cannot be written") as caught:
            reproduce(folder)
        assert str(folder) in str(caught.value)
        assert isinstance(caught.value, ss.SteadyslipError)
        assert isinstance(caught.value, OSError)


@pytest.mark.usefixtures("unpainted")
def test_another_figure_is_one_entry(tmp_path, monkeypatch):
    extra = PaperFigure("fig1", lambda ax: ss.figures.root_locus(paper_rig(), ax))
    monkeypatch.setattr("steadyslip.reproduce.FIGURES", (FIGURES[-1], extra))
    assert {"fig1.png", "fig1.svg"} <= {path.name for path in reproduce(tmp_path)}
