"""Effects that change the deformation that the fluid really felt."""
