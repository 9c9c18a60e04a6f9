"""Effects that change what was recorded."""
