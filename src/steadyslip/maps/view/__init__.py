"""Access to a computed map: its result, sections for figures, export to other file formats."""
