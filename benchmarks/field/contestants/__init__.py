"""One file a contestant, registered by being here: see `docs/evidence.md`."""
