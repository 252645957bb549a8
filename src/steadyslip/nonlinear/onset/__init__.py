"""The kind of onset at an edge of stability, and the edge in two parameters."""
