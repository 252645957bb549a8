"""Compiled integration of one Model: reduced equations -> straight-line programs -> machine code.

Stages: reduction (choice of variables), `source` (expressions as operations), `kernel` (programs of one model and
method, on arrays with the indices in `layout`), `printers` (programs as text), `build` (compilation and cache) and
`runner` (arrays of parameters and settings). `driver` handles events between steps, with the same code for all models.
Nothing here depends on protocols, rigs or results.
"""
