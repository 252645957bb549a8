"""Translation of the driver to LLVM assembly."""
