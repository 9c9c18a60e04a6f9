"""Linear sweeps: the modes that they support, and sweeps at several temperatures moved to one."""
