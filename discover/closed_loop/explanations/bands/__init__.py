"""How far predictions and constants are known, over all explanations."""
