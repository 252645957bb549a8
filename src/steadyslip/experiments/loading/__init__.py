"""Commanded loading of an experiment, found in measured columns; works on arrays, independent of friction laws."""
