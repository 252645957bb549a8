"""Where a map lies: a folder that stays inside itself, its layout, its arrays. Knows nothing of who computes."""
