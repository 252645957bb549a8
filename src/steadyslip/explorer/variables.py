"""Short names for the variables of minified JavaScript modules; properties, keys and strings are unchanged."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Iterator
from itertools import product
from typing import NamedTuple

from steadyslip.explorer.minify import LETTERS, split_code

_TOKEN = re.compile(r"(?P<name>[A-Za-z_$][\w$]*)|\d[\w.]*|\.\.\.|\?\.|=>|\S")
_RESERVED = frozenset(
    re.findall(
        r"\w+",
        "arguments as async await break case catch class const continue default delete do else extends false finally "
        "for function get if in instanceof let new null of return set static super switch this throw true try typeof "
        "undefined var void while yield",
    )
)
_GLOBAL = frozenset(
    re.findall(
        r"\w+",
        "Array BigInt Blob Boolean Date DOMParser Error Float64Array Image Infinity IntersectionObserver Map Math "
        "NaN Number Object Promise ResizeObserver Set String URL Uint32Array Uint8Array Worker XMLSerializer "
        "cancelAnimationFrame clearTimeout decodeURIComponent document encodeURIComponent getComputedStyle history "
        "location navigator performance "
        "postMessage requestAnimationFrame self setTimeout window",
    )
)
"""Global names of JavaScript and browsers used by the modules; modules must not declare variables of these names."""
_BEFORE_BLOCK = frozenset({"", ")", "=>", ";", "{", "}", "else", "try", "finally", "do", "catch"})
_BEFORE_NAME = frozenset({"get", "set", "async", "static"})


class _Word(NamedTuple):
    """A name in code: its text, True if it is a variable, and True if it is both key and variable (``{ name }``)."""

    text: str
    is_variable: bool
    is_shorthand: bool = False


def shorten_variables(text: str, known: Iterable[str]) -> str:
    """Minified modules in one scope, with short names for their variables, the shortest for the most frequent.

    A name is replaced by one short name wherever it occurs, so that scopes need not be distinguished.

    Parameters
    ----------
    text : str
        Minified modules.
    known : iterable of str
        Names used by other code, which are kept.

    Examples
    --------
    >>> shorten_variables("const found=(given)=>({found:given.found,given});", ())
    'const b=(a)=>({found:a.found,given:a});'
    """
    parts = list(_words(text))
    kept = {*_RESERVED, *_GLOBAL, *known}
    counts = Counter(one.text for one in parts if isinstance(one, _Word) and one.is_variable and one.text not in kept)
    free = (name for size in (1, 2) for name in map("".join, product(LETTERS, repeat=size)) if name not in kept)
    short = {name: next(free) for name, _ in sorted(counts.items(), key=lambda item: (-item[1], item[0]))}

    def named(one: _Word | str) -> str:
        if isinstance(one, str) or not one.is_variable or one.text not in short:
            return one if isinstance(one, str) else one.text
        return f"{one.text}:{short[one.text]}" if one.is_shorthand else short[one.text]

    return "".join(map(named, parts))


def _words(text: str) -> Iterator[_Word | str]:
    """Names in code as `_Word`, and the text between them."""
    tokens = [*_tokens(text), ("", False)]
    opened, before, in_class = ["block"], "", False
    for (token, is_name), (after, _), (behind, _) in zip(tokens, tokens[1:], [*tokens[2:], ("", False)], strict=False):
        yield _word(token, before, after.strip() or behind, opened[-1]) if is_name else token
        if not token.strip():
            continue
        in_class = in_class or (token == "class" and before != "." and after != ":")
        if token[0] in ")]}":  # this may also be the text of a template after ``${...}``
            opened.pop()
        if token == "{":
            opened.append("class" if in_class else "block" if before in _BEFORE_BLOCK else "object")
            in_class = False
        elif token in ("(", "[") or token.endswith("${"):
            opened.append(token)
        before = token


def _tokens(text: str) -> Iterator[tuple[str, bool]]:
    """Tokens of code, spaces and literals, each with True if it is a name."""
    for part, is_code in split_code(text):
        if not is_code:
            yield part, False
            continue
        end = 0
        for found in _TOKEN.finditer(part):
            if found.start() > end:
                yield part[end : found.start()], False
            yield found[0], found["name"] is not None
            end = found.end()
        if end < len(part):
            yield part[end:], False


def _word(name: str, before: str, after: str, within: str) -> _Word:
    """`_Word` of a name: variable or property, by the tokens beside it and the kind of bracket around it."""
    if before in (".", "?."):
        return _Word(name, False)
    begins = within == "object" and before in ("{", ",")
    if begins and after in (",", "}", "="):
        return _Word(name, True, True)
    member = begins or (within == "class" and before in ("{", ";", "}")) or (
        within in ("class", "object") and before in _BEFORE_NAME
    )  # fmt: skip
    return _Word(name, not member)
