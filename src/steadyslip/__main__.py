"""``python -m steadyslip``: the command line."""

from steadyslip.cli import main

main()
