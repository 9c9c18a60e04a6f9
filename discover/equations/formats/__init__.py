"""The forms in which a law leaves, and in which it comes back."""
