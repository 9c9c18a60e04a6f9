"""Double precision, turned on where a program starts."""


def enable_x64() -> None:
    """Make JAX compute in float64.

    Called by the command line, by notebooks and by the tests' ``conftest``: sparse regression
    and reference solutions need it. Importing the library alone changes no global setting.
    """
    import jax

    jax.config.update("jax_enable_x64", True)
