"""Estimators in files: plain values, and where they come from."""
