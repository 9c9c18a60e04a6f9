"""xarray, which an extra installs: arrays whose dimensions have names."""

from typing import Any

from discover.errors import InputError


def xarray_module() -> Any:
    """Return the module xarray."""
    try:
        import xarray
    except ImportError:
        raise InputError(
            'This needs xarray; install it with: pip install "discover-rheology[xarray]".'
        ) from None
    return xarray
