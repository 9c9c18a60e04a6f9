"""Fluids followed in time: one step, and what is asked of it at a given rate and a given stress."""
