"""What was commanded in an experiment, found in what was measured. Knows arrays, not laws."""
