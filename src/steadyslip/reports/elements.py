"""HTML elements: escaped text with proper typography, tables, formulas, figures."""

from __future__ import annotations

import html
import re
from collections.abc import Iterable, Sequence
from itertools import zip_longest
from typing import Any
from xml.etree import ElementTree

import sympy as sp
from sympy.printing.mathml import MathMLPresentationPrinter

from steadyslip.core.expressions import LONG_POWER, asinh_exp, power_of_ten
from steadyslip.core.format import typeset_powers

_REPLACEMENTS = (
    (r"(?<![A-Za-z])u(?=(?:m|s|N|Pa|rad)(?![A-Za-z]))", "µ"), (r"\^2\b", "²"), (r"\^3\b", "³"), (r"->", "→"),
    (r"^x (?=-?\d)", "× "), (r"(?<![\w.])-(?=\d)", "−"), (r"\binf\b", "∞"),
)  # fmt: skip
_SUBSCRIPT = re.compile(r"(?<![\w.])(?!^\w+$)([A-Za-zΑ-ω])_(\w+)(?!\.?\w)")  # not in dotted names, or a key alone
_NUMBER = re.compile(r"(?<=\d) (?=[^\s\d(])|(?<=[±×]) (?=[\d∞])")  # space after a number
_POWER = re.compile(r"(?<=10)([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+) (?=[A-Za-zµ])")  # space between a power of ten and its unit
_SLASH = re.compile(r"(\d\u00a0(?:[^\s/]+\u00a0)?[^\s/]+/)(?=\S)")  # slash within a unit after its number: 5 N/µm
_UNIT = r"[mkMGTnµ]?(?:N|m|s|g|Pa|J|W|rad)|[cd]m|deg|rev"
_WITHIN = re.compile(
    rf"(?<=\d\u00a0)(?:{_UNIT})[²³]?(?: (?:{_UNIT})[²³]?(?![\w.]))+"
)  # unit of several words after its number
_LONG = 30  # a word with more characters, such as a hash, may be broken anywhere
_NARROW = 3  # largest number of columns that fit on a telephone's screen (by trial, at 360 px)
_NARROW_LINE = 44  # largest number of letters of 13 px in a line of a telephone's screen (358 px)
_LINE = 90  # largest number of characters in a line of a formula (by trial, for the width of a page)
_PIECE = 30  # largest number of characters in an unbreakable part of a formula: 300 of the 358 px of a telephone
_ZERO = '<mrow><mo form="infix">=</mo><mn>0</mn></mrow>'
_ENTITIES = {"&InvisibleTimes;": "\u2062", "&dd;": "d", "&ExponentialE;": "e", "<mo>-</mo>": "<mo>−</mo>"}
STYLE = """
.steadyslip-told { font: 15px/1.5 system-ui, "DejaVu Sans", sans-serif; color: #1b2430; }
.steadyslip-told h1 { font-size: 25px; line-height: 1.25; margin: 2px 0 6px; }
.steadyslip-told h2 { font-size: 18px; margin: 26px 0 6px; break-after: avoid; }
.steadyslip-told h3 { font-size: 15px; margin: 14px 0 4px; break-after: avoid; }
.steadyslip-told table { border-collapse: collapse; margin: 6px 0; }
.steadyslip-told.steadyslip-told td, .steadyslip-told.steadyslip-told th { padding: 3px 14px 3px 0;
  border-bottom: 1px solid #d5dae1; text-align: left; vertical-align: top;
  font-variant-numeric: tabular-nums; background: none; }
.steadyslip-told th { font-weight: 650; }
.steadyslip-told thead th { min-width: 4.5em; }
.steadyslip-told .n { white-space: nowrap; }
.steadyslip-told h1, .steadyslip-told p, .steadyslip-told td { overflow-wrap: break-word; }
.steadyslip-told td.l { overflow-wrap: anywhere; }
.steadyslip-told tr { break-inside: avoid; }
.steadyslip-told caption, .steadyslip-told thead { break-inside: avoid; break-after: avoid; }
.steadyslip-told tbody tr:nth-child(-n+2), .steadyslip-told tbody tr:nth-last-child(-n+2) { break-before: avoid; }
.steadyslip-told table:not(:has(tbody tr:nth-child(9))) { break-inside: avoid; }
.steadyslip-told p:has(+ .formula, + figure, + .wide) { break-after: avoid; }
.steadyslip-told p { orphans: 3; widows: 3; }
.steadyslip-told .wide { overflow-x: auto; max-width: 100%; }
.steadyslip-told figure { margin: 10px 0; break-inside: avoid; }
.steadyslip-told figure svg, .steadyslip-told figure img { max-width: 100%; height: auto; }
.steadyslip-told .pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(320px, 100%), 1fr));
  gap: 0 18px; align-items: start; }
.steadyslip-told .pair > figure { max-width: 430px; }
.steadyslip-told .pair svg, .steadyslip-told .pair img { width: 100% !important; }
.steadyslip-told figcaption, .steadyslip-told .small { color: #566173; font-size: 13px; }
.steadyslip-told .warning { background: #fff3d6; border-left: 5px solid #d97f12; padding: 6px 12px; margin: 8px 0; }
.steadyslip-told pre { background: #f4f4f1; padding: 10px; overflow: auto; font-size: 13px; line-height: 1.4;
  white-space: pre-wrap; overflow-wrap: anywhere; }
.steadyslip-told sub { line-height: 0; }
.steadyslip-told math { font-size: 17px; white-space: nowrap; }
@media screen and (max-width: 600px) {
  .steadyslip-told .formula math { font-size: 14px; }
  .steadyslip-told .formula mfrac { font-size: 12px; }
  .steadyslip-told .formula :is(math, mtd) { display: flex; flex-wrap: wrap; align-items: center;
    row-gap: 4px; }
  .steadyslip-told .formula math { justify-content: safe center; }
  .steadyslip-told .formula :is(mtable, mtr) { display: block; min-width: 0; }
}
@media print { .steadyslip-told .formula math { font-size: 12px; } }
.steadyslip-told .narrow { display: none; }
@media screen and (max-width: 600px) {
  .steadyslip-told .broad { display: none; }
  .steadyslip-told .narrow { display: block; }
  .steadyslip-told .narrow > svg { width: 100% !important; }
  .steadyslip-told figure:not(.pair > figure):has(> :is(svg, img)) { overflow-x: auto; }
  .steadyslip-told figure:not(.pair > figure) > :is(svg, img).large { max-width: none; width: 580px !important; }
  .steadyslip-told table { font-size: 13px; }
  .steadyslip-told.steadyslip-told :is(th, td) { padding-right: 8px; }
  .steadyslip-told .stacks thead { position: absolute; clip-path: inset(50%); }
  .steadyslip-told .stacks tr { display: block; border-bottom: 1px solid #d5dae1; padding: 4px 0; }
  .steadyslip-told.steadyslip-told .stacks :is(th, td) { display: inline-block; border: 0; padding: 0 14px 0 0; }
  .steadyslip-told.steadyslip-told .stacks :is(th:first-child, td:first-child) { display: block; }
  .steadyslip-told .stacks td[data-head]::before { content: attr(data-head) " "; color: #566173; font-size: 13px; }
}
@supports not (-moz-appearance: none) { .steadyslip-told msub > :last-child { transform: translateY(.18em); } }
.steadyslip-told .formula { overflow-x: auto; overflow-y: hidden; margin: 6px 0; padding: 4px 0 10px; }
"""  # style sheet for elements inside one of class "steadyslip-told"


def typographic(text: Any) -> str:
    """Text with print typography: µm, ², →, minus sign, × 10⁻³."""
    words = str(text)
    for pattern, better in _REPLACEMENTS:
        words = re.sub(pattern, better, words)
    return typeset_powers(words)


def why(refused: Exception) -> str:
    """Reason given by an error, without advice on function calls, which readers of a document cannot make."""
    return re.split(r"; (?:offered are|ask `|stable_stiffness)", str(refused))[0]


def html_text(text: Any, prose: bool = False) -> str:
    """Text with print typography, escaped for HTML; subscripts such as that of d_c are set below the line.

    No line breaks between a number and its unit or error, nor within a unit; in `prose` not after its slash either.
    """
    words = _WITHIN.sub(lambda unit: unit[0].replace(" ", "\u00a0"), _NUMBER.sub("\u00a0", typographic(text)))
    words = _POWER.sub("\\1\u00a0", words)
    if prose:
        words = _SLASH.sub("\\1\u2060", words)
    return _SUBSCRIPT.sub(r"\1<sub>\2</sub>", html.escape(words, quote=True))


def with_subscripts(text: str) -> str:
    """Text in which a letter followed by a digit, such as B0, is written with a subscript, B_0.

    >>> with_subscripts("eq. 1: σ = σ0 - B0 T of B819")
    'eq. 1: σ = σ_0 - B_0 T of B819'
    """
    return re.sub(r"(?<![\w.])([^\W\d_])(\d)(?![\w.])", r"\1_\2", text)


def paragraph(text: str, kind: str = "") -> str:
    """HTML paragraph of plain text, with an optional CSS class."""
    return f"<p{f' class={kind!r}' if kind else ''}>{html_text(text, prose=True)}</p>"


def heading(text: str, level: int = 2) -> str:
    """HTML heading of plain text."""
    return f"<h{level}>{html_text(text)}</h{level}>"


def table(rows: Iterable[Sequence[Any]], head: Sequence[str] = (), left: bool = True, caption: str = "") -> str:
    """HTML table; `Markup` cells are kept, others escaped. With `left` the first cell of each row is a row header.

    A document's style sheet numbers tables with a caption. On a narrow screen the rows of tables with more than
    `_NARROW` columns, or wider than `_NARROW_LINE`, become blocks, with the name of its column before each cell.
    """
    rows = list(rows)
    above = f"<caption>{html_text(caption)}</caption>" if caption else ""
    top = f"<thead><tr>{''.join(f'<th scope=col>{html_text(cell)}</th>' for cell in head)}</tr></thead>" if head else ""
    stacked = len(head) > _NARROW or (bool(head) and _least_width(rows) > _NARROW_LINE)
    names = [f' data-head="{html_text(cell)}"' if cell else "" for cell in head[1:]] if stacked else []
    lines = []
    for row in rows:
        first, *rest = [cell if isinstance(cell, Markup) else html_text(cell) for cell in row]
        side = f"<th scope=row>{_breakable(first)}</th>" if left else f"<td>{first}</td>"
        cells = (
            f"<td{_width_class(cell)}{name if cell else ''}>{cell}</td>"
            for cell, name in zip_longest(rest, names[: len(rest)], fillvalue="")
        )
        lines.append(f"<tr>{side}{''.join(cells)}</tr>")
    kind = ' class="stacks"' if stacked else ""
    return (
        f'<div class="wide" tabindex="0"><table{kind}>{above}{top}<tbody>{"".join(lines)}</tbody></table></div>'
        if lines
        else ""
    )


def _least_width(rows: Sequence[Sequence[Any]]) -> int:
    """Minimum width of a table in letters: longest word of each column, plus gaps; `Markup` cells are ignored."""
    columns = zip_longest(*rows, fillvalue="")
    longest = [
        max((len(word) for cell in column if not isinstance(cell, Markup) for word in _words(cell)), default=0)
        for column in columns
    ]
    return sum(longest) + max(len(longest) - 1, 0)


def _words(cell: Any) -> list[str]:
    """Parts of a cell's text between which a line may be broken."""
    text = _NUMBER.sub("\u00a0", typographic(cell))
    return [text] if _width_class(text) == " class=n" else text.split(" ")


def _breakable(name: str) -> str:
    """Dotted name with line-break opportunities after dots and underscores; other text unchanged."""
    return re.sub(r"(?<=[.])(?=\w)|(?<=_)(?=\w)", "<wbr>", name) if re.fullmatch(r"[A-Za-z]\w*(\.\w+)+", name) else name


def _width_class(cell: str) -> str:
    """HTML class attribute of a cell: short cells (value with unit) stay on one line, long words break anywhere."""
    if max(map(len, cell.split()), default=0) > _LONG and "<" not in cell:
        return " class=l"
    return " class=n" if len(cell) <= 20 and re.search("[ \u00a0]", cell) else ""


class Markup(str):
    """Text that is HTML already and must not be escaped."""


def math(expression: Any, display: bool = True) -> Markup:
    """MathML of a SymPy expression, which browsers display without extra fonts or scripts."""
    return _mathml(_presented(expression), display)


def equation(one: sp.Eq) -> str:
    """HTML of a displayed equation; long sums are broken into lines, since paper cannot be scrolled.

    Each term of a sum is an element of its own, so that narrow screens can break lines between terms.
    """
    left, right = one.args
    side, begin, end = (left, "", _ZERO) if right == 0 else (right, f"{_presented(left)}<mo>=</mo>", "")
    lines = [[_presented(term) for term in terms] for terms in _lines(side.as_ordered_terms())]
    pieces = [
        [piece for k, text in enumerate(line) for piece in _term(text, not (n or k))] for n, line in enumerate(lines)
    ]
    whole = [row for line in pieces for row in _rows(line)]
    if len(whole) == 1:
        begin = f"<mrow>{begin}</mrow>" if begin else ""
        return f'<div class="formula" tabindex="0">{_mathml(begin + whole[0] + end, True)}</div>'
    before, after = [begin, *("" for _ in whole[1:])], [*("" for _ in whole[1:]), end]
    rows = (
        f'<mtr><mtd style="text-align:right">{a}</mtd><mtd style="text-align:left">{text}{c}</mtd></mtr>'
        for a, text, c in zip(before, whole, after, strict=True)
    )
    return f'<div class="formula" tabindex="0">{_mathml("<mtable>" + "".join(rows) + "</mtable>", True)}</div>'


def _term(text: str, first: bool) -> list[str]:
    """MathML pieces of a term of a sum with its sign; lines may be broken between pieces.

    The sign is an infix operator, with space on both sides, unless the term is the first.
    """
    if not first and re.match("(<mrow>)*<mo>−</mo>", text):  # the minus sign belongs to the term, not to a numerator
        text = text.replace("<mo>−</mo>", '<mo form="infix">−</mo>', 1)
    elif not first:
        text = f'<mo form="infix">+</mo>{text}'
    pieces = _pieces(ElementTree.fromstring(f"<mrow>{text}</mrow>"))
    return [f"<mrow>{''.join(ElementTree.tostring(one, 'unicode') for one in piece)}</mrow>" for piece in pieces]


def _rows(pieces: Iterable[str]) -> list[str]:
    """Lines of MathML from pieces: each at most `_LINE` characters, unless a single piece is longer."""
    rows, room = [""], _LINE
    for piece in pieces:
        length = len(re.sub("<.*?>", "", piece))
        if rows[-1] and length > room:
            rows.append("")
            room = _LINE
        rows[-1] += piece
        room -= length
    return rows


def _pieces(element: ElementTree.Element, most: int = _PIECE) -> list[list[ElementTree.Element]]:
    """Children of a MathML row in groups of about `most` characters; each group begins at a sign or a slash."""
    if element.tag != "mrow" or _length([element]) <= most:
        return [[element]]
    groups: list[list[ElementTree.Element]] = [[]]
    for n, child in enumerate(element):
        sign = child.tag == "mo" and child.text in ("+", "−", "-")
        if sign and not child.get("form"):
            child.set("form", "infix" if n else "prefix")
        if n and (sign or (child.text == "/" and "".join(element[n - 1].itertext()).endswith(")"))):
            groups.append([])
        if child.get("symmetric"):  # fix the height of a bracket, as the fraction within may be in another piece
            child.set("minsize", "2.2em")
        groups[-1].append(child)
    found: list[list[ElementTree.Element]] = []
    for group in groups:
        found.append([])
        for child in group:
            inner = most if len(group) == 1 else max(most // 2, _PIECE // 2)
            first, *others = _pieces(child, inner) if _length(group) > most else [[child]]
            found[-1].extend(first)
            found.extend(others)
    return found


def _length(elements: Iterable[ElementTree.Element]) -> int:
    """Number of text characters in MathML elements."""
    return sum(len(text) for one in elements for text in one.itertext())


def _lines(terms: Iterable[sp.Expr]) -> list[list[sp.Expr]]:
    """Terms of a sum by line: each line at most `_LINE` characters, unless a single term is longer."""
    lines: list[list[sp.Expr]] = [[]]
    for term in terms:
        if lines[-1] and len(" + ".join(map(str, [*lines[-1], term]))) > _LINE:
            lines.append([])
        lines[-1].append(term)
    return lines


def _presented(expression: Any) -> str:
    """Presentation MathML of an expression, without the enclosing `math` element."""
    if isinstance(expression, sp.Basic):  # asinh_exp(x, y) avoids overflow in computing; print it as asinh(x exp(y))
        expression = expression.replace(asinh_exp, lambda x, y: sp.asinh(x * sp.exp(y)))
    text: str = _Printer().doprint(expression)
    for entity, character in _ENTITIES.items():
        text = text.replace(entity, character)
    text = _with_low_brackets(text)
    return re.sub(r"(?<=<mo>\u2062</mo>)(?=<mrow><mi>[a-z]{3,}</mi>)", '<mspace width=".2em"/>', text)


def _with_low_brackets(text: str) -> str:
    """MathML in which brackets are as high as a letter, or as the fraction that they enclose.

    By default browsers make brackets twice as high as the larger half of their contents, and larger with each nesting.
    """
    opened: list[int] = []
    kinds: dict[int, str] = {}
    for found in re.finditer(r"<mo>([()])</mo>", text):
        if found[1] == "(":
            opened.append(found.start())
        elif opened:
            begin = opened.pop()
            holds_fraction = "<mfrac" in text[begin : found.start()]
            kinds[begin] = kinds[found.start()] = ' symmetric="false"' if holds_fraction else ' stretchy="false"'
    return re.sub(r"<mo>(?=[()]</mo>)", lambda found: f"<mo{kinds.get(found.start(), '')}>", text)


class _Printer(MathMLPresentationPrinter):  # type: ignore[misc]  # SymPy has no types
    """MathML printer with equal looks in all fonts: no root signs (some fonts lack the bar), no stacked exponents."""

    _inline = False  # True within exp, log and fractions, where a fraction on two lines would be too small to read

    def _print_exp(self, expression: sp.exp) -> Any:
        return self._print_inline(sp.Function("exp")(*expression.args))

    def _print_log(self, expression: sp.log) -> Any:
        return self._print_inline(sp.Function("log")(*expression.args))

    def _print_inline(self, expression: Any, printed: Any = None) -> Any:
        before, self._inline = self._inline, True
        found = (printed or self._print)(expression)
        self._inline = before
        return found

    def _print_Mul(self, expression: sp.Mul) -> Any:  # noqa: N802 -- SymPy's name
        above, below = sp.fraction(expression)
        wide = max(len(str(above)), len(str(below))) > _LINE  # lines can be broken in a quotient, not in a fraction
        if below == 1:
            return super()._print_Mul(expression)
        if not (self._inline or wide):  # fractions within a fraction are on one line
            return self._print_inline(expression, super()._print_Mul)
        sign = above.could_extract_minus_sign() and not above.is_Add
        parts = [self._sign("-")] * sign + [self._closed(-above if sign else above, above.is_Add)]
        return self._row([*parts, self._sign("/"), self._closed(below, below.is_Add or below.is_Mul)])

    def _print_Pow(self, expression: sp.Pow) -> Any:  # noqa: N802 -- SymPy's name
        base, exponent = expression.as_base_exp()
        if exponent != sp.S.Half:
            return super()._print_Pow(expression)
        whole = self.dom.createElement("msup")
        whole.appendChild(self._closed(base, not base.is_Symbol))
        whole.appendChild(self._row([self._print(sp.Integer(1)), self._sign("/"), self._print(sp.Integer(2))]))
        return whole

    def _print_Rational(self, number: sp.Rational) -> Any:  # noqa: N802 -- SymPy's name
        power = power_of_ten(number)
        if abs(power) < LONG_POWER:
            return super()._print_Rational(number)
        raised = self.dom.createElement("msup")
        raised.appendChild(self._print(sp.Integer(10)))
        raised.appendChild(self._print(sp.Integer(power)))
        return raised

    def _closed(self, expression: Any, brackets: bool) -> Any:
        inner = self._print(expression)
        return self._row([self._sign("("), inner, self._sign(")")]) if brackets else inner

    def _row(self, parts: Iterable[Any]) -> Any:
        row = self.dom.createElement("mrow")
        for part in parts:
            row.appendChild(part)
        return row

    def _sign(self, text: str) -> Any:
        element = self.dom.createElement("mo")
        element.appendChild(self.dom.createTextNode(text))
        return element


def _mathml(text: str, display: bool) -> Markup:
    style = ' display="block"' if display else ""
    return Markup(f'<math xmlns="http://www.w3.org/1998/Math/MathML"{style}>{text}</math>')


def inline_math(symbol: sp.Symbol) -> Markup:
    """MathML of a symbol within a line of text."""
    return math(symbol, display=False)


def figure(drawing: str, caption: str = "") -> str:
    """HTML figure of a drawing with a caption; empty if the drawing is empty. Large ones can be scrolled."""
    below = f"<figcaption>{html_text(caption)}</figcaption>" if caption else ""
    scrolls = ' tabindex="0"' if drawing.startswith(('<svg class="large"', '<img class="large"')) else ""
    return f"<figure{scrolls}>{drawing}{below}</figure>" if drawing else ""


def beside(figures: Iterable[str]) -> str:
    """HTML of figures, two in a row where the page is wide enough; empty if all figures are empty."""
    found = [one for one in figures if one]
    return f'<div class="pair">{"".join(found)}</div>' if found else ""


def listing(text: str) -> str:
    """Preformatted HTML of a text, such as a file, without changes of typography."""
    return f"<pre>{html.escape(text)}</pre>"


def result_listing(result: Any) -> str:
    """Preformatted HTML of the printed text of a result, with print typography."""
    return listing(typographic(result))
