"""Checks of body and link names in the raw tables of a machine file, which work even if no `Machine` can be made."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from difflib import get_close_matches
from typing import Any

from steadyslip.core.errors import Problem, unknown_name
from steadyslip.machine.mechanism import GROUND, LOAD_POINT


def unknown_ends(tables: Mapping[str, Any]) -> Iterator[Problem]:
    """Yield Problems for unknown names of bodies and links in raw tables, and for bodies that nothing refers to."""
    bodies, links, contacts = (_tables(tables.get(name)) for name in ("bodies", "links", "contacts"))
    own = bodies
    bodies = {end: body for name, body in own.items() for end in _points(name, body, [*links.values()], contacts)}
    for name, link in links.items():
        ends = link.get("between")
        for end in ends if isinstance(ends, list) else ():
            yield from unknown_body(f"links.{name}.between", end, [*bodies, GROUND, LOAD_POINT])
    for name, surface in contacts.items():
        yield from unknown_body(f"contacts.{name}.body", surface.get("body"), [*bodies, LOAD_POINT])
        yield from unknown_body(f"contacts.{name}.against", surface.get("against"), [*bodies, GROUND, LOAD_POINT])
        if isinstance(by := surface.get("loaded_by"), str) and by not in links:
            yield Problem(f"contacts.{name}.loaded_by", unknown_name("link", by, links))
    drive = tables.get("drive")
    driven = drive if isinstance(drive, dict) else {}
    for key in ("body", "measured", "speed_measured", "velocity_of"):
        yield from unknown_body(f"drive.{key}", driven.get(key), list(bodies))
    named = [end for link in links.values() if isinstance(link.get("between"), list) for end in link["between"]]
    named += [surface.get(key) for surface in contacts.values() for key in ("body", "against")]
    lost = list(unreferenced_bodies(own, [*map(body_of, named), driven.get("body")]))
    yield from lost
    if all(end in (*bodies, GROUND, LOAD_POINT) for end in named if isinstance(end, str)):
        reported = {problem.name for problem in lost}
        plain = [name for name, body in own.items() if not _is_structure(body)]
        yield from (one for one in _floating(plain, links, driven.get("body")) if one.name not in reported)


def body_of(end: Any) -> Any:
    """Name of the body at an end of a link or contact: ``caliper`` for the point ``caliper.pad`` of a structure."""
    return end.partition(".")[0] if isinstance(end, str) else end


def _is_structure(body: Mapping[str, Any]) -> bool:
    """True for a raw table of a structure, even if the word "structure" is misspelt or missing.

    The misspelt or missing word is reported elsewhere; points of the structure must not be reported as unknown bodies.
    """
    named = body.get("motion", body.get("kind"))
    if named is None:
        return any(key in body for key in ("matrices", "modes", "response"))
    return isinstance(named, str) and bool(get_close_matches(named, ["structure"]))


def _points(
    name: str, body: Mapping[str, Any], links: Sequence[Mapping[str, Any]], contacts: Mapping[str, Mapping[str, Any]]
) -> list[str]:
    """Valid ends at a body: its name; for a structure all points named by links and contacts, in case it has them."""
    if not _is_structure(body):
        return [name]
    ends = [end for link in links if isinstance(link.get("between"), list) for end in link["between"]]
    ends += [surface.get(key) for surface in contacts.values() for key in ("body", "against")]
    return [*dict.fromkeys(end for end in ends if isinstance(end, str) and end.startswith(f"{name}."))]


def _floating(bodies: Iterable[str], links: Mapping[str, Mapping[str, Any]], driven: Any) -> Iterator[Problem]:
    """Yield a Problem for each body that no chain of links with stiffness connects to the drive or the ground."""
    stiff = [link for link in links.values() if "stiffness" in link and link.get("direction") != "normal"]
    ties = [link["between"] for link in stiff if isinstance(link.get("between"), list)]
    reached = [GROUND, LOAD_POINT, *([driven] if isinstance(driven, str) else [])]
    for one in reached:  # grows during the loop
        reached += [end for ends in ties if one in ends for end in ends if end not in reached]
    yield from (floating_body(name) for name in bodies if name not in reached)


def floating_body(name: str) -> Problem:
    """Problem for a body whose speed in steady sliding is undetermined."""
    return Problem(
        f"bodies.{name}", "floats: no chain of links with stiffness ties it to the drive or the ground, so that its "
        "speed in steady sliding is undetermined",
    )  # fmt: skip


def unreferenced_bodies(bodies: Iterable[str], named: Sequence[Any]) -> Iterator[Problem]:
    """Yield a Problem for each body that is not among the names, unless a misspelt name is similar to it."""
    bodies = list(bodies)
    meant = {near for end in named if isinstance(end, str) and end not in bodies
             for near in get_close_matches(end, bodies, cutoff=0.5)}  # fmt: skip
    for name in bodies:
        if name not in named and name not in meant:
            yield Problem(f"bodies.{name}", "floats: no link, contact or drive names it")


def _tables(raw: Any) -> dict[str, dict[str, Any]]:
    return {key: one for key, one in raw.items() if isinstance(one, dict)} if isinstance(raw, dict) else {}


def unknown_body(where: str, name: Any, known: list[str]) -> Iterator[Problem]:
    """Yield a Problem if a text is not the name of a known body; values of other types are ignored."""
    if isinstance(name, str) and name not in known:
        yield Problem(where, unknown_name("body", name, known))
