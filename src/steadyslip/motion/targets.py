"""What the pieces of a protocol act on: a body or the drive, the surfaces of a contact or the fluid in it."""

from __future__ import annotations

from collections.abc import Mapping

from steadyslip.core.errors import ParameterError, Problem, unknown_name
from steadyslip.laws.contact import ContactLaw
from steadyslip.machine.machine import Machine
from steadyslip.machine.mechanism import LOAD_POINT
from steadyslip.machine.slider import Slider
from steadyslip.model.reducing import PORES
from steadyslip.protocol import Protocol, protocol as channels
from steadyslip.protocol.protocol import Piece
from steadyslip.protocol.stress import OnBlock, OnDrive, OnNormalStress, OnPores


def targets(rig: Slider | Machine, plan: Protocol) -> tuple[str, str]:
    """The coordinate that a protocol pushes, or the drive; and the contact that it presses, or into which it injects.

    As `steadyslip.model.reducing.reduce_model` takes them; empty where it does neither.

    Raises
    ------
    ParameterError
        If it is open what a piece acts on, several pieces act on different ones, or one on what does not feel it.
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
        self.own: dict[int, str] = {}

    def found(self) -> tuple[str, str]:
        """Both, or all problems."""
        for i, piece in enumerate(self.plan.pieces, start=1):
            where = f"protocol.pieces.{i}"
            if isinstance(piece, OnDrive):
                self._take(piece, where, LOAD_POINT)
            elif isinstance(piece, OnBlock):
                self._take(piece, f"{where}.on", self._chosen(piece, f"{where}.on", "body", self.bodies))
            elif isinstance(piece, OnNormalStress):
                self._take(piece, f"{where}.on", self._chosen(piece, f"{where}.on", "contact", list(self.laws)))
            elif isinstance(piece, OnPores):
                self._inject(piece, where)
        if self.plan.frees_load_point:
            self._load_point_is_free()
        if self.problems:
            raise ParameterError(self.problems)
        return self.own.get(channels.DISTURBANCE, ""), self.own.get(channels.NORMAL_STRESS, "")

    def _inject(self, piece: OnPores, where: str) -> None:
        wet = [name for name, law in self.laws.items() if law.has_pores()]
        if not wet:
            own = " and ".join(dict.fromkeys(law.name or type(law).__name__ for law in self.laws.values()))
            message = f"{piece.name} needs a contact with pore fluid, of law pore-fluid; here it is {own}"
            self.problems.append(Problem(where, message))
            return
        contact = self._chosen(piece, f"{where}.on", "contact with pore fluid", wet)
        self._take(piece, f"{where}.on", None if contact is None else contact + PORES)

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

    def _take(self, piece: Piece, where: str, target: str | None) -> None:
        if target is None:
            return
        other = self.own.setdefault(piece.channel, target)
        if other != target:
            kind = "body" if piece.channel == channels.DISTURBANCE else "contact"
            message = (
                f"{piece.name} acts on {self._called(target, kind)}, but an earlier piece acts on "
                f"{self._called(other, kind)}; allowed: one {kind} a run"
            )
            self.problems.append(Problem(where, message))

    def _called(self, target: str, kind: str) -> str:
        if target == LOAD_POINT:
            return "the drive's pull"
        name = target.removesuffix(PORES)
        whose = repr(name) if name else {"body": "the block", "contact": "the normal stress"}[kind]
        if not target.endswith(PORES):
            return whose
        return f"the fluid of {name!r}" if name else "the fluid in the pores"

    def _load_point_is_free(self) -> None:
        for i, piece in enumerate(self.plan.pieces, start=1):
            if piece.channel == channels.LOAD_POINT:
                message = (
                    f"{piece.name} sets the motion of the load point, which creep leaves to the force of the drive; "
                    "allowed: one of the two in a run"
                )
                self.problems.append(Problem(f"protocol.pieces.{i}", message))
