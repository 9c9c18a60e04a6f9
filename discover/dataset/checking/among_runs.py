"""Doubts about runs held against one another: another unit in one of them, or temperature."""

from collections.abc import Iterator, Sequence

import numpy as np
from jaxtyping import Float

from discover.dataset.checking.finding import Finding
from discover.dataset.run import Run
from discover.protocols.kinematics import KINDS

# Units differ by 60, 100 or 1000; what fluids do beyond the bounds below (they thicken, yield or
# band) stays within this factor
_UNIT_FACTOR = 30.0

_ONE_TEMPERATURE = 2.0
"""In °C. Times change by 2 to 10 % a degree (Ferry 1980, ch. 11), so that less than this is within
the gain and the noise of most records."""


def is_start_up(run: Run) -> bool:
    """Return whether a run is at one rate, in three samples or more."""
    rate = run.rate
    return bool(len(run) >= 3 and rate[0] != 0 and np.ptp(rate) <= 1e-6 * np.max(np.abs(rate)))


def doubts_among_runs(runs: Sequence[Run]) -> Iterator[Finding]:
    """Yield which start-ups do not go together with the others.

    In a faster start-up the largest stress is no smaller, and larger by the ratio of the rates at
    most, as viscosities do not rise with the rate; half of it is reached no later, and earlier by
    that ratio at most, which is the same strain. Shear thickening and yielding break these rules by
    less than another unit of stress or of time does. Another unit of rate may pass for thinning.

    `runs`: those that load; less than two start-ups say nothing.
    """
    for kind in KINDS:  # the stress of an extension is not that of a shear at the same rate
        alike = [r for r in runs if r.flow == kind and r.from_rest and is_start_up(r)]
        yield from _among_alike(alike)


def doubts_of_temperature(runs: Sequence[Run]) -> Iterator[Finding]:
    """Yield that runs at several temperatures are taken for those of one fluid, if they are.

    `runs`: those whose times nobody has shifted to one temperature, with ``temperature_C`` of
    runs.csv.
    """
    told = {run.name: run.metadata.get("temperature_C") for run in runs}
    known = {name: float(t) for name, t in told.items() if isinstance(t, int | float)}
    if not known or max(known.values()) - min(known.values()) <= _ONE_TEMPERATURE:
        return
    coldest, hottest = min(known, key=known.__getitem__), max(known, key=known.__getitem__)
    yield Finding(
        "warning",
        "temperature",
        "",
        f"{coldest} was measured at {known[coldest]:g} °C and {hottest} at {known[hottest]:g} °C, "
        "and relaxation times change by some per cent a degree: one law for both looks like a "
        "missing effect. Fit the runs of one temperature ([data] fit), or shift their times to one "
        "and name the column of the factors ([data] clock_factor).",
    )


def _among_alike(start_ups: Sequence[Run]) -> Iterator[Finding]:
    if len(start_ups) < 2:
        return
    rates = np.array([abs(run.rate[0]) for run in start_ups])
    for what, quantity, rises in (
        ("The stress", _largest, True),
        ("The time at which the stress rises", _half_time, False),
    ):
        values = np.array([quantity(run) for run in start_ups])
        for run, ratio in zip(start_ups, _least_outside(values, rates, rises), strict=True):
            if abs(np.log(ratio)) < np.log(_UNIT_FACTOR):
                continue
            large = f"{ratio:.2g} times too large"
            size = large if ratio > 1.0 else f"{1.0 / ratio:.2g} times too small"
            yield Finding(
                "warning",
                "units",
                run.name,
                f"{what} in {run.name} is at least {size} for its shear rate, beside the other "
                "start-ups. Check the units of its stress and time (kPa for Pa, ms for s).",
            )


def _largest(run: Run) -> float:
    return float(np.max(np.abs(run.stress)))


def _half_time(run: Run) -> float:
    stress = np.abs(run.stress)
    return float(run.time[int(np.argmax(stress >= 0.5 * np.max(stress)))])


def _least_outside(
    values: Float[np.ndarray, " n"], rates: Float[np.ndarray, " n"], rises: bool
) -> Float[np.ndarray, " n"]:
    """Return by which factor each run is outside what the others allow; 1 inside.

    Of two nobody knows which is wrong, and both are named; of more, a run is held against the one
    that it fits best.
    """
    found = np.ones(len(values))
    if not np.all(values > 0.0):
        return found
    for i in range(len(values)):
        reference, share = np.delete(values, i), rates[i] / np.delete(rates, i)
        bound = reference * (share if rises else 1.0 / share)
        low, high = np.minimum(reference, bound), np.maximum(reference, bound)
        ratios = values[i] / np.clip(values[i], low, high)
        found[i] = ratios[np.argmin(np.abs(np.log(ratios)))]
    return found
