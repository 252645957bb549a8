"""Model -> reduced equations -> kernel text -> machine code: the fast part of the package.

reduction (which variables) -> source (expressions to text) -> kernel (one step of a method, in lanes) -> build
(compile, keep) -> program (arrays in, arrays out). `primitives`, `driver` and `field` are kernel
text, not modules; `variational` adds the linearisation along the motion.
"""
