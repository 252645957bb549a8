"""The Model: everything that is known of a rig, as expressions; the waist through which all later stages go."""

from steadyslip.model.equations import Model, build_model

__all__ = ["Model", "build_model"]
