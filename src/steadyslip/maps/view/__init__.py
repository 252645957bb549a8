"""What is seen of a map: its result, cuts through it, other files of it."""
