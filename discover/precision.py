"""Double precision, turned on where a program starts."""


def enable_x64() -> None:
    """Make JAX compute in float64.

    Sparse regression and reference solutions need it. Whatever computes calls this when it is first
    used (`discover.first_use`); ``import discover`` alone changes no global setting.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
