"""Trajectories of trial laws of a library, with derivatives: what learners of terms fit through."""
