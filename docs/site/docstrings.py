"""Docstrings as Sphinx reads them: stars, bars and signs in sentences are no markup."""

import re

CODE = re.compile(r"(``.*?``|`[^`]*`)")
FOLLOWS = set(" '\")]}>-/\\:.,;!?")
"""Characters that may follow code in reStructuredText; another one is parted from it by a blank of no width."""


def plain_lines(app, what, name, thing, options, lines):
    """Escape what reStructuredText would take for markup, outside of code; called by autodoc for each docstring."""
    for i, line in enumerate(lines):
        if not line.lstrip().startswith((">>>", "...")):
            pieces = CODE.split(line)  # every second one is code
            lines[i] = "".join(piece if k % 2 else plain(piece, k > 0) for k, piece in enumerate(pieces))


def plain(text: str, after_code: bool) -> str:
    text = re.sub(r"([*|]|(?<=\w)_(?=\W|$))", r"\\\1", text)
    text = re.sub(r"^(\s*)([+-])(?= )", r"\1\\\2", text)
    return "\\ " + text if after_code and text and text[0] not in FOLLOWS else text
