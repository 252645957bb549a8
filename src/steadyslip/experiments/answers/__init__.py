"""Results derived from fits: uncertainty, comparison of laws, prediction for another rig, planned experiments."""
