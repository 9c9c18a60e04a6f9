"""Pages, pictures and equations from results."""
