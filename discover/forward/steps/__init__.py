"""One step in time: its weights, and the same method as a solver of diffrax."""
