"""Results find their figures through one table, which users can add to."""

import pytest

from public_names import public
from steadyslip import figures, pictures
from steadyslip.core.errors import NotAvailable


def results_with_a_picture():
    for found in public().values():
        if isinstance(found, type) and hasattr(found, "plot"):
            yield found


def test_every_result_that_offers_a_picture_has_one():
    offered = set(results_with_a_picture())
    assert {found.__name__ for found in offered} >= {"Analysis", "History", "Fit", "MapResult"}
    assert offered <= set(pictures._figures)


def test_a_user_puts_a_figure_of_theirs_beside_ours(monkeypatch):
    class Result:
        pass

    monkeypatch.setattr(pictures, "_figures", {})
    with pytest.raises(NotAvailable, match="no figure of a Result"):
        pictures.draw(Result())
    pictures.register_figures(Result, first=lambda result, ax: ("first", ax), other=lambda result, ax: ("other", ax))
    assert pictures.draw(Result(), ax=1) == ("first", 1)
    assert pictures.draw(Result(), "other", ax=2) == ("other", 2)
    with pytest.raises(NotAvailable, match=r"'oter'.*other"):
        pictures.draw(Result(), "oter")

    class Special(Result):
        pass

    pictures.register_figures(Special, first=lambda result, ax: ("special", ax))
    assert pictures.draw(Special(), ax=3) == ("special", 3)
    assert pictures.draw(Special(), "other", ax=3) == ("other", 3)


def test_figures_are_all_drawn_by_this_table():
    drawn = {kind for kinds in pictures._figures.values() for kind in kinds.values()}
    assert {figures.history, figures.fit, figures.basin, figures.map_figure} <= drawn
