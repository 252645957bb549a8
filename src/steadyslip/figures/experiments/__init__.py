"""Figures of experiments: records with the commanded loading, fits, and predictions from fits."""
