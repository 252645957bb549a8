"""Documents about two rigs beside each other, and pictures of a verdict."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import steadyslip as ss
from read_pages import words
from steadyslip import figures
from steadyslip.cli import verdict_files
from steadyslip.cli.program import app

AXIS = ss.read_rig("examples/stick-slip.toml")
PAD = ss.read_rig("examples/machines/brake-pad.toml")
STIFF = Path("examples/stick-slip.toml").read_text().replace('"12 GPa/m"', '"40 GPa/m"')


def test_a_comparison_is_a_document_like_that_of_one_rig(tmp_path):
    """It had neither answer, nor recommendation, nor title block, nor the files that it was made of."""
    other = tmp_path / "stiff.toml"
    other.write_text(STIFF)
    to = tmp_path / "both.html"
    block = ["--project", "Press 4", "--author", "A. Writer", "--revision", "B"]
    done = CliRunner().invoke(app, ["compare", "examples/stick-slip.toml", str(other), "-o", str(to), *block])
    assert done.exit_code == 0
    text = words(to.read_text(encoding="utf-8"))
    for part in ("project Press 4", "revision B", "stick-slip: unstable; stiff: stable",
                 "stick-slip becomes stable with that of stiff in stiffness k",
                 "The recommendation for stick-slip Change preload", "The recommendation for stiff Keep it as it is",
                 "How far is the edge of stiff?", "The motion of stick-slip", "judders: every 75.5 s", "Assumptions",
                 "SHA-256 of stick-slip.toml", "SHA-256 of stiff.toml"):  # fmt: skip
        assert part in text, part
    assert STIFF.splitlines()[0] in to.read_text(encoding="utf-8")
    assert "How near stick-slip and stiff are to the edge of stability" in text
    assert len(to.read_bytes()) <= 500_000


def test_two_rigs_of_one_verdict_are_told_what_differs_most():
    rig = ss.read_rig("examples/stick-slip.toml")
    found = ss.compare_rigs(rig, rig.with_values({"stiffness": "20 GPa/m"}), names=("old", "new"))
    text = words(ss.report(found).html)
    assert "No difference decides, as the verdict is the same; most of what differs comes from stiffness k" in text
    assert "its part in k/k_cr" in text.replace("k/kcr", "k/k_cr")
    other = ss.compare_rigs(rig, ss.read_rig("examples/two-states.toml"))
    assert not other.measure
    text = words(ss.report(other).html)
    assert "its part in" not in text, "there was a column without anything in it"
    assert "are to the edge of stability, over stiffness k;" in text, "the picture was over what differs least"
    assert "first: The rig is modelled with" not in text
    same = words(ss.report(ss.compare_rigs(rig, rig)).html)
    assert "They have the same equations and numbers" in same


@pytest.mark.parametrize(
    ("rigs", "over", "measure"),
    [
        ((AXIS, AXIS.with_values({"stiffness": 40e9, "friction.a": 0.011})), "slider.stiffness", "safety_factor"),
        ((PAD, PAD.with_values({"disc.contact.normal_stiffness": 5e6})), "contacts.disc.contact.normal_stiffness", ""),
        ((AXIS, ss.read_rig("examples/stick-slip.toml", ["friction.evolution=aging"])), "drive.velocity", ""),
        ((AXIS, AXIS.with_values({"damping": 1e10})), "slider.damping", ""),
    ],
    ids=["stiffness", "machine", "law", "zero"],
)
def test_two_rigs_have_one_chart(rigs, over, measure):
    """Each curve goes through its own rig, at the edge a verdict changes, and dashes and marks differ for grey."""
    found = ss.compare_rigs(*rigs, names=("old", "new"))
    ax = found.plot()
    a, b, edge = ax.get_lines()
    assert a.get_linestyle() != b.get_linestyle()
    assert a.get_marker() != b.get_marker()
    assert [text.get_text() for text in ax.get_legend().get_texts()] == ["old", "new"]
    factor = (
        1e9
        if "GPa" in ax.get_xlabel()
        else 1e6
        if "N/µm" in ax.get_xlabel()
        else 1e-6
        if "µm/s" in ax.get_xlabel()
        else 1
    )
    safe = "k/k" in ax.get_ylabel()
    assert safe or not measure
    for line, rig in zip((a, b), rigs, strict=True):
        (at,) = line.get_markevery()
        value = rig.value(over)
        assert line.get_xdata()[at] * factor == pytest.approx(value)
        own = ss.safety_factor(rig) if safe else ss.growth_rate(rig)
        assert line.get_ydata()[at] == pytest.approx(float(own))
        (height,) = set(edge.get_ydata())
        assert (line.get_ydata()[at] > height) == (ss.analyze(rig).stable == safe)


@pytest.mark.parametrize(("name", "first"), [("inclined-spring", "contact.preload"), ("lead-screw", "drive.velocity")])
def test_the_picture_of_a_verdict_has_what_can_be_changed(monkeypatch, tmp_path, name, first):
    """It was drawn over b, which nobody buys, while the document had the preload."""
    drawn = []
    monkeypatch.setattr(
        verdict_files, "stability_chart", lambda rig, *over: drawn.append(over) or figures.root_locus(rig)
    )
    path = Path(f"examples/{name}.toml")
    verdict_files.write_verdict(ss.analyze(ss.read_rig(path)), None, tmp_path / "a.svg", path)
    assert [over[0] for over in drawn] == [first]
