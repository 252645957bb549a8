"""The driver as LLVM assembly."""
