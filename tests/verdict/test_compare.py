"""Comparison of two rigs: parts agree with closed forms and with all orders by hand."""

import dataclasses
import itertools
import json
import math
import re
from pathlib import Path

import numpy as np
import pytest

import steadyslip as ss
from command import run
from rigs_of_theory import rate_state, rig
from steadyslip.core.tolerances import read_tolerance
from steadyslip.files.specifications.tolerance_tables import rig_and_tolerances
from steadyslip.verdict import Tolerances, between
from steadyslip.verdict.compare import compare_files
from toleranced import AXIS

TILTED = rig(
    friction=rate_state(normal_memory=ss.laws.LinkerDieterich(alpha=0.5)),
    contact=ss.laws.InclinedSpring(preload=5e6, angle=-0.3), mass=1e3,
)  # fmt: skip
EXACT = 1e-9  # relative: sums of some ten rounded numbers


def parts(found):
    return {one.parameter: one.part for one in found.differences}


def test_nothing_differs_from_itself():
    for one in (rig(), ss.read_rig("examples/machines/feed-axis.toml")):
        found = ss.compare_rigs(one, one)
        assert found.differences == ()
        assert "same equations" in str(found)


@pytest.mark.parametrize(
    ("second", "words"),
    [
        ({}, "The rigs have the same equations and numbers"),
        (None, "The rigs have the same equations, numbers and tolerances"),
        ({"friction.a": "5 %", "friction.b": "2 % (normal)"}, "other tolerances of friction.b"),
        ({"friction.a": "5 %"}, "other tolerances of friction.b"),
        (
            Tolerances(
                {"friction.a": read_tolerance("5 %"), "friction.b": read_tolerance("2 %")},
                (("friction.b", "friction.a", 0.5),),
            ),
            "other tolerances of friction.a with friction.b",
        ),
    ],
)
def test_rigs_that_are_alike_are_told_whether_their_tolerances_are(second, words):
    first = {} if second == {} else {"friction.a": "5 %", "friction.b": "2 %"}
    found = ss.compare_rigs(rig(), rig(), tolerances=(first or None, (first if second is None else second) or None))
    assert str(found).splitlines()[-1].endswith(words)


def test_deviations_in_a_unit_are_the_same_as_shares_and_in_totals_of_a_contact(tmp_path):
    """12 ± 2.4 N/um is 12 N/um ± 20 %; a contact twice as large enters no equation of forces."""
    first, second = tmp_path / "a.toml", tmp_path / "b.toml"
    first.write_text(AXIS)
    second.write_text(AXIS.replace('"12 ± 20 % N/um"', '"12 ± 2.4 N/um"').replace("200 cm^2", "400 cm^2"))
    assert second.read_text() != AXIS
    assert str(compare_files(first, second)).splitlines()[-1] == (
        "The rigs have the same equations, numbers and tolerances"
    )


def test_parts_of_a_product_are_its_factors():
    """Quasistatic, constant σ: k/k_cr = k d_c/(σ(b − a)), so the parts of σ, k and d_c are their ratios."""
    a = rig()
    b = a.with_values({"stiffness": 3 * a.value("stiffness"), "preload": 8e6, "d_c": 4e-6})
    found = ss.compare_rigs(a, b)
    assert found.measure == "safety"
    wanted = {"slider.stiffness": 3, "contact.preload": 5 / 8, "friction.d_c": 4e-6 / a.value("d_c")}
    assert parts(found) == pytest.approx(wanted, rel=EXACT)
    assert sum(one.share for one in found.differences) == pytest.approx(1, rel=EXACT)


def orders_by_hand(a, b, names, measure):
    """Mean step of each value over all orders, from rigs that are judged one by one."""
    total = dict.fromkeys(names, 0.0)
    for order in itertools.permutations(names):
        now = a
        for name in order:
            after = now.with_values({name: b.value(name)})
            total[name] += measure(after) - measure(now)
            now = after
    return {name: value / math.factorial(len(names)) for name, value in total.items()}


def test_parts_are_means_over_all_orders():
    a = TILTED
    b = a.with_values({"angle": 0.3, "friction.a": 0.011, "alpha": 0.2, "mass": 4e4})
    found = ss.compare_rigs(a, b)
    by_hand = orders_by_hand(a, b, list(parts(found)), lambda one: math.log(ss.safety_factor(one)))
    assert found.measure == "safety"
    assert {name: math.log(one) for name, one in parts(found).items()} == pytest.approx(by_hand, rel=1e-7)


def test_parts_of_a_machine_are_of_the_growth_rate():
    a = ss.read_rig("examples/machines/feed-axis.toml")
    b = a.with_values({"table.mass": 500.0, "screw.stiffness": 3e7, "guide.friction.a": 0.02})
    found = ss.compare_rigs(a, b)
    assert found.measure == "growth"
    assert parts(found) == pytest.approx(orders_by_hand(a, b, list(parts(found)), ss.growth_rate), rel=1e-6, abs=1e-9)
    assert sum(parts(found).values()) == pytest.approx(ss.growth_rate(b) - ss.growth_rate(a), rel=1e-9)


def test_exchanging_the_rigs_inverts_the_parts():
    a = TILTED
    b = a.with_values({"angle": 0.2, "friction.b": 0.02})
    there, back = parts(ss.compare_rigs(a, b)), parts(ss.compare_rigs(b, a))
    assert back == pytest.approx({name: 1 / one for name, one in there.items()}, rel=EXACT)


def test_drawn_orders_agree_with_all(monkeypatch):
    a = TILTED
    b = a.with_values({"angle": 0.3, "friction.a": 0.011, "alpha": 0.2, "mass": 4e4, "d_c": 3e-6})
    exact = ss.compare_rigs(a, b)
    monkeypatch.setattr(between, "MOST_EXACT", 2)
    drawn = ss.compare_rigs(a, b)
    size = sum(abs(math.log(one)) for one in parts(exact).values())
    for name, one in parts(exact).items():
        assert abs(math.log(parts(drawn)[name] / one)) < 0.05 * size  # drawn orders: error of some percent
    assert math.prod(parts(drawn).values()) == pytest.approx(math.prod(parts(exact).values()), rel=EXACT)


def test_keys_that_exclude_each_other_are_one_difference_and_laws_are_whole():
    a = rig(contact=ss.laws.InclinedSpring(preload=5e6, angle=-0.3))
    b = ss.Slider(
        friction=rate_state(evolution=ss.laws.Aging()), contact=a.contact, axial_stiffness=2e10, drive=a.drive
    )
    found = ss.compare_rigs(a, b)
    assert set(parts(found)) == {"slider.stiffness + axial_stiffness", "friction.evolution"}
    assert parts(found)["friction.evolution"] == pytest.approx(1, rel=EXACT)  # slip and aging share one linearisation


def test_a_contact_area_enters_no_equation():
    """Ten times the area with the same forces is the same rig."""
    a = ss.Slider(friction=rate_state(), contact=ss.laws.ConstantNormalStress(preload=5e6), stiffness=1e9, area=1e-3,
                  drive=ss.machine.SteadyDrive(1e-6))  # fmt: skip
    b = a.with_values({"area": 1e-2, "preload": 5e5, "stiffness": 1e8})
    assert ss.compare_rigs(a, b).differences == ()
    assert ss.compare_rigs(a, a.with_values({"area": 1e-2})).differences == ()  # the same stresses


def test_a_rig_between_that_locks_up_leaves_verdicts_without_parts():
    a = rig(contact=ss.laws.InclinedSpring(preload=5e6, angle=-0.9))
    b = a.with_values({"angle": -0.1, "mu_ref": 1.2})
    found = ss.compare_rigs(a, b)
    assert found.measure == ""
    assert all(math.isnan(one.part) for one in found.differences)
    with_it = {one.parameter: one.first_with for one in found.differences}
    assert with_it["friction.mu_ref"] == "no steady sliding"


def test_verdicts_with_one_value_of_the_other_are_those_of_analyze():
    a = TILTED
    b = a.with_values({"stiffness": 5e10, "friction.b": 0.0155, "mass": 4e4})
    for one in ss.compare_rigs(a, b).differences:
        assert one.first_with == ss.stability(a.with_values({one.parameter: b.value(one.parameter)}))
        assert one.second_with == ss.stability(b.with_values({one.parameter: a.value(one.parameter)}))


def test_files_are_compared_with_their_tolerances(tmp_path):
    first, second = tmp_path / "a.toml", tmp_path / "b.toml"
    first.write_text(AXIS)
    second.write_text(re.sub(r" (±|\+-|\+/-) 20 %", "", AXIS).replace('"12 N/um"', '"25 N/um"'))
    page = tmp_path / "page.html"
    done = run("compare", first, second, "-o", page)
    assert done.returncode == 0
    assert "slider.stiffness  12 N/um -> 25 N/um" in done.stdout
    assert "a becomes stable with that of b in slider.stiffness" in done.stdout
    assert re.search(r"stable in +24\.\d+ ± 0\.\d+ % +\w", done.stdout)
    assert "a becomes stable with that of b in stiffness k" in page.read_text()


def test_choices_are_told_in_plain_words():
    done = run("compare", "examples/slow-axis.toml", "examples/inclined-spring.toml")
    assert "friction.regularised      yes -> no" in done.stdout
    assert not re.search(r"True|False| $", done.stdout, re.MULTILINE)


def test_json_has_both_rigs_and_their_differences():
    done = run("compare", "examples/slow-axis.toml", "examples/slow-axis.toml", "--set", "drive.kp=2 N/um", "--json")
    data = json.loads(done.stdout)
    assert data["differences"] == []
    assert [one["stable"] for one in data["rigs"]] == [True, True]


def test_a_slider_beside_a_machine_is_refused():
    with pytest.raises(ss.ParameterError, match="machine of one body"):
        ss.compare_rigs(rig(), ss.read_rig("examples/machines/feed-axis.toml"))
    done = run("compare", "examples/slow-axis.toml", "examples/machines/feed-axis.toml")
    assert done.returncode == 2
    assert "machine of one body" in done.stderr


def test_a_held_axis_is_named_with_what_to_do():
    held = ss.read_rig("examples/hunting-axis.toml")
    with pytest.raises(ss.ParameterError, match=r"^second: drive.velocity is 0, .* a speed, .* `steadyslip hunt`"):
        ss.compare_rigs(ss.read_rig("examples/slow-axis.toml"), held)
    done = run("compare", "examples/slow-axis.toml", "examples/hunting-axis.toml")
    assert done.returncode == 2
    assert done.stderr.startswith("error: examples/hunting-axis.toml: drive.velocity is 0")


def test_the_oscillation_is_that_of_the_mode_whose_growth_rate_is_told():
    """A carriage that drifts away at 561 1/s was told the period of a mode that dies out."""
    axis, chance, kinds = ss.rig_from_text(AXIS), np.random.default_rng(33), set()
    for many in 10.0 ** chance.uniform(-3, 3, (10, 3)):
        names = ("slider.stiffness", "slider.mass", "drive.velocity")
        other = axis.with_values({name: axis.value(name) * x for name, x in zip(names, many, strict=True)})
        found = ss.compare_rigs(axis, other)
        row = {label: second for label, _, second in found.side_by_side()}
        verdict = found.verdicts[1]
        leading = verdict.eigenvalues[0]
        period = found.to_dict()["rigs"][1]["period"]
        assert leading.real == pytest.approx(verdict.growth_rate)
        kinds.add(bool(leading.imag))
        if not leading.imag:
            assert (period, row.get("oscillation", "none")) == (None, "none")
            continue
        assert period == pytest.approx(2 * math.pi / abs(leading.imag))
        ratio = float(row["oscillation"].rpartition(" ")[2])
        assert ratio == pytest.approx(-leading.real / abs(leading), rel=6e-3)
    assert kinds == {True, False}


def test_what_stands_for_a_value_that_is_not_given_is_told():
    """The exponent of a Stribeck curve is 2 without one; contacts are told by their friction, ends by their names."""
    axis = ss.rig_from_text(AXIS.replace("stribeck_exponent = 0.8", ""))
    found = ss.compare_rigs(axis, axis.with_values({"stribeck_exponent": 0.8}))
    assert [(one.first, one.second) for one in found.differences] == [("2", "0.8")]
    first = ss.read_rig("examples/machines/feed-axis.toml")
    contact = next(iter(first.contacts))
    contacts = {**first.contacts, "wiper": first.contacts[contact]}
    told = {one.parameter: (one.first, one.second) for one in
            ss.compare_rigs(first, dataclasses.replace(first, contacts=contacts)).differences}  # fmt: skip
    assert told["contacts.wiper"] == ("none", f"{first.contacts[contact].friction.name} friction")


def test_orders_and_subsets_are_complete():
    assert {tuple(row) for row in between._all_subsets(3)} == set(itertools.product((False, True), repeat=3))
    rows = between._prefixes(np.array([[2, 0, 1]]))
    assert rows.tolist() == [[False] * 3, [False, False, True], [True, False, True], [True] * 3]


def test_items_of_lists_are_told_by_their_values():
    """The states of a friction law that the other lacks: keys and values with units, no Python."""
    one, two = (ss.read_rig(f"examples/{name}.toml") for name in ("inclined-spring", "double-direct-shear"))
    text = str(ss.compare_rigs(one, two))
    assert re.search(r"friction\.states +none -> b 0\.006, d_c 4 um; b 0\.002, d_c 40 um", text)


def test_one_file_that_is_held_is_refused_once(tmp_path):
    """Compared with itself it has one problem."""
    path = tmp_path / "held.toml"
    path.write_text(
        (Path(__file__).parents[2] / "examples/hunting-axis.toml").read_text(encoding="utf-8"), encoding="utf-8"
    )
    with pytest.raises(ss.ParameterError, match=r"drive\.velocity is 0, but verdicts") as raised:
        compare_files(path, path)
    assert len(raised.value.problems) == 1


def unknown(**ends):
    """Intervals of the friction law's parameters as of a file."""
    return Tolerances(unknown={f"friction.{name}": own for name, own in ends.items()})


def test_what_is_not_known_of_both_alike_is_no_difference():
    """k/k_cr = k d_c/(σ(b − a)): a ratio of stiffnesses is the same whatever b is."""
    a = rig()
    b = a.with_values({"stiffness": 3 * a.value("stiffness"), "friction.b": 1.01 * a.value("friction.b")})
    ends = (a.value("friction.b"), 1.2 * a.value("friction.b"))
    found = ss.compare_rigs(a, b, tolerances=(unknown(b=ends), unknown(b=ends)))
    (one,) = found.differences
    assert (one.parameter, found.measure) == ("slider.stiffness", "safety")
    assert (*one.parts, one.part) == pytest.approx((3, 3, 3), rel=EXACT)
    same = ss.compare_rigs(a, a, tolerances=(unknown(b=ends),) * 2)
    assert same.differences == ()
    assert str(same).endswith("The rigs have the same equations, numbers and intervals of what is not known")


@pytest.mark.parametrize("swapped", [False, True])
def test_what_is_not_known_of_one_is_a_difference_over_its_interval(swapped):
    """Its part is the ratio of b − a, least at one end of the interval and largest at the other."""
    a = rig()
    low, b, direct = a.value("friction.b"), 1.1 * a.value("friction.b"), a.value("friction.a")
    known, ends = a.with_values({"friction.b": b}), (low, 1.3 * a.value("friction.b"))
    rigs, given = (a, known), (unknown(b=ends), None)
    found = ss.compare_rigs(*(rigs[::-1] if swapped else rigs), tolerances=given[::-1] if swapped else given)
    (one,) = found.differences
    ratios = sorted((end - direct) / (b - direct) for end in ends)
    assert one.parts == pytest.approx([1 / ratios[1], 1 / ratios[0]] if swapped else ratios, rel=EXACT)
    assert "somewhere in " in (one.second if swapped else one.first)
    assert f"x {one.parts[0]:.3g} to {one.parts[1]:.3g} (100 %)" in str(found)


def test_verdicts_hold_for_all_that_is_not_known_or_are_not_told():
    """Of two intervals of b, one on both sides of the edge; verdicts with one value of the other at all values."""
    a, direct = rig(), rig().value("friction.a")
    edge = direct + a.stiffness * a.value("friction.d_c") / a.value("contact.preload")  # b at which k = k_cr
    soft, firm = (edge * 1.01, edge * 1.05), (direct * 1.01, edge * 0.99)
    both = (direct * 1.01, edge * 1.05)
    found = ss.compare_rigs(a, a, tolerances=(unknown(b=soft), unknown(b=firm)), names=("soft", "firm"))
    assert found.alike == ("unstable", "stable")
    assert "soft becomes stable with that of firm in friction.b" in str(found)
    found = ss.compare_rigs(a, a, tolerances=(unknown(b=soft), unknown(b=both)), names=("soft", "both"))
    assert found.alike == ("unstable", "not at every value")
    assert str(found).endswith("whether both is stable depends on what is not known of it, friction.b")
    assert found.differences[0].second_with == "unstable"
    assert found.differences[0].first_with == "not at every value"


def test_files_are_compared_with_what_is_not_known(tmp_path):
    """Chances are the least of rigs at five values; the page has the rows of the text."""
    paths = [tmp_path / "a.toml", tmp_path / "b.toml"]
    interval = '[unknown]\nfriction.bristle_damping = ["0 s/m", "3 s/m"]\n'
    for path, stiffness in zip(paths, ("12", "25"), strict=True):
        path.write_text(f"{AXIS.replace('12 ±', f'{stiffness} ±')}{interval}")
    data = json.loads(run("compare", *paths, "--json").stdout)
    assert [one["parameter"] for one in data["differences"]] == ["slider.stiffness"]
    own, within = rig_and_tolerances(paths[0])
    rigs = [own.with_values({"friction.bristle_damping": value}) for value in np.linspace(0, 3, 5)]
    least = min(ss.tolerate(one, within).share for one in rigs)
    first, second = data["rigs"]
    assert first["least_chance"][0] == least < second["least_chance"][0]
    assert first["unknown"]["parameters"]["friction.bristle_damping"]["interval"] == [0.0, 3.0]
    for path in paths:
        path.write_text(re.sub(r" (±|\+-|\+/-) 20 %", "", path.read_text()).replace("2.56..3.84 kN", "3.2 kN"))
    text = run("compare", *paths, "-o", tmp_path / "page.html").stdout
    assert re.search(r"friction\.bristle_damping +stable .* in 0 s/m .* to 3 s/m", text)
    assert "with the file's values of what is not known" in text
    page = (tmp_path / "page.html").read_text()
    assert "over values of what is not known" in page
    assert "bristle damping s₁</th><td>stable nowhere in 0" in page
