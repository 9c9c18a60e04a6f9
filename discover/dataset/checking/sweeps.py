"""Doubts about linear and amplitude sweeps, by themselves."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from discover.dataset.checking.finding import Finding
from discover.dataset.linear.mode_search import BEYOND, relative_moduli, solved
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
        text = (
            f"The strain in {run.name} goes from {low:.3g} to {high:.3g}. If that is in per cent, "
            "rename the column to strain_percent."
        )
        yield Finding("warning", "units", run.name, text)
    for name, values in (("G′", run.storage_modulus), ("G″", run.loss_modulus)):
        if np.any(values <= 0.0):
            text = (
                f"{np.count_nonzero(values <= 0.0)} values of {name} in {run.name} are not "
                "positive, as those of a passive fluid are: they are noise, or the phase is wrong."
            )
            yield Finding("warning", "sign", run.name, text)
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
        text = (
            f"At strains up to {_SMALL:g} the modulus in {run.name} is {factor:.2g} times that of "
            "lve.csv at the same frequency: another loading, another unit, or no linear range."
        )
        yield Finding("warning", "sweep", run.name, text)


# Modes enough for any sweep of so many points; more would only fit its noise
_POINTS_PER_MODE = 1.5


@dataclass(frozen=True)
class SweepInertia:
    """What a term −I ω² in G′ does for a sum of Maxwell modes.

    `inertia`: I in Pa s². Positive where the tool's inertia was not subtracted, or not enough of
        it; negative where too much was.
    `deviation`: its standard deviation.
    `error_before`, `error_after`: root mean square of the misfit of G′ and G″ over the magnitude of
        the complex modulus, without and with the term.
    `evidence`: lowering of the Bayesian information criterion; 6 is strong [Kass & Raftery 1995,
        JASA 90, 773].
    """

    inertia: float
    deviation: float
    error_before: float
    error_after: float
    evidence: float


def sweep_inertia(sweep: LinearSweep) -> SweepInertia:
    """Return how much of G′ is inertia, with Maxwell modes, a solvent and an elastic constant.

    The torque on tool and sample is G* − I ω² times the strain   [Krieger 1990, J. Rheol. 34, 471].
    Modes with positive moduli only rise in G′, so a G′ that falls with ω² is no material's; a
    solvent raises G″ alone, and an elastic constant raises G′ at every frequency alike.

    `sweep`: G′ and G″. As recorded, or raw; raw G′ may be negative.
    """
    omega = np.asarray(sweep.angular_frequency, dtype=float)
    size = np.hypot(sweep.storage_modulus, sweep.loss_modulus)
    data = np.concatenate([sweep.storage_modulus / size, sweep.loss_modulus / size])
    zero = np.zeros_like(omega)
    falling = np.concatenate([-(omega**2) / size, zero])[:, None]
    n_modes = max(1, int(len(omega) / _POINTS_PER_MODE))
    trials = []
    for margin in np.linspace(0.0, BEYOND, 4):
        times = np.geomspace(10.0**-margin / omega.max(), 10.0**margin / omega.min(), n_modes)
        modes = relative_moduli(omega, np.stack([size, size]), times, solvent=True, elastic=True)
        # either sign: the correction may have been too small or too large
        trials.append((solved(modes, data), solved(np.hstack([modes, falling, -falling]), data)))
    before = min((without for without, _ in trials), key=lambda fit: fit[1])
    after = min((with_it for _, with_it in trials), key=lambda fit: fit[1])
    inertia = float(after[0][-2] - after[0][-1])
    n = len(data)
    gain = n * np.log(max(before[1], 1e-300) / max(after[1], 1e-300)) - np.log(n)
    column = falling[:, 0]
    deviation = np.sqrt(after[1] / max(n - 1, 1) / max(float(column @ column), 1e-300))
    return SweepInertia(
        inertia,
        float(deviation),
        float(np.sqrt(before[1] / n)),
        float(np.sqrt(after[1] / n)),
        float(gain),
    )
