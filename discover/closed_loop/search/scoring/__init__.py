"""What a candidate is worth: its score, its refit, the evidence for it, and its values."""
