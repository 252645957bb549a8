"""What the sliding contact is built into: the slider and its drive."""
