"""What else may describe the runs as well: the bench, the reading, the loading, a further mode."""
