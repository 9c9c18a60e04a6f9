"""Bands of N1, N2 and σ12, and what widens them."""
