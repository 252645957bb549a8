"""Documents about two rigs beside each other, and pictures of a verdict."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

import steadyslip as ss
from read_pages import words
from steadyslip import figures
from steadyslip.cli.program import app
from steadyslip.reports import verdict_files

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
    assert len(to.read_bytes()) <= 500_000


def test_two_rigs_of_one_verdict_are_told_what_differs_most():
    rig = ss.read_rig("examples/stick-slip.toml")
    found = ss.compare_rigs(rig, rig.with_values({"stiffness": "20 GPa/m"}), names=("old", "new"))
    text = words(ss.report(found).html)
    assert "No difference decides, as the verdict is the same; most of what differs comes from stiffness k" in text
    same = words(ss.report(ss.compare_rigs(rig, rig)).html)
    assert "They have the same equations and numbers" in same


@pytest.mark.parametrize(("name", "first"), [("inclined-spring", "contact.preload"), ("lead-screw", "drive.velocity")])
def test_the_picture_of_a_verdict_has_what_can_be_changed(monkeypatch, tmp_path, name, first):
    """It was drawn over b, which nobody buys, while the document had the preload."""
    drawn = []
    monkeypatch.setattr(figures, "stability_chart", lambda rig, *over: drawn.append(over) or figures.root_locus(rig))
    path = Path(f"examples/{name}.toml")
    verdict_files.write_verdict(ss.analyze(ss.read_rig(path)), None, tmp_path / "a.svg", path)
    assert [over[0] for over in drawn] == [first]
