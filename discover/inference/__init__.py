"""Hypotheses weighed by one criterion, for a loop and for a comparison."""
