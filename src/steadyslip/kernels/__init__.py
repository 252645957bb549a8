"""Compiled integration of one Model: reduced equations -> straight-line programs -> machine code.

Order of the work: reduction (choice of variables), `source` (expressions as operations), `kernel` (programs of one
model and method, on arrays laid out by `layout`), `printers` (code as text), `build` (compilation and cache), `runner`
(arrays in, arrays out). `driver` handles events between steps with one code for all models. Nothing here depends on
protocols, rigs or results.
"""
