"""How sure what was found is: explained or not, determined or open, and what to measure next."""
