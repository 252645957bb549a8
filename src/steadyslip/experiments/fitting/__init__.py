"""From records and a rig to a fit: what drives it, the compiled model, starts, minimum, result."""
