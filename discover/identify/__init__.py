"""What data determine and what they leave open."""
