"""Protocol pieces that act by stresses: disturbance of the block, added normal stress, creep, injection."""

from __future__ import annotations

from typing import ClassVar

from steadyslip.core.entries import Text
from steadyslip.core.records import setting
from steadyslip.protocol.protocol import DISTURBANCE, NORMAL_STRESS, Piece
from steadyslip.protocol.shapes import Harmonic, StressPulse, StressRamp, StressStep, StressTable


class OnNormalStress(Piece):
    """Base of pieces that add to the normal stress of the contact law, or the normal force of a machine's contact."""

    channel: ClassVar[int] = NORMAL_STRESS

    on: str | None = setting(Text("the contact, of a machine that has several"), default=None)


class OnBlock(Piece):
    """Base of pieces with a disturbance stress q that pushes the block, or a force or torque on a machine's body."""

    channel: ClassVar[int] = DISTURBANCE

    on: str | None = setting(Text("the body, of a machine that has several"), default=None)


class OnPores(Piece):
    """Base of pieces that change the pressure around a contact with pore fluid (theory 4), such as injection."""

    channel: ClassVar[int] = NORMAL_STRESS

    on: str | None = setting(Text("the contact, of a machine that has several"), default=None)


class OnDrive(Piece):
    """Base of creep pieces: the stress of the drive is imposed, and its motion is free.

    The piece adds to the stress at the drive's release if another piece releases the drive, and lasts until it moves
    again; otherwise it adds to the stress in steady sliding, and the drive is free during the whole run.
    """

    channel: ClassVar[int] = DISTURBANCE
    frees_load_point: ClassVar[bool] = True


class CreepStep(StressStep, OnDrive, name="creep-step"):
    """The drive pulls with a constant stress, which changes at once and stays so."""


class CreepRamp(StressRamp, OnDrive, name="creep-ramp"):
    """The drive pulls with a stress that grows at a constant rate for some time and stays so."""


class CreepTable(StressTable, OnDrive, name="creep-table"):
    """The drive pulls with a measured stress: linear between samples, constant before the first and after the last."""


class InjectionStep(StressStep, OnPores, name="injection-step"):
    """The pressure around a contact with pore fluid changes at once and stays so."""


class InjectionPulse(StressPulse, OnPores, name="injection-pulse"):
    """The pressure around a contact with pore fluid changes at once, and back after some time."""


class InjectionRamp(StressRamp, OnPores, name="injection-ramp"):
    """The pressure around a contact with pore fluid changes at a constant rate for some time and stays so."""


class InjectionHarmonic(Harmonic, OnPores, name="injection-harmonic"):
    """The pressure around a contact with pore fluid oscillates."""


class InjectionTable(StressTable, OnPores, name="injection-table"):
    """A measured pressure around a contact with pore fluid: linear between samples, constant before and after."""


class NormalStressStep(StressStep, OnNormalStress, name="normal-stress-step"):
    """The normal stress changes at once and stays so."""


class NormalStressPulse(StressPulse, OnNormalStress, name="normal-stress-pulse"):
    """The normal stress changes at once, and back after some time."""


class NormalStressRamp(StressRamp, OnNormalStress, name="normal-stress-ramp"):
    """The normal stress changes at a constant rate for some time and stays so."""


class NormalStressHarmonic(Harmonic, OnNormalStress, name="normal-stress-harmonic"):
    """The normal stress oscillates: amplitude · sin(2π (t − at)/period + phase) is added between `at` and `until`."""


class NormalStressTable(StressTable, OnNormalStress, name="normal-stress-table"):
    """A measured change of the normal stress: linear between samples, constant before the first and after the last."""


class DisturbanceStep(StressStep, OnBlock, name="disturbance-step"):
    """A stress begins to push the block."""


class DisturbancePulse(StressPulse, OnBlock, name="disturbance-pulse"):
    """A stress pushes the block for some time."""


class DisturbanceRamp(StressRamp, OnBlock, name="disturbance-ramp"):
    """A stress that pushes the block grows at a constant rate for some time and stays so."""


class DisturbanceHarmonic(Harmonic, OnBlock, name="disturbance-harmonic"):
    """An oscillating stress on the block: amplitude · sin(2π (t − at)/period + phase) between `at` and `until`."""


class DisturbanceTable(StressTable, OnBlock, name="disturbance-table"):
    """A measured stress on the block: linear between samples, constant before the first and after the last."""
