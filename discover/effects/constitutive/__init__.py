"""Effects that change the fluid."""
