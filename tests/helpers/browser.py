"""A real Chromium for tests: Debian's, or what STEADYSLIP_CHROMIUM names; a skip that says so where there is none.

Where STEADYSLIP_CHROMIUM is set, as `.ci/run` does once it has a browser, nothing is skipped.
"""

import os
import shutil

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")


def chromium():
    """The path of the browser."""
    named = os.environ.get("STEADYSLIP_CHROMIUM")
    path = named or next(filter(None, map(shutil.which, NAMES)), None)
    if path is None:
        pytest.skip("there is no Chromium here (apt-get install chromium)")
    return path


def driver():
    """Playwright's entry."""
    if os.environ.get("STEADYSLIP_CHROMIUM"):
        from playwright.sync_api import sync_playwright
    else:
        sync_playwright = pytest.importorskip(
            "playwright.sync_api", reason="Playwright is not installed"
        ).sync_playwright
    return sync_playwright()
