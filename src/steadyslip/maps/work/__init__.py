"""Who computes a map: one chunk of it, workers here or on a cluster, and a run from start to end."""
