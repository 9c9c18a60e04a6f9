"""What faults of reading leave in residuals."""
