"""The processor as the place where commands compute, whatever accelerator stands beside it."""

import os

_CHOSEN = ("JAX_PLATFORMS", "JAX_PLATFORM_NAME")


def use_the_processor_from_the_start() -> None:
    """Let JAX, once this process or one begun from it loads it, compute on the processor.

    The loops here are thousands of steps on arrays of a few hundred numbers, and an accelerator
    begins each anew: ``discover demo`` takes 53 s on the processor beside an H100, and 143 s on
    that, for the same answers. A choice of the user's, ``JAX_PLATFORMS=cuda`` say, stays as it is.
    """
    if not any(os.environ.get(name) for name in _CHOSEN):
        os.environ["JAX_PLATFORMS"] = "cpu"
