"""What the pieces of a protocol act on: a body or the drive, the surfaces of a contact or the fluid in it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from steadyslip.core.errors import ParameterError, Problem, unknown_name
from steadyslip.laws.contact import ContactLaw
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import LOAD_POINT
from steadyslip.machine.slider import Slider
from steadyslip.model.equations import EITHER, MOVED, PULLED
from steadyslip.model.reducing import FREE, PORES, SWITCH
from steadyslip.protocol import Protocol, protocol as channels
from steadyslip.protocol.protocol import Piece, channel_of
from steadyslip.protocol.stress import OnBlock, OnDrive, OnNormalStress, OnPores


@dataclass(frozen=True)
class Targets:
    """What a protocol acts on, and the channels in which it is told.

    Attributes
    ----------
    pushes : tuple of str
        Coordinates that are pushed, or the drive, in the order of their first pieces.
    presses : tuple of str
        Contacts that are pressed, or into which is injected. Both as `steadyslip.model.reducing.reduce_model` takes
        them: empty where nothing is done, and "" where the block of a slider is pushed or pressed.
    channels : tuple of int
        That of each piece.
    """

    pushes: tuple[str, ...] = ()
    presses: tuple[str, ...] = ()
    channels: tuple[int, ...] = ()

    @property
    def drive(self) -> str:
        """What the drive does in the run."""
        return EITHER if FREE in self.pushes else PULLED if LOAD_POINT in self.pushes else MOVED

    def named(self) -> dict[str, tuple[int, str, str]]:
        """What a result calls the forces and stresses that act: channel, kind of target and its name, by that.

        The only push of a run is its ``disturbance``, of several each has the name of what it pushes before it; so it
        is with ``normal_disturbance`` and ``injection``. A push is there even where nothing is pushed. Where the drive
        is let go for some time, ``creep`` is 1 then.
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
"""What is pushed first where a drive is let go and moves on."""


def targets(rig: Slider | Machine, plan: Protocol) -> Targets:
    """What a protocol pushes and presses, and where it injects.

    Raises
    ------
    ParameterError
        If it is open what a piece acts on, or one acts on what does not feel it.
    """
    return _Targets(rig, plan).found()


class _Targets:
    """One pass through a protocol."""

    def __init__(self, rig: Slider | Machine, plan: Protocol) -> None:
        self.plan, self.several = plan, isinstance(rig, Machine)
        laws: Mapping[str, ContactLaw] = {"": rig.contact} if isinstance(rig, Slider) else {}
        if isinstance(rig, Machine):
            laws = {name: surface.contact for name, surface in rig.contacts.items()}
        self.laws = laws
        self.bodies = list(rig.bodies) if isinstance(rig, Machine) else [""]
        self.problems: list[Problem] = []

    def found(self) -> Targets:
        """All of them, or all problems."""
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
        """Names of what pieces of a kind act on, each once."""
        pairs = zip(self.plan.pieces, own, strict=True)
        return tuple(dict.fromkeys(name for piece, name in pairs if piece.channel == kind and name is not None))

    def _of(self, piece: Piece, where: str) -> str | None:
        """What a piece acts on; None for the motion of the load point, and where that is a problem."""
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
        if not self.several:
            if given is not None:
                self.problems.append(Problem(where, f"got {given!r}; a slider is one block, leave it out"))
            return ""
        if given is None and len(names) > 1:
            message = f"missing; name the {kind} that {piece.name} acts on: {', '.join(names)}"
            self.problems.append(Problem(where, message))
            return None
        if given is not None and given not in names:
            self.problems.append(Problem(where, unknown_name(kind, given, names)))
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
