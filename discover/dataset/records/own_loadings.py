"""Runs each of which is a loading of its own."""

from collections.abc import Sequence
from dataclasses import replace

from discover.dataset.loading import LARGEST, Loading
from discover.dataset.run import Run
from discover.errors import InputError


def with_loadings(runs: Sequence[Run], deviation: float | None, noise: float | None) -> list[Run]:
    """Return runs each of which is a loading of its own; as they are where nothing is said of it.

    `deviation`: relative standard deviation by which loadings differ. `noise`: relative noise,
    where it is known. Raises InputError if they cannot differ so, or a stress was imposed, which a
    factor changes otherwise.
    """
    if deviation is None:
        return list(runs)
    if not 0.0 < deviation <= LARGEST:
        raise InputError(
            f"loading must be above 0 and at most {LARGEST:g}; got {deviation:g}. It is "
            "the relative standard deviation by which loadings of a sample differ, such as 0.03."
        )
    creep = [run.name for run in runs if run.protocol.control == "stress"]
    if creep:
        raise InputError(
            f"loading is a factor on a recorded stress, and the stress of the run {creep[0]!r} was "
            "imposed. Take such runs out, or leave loading out."
        )
    return [replace(run, loading=Loading(deviation, noise)) for run in runs]
