"""The command line: each command calls one public function. No other folder imports this one."""

from steadyslip.cli.program import app, main

__all__ = ["app", "main"]
