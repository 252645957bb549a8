"""Pages of machines in a browser: the sentence, the bar of any parameter, motion of named contacts and bodies."""

import re
from pathlib import Path

import pytest

import steadyslip as ss
from explored_edges import written
from explored_pages import Visit
from joint_at_radius import joint
from machines import block
from steadyslip.machine.letters import label_of
from steadyslip.verdict.words import EIGENVALUE_COLUMNS, eigenvalue_row

MACHINES = Path(__file__).parents[3] / "examples" / "machines"


@pytest.fixture(scope="module")
def page_of_servo(tmp_path_factory):
    path = tmp_path_factory.mktemp("machines") / "servo.html"
    machine = ss.read_rig(MACHINES / "geared-servo.toml")
    ss.explore(machine, title="servo").save(path)
    return machine, path


def test_a_page_of_what_nothing_damps_says_undamped(browser, tmp_path):
    """Verdict, bar, chart, eigenvalues and the guess; beyond the edge it is unstable, and damped it is stable."""
    ss.explore(block()).save(tmp_path / "block.html")
    with Visit(browser, tmp_path / "block.html") as visit:
        assert visit.sentence().startswith("Undamped: no disturbance of steady sliding at 1 m/s grows")
        assert visit.page.locator(".verdict").get_attribute("data-kind") == "undamped"
        assert (
            visit.page.locator(".bar").get_attribute("aria-label").startswith("undamped values of link one stiffness")
        )
        assert "undamped" in visit.page.locator(".map .word").all_text_contents()
        assert "Stable means" not in visit.page.inner_text("footer"), "which is not what it is"
        assert "neither grows" in visit.page.locator(".facts tbody").inner_text()
        visit.type("contacts.belt.friction.viscous", "0.1")
        assert visit.sentence().startswith("Stable")
        visit.page.get_by_role("button", name="undo").click()
        visit.type("contacts.belt.friction.mu_coulomb", "1.1")
        assert visit.sentence().startswith("Unstable")
        visit.page.get_by_role("button", name="reset").click()
        visit.page.get_by_role("button", name="guess first").click()
        visit.type("bodies.block.mass", "2")
        visit.page.locator(".guess").get_by_role("button", name="undamped", exact=True).click()
        assert visit.page.locator(".said").inner_text().startswith("Right: Undamped")


def test_a_page_of_a_machine_says_what_analyze_says(browser, page_of_servo):
    machine, path = page_of_servo
    analysis = ss.analyze(machine)
    with Visit(browser, path) as visit:
        assert visit.sentence() == "Unstable: steady sliding at 20 µm/s"
        reason = visit.reason()
        assert reason.lower() == f"{analysis.reason}.".lower()
        assert analysis.mode.words() in visit.page.locator(".mode").inner_text()
        rows = [row.split("\t") for row in visit.page.locator(".facts tbody").inner_text().split("\n")]
        theirs = [[written(cell) for cell in eigenvalue_row(s)] for s in analysis.eigenvalues if s.imag >= 0]
        assert [[written(cell.replace("\u00a0", " ")) for cell in row] for row in rows] == theirs
        heads = visit.page.locator(".facts thead th").all_inner_texts()
        assert heads == list(EIGENVALUE_COLUMNS)
        first = analysis.margins[0].parameter
        bar = visit.page.locator(".bar").get_attribute("aria-label")
        assert label_of(machine, first) in bar, "the bar begins with the nearest edge"
        visit.page.get_by_label("parameter of the bar").select_option("drive.kp")
        bar = visit.page.locator(".bar").get_attribute("aria-label")
        assert "proportional gain k_p" in bar
        assert "above 0.4362 N/µm" in bar
        visit.page.get_by_label("parameter of the bar").select_option("contacts.mesh.friction.a")
        assert "above 0.02108" in visit.page.locator(".bar").get_attribute("aria-label")
        visit.type("drive.kp", "1 N/um")
        assert visit.sentence().startswith("Stable")
        visit.page.get_by_role("button", name="undo").click()
        assert visit.sentence().startswith("Unstable")
        assert visit.page.evaluate("document.documentElement.scrollWidth - innerWidth") <= 0


def test_a_machine_is_disturbed_where_one_says_and_shown_by_name(browser, page_of_servo):
    _, path = page_of_servo
    with Visit(browser, path) as visit:
        visit.told(r"slip events? \(guide\)")
        visit.page.get_by_label("after a disturbance").select_option("pull")
        visit.page.get_by_label("where it acts").select_option("load")
        visit.page.locator(".motion .hint", has_text="pull on load").wait_for()
        visit.page.get_by_label("contact or body").select_option(label="body load")
        assert "ahead" in visit.page.locator("svg.strips").get_attribute("aria-label")
        bodies = visit.page.locator(".sketch .part")
        before = [bodies.nth(i).get_attribute("transform") for i in range(bodies.count())]
        visit.page.get_by_label("time", exact=True).fill("700")
        after = [bodies.nth(i).get_attribute("transform") for i in range(bodies.count())]
        assert len(before) == 2
        assert before != after


def test_a_page_tells_what_a_turning_body_sheds_as_a_torque_at_any_radius(browser, tmp_path):
    """The same joint with its bearing at 5 cm: in the text and in the table of events."""
    drops = []
    for radius in (1.0, 0.05):
        path = tmp_path / f"{radius}.html"
        ss.explore(ss.rig_from_text(joint(radius))).save(path)
        with Visit(browser, path) as visit:
            told = visit.told("in the torque of shaft on joint")
            (drop,) = re.findall(r"; the last: .*torque drop ([\d.]+) N m", told)
            drops.append(float(drop))
            head = visit.page.locator(".events th").all_text_contents()
            row = visit.page.locator(".events tbody tr").last.text_content().replace("\u00a0", " ")
            assert "drop of torque" in head
            assert f"{drop} N m" in row
    assert drops[1] == pytest.approx(drops[0], rel=0.1)  # the last events of runs that are cut


@pytest.mark.parametrize("changes", [
    {"contacts.mesh.friction.mu_ref": "3", "contacts.mesh.contact.angle": "-80 deg"},
    {"bodies.load.force": "400 N"},
])  # fmt: skip
def test_a_page_says_why_there_is_no_steady_sliding_as_analyze_does(browser, page_of_servo, changes):
    machine, path = page_of_servo
    found = ss.analyze(machine.with_values(changes))
    assert found.stable is None
    with Visit(browser, path) as visit:
        for name, value in changes.items():
            visit.type(name, value)
        assert visit.sentence() == "No steady sliding at 20 µm/s"
        said = visit.reason().replace("−", "-").lower()
        assert said == f"{found.reason}.".lower()


def test_a_force_that_holds_the_contact_ends_at_zero(browser, tmp_path):
    """The edge of what presses is 0 on the page as in Python, and its other side is a lift-off, not a lock-up."""
    machine = ss.read_rig(MACHINES / "brake-pad.toml")
    assert next(one for one in ss.analyze(machine).margins if one.parameter == "bodies.pad.press").edge.value == 0
    ss.explore(machine).save(tmp_path / "pad.html")
    with Visit(browser, tmp_path / "pad.html") as visit:
        assert "pad pressing force\u00a0P → 0\u00a0N" in visit.page.locator(".edges button").all_text_contents()
        edges = visit.page.locator(".edges li")
        assert any(re.search("force\u00a0P → 0\u00a0N .*: disc lifts off", one) for one in edges.all_text_contents())
        push = visit.page.get_by_label("after a disturbance").locator("option[value=push][disabled]")
        push.wait_for(state="attached")  # through the dashpot of the arm it would be an infinite force
        visit.page.get_by_role("button", name="lining stiffness\u00a0k →").click()
        edges.filter(has_text=re.compile(r"caliper stiffness\sk → 6.138.* an oscillation grows")).wait_for()
        edges.filter(has_text=re.compile(r"lining stiffness\sk → 7.328.* an oscillation grows")).wait_for()
        assert "--unstable" in visit.slider("links.caliper.stiffness").get_attribute("style"), "a band 9 % wide"
        visit.page.get_by_role("button", name="undo").click()
        visit.type("bodies.pad.press", "-1 N")
        edges.filter(has_text="pad pressing force").filter(has_text="slides steadily, but unstable").wait_for()
        assert visit.reason().startswith("Lift-off at contact disc.")
