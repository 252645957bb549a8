"""Rig files: TOML text to and from a `Slider`, `Machine`, `Protocol` and further tables, and their JSON schema.

No parameter is listed here: keys, units, domains and defaults are those that records declare; maps and fits pass the
tables that they need (`read.read_contents`). Opening a file never executes code; laws are found by registered name or
installed entry point.
"""

from steadyslip.files.specifications.changes import named_value
from steadyslip.files.specifications.protocols import piece_from_text, protocol_from_text, read_protocol
from steadyslip.files.specifications.read import read_rig, read_slider, rig_from_text, slider_from_text
from steadyslip.files.specifications.write import rig_to_text, stored_text, write_rig

__all__ = [
    "named_value",
    "piece_from_text",
    "protocol_from_text",
    "read_protocol",
    "read_rig",
    "read_slider",
    "rig_from_text",
    "rig_to_text",
    "slider_from_text",
    "stored_text",
    "write_rig",
]
