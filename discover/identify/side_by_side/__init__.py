"""Many laws of one library in many flows: one compiled program for all."""
