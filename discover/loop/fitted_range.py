"""The flows of the fitted runs, in numbers: where a law was learned."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.answer import Range
from discover.answer.modes_in_words import degrees
from discover.equations import Equation
from discover.equations.equation import flow_numbers
from discover.loop.runs import RunRecord
from discover.words import significant

# Share of the largest rate that a flow reaches in the other direction, if it oscillates
_TURNS = 0.5
# Share of the time of a run for which it is at most as slow as the slowest rate of its range
_STAYS = 0.05
# Share of the largest rate, and of the samples, from which on a rate passes and does not jump
_PASSED = 0.1
_SAME = 0.8  # Share of the largest rate above which a rate that was read is one rate
# Share of the largest rate up to which a sheared fluid is taken to be at rest, as after a stop
_AT_REST = 1e-3


def by_temperature(records: Sequence[RunRecord]) -> dict[float, list[RunRecord]]:
    """Return runs as the instrument had them by temperature in °C, the hottest first.

    Empty where none was shifted to another temperature, or where the temperature of one is unknown.
    """
    found: dict[float, list[RunRecord]] = {}
    for record in records:
        if (at := record.temperature_C) is None:
            return {}
        found.setdefault(at, []).append(record.unshifted)
    shifted = any(record.shift != 1.0 for record in records)
    return dict(sorted(found.items(), reverse=True)) if shifted else {}


def as_measured(records: Sequence[RunRecord], rate: float | None = None) -> str:
    """Return a rate, by default its own, as the fastest run has it at its temperature."""
    fastest = max(records, key=lambda record: record.fastest)
    share = 1.0 if rate is None else rate / fastest.fastest
    at = fastest.temperature_C
    place = "" if fastest.shift == 1.0 or at is None else f" and {degrees(at)}"
    return f"{significant(share * fastest.unshifted.fastest, 2)} 1/s{place}"


def range_of(records: Sequence[RunRecord], equation: Equation | None = None) -> Range:
    """Return the flows of the fitted runs, in numbers without units if the equation has them.

    Of a flow curve each sample counts, of an oscillation the amplitude, of other runs the largest
    rate and the smallest at which the run stays. Of shifted runs also by temperature, unshifted.
    """
    fitted = [record for record in records if not record.held_out]
    measured = {at: _range(own, None) for at, own in by_temperature(fitted).items()}
    return replace(_range(fitted, equation), by_temperature=measured)


def _range(fitted: Sequence[RunRecord], equation: Equation | None) -> Range:
    flows = tuple(dict.fromkeys(record.flow for record in fitted)) or ("shear",)
    strains = [float(np.nanmax(np.abs(r.strain))) for r in fitted if np.any(np.isfinite(r.strain))]
    strain = (0.0, max(strains)) if strains else None
    if fitted and all(record.control == "oscillation" for record in fitted):
        frequencies = np.concatenate([record.rate / record.strain for record in fitted])
        ends = float(np.min(frequencies)), float(np.max(frequencies))
        return Range(None, None, strain, None, ends, flows)
    turned = [r for r in fitted if _turns(r)]
    rates = [rate for r in fitted for rate in (*_rates_of(r), abs(r.rate_before)) if rate > 0.0]
    box = None if equation is None or equation.tested is None else equation.tested.learned_in
    # one that turns has a frequency besides its rate
    found = [flow_numbers(r.time, r.rate, 1.0)[1] for r in turned]
    sizes = [0.5 * float(np.nanmax(r.strain) - np.nanmin(r.strain)) for r in turned]
    tests = dict.fromkeys(test for r in fitted if (test := _test(r)))
    return Range(
        None if box is None else box.weissenberg,
        None if box is None else box.deborah,
        strain,
        (min(rates), max(rates)) if rates else None,
        (min(found), max(found)) if found else None,
        flows,
        bool(turned),
        amplitude=(min(sizes), max(sizes)) if sizes and len(sizes) == len(fitted) else None,
        steady=bool(fitted) and all(r.control == "steady" for r in fitted),
        tests=tuple(sorted(tests, reverse=True)),  # start-up before creep and oscillation
    )


def _turns(record: RunRecord) -> bool:
    if record.control == "stress":  # the slope of a noisy strain changes its sign at any time
        return False
    ways = np.sign(record.rate[np.abs(record.rate) > _TURNS * record.fastest])
    # one is a reversal, unless the rate passes through all between, as in one cycle
    sizes, jumps = np.abs(record.rate), np.abs(np.diff(record.rate)) > _TURNS * record.fastest
    between = (sizes > _PASSED * record.fastest) & (sizes < _TURNS * record.fastest)
    slow = np.mean(between) > _PASSED and not np.any(jumps)
    return record.is_transient and bool(np.count_nonzero(np.diff(ways)) > (0 if slow else 1))


def _test(record: RunRecord) -> str:
    """Return what a transient is, in words; empty of what turns, and of states."""
    before = record.rate_before
    if not record.is_transient or _turns(record):
        return ""
    if record.control == "stress":
        return "creep"
    if record.fastest == 0.0 and not before:
        return "stress relaxation"
    rates = record.rate * np.sign(record.rate[-1])
    one = np.percentile(rates, 5.0) >= _SAME * record.fastest
    if one and not before:
        return "start-up"
    return "cessation" if one and record.fastest <= _AT_REST * abs(before) else "steps of rate"


def shows_recovery(records: Sequence[RunRecord]) -> bool:
    """Return whether fitted runs show what recovers: shear that falls to slower shear or to rest.

    A fluid that flow softens is thixotropic if it does   [Mewis & Wagner 2009, Adv. Colloid
    Interface Sci. 147, 214].
    """
    return any(_falls(r.rate) for r in records if r.control == "rate" and not r.held_out)


def _falls(rate: Float[np.ndarray, " n"]) -> bool:
    """Return whether a rate that hardly turns ends, over a tenth of its samples, below half."""
    last = np.median(rate[-max(len(rate) // 10, 1) :])
    ways = abs(np.min(rate)), abs(np.max(rate))
    swings_past = min(ways) if np.min(rate) < 0.0 < np.max(rate) else 0.0  # as a motor does
    return bool(abs(last) < 0.5 * max(ways) and swings_past < 0.2 * max(ways))


def described(record: RunRecord) -> str:
    """Return what a run is with its rates as the instrument had them, and its name in brackets."""
    own = record.unshifted
    rates = own.rate_before or own.rate[0], own.rate[-1]
    first, last = (significant(abs(float(rate)), 2) for rate in rates)
    step = f"the step from {first} to"
    told = {"start-up": "the start-up at", "steps of rate": step, "cessation": step}
    what = told.get(_test(record), "")
    return f"{what} {last} 1/s ({record.name})" if what else record.name


def _rates_of(record: RunRecord) -> list[float]:
    """Return the slowest rate at which a run stays and its fastest; of states each."""
    if record.control == "oscillation":
        return []
    if _turns(record):
        return [record.fastest]
    rates = np.abs(record.rate)
    if not record.is_transient:
        return [float(rate) for rate in rates]
    lasting = np.gradient(record.time) if len(rates) > 1 else np.ones(1)
    moving = np.flatnonzero(rates > _AT_REST * record.fastest)
    order = moving[np.argsort(rates[moving])]
    passed = np.cumsum(lasting[order])
    slowest = order[np.searchsorted(passed, _STAYS * passed[-1])] if len(order) else 0
    return [float(rates[slowest]), record.fastest]
