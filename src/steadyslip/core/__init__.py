"""What every other part stands on: declared records of parameters, quantities with units, errors, progress, registries.

Knows nothing of friction."""
