"""What pages are made of: words as in print, tables, formulas."""

import re

import pytest
import sympy as sp

import steadyslip as ss
from read_pages import Balanced, words
from rigs_of_theory import rate_state, rig
from steadyslip.core.expressions import latex
from steadyslip.reports.brief import text_html
from steadyslip.reports.elements import html_text, math, paragraph, table

# -- set as in print


@pytest.mark.parametrize(
    ("text", "printed"),
    [("5 um", "5 µm"), ("3 um/s", "3 µm/s"), ("9 kg/m^2", "9 kg/m²"), ("sum of 2", "sum of 2"), ("-45 deg", "−45 deg"),
     ("1e-05", "1 × 10⁻⁵"), ("-1.001e+05 1/s", "−1.001 × 10⁵ 1/s"), ("v=1e-05", "v=1e-05"),
     ("run-1e-05.csv", "run-1e-05.csv"), ("6.928 us", "6.928 µs"), ("5 uN", "5 µN"), ("menus", "menus"),
     ("a-b", "a-b"), ("x 59", "× 59"), ("a -> b", "a → b"), ("<b>", "&lt;b&gt;"), ("inf", "∞")],
)  # fmt: skip
def test_words_are_set_as_in_print(text, printed):
    assert html_text(text).replace("\u00a0", " ") == printed


def test_a_unit_stays_in_the_line_of_its_number():
    assert html_text("from 5 MPa to 3 of 4") == "from 5\u00a0MPa to 3\u00a0of 4"


def test_lines_of_names_and_words_become_tables():
    found = text_html("Head\n  velocity      1 um/s to 2 um/s\n                going on\nlast  a  b\nThe end")
    assert words(found).strip() == "Head velocity 1 µm/s to 2 µm/s going on last a b The end"
    assert found.count("<tr>") == 2
    assert found.count("<p>") == 2


def test_a_sentence_over_two_lines_is_one_paragraph():
    text = (
        "A head\nthe stiffness is so many times the critical stiffness, above which sliding is\nstable, it seems.\nmore"
    )
    assert text_html(text).count("<p>") == 3
    assert "above which sliding is stable, it seems." in text_html(text)
    long = 12 * "words "
    assert text_html(f"  {long}\n  checked: all\n  {long}\nat the rig").count("<p>") == 4


def test_formulas_need_no_script_and_no_entity():
    own = rig(friction=rate_state(evolution=ss.laws.Aging()), radiation_damping=1e5, stiffness=6e9)
    text = math(ss.formula(own))
    Balanced(text)
    assert not re.search("&[a-zA-Z]", text)
    assert text.startswith('<math xmlns="http://www.w3.org/1998/Math/MathML" display="block"')


def test_long_names_may_go_on_in_the_next_line():
    text = table([("friction.normal_memory.alpha", "a"), ("0.0145", "b")])
    assert "friction.<wbr>normal_<wbr>memory.<wbr>alpha" in text
    assert "0.0145" in text


def test_cells_are_words_unless_they_say_otherwise():
    assert "&lt;i&gt;" in table([("<i>", "b")])


@pytest.mark.parametrize(
    ("text", "unbroken"),
    [
        ("above 272.2 mN m s/rad. Of", "272.2 mN m s/rad."),
        ("at 11676.36 ± 0.013 s, then", "11676.36 ± 0.013 s,"),
        ("40 kg cm^2 and", "40 kg cm²"), ("8 N s/mm or", "8 N s/mm"), ("after 7.37e-06 m", "7.37 × 10⁻⁶ m"),
    ],
)  # fmt: skip
def test_no_line_breaks_within_a_value(text, unbroken):
    """Nor inside its unit, nor around its error."""
    assert unbroken.replace(" ", "\u00a0") in html_text(text)
    assert "5\u00a0s mass m" in html_text("after 5 s mass m")
    assert html_text("7.9e-06. Then").endswith("10⁻⁶. Then")


def test_formulas_look_alike_in_every_font():
    """No root sign, whose bar some fonts lack, no exponent of an exponent, and room before a function."""
    a, b, v = sp.symbols("a b v", positive=True)
    text = math(a * sp.sqrt(4 * v**2 + sp.exp(-2 * b / a)) + a * b * sp.asinh(v))
    assert "msqrt" not in text
    assert "<mi>exp</mi>" in text
    assert "<mo>/</mo>" in text
    assert text.count("<mfrac>") == 0  # within exp fractions stand on the line
    assert '<mspace width=".2em"/><mrow><mi>arcsinh</mi>' in text


def test_numbers_of_many_zeros_are_powers_of_ten():
    """As in the Stribeck curve with an exponent, whose slope at rest is kept finite."""
    tiny, x = sp.Rational(1, 10**24), sp.Symbol("x")
    for expression in (x**2 + tiny, (x + tiny) ** sp.Symbol("n"), x * tiny, sp.exp(x * 10**12)):
        assert "00000" not in math(expression)
        assert "00000" not in latex(expression)
    assert "<msup><mn>10</mn><mn>-24</mn></msup>" in math(x**2 + tiny)
    assert latex(x**2 + tiny) == "x^{2} + 10^{-24}"
    assert latex(x / 100) == sp.latex(x / 100)


def test_brackets_are_as_high_as_a_letter_or_the_fraction_that_they_hold():
    """Browsers made those of a(b + c(d + e)) higher with each, and twice as high as a fraction's larger half."""
    a, b, c, d = sp.symbols("a b c d")
    flat, divided = math(a * (b + c * (a + d))), math(a * (b / c + d * (a + b)))
    assert flat.count('<mo stretchy="false">(</mo>') == flat.count('<mo stretchy="false">)</mo>') == 2
    assert "symmetric" not in flat
    assert [divided.count(f'<mo {kind}="false">(</mo>') for kind in ("symmetric", "stretchy")] == [1, 1]
    assert "<mo>(" not in flat + divided


def test_tables_too_wide_for_a_telephone_become_blocks():
    """The third column of a fit was cut there; a table of short words keeps its columns."""
    rows = [("evolution effect b", "−0.005294 ± 0.00067", "0.01346 to 0.01564")]
    assert 'class="stacks"' in table(rows, ("parameter", "value", "95 %"))
    assert 'class="stacks"' not in table([("evolution effect b", "0.0147", "0.0135")], ("parameter", "value", "edge"))


def test_no_line_breaks_behind_the_slash_of_a_unit():
    assert (
        paragraph("from 0.6 N/um to 2 kN s/m, a/b")
        == "<p>from 0.6\u00a0N/\u2060µm to 2\u00a0kN\u00a0s/\u2060m, a/b</p>"
    )
