"""What noise is like: its size, its correlation, and what only looks like it."""
