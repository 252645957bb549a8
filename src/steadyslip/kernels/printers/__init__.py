"""Programs as text: LLVM assembly for machine code, Python for debuggers, JavaScript for browsers."""
