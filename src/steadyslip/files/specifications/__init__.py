"""Rig files: TOML text to and from a `Slider` and a `Protocol`, and the JSON schema of the format.

Nothing here lists a parameter: keys, units, domains and defaults are those declared by the records.
Opening a file never executes code; laws are found by registered name or installed entry point.
"""

from steadyslip.files.specifications.protocols import piece_from_text, protocol_from_text, read_protocol
from steadyslip.files.specifications.read import read_rig, rig_from_text
from steadyslip.files.specifications.schema import json_schema
from steadyslip.files.specifications.write import rig_to_text, write_rig

__all__ = [
    "json_schema",
    "piece_from_text",
    "protocol_from_text",
    "read_protocol",
    "read_rig",
    "rig_from_text",
    "rig_to_text",
    "write_rig",
]
