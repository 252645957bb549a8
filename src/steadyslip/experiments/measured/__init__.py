"""Reading of laboratory files as clean records, with a note of every change made to the data."""
