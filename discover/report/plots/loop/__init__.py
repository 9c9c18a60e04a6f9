"""Pictures of a closed loop."""
