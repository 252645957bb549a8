"""Figures of experiments: records and what was commanded in them, fits, and what follows from them."""
