"""The command line: thin, every command calls one public function. Nothing may know it."""

from steadyslip.cli.program import app, main

__all__ = ["app", "main"]
