"""Is a law physically sound, and where does it fail: checks that hold for any law."""
