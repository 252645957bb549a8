"""Code and styles without what only people read: comments, indentation, spaces; names stay but in generated code."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import groupby, product

_OTHER = re.compile(
    r""""(?:\\.|[^"\\\n])*"|'(?:\\.|[^'\\\n])*'"""  # strings
    r"|(?<=[(,=:?&|!]) ?/(?![/*])(?:\\.|\[(?:\\.|[^\]\\\n])*\]|[^/\\\n\[])+/[a-z]*"  # regular expressions
)
_PRODUCT = re.compile(r"(?<=[-+(,=?:<>&|])\(([\w.\[\]]+(?:[*/][\w.\[\]]+)+)\)(?=[-+),;?:<>&|])")
_SUM = re.compile(r"(?<=[\[(,=?:])\(([\w.\[\]]+(?:[-+*/][\w.\[\]]+)+)\)(?=[-+),;?:<>&|\]])")
"""Products within sums, and sums at the begin of sums, in brackets that change nothing: not even the order."""
_LINE = re.compile(r"([;{,\n])\n+")
"""Ends of lines that end no statement."""
_SPACE = re.compile(r" *([-+*/%<>=!?:;,&|(){}\[\]]+) *")


def narrow(text: str) -> str:
    """A module; no string of it goes over several lines."""
    bare = re.sub(r"^ *(//.*|/\*\*[^\n]*\*/|/\*\*\n(?:.*\n)*?.*\*/) *\n", "", text, flags=re.M)
    bare = re.sub(r"/\*\* @\w[^\n]*?\*/ ?", "", bare)  # types within a line
    bare = re.sub(r"(?<=[;{},)]) // [^\n]*$|^ +", "", bare, flags=re.M)
    return _LINE.sub(r"\1", "".join(_SPACE.sub(_close, part) if code else part for part, code in _parts(bare)))


def _parts(text: str) -> Iterator[tuple[str, bool]]:
    """Code, and what must stay as it is: strings, templates, regular expressions; whether it is code."""
    start = at = 0
    while at < len(text):
        found = _OTHER.match(text, at)
        end = found.end() if found else _template_end(text, at) if text[at] == "`" else at
        if end > at:
            yield text[start:at], True
            yield text[at:end], False
            start = at = end
        else:
            at += 1
    yield text[start:], True


def _template_end(text: str, at: int) -> int:
    """Where a template ends that begins here; others may be within."""
    at += 1
    while text[at] != "`":
        if text.startswith("${", at):
            at, depth = at + 2, 1
            while depth:
                depth += {"{": 1, "}": -1}.get(text[at], 0)
                at = _template_end(text, at) if text[at] == "`" else at + 1
        else:
            at += 2 if text[at] == "\\" else 1
    return at + 1


def _close(found: re.Match[str]) -> str:
    """Signs without the spaces around, but for two that would be another sign together."""
    signs, whole, text = found[1], found[0], found.string
    before = whole[0] == " " and signs[0] in "+-" and text[: found.start()].endswith(signs[0])
    after = whole[-1] == " " and signs[-1] in "+-" and text[found.end() :].startswith(signs[-1])
    return " " * before + signs + " " * after


def dense(text: str) -> str:
    """Generated code, which has no strings, without the spaces beside signs; declarations in a row are one."""
    bare = re.sub(r" *([-+*/%<>=!?:;,&|(){}\[\]]+) *", r"\1", re.sub(r"^ +", "", text, flags=re.M))
    before = ""
    while before != bare:
        before, bare = bare, _SUM.sub(r"\1", _PRODUCT.sub(r"\1", bare))
    bare = _once(bare)
    rows: list[str] = []
    for declared, lines in groupby(bare.split("\n"), lambda line: line.startswith("var ") and line.endswith(";")):
        own = list(lines)
        rows += ["var " + ",".join(line[4:-1] for line in own) + ";"] if declared else own
    return _LINE.sub(r"\1", "\n".join(rows))


_NAME = re.compile(r"(?<![\w.$])[A-Za-z_]\w*")
_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
_WORDS = frozenset(
    re.findall(
        r"\w+",
        "as break const continue do else false for function if in let new null of return true var while "
        "Math Number Infinity NaN Float64Array",
    )
)
"""What generated code has of JavaScript itself."""


_LONG, _OFTEN = re.compile(r"(?<![\w.])\d+\.\d{8,}(?:e-?\d+)?"), 4


def functions_of(text: str) -> set[str]:
    """Names of the functions of generated code."""
    return set(re.findall(r"^ *function (\w+)", text, flags=re.M))


def renamed(text: str, known: Iterable[str]) -> str:
    """Generated code with names of its own as short as may be, the shortest for those that occur most.

    Parameters
    ----------
    text : str
        Without strings.
    known : iterable of str
        Names that others know.
    """
    taken = _WORDS.union(known)
    counts = Counter(name for name in _NAME.findall(text) if name not in taken)
    free = (name for size in (1, 2, 3) for name in map("".join, product(_LETTERS, repeat=size)) if name not in taken)
    short = {name: next(free) for name, _ in sorted(counts.items(), key=lambda item: (-item[1], item[0]))}
    return _NAME.sub(lambda found: short.get(found[0], found[0]), text)


def shared(text: str) -> str:
    """Generated functions in one that begins with ``(() => {``, with a name for each long number that they share."""
    counts = Counter(_LONG.findall(text))
    names = {number: f"number{n}" for n, (number, many) in enumerate(counts.items()) if many >= _OFTEN}
    if not names:
        return text
    head, body = text.split("{", 1)
    declared = ", ".join(f"{name} = {number}" for number, name in names.items())
    return f"{head}{{\nconst {declared};{_LONG.sub(lambda found: names.get(found[0], found[0]), body)}"


def _once(text: str) -> str:
    """Brackets in brackets, and brackets around all that is assigned, left out."""
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


def narrow_style(text: str) -> str:
    """A style sheet."""
    return re.sub(r"(?<=[;{},]) +|(?<=[a-z]:) (?=[^{}]*[;}])|;? *(?=\})", "", re.sub(r"^ +", "", text, flags=re.M))
