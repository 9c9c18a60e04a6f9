"""Text tables and their units."""
