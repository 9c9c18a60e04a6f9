"""What is doubtful in an amplitude sweep, by itself and against the linear sweep."""

from collections.abc import Iterator

import numpy as np

from discover.dataset.checking.finding import Finding
from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.dataset.run import Run

# A sweep begins where the fluid is linear; above this amplitude no edge stays whole for many cycles
_LARGEST_FIRST, _LARGEST = 0.5, 30.0

# A small strain, and by how much G* there may differ from that of the linear sweep: another loading
_SMALL, _APART = 0.1, 0.2


def doubts_of_amplitude_sweep(run: Run, linear: LinearSweep | None) -> Iterator[Finding]:
    """Yield what is doubtful in an amplitude sweep."""
    if run.strain is None or run.storage_modulus is None or run.loss_modulus is None:
        return
    low, high = float(np.min(run.strain)), float(np.max(run.strain))
    if low > _LARGEST_FIRST and high > _LARGEST:
        yield Finding(
            "warning",
            "units",
            run.name,
            f"The strain in {run.name} goes from {low:.3g} to {high:.3g}. If that is in per cent, "
            "rename the column to strain_percent.",
        )
    for name, values in (("G′", run.storage_modulus), ("G″", run.loss_modulus)):
        if np.any(values <= 0.0):
            yield Finding(
                "warning",
                "sign",
                run.name,
                f"{np.count_nonzero(values <= 0.0)} values of {name} in {run.name} are not "
                "positive, as those of a passive fluid are: they are noise, or the phase is wrong.",
            )
    if linear is None:
        return
    omega = run.angular_frequency
    inside = (omega >= linear.angular_frequency[0]) & (omega <= linear.angular_frequency[-1])
    small = inside & (run.strain <= _SMALL)
    if not np.any(small):
        return
    expected, found = (
        np.hypot(storage, loss)
        for storage, loss in (
            (linear.storage_modulus, linear.loss_modulus),
            (run.storage_modulus[small], run.loss_modulus[small]),
        )
    )
    at = np.log(linear.angular_frequency)
    factor = float(np.median(found / np.exp(np.interp(np.log(omega[small]), at, np.log(expected)))))
    if abs(np.log(factor)) > _APART:
        yield Finding(
            "warning",
            "sweep",
            run.name,
            f"At strains up to {_SMALL:g} the modulus in {run.name} is {factor:.2g} times that of "
            "lve.csv at the same frequency: another loading, another unit, or no linear range.",
        )
