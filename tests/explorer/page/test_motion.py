"""Motion on the explorer's page: disturbances, curves, one time for all that is drawn, and stopping."""

import re

import numpy as np
import pytest

import steadyslip as ss
from explored_pages import FOLLOW, MOVED, Visit
from rigs_of_theory import rig

DISTURBED = {
    "hold": "5 s", "push": "-0.1 um", "normal": "-0.2 MPa", "pull": "10 kPa", "blow": "3",
}  # fmt: skip


def test_every_disturbance_moves_the_rig(browser, tmp_path):
    ss.explore(rig(mass=1e3, stiffness=3e10)).save(tmp_path / "rig.html")
    with Visit(browser, tmp_path / "rig.html") as visit:
        for name, size in DISTURBED.items():
            visit.page.get_by_label("after a disturbance").select_option(name)
            visit.page.get_by_label("size of the disturbance").fill(size)
            visit.page.evaluate("document.querySelector('.told').textContent = ''")
            visit.page.get_by_label("size of the disturbance").press("Tab")
            assert re.search("No slip event|slip events?[,;]", visit.told("slip event")), name
        visit.page.get_by_label("size of the disturbance").fill("-3")
        visit.page.get_by_label("size of the disturbance").press("Tab")
        visit.told("a number above 0")


def test_a_run_that_ends_with_its_disturbance_is_drawn(browser, moved):
    """The step lifts the block off: what there is to see is the time before it."""
    with Visit(browser, moved["explorer"]) as visit:  # which hears the browser complain of numbers that are none
        visit.told("slip event")
        visit.page.get_by_label("after a disturbance").select_option("normal")
        visit.page.get_by_label("size of the disturbance").fill("-50 MPa")
        visit.page.get_by_label("size of the disturbance").press("Tab")
        visit.told("It ends with the disturbance, at .*: the normal (stress|force) fell to zero")
        frame, step = visit.page.locator(".strips .frame").first.bounding_box(), visit.page.locator(".strips .step")
        assert not step.count() or step.bounding_box()["x"] <= frame["x"] + frame["width"] + 1
        assert visit.page.locator(".strips .curve").first.get_attribute("d").startswith("M")


def test_bare_numbers_count_in_the_unit_that_is_shown(browser, moved):
    """Size and length of a disturbance, as every parameter: what the field shows is what a number counts in."""
    with Visit(browser, moved["explorer"]) as visit:
        visit.told("slip event")
        field = visit.page.get_by_label("length of the run")
        for text, becomes in (("200", "200 s"), ("0.1 h", "0.1 h"), ("0.2", "0.2 h")):
            field.fill(text)
            field.press("Tab")
            assert field.input_value() == becomes
        size = visit.page.get_by_label("size of the disturbance")
        for kind in ("push", "normal", "hold"):
            visit.page.get_by_label("after a disturbance").select_option(kind)
            visit.page.locator("[aria-label$='size of the disturbance'][placeholder*=' ']").wait_for()
            unit = size.get_attribute("placeholder").split()[1]
            size.fill("2")
            size.press("Tab")
            assert size.input_value() == f"2 {unit}"
            visit.page.locator(".motion .hint", has_text=f", 2 {unit}.").wait_for()


def test_curves_are_those_of_the_disturbance_that_is_asked_for(browser, moved):
    """When it comes and what it is is said beside them; where it cannot be, there are no curves of another."""
    with Visit(browser, moved["explorer"]) as visit:
        visit.told("slip event")
        hint, curves = visit.page.locator(".motion .hint"), visit.page.locator(".strips")
        assert re.fullmatch(r"At .* s \(dashed line\): step of the drive velocity, ×\s2\.", hint.inner_text())
        frame, step = visit.page.locator(".strips .frame").first.bounding_box(), visit.page.locator(".strips .step")
        assert step.bounding_box()["x"] == pytest.approx(frame["x"] + frame["width"] / 20, abs=2)
        visit.page.emulate_media(media="print")
        assert hint.is_visible()
        visit.page.emulate_media(media="screen")
        for label, wrong, words in (
            ("size of the disturbance", "abc", "not a number"),
            ("length of the run", "-1 s", "above 0 s"),
        ):
            visit.page.get_by_label(label).fill(wrong)
            visit.page.get_by_label(label).press("Tab")
            visit.told(words)
            assert not curves.is_visible()
            assert not visit.page.locator(".reading").is_visible()
            visit.page.get_by_label(label).fill("")
            visit.page.get_by_label(label).press("Tab")
            visit.told("slip event")
            assert curves.is_visible()
        visit.page.evaluate(FOLLOW, "#friction.b=0.0145&slider.stiffness=1e-305")  # a period beyond all numbers
        visit.told("too slowly to show; say how long the run lasts")
        assert not curves.is_visible()
        visit.page.evaluate(FOLLOW, "#friction.b=0.016")
        visit.told("slip event")
        visit.page.get_by_label("after a disturbance").select_option("blow")
        visit.told("a blow needs a mass")
        assert visit.page.get_by_label("size of the disturbance").get_attribute("placeholder") == ""


def test_motion_goes_on_where_no_worker_may_run(browser, file, tmp_path):
    """A policy without workers, as some notebooks have: the page computes in slices itself."""
    text = file.read_text(encoding="utf-8").replace("worker-src blob:;", "worker-src 'none';")
    (tmp_path / "rig.html").write_text(text.replace("unsafe-inline' blob:", "unsafe-inline'"), encoding="utf-8")
    visit = Visit(browser, tmp_path / "rig.html")
    visit.told("It runs away at ")
    assert all("Content Security Policy" in one for one in visit.complaints)
    visit.leave()


def test_the_rig_moves_and_stops_when_asked(browser, moved):
    run = ss.simulate(MOVED, ss.protocol.VelocityStep(at=10.0, to=2e-6), until=200.0, rtol=1e-6)
    with Visit(browser, moved["explorer"]) as visit:
        visit.page.get_by_label("length of the run").fill("200 s")
        visit.page.get_by_label("length of the run").press("Tab")
        told = visit.told(f"^{len(run.slip_events)} slip events, the last two ")
        assert f"{run.slip_events[-1].recurrence:.3g} s apart" in told
        assert visit.page.locator(".strips .curve").count() == 2
        assert visit.page.locator(".events tbody tr").count() == len(run.slip_events)
        own_time(visit, run)
        visit.type("friction.b", "0.0161")
        visit.told("slip events")
        visit.page.wait_for_selector(".strips .before")
        assert visit.page.locator(".strips .before").count() == 2
        assert visit.page.locator(".phase .before").count() == 1
        visit.type("friction.b", "0.016")
        visit.page.get_by_label("after a disturbance").select_option("push")
        visit.page.get_by_label("size of the disturbance").fill("1 m/s")
        visit.page.get_by_label("size of the disturbance").press("Tab")
        visit.told("wrong dimension")
        visit.page.get_by_label("size of the disturbance").fill("1 nm")
        visit.page.evaluate(STOP)
        visit.told(r"stopped\.$")
        visit.type("slider.mass", "3 kg/m^2")
        visit.told("has no slider.mass")


def own_time(visit, run):
    """Curves, phase plane and sketch show one time, which the slider sets: read off there, it is what Python has."""
    time = visit.page.get_by_label("time", exact=True)
    place = "document.querySelector('.sketch .body').getAttribute('transform')"
    before = visit.page.evaluate(place)
    time.focus()
    time.evaluate("e => { e.value = 500; e.dispatchEvent(new Event('input')); }")
    reading = visit.page.inner_text(".reading")
    assert reading.startswith("100 s: ")
    friction = float(re.search(r"friction ([\d.]+)", reading)[1])
    there = np.interp(100.0, run["t"], run["shear_stress"] / run["normal_stress"])
    assert friction == pytest.approx(there, abs=2e-3)
    assert visit.page.evaluate(place) != before
    visit.page.locator(".events summary").click()
    visit.page.get_by_title(re.compile("^go to ")).nth(1).click()
    assert visit.page.inner_text(".reading").startswith(f"{run.slip_events[1].begin:.4g} s")
    visit.page.get_by_role("button", name="play").click()
    visit.page.wait_for_timeout(100)
    visit.page.get_by_role("button", name="pause").click()


STOP = """() => new Promise((done) => {
  const stop = [...document.querySelectorAll("button")].find((one) => one.textContent === "stop");
  const length = document.querySelector("[aria-label$='length of the run']");
  length.value = "100 yr";
  length.dispatchEvent(new Event("change"));
  const began = performance.now();
  const look = () => {
    if (stop.disabled && performance.now() < began + 5000) return setTimeout(look);
    stop.click();
    setTimeout(done, 100);
  };
  look();
})"""


def test_the_run_of_a_page_is_one_of_the_command_line(browser, moved, tmp_path):
    """The protocol that it tells gives the run that it shows."""
    with Visit(browser, moved["explorer"]) as visit:
        visit.page.get_by_label("after a disturbance").select_option("pull")
        visit.page.locator(".motion .hint", has_text="pull on the block").wait_for()
        told = visit.told("slip event")
        block = visit.page.locator(".motion pre").text_content()
        when = re.match(r"At ([\d.]+) s ", visit.page.inner_text(".motion .hint"))[1]
    ss.write_rig(MOVED, tmp_path / "rig.toml")
    (tmp_path / "rig.toml").write_text(
        (tmp_path / "rig.toml").read_text(encoding="utf-8") + "\n" + block, encoding="utf-8"
    )
    protocol = ss.read_protocol(tmp_path / "rig.toml")
    assert f"{protocol.pieces[0].at:.4g}" == when
    run = ss.simulate(ss.read_rig(tmp_path / "rig.toml"), protocol, rtol=1e-6)
    assert told.startswith(f"{len(run.slip_events)} slip events")
    assert f"{run.slip_events[-1].recurrence:.3g} s apart" in told
