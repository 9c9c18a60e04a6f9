"""Linear tests at several temperatures, and what they say of one another."""
