"""What a closed loop found, as data: for people, pictures and other programs."""
