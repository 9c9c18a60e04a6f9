"""What two laws share in shear, in exact arithmetic."""
