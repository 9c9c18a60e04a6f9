"""Studies as tasks: one folder each, resumable, alone or many at a time."""
