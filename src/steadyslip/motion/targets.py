"""Targets of protocol pieces: a body or the drive, the surfaces of a contact or the fluid in it."""

from __future__ import annotations

from dataclasses import dataclass

from steadyslip.core.errors import ParameterError, Problem
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import LOAD_POINT
from steadyslip.machine.slider import Slider
from steadyslip.model.equations import EITHER, MOVED, PULLED
from steadyslip.model.reducing import FREE, PORES, SWITCH
from steadyslip.protocol import Protocol, protocol as channels
from steadyslip.protocol.pieces import OnBlock, OnDrive, OnNormalStress, OnPores
from steadyslip.protocol.protocol import Piece, channel_of


@dataclass(frozen=True)
class Targets:
    """Targets of a protocol, and the input channels of its pieces.

    Attributes
    ----------
    pushes : tuple of str
        Coordinates (or the drive) on which forces act, in the order of their first pieces; "" for a slider's block.
    presses : tuple of str
        Contacts whose normal stress or pore pressure is changed; "" for a slider's contact.
    channels : tuple of int
        Channel of each piece.
    """

    pushes: tuple[str, ...] = ()
    presses: tuple[str, ...] = ()
    channels: tuple[int, ...] = ()

    @property
    def drive(self) -> str:
        """Kind of drive in the run: `MOVED`, `PULLED` by an imposed force, or `EITHER`, one after the other."""
        return EITHER if FREE in self.pushes else PULLED if LOAD_POINT in self.pushes else MOVED

    def named(self) -> dict[str, tuple[int, str, str]]:
        """Names in results of the forces and stresses that act, each with (channel, kind of target, target).

        A single push is called ``disturbance``; if there are several, each has its target's name before it. Likewise
        ``normal_disturbance`` and ``injection``. Without any push there is a ``disturbance`` of 0. If the drive is
        released for some time, ``creep`` is 1 during it.
        """
        found = {}
        by_turns = self.drive == EITHER
        bodies = self.pushes[len(LET_GO) :] if by_turns else self.pushes
        if by_turns:
            found["creep"] = (channel_of(channels.DISTURBANCE, 1, len(self.pushes)), "share", FREE)
        for number, name in enumerate(bodies or (() if by_turns else ("",)), start=len(self.pushes) - len(bodies)):
            own = f"{name}." if name and len(bodies) > 1 else ""
            place = channel_of(channels.DISTURBANCE, number, len(self.pushes))
            found[f"{own}disturbance"] = (place, "push", name)
        for number, name in enumerate(self.presses):
            what = "injection" if name.endswith(PORES) else "normal_disturbance"
            of_kind = sum(one.endswith(PORES) == name.endswith(PORES) for one in self.presses)
            own = f"{name.removesuffix(PORES)}." if name.removesuffix(PORES) and of_kind > 1 else ""
            place = channel_of(channels.NORMAL_STRESS, number, len(self.pushes))
            found[f"{own}{what}"] = (place, "press", name)
        return found


NOTHING = Targets()
LET_GO = (LOAD_POINT, FREE, SWITCH)
"""First targets in `Targets.pushes` if the protocol releases the drive for some time."""


def targets(rig: Slider | Machine, plan: Protocol) -> Targets:
    """Targets of a protocol's pushes, presses and injections.

    Raises
    ------
    ParameterError
        If the target of a piece is ambiguous, or a piece has no effect on its target.
    """
    return _TargetSearch(rig, plan).found()


class _TargetSearch:
    """Search for the targets of one protocol."""

    def __init__(self, rig: Slider | Machine, plan: Protocol) -> None:
        self.plan, self.rig = plan, rig
        self.laws = {name: own.contact for name, own in rig.laws_by_contact().items()}
        self.bodies = list(rig.ends()) or [""]
        self.problems: list[Problem] = []

    def found(self) -> Targets:
        """Targets of the protocol; raises one ParameterError with all problems."""
        own = [self._of(piece, f"protocol.pieces.{i}") for i, piece in enumerate(self.plan.pieces, start=1)]
        if self.plan.frees_load_point:
            self._load_point_is_free()
        if self.problems:
            raise ParameterError(self.problems)
        acting = {kind: self._in_order(kind, own) for kind in (channels.DISTURBANCE, channels.NORMAL_STRESS)}
        pushes, presses = acting.values()
        if self.plan.lets_go:
            pushes = (*LET_GO, *(name for name in pushes if name != LOAD_POINT))
            acting[channels.DISTURBANCE] = pushes
        places = tuple(
            channels.LOAD_POINT if name is None else channel_of(kind, acting[kind].index(name), len(pushes))
            for kind, name in zip((piece.channel for piece in self.plan.pieces), own, strict=True)
        )
        return Targets(pushes, presses, places)

    def _in_order(self, kind: int, own: list[str | None]) -> tuple[str, ...]:
        """Targets of the pieces of a kind, without duplicates."""
        pairs = zip(self.plan.pieces, own, strict=True)
        return tuple(dict.fromkeys(name for piece, name in pairs if piece.channel == kind and name is not None))

    def _of(self, piece: Piece, where: str) -> str | None:
        """Target of a piece; None for the motion of the load point, and if a problem was added to `problems`."""
        if isinstance(piece, OnDrive):
            return LOAD_POINT
        if isinstance(piece, OnBlock):
            return self._chosen(piece, f"{where}.on", "body", self.bodies)
        if isinstance(piece, OnNormalStress):
            return self._chosen(piece, f"{where}.on", "contact", list(self.laws))
        return self._injected(piece, where) if isinstance(piece, OnPores) else None

    def _injected(self, piece: OnPores, where: str) -> str | None:
        wet = [name for name, law in self.laws.items() if law.has_pores()]
        if not wet:
            own = " and ".join(dict.fromkeys(law.name or type(law).__name__ for law in self.laws.values()))
            message = f"{piece.name} needs a contact with pore fluid, of law pore-fluid; here it is {own}"
            self.problems.append(Problem(where, message))
            return None
        contact = self._chosen(piece, f"{where}.on", "contact with pore fluid", wet)
        return None if contact is None else contact + PORES

    def _chosen(self, piece: Piece, where: str, kind: str, names: list[str]) -> str | None:
        given = getattr(piece, "on", None)
        if given is None and len(names) > 1:
            message = f"missing; name the {kind} that {piece.name} acts on: {', '.join(names)}"
            self.problems.append(Problem(where, message))
            return None
        if wrong := self.rig.place_problems(where, given, names, kind):
            self.problems += wrong
            return None
        return given or names[0]

    def _load_point_is_free(self) -> None:
        for i, piece in enumerate(self.plan.pieces, start=1):
            if piece.channel == channels.LOAD_POINT:
                message = (
                    f"{piece.name} sets the motion of the load point, which creep leaves to the force of the drive; "
                    "allowed: one of the two in a run, or a piece creep that says when the drive is let go"
                )
                self.problems.append(Problem(f"protocol.pieces.{i}", message))
