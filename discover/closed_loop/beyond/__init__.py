"""What is told beyond the effects that a search found: free functions, next tests, bands."""
