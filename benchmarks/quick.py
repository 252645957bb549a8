"""``--quick`` of every script: a few seconds, to see that it runs; what it prints then says little."""

from __future__ import annotations

import argparse
import sys
from typing import Any

QUICK = "--quick" in sys.argv


def parsed(parser: argparse.ArgumentParser, **few: Any) -> argparse.Namespace:
    """What a script was asked for; with ``--quick`` the defaults are `few`."""
    parser.add_argument("--quick", action="store_true", help="a few seconds, to see that it runs")
    if QUICK:
        parser.set_defaults(**few)
    return parser.parse_args()
