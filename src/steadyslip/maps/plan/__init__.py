"""Definition of a map: measures, varied parameters, chunks. Does no map computation and writes no files."""
