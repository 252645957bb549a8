"""Programs as text: LLVM assembly for the machine, Python to step through. Knows nodes only."""
