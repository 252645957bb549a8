"""Pages as their readers see them."""

import re
from html.parser import HTMLParser

VOID = {"br", "img", "meta", "hr", "input", "link"}


class Balanced(HTMLParser):
    """Complains of elements that do not nest."""

    def __init__(self, text):
        super().__init__()
        self.open, self.words, self.quiet = [], [], 0
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if tag not in VOID:
            assert self.open.pop() == tag

    def handle_data(self, data):
        if not {"script", "style", "pre", "svg"} & set(self.open):
            self.words.append(data)


def words(text):
    """Visible text of a page, with its elements checked."""
    joined = re.sub("<wbr>|\u2060", "", re.sub(r"<sub>(\w+)</sub>", r"_\1", text))  # where lines may break, or not
    return re.sub(r"\s+", " ", " ".join(Balanced(joined).words))
