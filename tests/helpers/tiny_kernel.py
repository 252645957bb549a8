"""A kernel as small as they come, to be compiled and asked; here, so that processes that do so start quickly."""

import ctypes

import numpy as np

from steadyslip.kernels import build
from steadyslip.kernels.nodes import Program


def routine_at(address):
    """A routine of machine code as a Python function."""
    pointer = ctypes.POINTER(ctypes.c_double)
    function = ctypes.CFUNCTYPE(None, pointer, ctypes.c_double, pointer)(address)
    return lambda record, number, array: function(record.ctypes.data_as(pointer), number, array.ctypes.data_as(pointer))


def called(address, record, number=0.0):
    """Call machine code from here."""
    scratch = np.zeros(8)
    routine_at(address)(record, number, scratch)
    return scratch


def tiny(factor):
    """A program as small as they come."""
    program = Program("step")
    program.store(0, factor * program.load(0))
    return program


def ask(factor):
    """Value of the little kernel, made anew or found in the cache."""
    build._loaded.clear()
    record = np.ones(1)
    called(build.machine_code([tiny(factor)], 1)["step"], record)
    return record[0]
