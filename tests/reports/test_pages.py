"""Results as HTML: in notebooks all of them, as documents those that answer a question."""

import dataclasses
import hashlib
import html
import re
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import lab_records as lab
import steadyslip as ss
from command import run
from fuzz_rigs import DRIVES, FRICTION
from public_names import public_results
from read_pages import words
from rigs_of_theory import CONTACTS, SIGMA, V0, rate_state, rig
from steadyslip.cli.run_files import write_history
from steadyslip.core.format import format_quantity
from steadyslip.explorer.sketch import sketch
from steadyslip.figures.inline import figure_html
from steadyslip.files.html_document import write_page
from steadyslip.machine.letters import label_of, worded, words_of
from steadyslip.nonlinear.kicks.several_kicks import Thresholds
from steadyslip.reports.brief import _HIDDEN, DIMENSIONLESS, RESULT_UNIT, UNITS, brief, result_html, unit_of
from steadyslip.reports.results import MAX_ROWS, _distinct_rows, protocol_table
from steadyslip.reports.rig import input_table

MACHINES = Path(__file__).parents[2] / "examples" / "machines"
OWN_RIG = rig(friction=rate_state(evolution=ss.laws.Aging()), radiation_damping=1e5, stiffness=6e9)


# -- notebooks

RESULTS = [one for one in public_results() if dataclasses.is_dataclass(one)]


@pytest.mark.parametrize("kind", RESULTS, ids=lambda kind: kind.__name__)
def test_every_public_result_has_html_and_every_number_of_it_a_unit(kind):
    assert hasattr(kind, "_repr_html_")
    for one in dataclasses.fields(kind):
        if re.search("float|ndarray|complex|Array", str(one.type)) and not one.name.startswith("_"):
            known = UNITS.keys() | RESULT_UNIT | DIMENSIONLESS | _HIDDEN
            assert one.name in known, f"{kind.__name__}.{one.name}: say in reports/brief.py which unit it has"


@pytest.fixture(scope="module")
def results():
    analysis = ss.analyze(OWN_RIG)
    run = ss.simulate(OWN_RIG, ss.protocol.VelocityStep(at=1.0, to=2 * V0), until=60.0)
    return {
        "rig": OWN_RIG, "law": OWN_RIG.friction, "protocol": run.protocol, "model": ss.build_model(OWN_RIG),
        "analysis": analysis, "steady": analysis.steady, "margin": analysis.margins[0], "onset": analysis.onset,
        "boundary": ss.boundary(OWN_RIG, "stiffness")[0], "response": ss.small_signal(OWN_RIG),
        "history": run, "event": run.events[0], "slip": run.slip_events[0],
        "ensemble": ss.simulate_many(OWN_RIG, {"stiffness": np.array([6e9, 5e10])}, until=2.0),
    }  # fmt: skip


SAID = {
    "rig": "slider.stiffness 6 GPa/m", "law": "d_c", "protocol": "pieces.1.to 2 µm/s", "model": "quasistatic",
    "analysis": "Unstable", "steady": "5 MPa", "margin": "absolute", "onset": "critical", "boundary": "GPa/m",
    "response": "Pa s/m", "history": "slip events", "event": "velocity", "slip": "peak velocity", "ensemble": "v",
}  # fmt: skip


@pytest.mark.parametrize("name", SAID)
def test_results_show_themselves_in_notebooks(results, name):
    shown = results[name]._repr_html_()
    text = words(shown)
    assert SAID[name].lower() in text.lower()
    assert " um" not in text
    assert "<script" not in shown
    assert not re.search(r"""(?:src|href)=["'](?!data:|#)""", shown)
    assert len(shown) < 150_000


def test_pictures_and_formulas_are_there(results):
    assert "<svg" in results["rig"]._repr_html_()
    assert results["history"]._repr_html_().count('role="img"') == 1
    assert results["model"]._repr_html_().count("<math") > 5


def test_units_are_those_of_the_result(results):
    assert unit_of(results["margin"], "absolute") == results["margin"].unit
    assert unit_of(results["slip"], "stress_drop") == "Pa"
    assert unit_of(results["boundary"], "value") == "Pa/m"


@pytest.mark.usefixtures("unpainted")
def test_rigs_with_an_area_are_told_in_newtons():
    text = words(brief(ss.analyze(rig(area=0.01, stiffness=6e9))))
    assert "MN/m" in text
    assert " GPa/m" not in text


# -- documents


@pytest.mark.parametrize("made", [input_table, brief])
def test_inputs_are_in_the_units_of_the_rigs_file(made):
    """With an area forces, masses and stiffnesses of all of it, in reports and in notebooks."""
    words = re.sub("<[^>]+>", " ", made(ss.read_rig("examples/slow-axis.toml"))).replace("\xa0", " ")
    assert all(f" {value} " in words for value in ("600 N", "8 kg", "50 N s/m", "0.6 N/µm", "2000 N s/m", "40 cm²"))
    assert not re.search(r"Pa\b|kg/m|normal stress", words)


@pytest.mark.parametrize(
    ("drive", "name"), [(ss.machine.PD(V0, kp=9e9, kd=0.0), "PD"), (ss.machine.PID(V0, kp=9e9, ki=1e8), "PID")]
)
def test_sketches_name_the_controller_that_drives(drive, name):
    assert f">{name}</text>" in sketch(rig(stiffness=None, drive=drive))


@pytest.mark.usefixtures("unpainted")
def test_formulas_call_functions_what_people_know():
    """What is computed so that it cannot overflow is read as asinh(x exp(y))."""
    document = ss.report(ss.read_rig("examples/slow-axis.toml"), explorer=False).html
    assert "asinh_exp" not in document
    assert "arcsinh" in document
    formula = document.partition("The critical stiffness of every rig")[2].partition("</math>")[0]
    assert len(re.sub("<[^>]+>", "", formula)) < 200  # characters, those of the sentence with them


def test_a_report_says_everything_about_a_rig():
    analysis, found = ss.analyze(OWN_RIG), ss.report(OWN_RIG, title="A rig")
    text = words(found.html)
    for part in ("Unstable: steady sliding at 1 µm/s", "Will this rig slide steadily", "The rig", "stiffness k",
                 "6 GPa/m", "How far is the edge?", "evolution effect b", "doubles in", "Assumptions", ss.__version__,
                 hashlib.sha256(ss.rig_to_text(OWN_RIG).encode()).hexdigest()):  # fmt: skip
        assert part in text, part
    assert f"{analysis.critical_stiffness / 1e9:.4g} GPa/m" in text
    assert " um" not in text
    assert found.html.count("<figure") == 6  # the rig, two charts, eigenvalues, motion over time and in its plane
    assert found.html.count("<math") > 10
    assert found.html.count('class="steadyslip-root"') == 1
    assert len(found.html.encode()) <= 500_000


@pytest.mark.usefixtures("unpainted")
@pytest.mark.parametrize("path", ["examples/inclined-spring.toml", "examples/machines/brake-pad.toml"])
def test_one_parameter_has_one_name_in_a_report(path):
    """Its words and letter, of inputs and edges alike; only the file at the end has the keys of files."""
    found = ss.read_rig(path)
    text, _, _ = words(ss.report(found, explorer=False).html).partition("SHA-256 of the file")
    inputs, _, edges = text.partition("How far is the edge?")
    for one in ss.analyze(found).margins:
        assert words_of(found, one.parameter) in inputs, one.parameter
        assert label_of(found, one.parameter) in edges, one.parameter
    assert [name for name in found.parameters() if name in text] == []


@pytest.mark.usefixtures("unpainted")
def test_a_machine_has_a_report():
    machine = ss.read_rig(MACHINES / "two-surfaces.toml")
    analysis = ss.analyze(machine)
    text = words(ss.report(machine).html)
    for part in ("Will this machine slide steadily", "normal force", "The verdict", "How far is the edge?",
                 ss.__version__,
                 hashlib.sha256(ss.rig_to_text(machine).encode()).hexdigest(), *machine.contacts):  # fmt: skip
        assert part in text, part
    assert text.count(" 1/s ") == sum(s.imag >= 0 for s in analysis.eigenvalues)
    assert "Explorer" not in text
    assert words(ss.report(analysis).html).replace(" ", "").startswith(text.replace(" ", "")[:400])
    within = words(ss.report(machine, tolerances={"drive.velocity": "5 %"}, explorer=False).html)
    assert "growth rate" in within
    assert "growth rate" not in text


@pytest.mark.usefixtures("unpainted")
def test_the_command_reports_on_machines_and_explores_them(tmp_path):
    answered = run("report", MACHINES / "brake-pad.toml", "-o", tmp_path / "report.html")
    assert answered.returncode == 0, answered.stderr
    own = (MACHINES / "brake-pad.toml").read_text(encoding="utf-8")
    told = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert html.escape(own) in told  # its comments and units, and nothing rewritten
    explored = run("explore", MACHINES / "brake-pad.toml", "-o", tmp_path / "page.html")
    assert explored.returncode == 0, explored.stderr
    assert "contacts.disc.contact.normal_stiffness" in (tmp_path / "page.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("unpainted")
def test_documents_are_called_by_their_kind_and_file(results, tmp_path):
    for name, title in (("run", "Run"), ("press 4", "Run: press 4")):
        write_page(results["history"], tmp_path / f"{name}.html", "Run", explorer=False)
        assert f"<title>{title} – steadyslip</title>" in (tmp_path / f"{name}.html").read_text(encoding="utf-8")


@pytest.mark.usefixtures("unpainted")
def test_documents_of_runs_and_maps_give_the_hash_of_their_file(results, tmp_path):
    file = tmp_path / "press.toml"
    file.write_bytes(b"# the file\n")
    write_history(results["history"], tmp_path / "run.html", source=file)
    assert hashlib.sha256(b"# the file\n").hexdigest() in (tmp_path / "run.html").read_text(encoding="utf-8")
    assert "SHA-256 of press.toml" in (tmp_path / "run.html").read_text(encoding="utf-8").replace("\xa0", " ")


@pytest.mark.usefixtures("unpainted")
def test_documents_of_maps_begin_with_what_was_found(tmp_path):
    settings = {"slider.stiffness": ss.maps.Grid("5 GPa/m", "50 GPa/m", 5)}
    found = ss.run_map(
        ss.Map(rig(), settings, ["status", "safety_factor"]), tmp_path / "m.zarr", workers=1, progress=False
    )
    text = ss.report(found).html.replace("\xa0", " ")
    stable = int(np.sum(np.linspace(5e9, 50e9, 5) > ss.critical_stiffness(rig())))
    assert 0 < stable < 5
    assert f"table at {20 * stable} %" in text.partition("<h1>")[2].partition("</h1>")[0]


def test_what_was_done_to_a_rig_is_told_in_units_that_people_read():
    plan = ss.Protocol.of([ss.protocol.VelocityStep(at=10.0, to=2e-6), ss.protocol.Hold(at=20.0, duration=7200.0)])
    text = "".join(protocol_table(rig(), plan)).replace("\xa0", " ")
    assert "at 10 s, to 2 µm/s" in text
    assert "duration 2 h" in text
    turning = ss.read_rig(MACHINES / "telescope.toml")
    turned = protocol_table(turning, ss.Protocol.of([ss.protocol.VelocityStep(at=1.0, to=0.05)]))
    assert "to 0.05 rad/s" in "".join(turned).replace("\xa0", " ")


def test_lists_of_cycles_leave_out_what_reads_the_same():
    rows = [("25 GPa/m", "17 s", "1 um/s", f"{i} Pa", "") for i in range(9)] + [
        (f"{i} GPa/m", "", "", "", "") for i in range(60)
    ]
    found = _distinct_rows(rows)
    assert len(found) <= MAX_ROWS
    assert found[-1] == rows[-1]
    assert sum(row[0] == "25 GPa/m" and row[1] == "17 s" for row in found) <= 1
    assert _distinct_rows(rows[:1]) == rows[:1]


def test_the_same_figure_is_the_same_text():
    first, second = (figure_html(lambda: Figure().add_subplot(), "an empty one") for _ in range(2))
    assert first.startswith("<svg")
    assert first == second


@pytest.mark.usefixtures("unpainted")
def test_runs_have_documents(results):
    found = ss.report(results["history"], explorer=False)
    assert 'class="steadyslip-root"' not in found.html
    text = words(found.html)
    count = len(results["history"].slip_events)
    assert f"{count} slip event{'' if count == 1 else 's'} in 1 min" in text or f"{count} slip event" in text
    assert "velocity-step" in found.html
    assert found.html.count("<figure") == 3


@pytest.mark.usefixtures("unpainted")
def test_a_run_without_disturbance_says_that_it_tells_nothing_of_stability():
    run = ss.simulate(rig(), until=10.0)
    assert run.undisturbed
    assert "<h1>Undisturbed" in ss.report(run, explorer=False).html
    pushed = ss.simulate(rig(), ss.protocol.VelocityStep(at=1.0, to=2e-6), until=10.0)
    assert not pushed.undisturbed
    assert "<h1>Undisturbed" not in ss.report(pushed, explorer=False).html


def test_what_is_no_result_has_no_document():
    with pytest.raises(ss.ParameterError, match="got int; allowed: a rig or a result"):
        ss.report(3)
    with pytest.raises(ss.ParameterError, match=r"unknown option .fit.; .*allowed: title"):
        ss.report(ss.hopf(OWN_RIG), fit=3)


@pytest.mark.usefixtures("unpainted")
@pytest.mark.parametrize("name", ["steady", "margin", "onset", "response", "event", "ensemble"])
def test_results_without_a_document_of_their_own_show_what_notebooks_show(results, name):
    document = ss.report(results[name], explorer=False).html
    shown, own = result_html(results[name]).replace("<wbr>", ""), getattr(results[name], "rig", None)
    assert (worded(own, shown) if own else shown) in document
    assert words(document)
    assert " um" not in words(document)


FAR = {"velocity": 25.0, "displacement": None}  # sizes that reach beyond the threshold of each kick


@pytest.fixture(scope="module")
def kicked():
    own = OWN_RIG.with_values({"stiffness": 1.2e10, "radiation_damping": 0.0})
    found = [ss.threshold(own, kick, up_to=up_to, precision=1e-3) for kick, up_to in FAR.items()]
    return own, found


@pytest.mark.usefixtures("unpainted")
def test_thresholds_have_documents(kicked):
    own, found = kicked
    text = words(ss.report(Thresholds(own, tuple(found)), explorer=False).html)
    for one in found:
        assert re.sub("um", "µm", str(one).partition(": ")[2].partition(" (size")[0]) in text
    single = words(ss.report(found[0], explorer=False).html)
    assert "a velocity kick up to" in single
    assert "displacement kick" not in single


@pytest.mark.usefixtures("unpainted")
def test_a_threshold_says_in_its_headline_that_all_or_nothing_is_survived(kicked):
    own, found = kicked
    none = ss.threshold(own.with_values({"stiffness": 1e9}), "velocity")
    assert "No kick is survived" in words(ss.report(none, explorer=False).html)
    every = dataclasses.replace(found[0], size=np.inf, bracket=(25.0, np.inf), amount=np.inf)
    told = ss.report(every, explorer=False).html
    amount = format_quantity(every.survived, "m/s", 4)
    assert f"Survives every velocity kick up to {amount}, the largest tried" in words(told)
    undecided = dataclasses.replace(found[0], size=np.nan, bracket=(0.0, np.inf), amount=np.inf)
    assert "Not decided: which kicks are survived" in words(ss.report(undecided, explorer=False).html)


@pytest.mark.usefixtures("unpainted")
def test_basins_have_documents(kicked):
    found = ss.basin(kicked[0], x=np.linspace(-1e-6, 1e-6, 5), v=np.geomspace(3e-7, 3e-6, 5), along="stiffness")
    document = ss.report(found, explorer=False).html
    assert f"{100 * found.share:.3g} % of the starting points return" in words(document)
    assert document.count("<figure") == 2


@pytest.mark.usefixtures("unpainted")
def test_sensitivities_have_documents():
    ranges = {"friction.a": (0.005, 0.009), "slider.stiffness": (1e9, 1e11)}
    found = ss.sensitivity(OWN_RIG, ranges, "critical_stiffness", points=256)
    text = words(ss.report(found, explorer=False).html)
    assert "direct effect a decides most about the critical stiffness" in text
    assert "1 to 100 GPa/m" in text
    assert f"{found.total['critical_stiffness'][0]:.3f}" in text


@pytest.mark.usefixtures("unpainted")
@pytest.mark.slow
@pytest.mark.parametrize("number", range(0, len(FRICTION) * len(CONTACTS), 37))
@pytest.mark.campaign
def test_reports_of_all_kinds_of_rigs_fit(number):
    law, contact = FRICTION[number % len(FRICTION)], CONTACTS[number % len(CONTACTS)]
    own = ss.Slider(friction=law, contact=contact, stiffness=9e9, mass=1e6 * (number % 2), drive=DRIVES[number % 3])
    found = ss.report(own)
    text = words(found.html)
    assert "steady sliding at" in text.lower()
    assert len(found.html.encode()) <= 500_000


@pytest.mark.usefixtures("unpainted")
def test_the_command_writes_a_report(tmp_path):
    ss.write_rig(OWN_RIG, tmp_path / "my rig.toml")
    answered = run("report", tmp_path / "my rig.toml", "-o", tmp_path / "report.html", "--set", "stiffness=90 GPa/m")
    assert answered.returncode == 0, answered.stderr
    text = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "<title>my rig – steadyslip</title>" in text
    assert "Stable: steady sliding" in text
    assert hashlib.sha256((tmp_path / "my rig.toml").read_bytes()).hexdigest() in text
    assert "stiffness = 90000000000.0" in text  # not what the file says
    refused = run("report", tmp_path / "my rig.toml", "-o", tmp_path / "report.pdf")
    assert refused.returncode == 2
    assert ".html" in refused.stderr


@pytest.mark.usefixtures("unpainted")
def test_locked_rigs_have_reports_too():
    text = words(ss.report(rig(contact=ss.laws.InclinedSpring(preload=SIGMA, angle=-1.0))).html)
    assert "No steady sliding at 1 µm/s" in text


@pytest.mark.usefixtures("unpainted")
def test_records_of_hostile_names_are_text():
    record = lab.record(lab.rig(), lab.STEP)
    hostile = dataclasses.replace(record, source="<script>alert(1)</script>")
    shown = hostile._repr_html_()
    assert "<script>alert" not in shown
    assert "&lt;script&gt;alert" in shown
