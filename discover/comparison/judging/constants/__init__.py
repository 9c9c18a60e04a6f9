"""Constants of the declared model: what of them is open, and whether modes share them."""
