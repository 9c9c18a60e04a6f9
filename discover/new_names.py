"""Names under which a user registers a law, an effect, an importer or a learner."""

from collections.abc import Sequence

from discover.errors import InputError


def require_new_name(name: str, known: Sequence[str], what: str) -> None:
    """Check a name that is to be registered.

    Parameters
    ----------
    known
        Names that are taken.
    what
        What it is to name, in the singular.
    """
    if not isinstance(name, str) or not name.isidentifier() or name != name.lower():
        raise InputError(
            f"The name of a {what} must be lower-case letters, digits and underscores; got "
            f"{name!r}. Write it like 'giesekus_mobility'."
        )
    if name in known:
        raise InputError(
            f"The {what} {name!r} is known already, and what was computed with it is kept under "
            "that name. Choose another name, or start Python anew."
        )
