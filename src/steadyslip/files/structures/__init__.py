"""Data of structures from files: matrices and modes, of bounded size.

Knows formats, not machines: what is read is `steadyslip.machine.structures.StructureData`.
"""
