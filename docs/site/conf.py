"""Sphinx's settings of the site; `build.py` beside it makes the pages that it reads."""

import os
import sys

from docutils.parsers.rst import roles

sys.path.insert(0, os.path.dirname(__file__))
from docstrings import plain_lines

from steadyslip.core.version import RELEASE

project = "steadyslip"
author = "The steadyslip developers"
copyright = author
version = release = RELEASE
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
root_doc = "index"
html_theme = "pydata_sphinx_theme"
html_title = f"steadyslip {RELEASE}"
html_show_sphinx = False
html_extra_path = ["../extra"]
html_static_path = html_css_files = ["style.css"]
html_theme_options = {
    "show_prev_next": False,
    "header_links_before_dropdown": 7,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_copy_source = html_show_sourcelink = False
myst_heading_anchors = 4
default_role = "literal"  # `name` in docstrings is code, as in Markdown
autodoc_typehints = "none"  # docstrings say the types, with units and shapes
autodoc_member_order = "bysource"
napoleon_google_docstring = False
napoleon_use_rtype = napoleon_use_ivar = False
suppress_warnings = [
    "misc.highlighting_failure",  # blocks of output are no program
    "ref.python",  # words of types that are attributes of several classes
]


def setup(app):
    roles.register_local_role("literal", roles.code_role)
    app.connect("autodoc-process-docstring", plain_lines, priority=400)  # before napoleon adds markup, at 500
