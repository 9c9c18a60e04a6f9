"""Is what a model leaves noise? Asked of the fitted runs, of those held out, and of arithmetic."""
