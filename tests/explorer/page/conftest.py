"""Pages that many tests look at."""

import pytest

import steadyslip as ss
from explored_pages import INCLINED, MOVED


@pytest.fixture(scope="session")
def file(tmp_path_factory):
    path = tmp_path_factory.mktemp("pages") / "rig.html"
    ss.explore(INCLINED, title="A rig").save(path)
    return path


@pytest.fixture(scope="session")
def moved(tmp_path_factory):
    """The explorer and the report of a rig that slips, by kind."""
    folder = tmp_path_factory.mktemp("moved")
    paths = {kind: folder / f"{kind}.html" for kind in ("explorer", "report")}
    ss.explore(MOVED).save(paths["explorer"])
    ss.report(MOVED).save(paths["report"])
    return paths
