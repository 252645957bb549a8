"""Minify JavaScript and CSS: comments, indentation and spaces removed; names shortened in generated code only."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import groupby, product

_LITERAL = re.compile(
    r""""(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'"""  # strings
    r"|(?<=[(,=:?&|!]) ?/(?![/*])(?:\\.|\[(?:\\.|[^\]\\\n])*\]|[^/\\\n\[])+/[a-z]*"  # regular expressions
)
# redundant brackets around products in sums, and around sums at the beginning of sums: rounding stays the same
_PRODUCT = re.compile(r"(?<=[-+(,=?:<>&|])\(([\w.\[\]]+(?:[*/][\w.\[\]]+)+)\)(?=[-+),;?:<>&|])")
_SUM = re.compile(r"(?<=[\[(,=?:])\(([\w.\[\]]+(?:[-+*/][\w.\[\]]+)+)\)(?=[-+),;?:<>&|\]])")
# + (-a) b equals - a b exactly
_NEGATIVE = re.compile(r"(?:\+|(?<=[=(,?:]))\(-([\w.\[\]]+)\)(?=[-+*/),;])")
_LINE_END = re.compile(r"([;{,\n])\n+")  # line ends that can be removed, as they do not end a statement
_SPACED_SIGNS = re.compile(r" *([-+*/%<>=!?:;,&|(){}\[\]]+) *")


def minify(text: str) -> str:
    """Minified text of a JavaScript module without multi-line strings."""
    bare = re.sub(r"^ *(//.*|/\*\*(?:(?!\*/)[\s\S])*\*/) *\n", "", text, flags=re.M)
    bare = re.sub(r"/\*\* @\w[^\n]*?\*/ ?", "", bare)  # JSDoc comments with types within a line
    bare = re.sub(r"(?<=[;{},)]) // [^\n]*$|^ +", "", bare, flags=re.M)
    return _LINE_END.sub(
        r"\1", "".join(_SPACED_SIGNS.sub(_strip_spaces, part) if code else part for part, code in split_code(bare))
    )


def _split_literals(text: str) -> Iterator[tuple[str, bool]]:
    """Parts of a JavaScript text, each with True for code, False for strings, templates and regular expressions."""
    start = at = 0
    while at < len(text):
        found = _LITERAL.match(text, at)
        end = found.end() if found else _template_end(text, at) if text[at] == "`" else at
        if end > at:
            yield text[start:at], True
            yield text[at:end], False
            start = at = end
        else:
            at += 1
    yield text[start:], True


def _template_end(text: str, at: int) -> int:
    """Index after the template literal that begins at `at`; template literals may be nested."""
    at += 1
    while text[at] != "`":
        at = _hole_end(text, at + 2) + 1 if text.startswith("${", at) else at + (2 if text[at] == "\\" else 1)
    return at + 1


def _hole_end(text: str, at: int) -> int:
    """Index of the bracket that closes the ``${`` code beginning at `at` in a template literal."""
    depth = 0
    while depth or text[at] != "}":
        depth += {"{": 1, "}": -1}.get(text[at], 0)
        at = _template_end(text, at) if text[at] == "`" else at + 1
    return at


def split_code(text: str) -> Iterator[tuple[str, bool]]:
    """Parts as from `_split_literals`, with code inside template literals split off as parts of its own."""
    for part, code in _split_literals(text):
        if part[:1] != "`":
            yield part, code
            continue
        start = at = 1
        while part[at] != "`":
            if part.startswith("${", at):
                end = _hole_end(part, at + 2)
                yield part[start - (start == 1) : at + 2], False
                yield from split_code(part[at + 2 : end])
                start = at = end
            at += 2 if part[at] == "\\" else 1
        yield part[start - (start == 1) :], False


def _strip_spaces(found: re.Match[str]) -> str:
    """Text of a match without spaces around signs, except between + + and - -, which would become ++ and --."""
    signs, whole, text = found[1], found[0], found.string
    before = whole[0] == " " and signs[0] in "+-" and text[: found.start()].endswith(signs[0])
    after = whole[-1] == " " and signs[-1] in "+-" and text[found.end() :].startswith(signs[-1])
    return " " * before + signs + " " * after


def minify_generated(text: str) -> str:
    """Minified generated code, which has no strings: no spaces at signs, adjacent declarations joined."""
    bare = re.sub(r" *([-+*/%<>=!?:;,&|(){}\[\]]+) *", r"\1", re.sub(r"^ +", "", text, flags=re.M))
    bare = re.sub(r"(?<![\w.])(\d+)\.0(?![\de])", r"\1", bare)
    before = ""
    while before != bare:
        before, bare = bare, _SUM.sub(r"\1", _PRODUCT.sub(r"\1", _NEGATIVE.sub(r"-\1", bare)))
    bare = _drop_brackets(bare)
    rows: list[str] = []
    for declared, lines in groupby(bare.split("\n"), lambda line: line.startswith("var ") and line.endswith(";")):
        own = list(lines)
        rows += ["var " + ",".join(line[4:-1] for line in own) + ";"] if declared else own
    return _LINE_END.sub(r"\1", "\n".join(rows))


_NAME = re.compile(r"(?<![\w.$])[A-Za-z_]\w*")
LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
# names of JavaScript that occur in generated code
_RESERVED = frozenset(
    re.findall(
        r"\w+",
        "as break const continue do else false for function if in let new null of return true var while "
        "Math Number Infinity NaN Float64Array",
    )
)
_LONG_NUMBER = re.compile(r"(?<![\w.])\d+\.\d{8,}(?:e-?\d+)?")
_MIN_USES = 4  # least number of uses for which a constant for a long number saves characters


def function_names(text: str) -> set[str]:
    """Names of the functions defined in generated code."""
    return set(re.findall(r"^ *function (\w+)", text, flags=re.M))


def names_in(text: str) -> set[str]:
    """Names in code without strings."""
    return set(_NAME.findall(text))


def shorten_names(text: str, known: Iterable[str]) -> str:
    """Generated code with its own names replaced by short ones, the shortest for the most frequent.

    Parameters
    ----------
    text : str
        Code without strings.
    known : iterable of str
        Names used by other code, which are kept.
    """
    taken = _RESERVED.union(known)
    counts = Counter(name for name in _NAME.findall(text) if name not in taken)
    free = (name for size in (1, 2, 3) for name in map("".join, product(LETTERS, repeat=size)) if name not in taken)
    short = {name: next(free) for name, _ in sorted(counts.items(), key=lambda item: (-item[1], item[0]))}
    return _NAME.sub(lambda found: short.get(found[0], found[0]), text)


def share_numbers(text: str) -> str:
    """Generated code, which begins with ``(() => {``; constants for long numbers used `_MIN_USES` times or more."""
    counts = Counter(_LONG_NUMBER.findall(text))
    names = {number: f"number{n}" for n, (number, many) in enumerate(counts.items()) if many >= _MIN_USES}
    if not names:
        return text
    head, body = text.split("{", 1)
    declared = ", ".join(f"{name} = {number}" for number, name in names.items())
    return f"{head}{{\nconst {declared};{_LONG_NUMBER.sub(lambda found: names.get(found[0], found[0]), body)}"


def _drop_brackets(text: str) -> str:
    """Code without double brackets, and without brackets around a whole assigned value."""
    opened: list[int] = []
    closed: dict[int, int] = {}
    for at, sign in enumerate(text):
        if sign == "(":
            opened.append(at)
        elif sign == ")":
            closed[opened.pop()] = at
    spare: set[int] = set()
    for at, end in closed.items():
        within = text[at - 1] == "(" and closed[at - 1] == end + 1
        assigned = text[at - 1] == "=" and text[at - 2] not in "=<>!" and text[end + 1] in ";,"
        if within or assigned:
            spare |= {at, end}
    return "".join(sign for at, sign in enumerate(text) if at not in spare)


def minify_css(text: str) -> str:
    """Minified text of a style sheet."""
    bare = re.sub(r"^ +", "", text, flags=re.M)
    return re.sub(r"(?<=[;{},])\s+|\s+(?=\{)|(?<=[a-z]:) (?=[^{}]*[;}])|;?\s*(?=\})", "", bare)
