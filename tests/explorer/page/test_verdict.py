"""What the explorer's page says of a rig in a real browser is what Python says."""

import re

import numpy as np
import pytest

import steadyslip as ss
from explored import Explored, page_modules
from explored_pages import INCLINED, Visit, edges_of, middle
from javascript import Script
from rigs_of_theory import ONE_MEMORY, SIGMA, rig
from steadyslip.model.point import operating_point


def test_the_page_says_what_python_says_and_asks_for_nothing(browser, file):
    analysis = ss.analyze(INCLINED)
    with Visit(browser, file) as visit:
        assert visit.sentence() == "Unstable: steady sliding at 1 µm/s"
        text = visit.reason()
        assert f"{analysis.critical_stiffness / 1e9:.4g} GPa/m" in text
        assert f"{9e9 / analysis.critical_stiffness:.3g} times" in text
        assert "agrees with 4 answers of Python" in visit.page.inner_text("footer")
        edges = edges_of(visit)
        for name in ("friction.a", "friction.b"):
            (edge,) = [one.value for one in ss.boundary(INCLINED, name)]
            assert float(edges[name]) == pytest.approx(edge, rel=1e-3)
        assert [one for one in visit.requests if not one.startswith(("blob:", "data:"))] == [file.as_uri()]
        explained(visit)
    assert file.stat().st_size <= 215_000
    assert "default-src 'none'" in file.read_text(encoding="utf-8")


def explained(visit):
    """What a reader who had never seen the page did not understand is said on it."""
    assert "At the edge: oscillation with period" in visit.reason()
    bar = visit.page.locator(".bar").inner_text()
    for words in ("stiffness now 9 GPa/m", "stable from", "10 GPa/m", "100 GPa/m"):
        assert words in bar
    assert "Θ: state of friction" in visit.page.inner_text(".facts dl")
    key = visit.page.locator(".map .key").inner_text()
    assert "no steady sliding" in key, "the track of mu_ref has that"
    assert "no such rig" not in key, "nothing on the page has that"
    marks = visit.page.locator(".facts .key")
    for words in (
        "now, grows",
        "now, does not grow",
        "at the edge of stability",
        "at other values of what the bar shows, the larger the higher",
    ):
        assert words in marks.inner_text()
    assert marks.locator("svg path").count() == 5


@pytest.mark.parametrize("name", ["inclined-spring", "slow-axis", "machines/brake-pad"])
def test_contours_are_of_what_python_computes(name):
    """The stiffness over the critical one, with the gain of a controller counted in; of machines the growth rate."""
    own = ss.read_rig(f"examples/{name}.toml")
    gains = [{"drive.kp": factor * own.drive.kp} for factor in (3.0, 30.0)] if name == "slow-axis" else []
    for change in (*({"drive.velocity": factor * own.drive.velocity} for factor in (0.2, 1.0, 3.0)), *gains):
        other = own.with_values(change)
        point = operating_point(other, None, own.kept_zeros())
        values = list(map(float, point.arguments))
        found = Explored(own).script("linear.set(values).status() && linear.strength()", values=values)
        expected = ss.growth_rate(other)
        if other.default_along is not None:
            expected = 1 / (1 + 1 / ss.safety_factor(other))
        assert found == pytest.approx(float(expected), rel=1e-9)


def test_lines_of_levels_are_where_a_plane_has_them():
    """A plane has straight lines; cells without a number have none."""
    grid = "Array.from({ length: 5 }, (_, j) => Array.from({ length: 7 }, (_, i) => (j > 3 ? NaN : i + j)))"
    found = Script(page_modules())(f"line({grid}, 3.5, 60, 40)")
    places = np.array(re.findall(r"[\d.]+", found["path"]), dtype=float).reshape(-1, 2)
    assert len(places) == 2 * len(found["middles"]) > 6
    np.testing.assert_allclose(places[:, 0] / 10 + (4 - places[:, 1] / 10), 3.5, atol=0.02)
    assert places[:, 1].min() >= 10


def test_bent_lines_of_levels_are_where_a_function_has_them():
    """On a hyperbola over few cells: sides and middles lie on it, which straight lines in cells miss by far."""
    function = "(x, y) => Math.exp(8 * x * y)"
    grid = f"Array.from({{ length: 7 }}, (_, j) => Array.from({{ length: 7 }}, (_, i) => ({function})(i / 6, j / 6)))"
    how = f"{{ exact: {function}, steep: 0, steps: 5, bends: true }}"
    straight, bent = (Script(page_modules())(f"line({grid}, 9, 600, 600, {one}).path") for one in ("{}", how))
    off = []
    for path in (straight, bent):
        x, y = np.array(re.findall(r"[\d.]+", path), dtype=float).reshape(-1, 2).T / 600
        off.append(np.abs(x * (1 - y) - np.log(9) / 8).max())
    assert off[1] < 0.002 < 0.01 < off[0]
    assert bent.count("L") == 2 * bent.count("M") == 2 * straight.count("L")


def test_contours_end_at_edges_only():
    """Numbers are carried on beyond the edge of steady sliding by one point, where lines are cut; jumps have none."""
    page = Script(page_modules())
    grid = "[[0, 1, NaN, NaN], [0, 1, NaN, NaN], [0, 1, NaN, NaN]]"
    np.testing.assert_allclose(np.array(page(f"carried({grid}).map((row) => row.slice(0, 3))")), 3 * [[0, 1, 2]])
    assert page("line([[0, 3], [0, 3]], 1.5, 60, 40, { jump: 1 }).path") == ""
    assert page("line([[0, 3], [0, 3]], 1.5, 60, 40).path")


def test_contours_are_drawn_while_nothing_moves(browser, file):
    with Visit(browser, file) as visit:
        lines = visit.page.locator(".map .contours")
        assert lines.locator("path").count() == 6
        assert set(lines.locator("text").all_text_contents()) >= {"0.5", "0.2", "0.1"}
        visit.slider("friction.a").evaluate("e => { e.value = 480; e.dispatchEvent(new Event('input')); }")
        assert lines.locator("path").count() == 0
        visit.slider("friction.a").evaluate("e => e.dispatchEvent(new Event('change'))")
        assert lines.locator("path").count() == 6


def test_tracks_are_painted_as_python_judges(browser, file):
    """Colours of the track of every slider, at positions between the edges, are statuses of Python."""
    with Visit(browser, file) as visit:
        paint = visit.slider("friction.a").evaluate("e => e.style.getPropertyValue('--track')")
        stops = [(name, float(at)) for name, at in re.findall(r"--(?!ink)(\w+)\) ([\d.]+)%", paint)]
        assert [name for name, _ in stops] == ["unstable", "unstable", "stable", "stable"]
        (edge,) = [one.value for one in ss.boundary(INCLINED, "friction.a")]
        low, high = 0.0145 / 30, 0.0145 * 30
        assert stops[1][1] == pytest.approx(100 * np.log(edge / low) / np.log(high / low), abs=0.01)


def test_a_browser_that_computes_otherwise_says_so(browser, file, tmp_path):
    text = file.read_text(encoding="utf-8")
    wrong = re.sub(r'("critical":)(\d+\.\d+)', lambda m: f"{m[1]}{float(m[2]) * (1 + 1e-9)!r}", text, count=1)
    assert wrong != text
    (tmp_path / "wrong.html").write_text(wrong, encoding="utf-8")
    with Visit(browser, tmp_path / "wrong.html") as visit:
        assert "do not rely on this page" in visit.page.inner_text(".notice")
        assert "the rig itself: the critical stiffness" in visit.page.inner_text(".notice")


def test_the_locus_shows_eigenvalues_and_where_stability_changes(browser, file):
    with Visit(browser, file) as visit:
        assert visit.page.locator("svg.chart.locus .own.grows").get_attribute("d").count("M") == 2
        crossing = visit.page.locator("svg.chart.locus .crossing")
        assert crossing.get_attribute("d").count("M") == 2
        box = visit.page.locator(".locus .left").bounding_box()
        assert middle(crossing)[0] == pytest.approx(box["x"] + box["width"], abs=1.0), "there nothing grows or decays"
        assert crossing.bounding_box()["width"] < 14


RIGS = {
    "area": rig(area=0.01, stiffness=9e9),
    "axial": rig(contact=ss.laws.Triaxial(confining_pressure=SIGMA, angle=0.5), stiffness=None, axial_stiffness=9e10),
    "controller": rig(stiffness=None, drive=ss.machine.PID(1e-6, kp=9e9, ki=1e8), mass=1e3),
    "locked": rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-1.0)),
    "bristles": rig(friction=ONE_MEMORY[-1]),
}


@pytest.mark.parametrize("name", RIGS)
def test_other_rigs_have_pages_too(browser, tmp_path, name):
    own = RIGS[name]
    ss.explore(own).save(tmp_path / "rig.html")
    analysis = ss.analyze(own)
    with Visit(browser, tmp_path / "rig.html") as visit:
        word = {None: "No steady sliding", True: "Stable", False: "Unstable"}[analysis.stable]
        assert visit.sentence().startswith(word)
        assert visit.page.inner_text(".notice") == ""
        visit.told("slip event|runs away|No motion|ends at")
        assert (visit.page.locator(".strips .curve").count() > 0) == (analysis.stable is not None)
        text = visit.saved("rig file")
    again = ss.rig_from_text(text)
    assert ss.analyze(again).critical_stiffness == analysis.critical_stiffness
    assert ss.analyze(again).eigenvalues == analysis.eigenvalues


def test_the_bar_of_a_gain_is_that_of_the_gain(browser, tmp_path):
    """A rig that its gain alone holds is told of that gain, not of a stiffness that it has not."""
    own = RIGS["controller"].with_values({"drive.kp": 9e11})
    ss.explore(own).save(tmp_path / "rig.html")
    (edge,) = [one.value for one in ss.boundary(own, "drive.kp")]
    with Visit(browser, tmp_path / "rig.html") as visit:
        assert "The drive proportional gain, 900 GPa/m, is 108 times the critical 8.357 GPa/m" in visit.reason()
        bar = visit.page.locator(".bar")
        assert "now 900 GPa/m" in bar.inner_text()
        assert (
            bar.get_attribute("aria-label")
            == f"stable values of drive proportional gain k_p: above {edge / 1e9:.4g} GPa/m"
        )


def test_numbers_off_every_scale_are_drawn_at_its_end(browser, file):
    with Visit(browser, file, "#slider.stiffness=1e-320") as visit:
        assert "NaN" not in visit.page.evaluate("document.querySelector('.steadyslip').innerHTML")
