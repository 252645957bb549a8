"""Answers of records as documents."""

import html
import re

import pytest

import lab_records as lab
import steadyslip as ss
from read_pages import words
from steadyslip.reports.elements import html_text


@pytest.fixture(scope="module")
def lab_results():
    records = [lab.record(lab.rig(b=b), lab.STEP, seed=i) for i, b in enumerate((0.0145, 0.0150, 0.0140))]
    fits = [ss.fit(lab.rig(), one, free=["a", "b", "d_c"]) for one in records]
    draws = ss.experiments.bootstrap(fits[0], 16)
    return {
        "draws": draws, "prediction": ss.predict(lab.rig(), draws),
        "population": ss.population(dict(zip("ABC", fits, strict=True)), count=200),
        "comparison": ss.compare_laws(lab.rig(), records[0], ("slip", "aging")), "fit": fits[0],
    }  # fmt: skip


LAB = {
    "draws": ("16 draws, bootstrap", "error of the draws", "slip distance d_c"),
    "prediction": ("How sure is that?", "probability"),
    "population": ("Population of 3 experiments", "another experiment, 95 %", "with the others"),
    "comparison": ("2 laws compared", "aging"),
    "fit": ("Fit to synthetic", "How sure is that?", "16 draws, bootstrap"),
}


@pytest.mark.parametrize("name", LAB)
def test_answers_of_records_have_documents(lab_results, name, request):
    if name != "fit":  # whose pictures are the largest
        request.getfixturevalue("unpainted")
    options = {"draws": lab_results["draws"]} if name == "fit" else {}
    document = ss.report(lab_results[name], explorer=False, **options).html
    text = words(document)
    for part in LAB[name]:
        assert part in text, part
    if name == "fit":
        found = lab_results[name]
        told = f"Direct effect a {found['a'].shown()}, evolution effect b"  # what it found, at once
        assert words(html_text(told)) in text
        answer = words(html_text(f"a - b = {found['a - b'].shown()}"))
        assert f"Friction falls with velocity, {answer}. Fit to synthetic" in text
        above = text[: text.index("What was found")]
        assert "Use these values with their errors" in above
        assert "friction.a" not in above
    shown = re.sub(r"<pre>\[friction\].*?</pre>", "", document, flags=re.S)  # a file stays as it is
    assert not re.search(r"\d um\b", shown)
    if name in ("fit", "draws"):
        assert "friction.a" not in shown
        details = [line.split("  ")[1] for line in html.unescape(shown).splitlines() if re.match(r"  \S.* ± ", line)]
        assert details[:3] == ["direct effect a", "evolution effect b", "slip distance d_c"]
    assert len(document.encode()) <= 500_000
