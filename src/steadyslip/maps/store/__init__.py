"""Storage of a map: a folder with checked access, its layout and its arrays. Independent of how maps are computed."""
