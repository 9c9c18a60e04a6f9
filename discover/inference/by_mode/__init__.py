"""Constants that may differ from mode to mode: how freely, how surely, and under which law."""
