"""Values on the explorer's page: typed, dragged, taken back, at an edge, in a link, in files."""

import json
import re
import time
from urllib.parse import quote

import numpy as np
import pytest

import steadyslip as ss
from explored_edges import EXAMPLES, example, pressed
from explored_pages import FOLLOW, INCLINED, Visit, edges_of, middle


def test_values_can_be_typed_with_units_and_taken_back(browser, file):
    with Visit(browser, file) as visit:
        visit.type("slider.stiffness", "90 GPa/m")
        assert visit.sentence().startswith("Stable")
        visit.type("slider.stiffness", "3 MPa")
        assert "wrong dimension" in visit.page.inner_text(".fault:not(:empty)")
        visit.type("slider.stiffness", "-3 GPa/m")
        assert "allowed: a finite number >= 0" in visit.page.inner_text(".fault:not(:empty)")
        visit.type("slider.stiffness", "80")  # in the unit that is shown
        assert visit.field("slider.stiffness").input_value() == "80 GPa/m"
        for _ in range(2):
            visit.page.get_by_role("button", name="undo").click()
        assert visit.sentence().startswith("Unstable")
        visit.page.get_by_role("button", name="redo").click()
        assert visit.sentence().startswith("Stable")
        visit.page.get_by_role("button", name="reset").click()
        assert visit.sentence().startswith("Unstable")


def test_sliders_and_the_chart_work_by_keyboard_and_by_pointer(browser, file):
    with Visit(browser, file) as visit:
        stiffness = visit.slider("slider.stiffness")
        stiffness.focus()
        for _ in range(12):
            visit.page.keyboard.press("PageUp")
        assert visit.sentence().startswith("Stable")
        assert "GPa/m" in stiffness.get_attribute("aria-valuetext")
        visit.page.get_by_role("button", name="reset").click()
        chart = visit.page.locator("svg[role=application]")
        chart.focus()
        for _ in range(10):
            visit.page.keyboard.press("Shift+ArrowUp")
        assert visit.sentence().startswith("Stable")
        assert "Stable" in chart.get_attribute("aria-label")
        box = chart.bounding_box()
        point = visit.page.locator("svg .point")
        visit.page.mouse.move(*middle(point))
        visit.page.mouse.down()
        visit.page.mouse.move(box["x"] + 0.9 * box["width"], box["y"] + 0.8 * box["height"], steps=5)
        visit.page.mouse.up()
        assert visit.sentence().startswith("Unstable")
        visit.page.get_by_role("button", name="undo").click()
        assert visit.sentence().startswith("Stable"), "a drag is one change"


@pytest.mark.campaign
def test_each_edge_in_the_list_leads_to_where_python_agrees(browser, tmp_path):
    """A sample of what `tests/helpers/explored_edges.py --browser` does."""
    page = example(EXAMPLES / "inclined-spring.toml")
    wrong, many = pressed(page, np.random.default_rng(2), browser, tmp_path / "rig.html")
    assert wrong == []
    assert many


def test_an_edge_in_the_list_goes_there(browser, file):
    with Visit(browser, file) as visit:
        visit.page.get_by_role("button", name=re.compile("^stiffness k →")).click()
        assert visit.sentence().startswith("Stable")
        assert "is 1.001 times the critical" in visit.reason(), "not 1 times, as on the edge"


def test_an_edge_outside_the_range_of_a_slider_takes_the_slider_there(browser, file):
    """With some radiation damping the edge of the velocity is further off than a track is widened by itself."""
    with Visit(browser, file) as visit:
        visit.type("slider.radiation_damping", "1e5 Pa s/m")
        visit.page.locator(".edges button", has_text="drive velocity v₀ → ").evaluate("one => one.click()")
        slider = visit.slider("drive.velocity")
        place = 0.1 * float(slider.input_value())  # per cent
        paint = slider.evaluate("e => e.style.getPropertyValue('--track')")
        ends = [(name, float(at)) for name, at in re.findall(r"--(\w+)\) ([\d.]+)%", paint) if name != "ink"]
        own = [name for (name, low), (_, high) in zip(ends[::2], ends[1::2], strict=True) if low <= place <= high]
        assert 50 < place < 100
        assert own == ["stable"]
        assert visit.sentence().startswith("Stable: ")


@pytest.mark.parametrize("far", [("friction.b", "1e10"), ("friction.b", "1600"), ("slider.stiffness", "1e-300 Pa/m")])
def test_a_value_far_away_leaves_nothing_behind(browser, file, far):
    """Edges, and where one lands, are the edge's own: no slider's range decides on them; reset brings ranges back."""
    with Visit(browser, file) as visit:
        before, track = edges_of(visit), visit.slider("friction.b").evaluate("e => e.style.cssText")
        visit.type(*far)
        if far[0] == "friction.b":
            assert edges_of(visit)["friction.b"] == before["friction.b"], "edges are exact on every range"
        for back in ("reset", "undo"):
            visit.page.get_by_role("button", name=back).click()
            if back == "undo":
                visit.page.get_by_role("button", name=back).click()
            assert edges_of(visit) == before
            assert visit.slider("friction.b").evaluate("e => e.style.cssText") == track
        visit.type(*far)
        visit.page.locator(".facts details").evaluate("e => (e.open = true)")
        visit.page.get_by_role("button", name=re.compile("^evolution effect b →")).click()
        if far[0] == "friction.b":
            landed = float(visit.field("friction.b").input_value())
            (edge,) = [one.value for one in ss.boundary(INCLINED, "friction.b")]
            assert landed == pytest.approx(0.999 * edge, rel=1e-4), "a thousandth to its stable side"
            assert visit.sentence().startswith("Stable")


def test_ranges_follow_a_link_and_the_critical_stiffness(browser, file):
    """An open page shows a link as one does that is opened with it; the stiffness that is needed is in reach."""
    link = "#friction.b=0.2&slider.stiffness=50000000000000"
    with Visit(browser, file, link) as visit:
        there = looks(visit)
    with Visit(browser, file) as visit:
        visit.page.evaluate(FOLLOW, link)
        end = time.time() + 10
        while visit.field("friction.b").input_value() != "0.2":
            assert time.time() < end
        assert looks(visit) == there
        critical = ss.critical_stiffness(INCLINED.with_values({"friction.b": 0.2}))
        assert edges_of(visit)["slider.stiffness"] == f"{critical / 1e9:.4g}"
    with Visit(browser, file) as visit:
        visit.type("friction.b", "0.5")
        critical = ss.critical_stiffness(INCLINED.with_values({"friction.b": 0.5}))
        assert critical > 30 * 9e9, "beyond the range of the rig of the file"
        assert edges_of(visit)["slider.stiffness"] == f"{critical / 1e9:.4g}"
        assert "--stable" in visit.slider("slider.stiffness").get_attribute("style")
        visit.type("friction.a", "0.4")
        (edge,) = [one.value for one in ss.boundary(INCLINED.with_values({"friction.a": 0.4}), "friction.b")]
        assert edge > 4 * 0.016, "beyond its range too"
        assert float(edges_of(visit)["friction.b"]) == pytest.approx(edge, rel=1e-3)
        visit.type("friction.a", "0.0145")
        row = next(line for line in visit.saved("edges CSV").splitlines() if "slider.stiffness" in line)
        assert float(row.split(",")[2]) == pytest.approx(critical, rel=1e-12)


def looks(visit):
    tracks = "[...document.querySelectorAll('input[type=range]')].map((e) => e.value + e.style.cssText)"
    return visit.sentence(), edges_of(visit), visit.page.evaluate(tracks)


def test_files_and_links_carry_every_digit(browser, file, tmp_path):
    with Visit(browser, file) as visit:
        visit.type("friction.a", "0.0123456789012345")
        visit.slider("contact.angle").focus()
        visit.page.keyboard.press("PageUp")
        (tmp_path / "rig.toml").write_text(visit.saved("rig file"), encoding="utf-8")
        end = time.time() + 10  # browsers take long over it
        while not visit.page.evaluate("location.hash.includes('contact.angle')"):
            assert time.time() < end
        link = visit.page.evaluate("location.hash")
        critical = visit.reason()
        table = visit.saved("edges CSV")
        picture = visit.saved("chart SVG")
        pixels = visit.saved("chart PNG", "latin-1")
    again = ss.read_rig(tmp_path / "rig.toml")
    assert again.friction.a == 0.0123456789012345
    assert f"{ss.analyze(again).critical_stiffness / 1e9:.4g} GPa/m" in critical
    assert json.dumps("friction.a") + ",0.0123456789012345," in table
    assert picture.startswith("<svg")
    assert "var(" not in picture
    assert pixels.startswith("\x89PNG")
    with Visit(browser, file, link) as visit:
        assert visit.reason() == critical
        (tmp_path / "rig2.toml").write_text(visit.saved("rig file"), encoding="utf-8")
    assert ss.read_rig(tmp_path / "rig2.toml") == again


HOSTILE = (
    "#friction.a=-1", "#friction.a=1e999", "#friction.a=NaN", "#friction.a=0x10", "#friction.a", "#=", "#%zz",
    "#&&&===", "#__proto__=1", "#constructor=2&toString=3", "#slider.stiffness=<script>alert(1)</script>",
    "#" + "a=1&" * 9000,
)  # fmt: skip


def test_hostile_links_change_nothing(browser, file):
    """Those that a page is opened with, and those that come while it is open."""
    own = ("Unstable: steady sliding at 1 µm/s", "0.0145")
    with Visit(browser, file, quote(HOSTILE[-2], safe="#=&%")) as visit:
        for link in ("", "#friction.a=0.03", *HOSTILE):
            visit.page.evaluate(FOLLOW, link)
            expected, end = (("Stable: steady sliding at 1 µm/s", "0.03") if "0.03" in link else own), time.time() + 10
            while (found := (visit.sentence(), visit.field("friction.a").input_value())) != expected:
                assert time.time() < end, (link, found)


def test_a_link_is_followed_while_the_page_is_about_to_write_its_own(browser, file):
    """The address shows the page's own values soon after they change: a link that comes just before is not lost."""
    with Visit(browser, file, "#friction.a=0.02") as visit:
        visit.page.evaluate("""() => new Promise((done) => {
            addEventListener("hashchange", () => setTimeout(done), { once: true });
            location.hash = "#friction.a=0.03";
            history.replaceState(null, "", "#friction.a=0.02");
        })""")
        assert visit.field("friction.a").input_value() == "0.03"


def test_what_a_link_cannot_bring_is_said(browser, file):
    """A link of another rig, and numbers that are not allowed: what is left out is named, until another link comes."""
    with Visit(browser, file, "#friction.a=0.02&friction.states.1.b=0.01&friction.d_c=-1") as visit:
        assert visit.field("friction.a").input_value() == "0.02"
        notice = visit.page.locator(".notice")
        assert "left out: friction.states.1.b, friction.d_c = -1 (allowed: a finite number > 0)." in notice.inner_text()
        visit.page.evaluate(FOLLOW, "#friction.a=0.03")
        notice.wait_for(state="hidden")
    with Visit(browser, file, "#the-caveats") as visit:
        assert visit.page.locator(".notice").inner_text() == "", "an anchor is no link to values"


def test_that_a_link_is_copied_is_said_for_a_while(browser, file):
    """Over the page, which stays where it is, and not as a warning."""
    with Visit(browser, file, permissions=["clipboard-write", "clipboard-read"]) as visit:
        before = visit.page.locator("main").bounding_box()["y"]
        visit.page.clock.install()
        visit.page.get_by_role("button", name="link", exact=True).click()
        said = visit.page.get_by_text("The link is copied.")
        said.wait_for()
        assert visit.page.locator("main").bounding_box()["y"] == before
        assert visit.page.locator(".notice").inner_text() == ""
        visit.page.clock.fast_forward(8000)
        assert said.count() == 0


def test_a_refused_entry_says_so_until_it_goes(browser, file):
    """A bare number says what it is taken for; a decimal comma counts; what is refused is marked until it goes."""
    with Visit(browser, file) as visit:
        field = visit.field("slider.stiffness")
        said = visit.page.locator(f"[id='{field.get_attribute('aria-describedby')}']")
        field.focus()
        assert said.inner_text() == "a bare number counts in GPa/m"
        field.fill("12,5")
        assert said.inner_text() == "taken as 12,5 GPa/m"
        field.press("Tab")
        assert field.input_value() == "12.5 GPa/m"
        for wrong, words in (("12,500", "may be 12.500 or 12500"), ("7 kg", "wrong dimension"), ("x", "not a number")):
            visit.type("slider.stiffness", wrong)
            assert field.get_attribute("aria-invalid") == "true"
            assert words in visit.page.inner_text(".fault:not(:empty)")
            assert field.input_value() == wrong
            if wrong == "x":
                visit.page.get_by_role("button", name="reset").click()
            else:
                field.press("Escape")
            assert field.get_attribute("aria-invalid") is None
            assert visit.page.locator(".fault:not(:empty)").count() == 0
            assert field.input_value() == ("9 GPa/m" if wrong == "x" else "12.5 GPa/m")


def test_a_link_brings_all_that_is_chosen(browser, moved):
    """The bar, the chart's axes, the disturbance with its numbers; what is no such thing is as it is at first."""
    with Visit(browser, moved["explorer"]) as visit:
        visit.told("slip event")
        visit.page.get_by_label("parameter of the bar").select_option("friction.b")
        visit.page.get_by_label("parameter across").select_option("friction.d_c")
        visit.page.get_by_label("after a disturbance").select_option("pull")
        for label, text in (("size of the disturbance", "20 kPa"), ("length of the run", "30 s")):
            visit.page.get_by_label(label).fill(text)
            visit.page.get_by_label(label).press("Tab")
        visit.page.locator(".motion .hint", has_text="pull on the block, 20 kPa").wait_for()
        shown, link = chosen(visit), linked(visit, "~for=30")
    assert "evolution effect b" in shown["bar"]
    with Visit(browser, moved["explorer"], link) as visit:
        visit.page.locator(".motion .hint", has_text="pull on the block, 20 kPa").wait_for()
        assert chosen(visit) == shown
        visit.page.evaluate(FOLLOW, "#~bar=no&~across=&~do=__proto__&~show=%zz&~of=9e999 m&~part=constructor")
        assert chosen(visit)["disturbance"] == "step of the drive velocity"
        assert "stiffness" in chosen(visit)["bar"]


def linked(visit, part):
    """The address, once it holds this: browsers take long over it."""
    end = time.time() + 10
    while part not in (link := visit.page.evaluate("location.hash")):
        assert time.time() < end
    return link


def chosen(visit):
    lists = "e => [...e.querySelectorAll('select')].map((one) => one.selectedOptions[0]?.textContent)"
    return {
        "bar": visit.page.locator(".bar").get_attribute("aria-label"),
        "axes": visit.page.locator(".map").evaluate(lists),
        "disturbance": visit.page.locator(".motion").evaluate(lists)[0],
        "fields": visit.page.locator(".motion").evaluate(
            "e => [...e.querySelectorAll('input[type=text]')].map((one) => one.value)"
        ),
    }


OWN = """# Of my own; 9 GPa/m was the old spring
[friction]
law = "rate-state"
a = 0.0145                # measured
b = 0.0160
d_c = "1 um"
mu_ref = 0.7
v_ref = "3.6 mm/h"
[contact]
law = "inclined-spring"
preload = 5e6             # Pa
angle = "-28.6 deg"
[slider]
stiffness = "9 N/um"
area = "0.002 m^2"
[drive]
velocity = "3.6 mm/h"
"""


def test_units_and_comments_of_the_file_stay(browser, tmp_path):
    """The page speaks in the units of the file, and saves it with its comments; only what has changed is new."""
    (tmp_path / "own.toml").write_text(OWN.replace("5e6 ", "9e3 "), encoding="utf-8")
    text, own = (tmp_path / "own.toml").read_text(encoding="utf-8"), ss.read_rig(tmp_path / "own.toml")
    ss.explore(own, source=tmp_path / "own.toml").save(tmp_path / "rig.html")
    with Visit(browser, tmp_path / "rig.html") as visit:
        assert visit.sentence() == "Unstable: steady sliding at 3.6 mm/h"
        assert visit.field("slider.stiffness").input_value() == "9 N/µm"
        assert "N/µm" in visit.reason()
        assert visit.saved("rig file") == text
        visit.type("slider.stiffness", "12.3")
        visit.type("drive.velocity", "7.2")
        visit.type("contact.preload", "10 kN")
        changed = text.replace('"9 N/um"', '"12.3 N/um"').replace("9e3", "10000")
        changed = changed.replace('velocity = "3.6 mm/h"', 'velocity = "7.2 mm/h"')
        assert visit.saved("rig file") == changed
        visit.type("slider.damping", "1 N s/m")
        visit.page.get_by_role("button", name=re.compile("^evolution effect b →")).click()
        (tmp_path / "again.toml").write_text(visit.saved("rig file"), encoding="utf-8")
        values = dict(one.split("=") for one in linked(visit, "friction.b")[1:].split("&"))
    assert ss.read_rig(tmp_path / "again.toml") == own.with_values({k: float(v) for k, v in values.items()})
