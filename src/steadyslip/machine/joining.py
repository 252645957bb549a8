"""Rigid links: a link is removed, and its two bodies become one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from steadyslip.core.errors import NotAvailable, UnknownNameError
from steadyslip.core.options import Tested, checked
from steadyslip.machine.bodies import Body, RotatingBody, SlidingBody
from steadyslip.machine.links import Link, Screw, Shaft, Spring
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import GROUND, LOAD_POINT
from steadyslip.machine.surfaces import Surface

_RATIO_TOLERANCE = 1e-12  # largest |ratio - 1| that counts as rounding error; products of a few ratios have some 1e-16
_LINK = Tested("the name of a link; give several names as separate arguments", lambda value: isinstance(value, str))


@checked(links=_LINK)
def joined(machine: Machine, *links: str) -> Machine:
    """Copy of a machine in which given links are rigid: each is removed, and its two bodies become one.

    A rotating and a sliding body can be joined: a screw's inertia J becomes a mass J/lead² of the table, or the table's
    mass m an inertia m lead² of the screw. Links and contacts of the removed body are transferred to the joint body.

    Parameters
    ----------
    machine : Machine
    *links : str
        Names of links, such as ``"screw"`` or ``"links.screw"``.

    Returns
    -------
    Machine
        Copy of the machine. The joint body has the name of the link's first end, unless the drive acts on the second
        body, or only the second can take over the contacts of both.

    Raises
    ------
    UnknownNameError
        If a link does not exist.
    NotAvailable
        If a link ends at the ground or the drive, an end moves away from the surface, a contact law depends on the
        force of the link (`loaded_by`), or neither body can take over the other's links and contacts.

    Examples
    --------
    >>> machine = ss.read_rig("examples/machines/feed-axis.toml")
    >>> len(machine.bodies), len(ss.machine.joined(machine, "screw").bodies)
    (2, 1)
    """
    for link in links:
        name = link.removeprefix("links.")
        if name not in machine.links:
            raise UnknownNameError("link", link, machine.links)
        machine = _without_link(machine, name)
    return machine


def _without_link(machine: Machine, name: str) -> Machine:
    link = machine.links[name]
    first, second = link.between
    for end in link.between:
        if end in (GROUND, LOAD_POINT):
            raise NotAvailable(
                f"links.{name} cannot be rigid: it ends at the {end}, so that {_other_end(link, end)!r} would not move "
                "by itself; leave that body out, or give the link a stiffness"
            )
        if machine.bodies[end].lifts or "y" in link.directions():
            raise NotAvailable(f"links.{name} cannot be rigid: one of its bodies moves away from the surface")
    for contact, surface in machine.contacts.items():
        if surface.loaded_by == name:
            raise NotAvailable(f"links.{name} cannot be rigid: contacts.{contact} depends on its force (loaded_by)")
    ratio = float(link.ratio())
    trials = [(first, second, ratio), (second, first, 1 / ratio)]
    if machine.drive.driven() == second:
        trials.reverse()
    try:
        return _merged(machine, name, *trials[0])
    except NotAvailable as error:
        try:
            return _merged(machine, name, *trials[1])
        except NotAvailable:
            raise error from None


def _other_end(link: Link, end: str) -> str:
    return link.between[1] if link.between[0] == end else link.between[0]


def _merged(machine: Machine, name: str, kept: str, gone: str, ratio: float) -> Machine:
    """Copy of a machine with body `gone`, which moves `ratio` times as fast as `kept`, joined to `kept`."""
    bodies = dict(machine.bodies)
    bodies[kept] = _joint_body(bodies[kept], bodies.pop(gone), ratio)
    links = {}
    for other, link in machine.links.items():
        if other != name and set(link.between) != {kept, gone}:
            links[other] = _moved_link(machine, other, link, kept, gone, ratio) if gone in link.between else link
    contacts = {
        n: _moved_contact(machine, n, one, kept, gone, ratio) if gone in (one.body, one.against) else one
        for n, one in machine.contacts.items()
    }
    drive = machine.drive
    if drive.driven() == gone and (not _is_one(ratio) or bodies[kept].turns != machine.bodies[gone].turns):
        raise NotAvailable(f"links.{name} cannot be rigid: the drive acts on {gone!r}; let it act on {kept!r}")
    senses: dict[str, Any] = {
        key: kept for key in ("body", "measured", "speed_measured") if getattr(drive, key, None) == gone
    }
    return replace(machine, bodies=bodies, links=links, contacts=contacts, drive=replace(drive, **senses))


def _is_one(ratio: float) -> bool:
    return abs(ratio - 1) <= _RATIO_TOLERANCE


def _joint_body(body: Body, other: Body, ratio: float) -> Body:
    """Copy of `body` to which inertia and constant force of `other` are added; `other` moves `ratio` times as fast."""
    inertia = body.inertia_of() + ratio**2 * other.inertia_of()
    force = body.along() + ratio * other.along()
    if isinstance(body, RotatingBody):
        return replace(body, inertia=inertia, torque=force)
    return replace(body, mass=inertia, force=force) if isinstance(body, SlidingBody) else body


def _moved_link(machine: Machine, name: str, link: Link, kept: str, gone: str, ratio: float) -> Link:
    """Link at body `kept` that is equivalent to a link at body `gone`."""
    shares = dict(zip(link.between, (-float(link.ratio()), 1.0), strict=True))
    other = _other_end(link, gone)
    own, far = shares[gone] * ratio, shares[other]
    turning: Mapping[str, bool | None] = {kept: machine.bodies[kept].turns, other: machine._turns(other)}

    def values(share: float) -> dict[str, Any]:
        stiffness = None if link.rigidity() is None else link.rigidity() * share**2
        return {"stiffness": stiffness, "damping": link.dashpot() * share**2}

    if turning[other] is None:  # the ground
        kind = Shaft if turning[kept] else Spring
        return kind(between=(other, kept), **values(own))
    if turning[kept] and turning[other]:
        return Shaft(between=(other, kept), gear=abs(far / own), **values(own))
    if turning[kept]:
        return Screw(between=(kept, other), lead=abs(own / far), **values(far))
    if turning[other]:
        return Screw(between=(other, kept), lead=abs(far / own), **values(own))
    if not _is_one(abs(far / own)):
        raise NotAvailable(
            f"links.{name} would tie two bodies that slide at different speeds; one of them must turn for that"
        )
    return Spring(between=(other, kept), **values(own))


def _moved_contact(machine: Machine, name: str, surface: Surface, kept: str, gone: str, ratio: float) -> Surface:
    """Contact of body `kept` that is equivalent to a contact of body `gone`."""
    if surface.against == gone or not machine.bodies[kept].turns:
        if not _is_one(ratio) or machine.bodies[kept].turns != machine.bodies[gone].turns:
            raise NotAvailable(
                f"contacts.{name}: {kept!r} cannot slide there in place of {gone!r}, whose motion is another"
            )
        return replace(surface, against=kept) if surface.against == gone else replace(surface, body=kept)
    return replace(surface, body=kept, radius=ratio * (1.0 if surface.radius is None else surface.radius))
