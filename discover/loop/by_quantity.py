"""Expected error of each quantity: of unseen runs without noise, else how far laws differ."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.special import chdtri

from discover.answer import Discrepancy, ExpectedError
from discover.answer.modes_in_words import degrees, span
from discover.loop.findings import LoopFindings
from discover.loop.fitted_range import as_measured, by_temperature
from discover.loop.runs import RunRecord
from discover.protocols.kinematics import MODULI
from discover.statistics.noise_model import rms
from discover.words import counted, listed, percent_of, significant

BEYOND = 2.0
"""Rates beyond the fastest fitted one, at which errors beyond the range are given."""

_APART = 0.2  # Relative difference between laws from which on a quantity is not determined
# Relative difference between laws that is told of a quantity that nothing tested
_WORTH_SAYING = 0.05

FASTER = 1.01
"""Rate over the fastest fitted one, from which on a run lies beyond the range."""

_UNSEEN, _FITTED = "unseen runs", "fitted runs"


def beyond_noise(error: float, noise: float | None) -> float:
    """Return what an error holds besides noise."""
    return float(np.sqrt(max(error**2 - (noise or 0.0) ** 2, 0.0)))


def of_fitted(records: Sequence[RunRecord], error: float, noise: float) -> Discrepancy:
    """Return what a law leaves of the fitted runs besides noise, without an interval."""
    size = beyond_noise(error, noise)
    fitted = [record for record in records if not record.held_out]
    by_run = {one.name: beyond_noise(float(one.errors[-1]), noise) for one in fitted}
    return Discrepancy(size, (size, size), by_run)


def with_unseen(result: LoopFindings) -> Discrepancy | None:
    """Return the discrepancy of a closed loop, of all unseen runs in the range if there are any."""
    if result.discrepancy is None:
        return None
    found, errors = result.discrepancy, unseen_errors(result)
    size, count = _mean([*errors.values()]), len(errors)
    if not found.size or size is None:
        return found
    # of few runs the size is uncertain, as that of normal misses is
    ends = np.sqrt(count / chdtri(count, (0.025, 0.975))) if count > 1 else np.ones(2)
    return replace(
        found,
        size=size,
        ci95=(float(ends[0]) * size, float(ends[1]) * size),
        by_run=(by_run := {**found.by_run, **errors}),
        unseen=_UNSEEN,
        met_up_to=_met_up_to(result, by_run),
    )


def _met_up_to(result: LoopFindings, by_run: Mapping[str, float]) -> str:
    """Return the rate up to which all runs meet the tolerance; empty where all do, or none."""
    own = sorted((r for r in result.records if r.name in by_run), key=lambda r: r.fastest)
    missed = [r.fastest for r in own if by_run[r.name] > result.tolerance]
    met = [r for r in own if missed and FASTER * r.fastest < missed[0]]
    several = len(by_temperature(own)) > 1 or len({(r.flow, r.quantity) for r in own}) > 1
    if several or not met:
        return ""
    rate = met[-1].unshifted.fastest
    return f"{span((rate, rate))} 1/s"


def unseen_errors(result: LoopFindings, kind: str = "") -> dict[str, float]:
    """Return errors without noise, by name of runs left out in turn, and of those held out.

    `kind`: quantity of `QUANTITIES` that these record; by default all of them.
    """
    if result.folds:
        found = {
            fold.run: beyond_noise(fold.error_after, result.noise_floor) for fold in result.folds
        }
    else:
        found = dict(result.left_out)
        found |= {
            record.name: beyond_noise(float(record.errors[-1]), result.noise_floor)
            for record in _held_inside(result)
        }
    own = {record.name for record in result.records if not kind or _is(record, kind)}
    return {name: error for name, error in found.items() if name in own}


def _held_inside(result: LoopFindings) -> list[RunRecord]:
    """Return runs held out of flows, quantities and rates that were fitted."""
    fitted = [record for record in result.records if not record.held_out]
    kinds = {(record.flow, record.quantity) for record in fitted}
    fastest = max((record.fastest for record in fitted), default=0.0)
    return [
        record
        for record in result.records
        if record.held_out
        and (record.flow, record.quantity) in kinds
        and record.fastest <= FASTER * fastest
        and np.isfinite(record.errors[-1])
    ]


def errors_by_quantity(result: LoopFindings) -> dict[str, ExpectedError]:
    """Return expected errors: of what was measured, else by how far equally good laws differ."""
    found = {"sigma12": of_stress(result)}
    for kind in ("N1", "N2", "uniaxial"):
        own = measured(result, kind)
        unseen = {} if own is None else unseen_errors(result, kind)
        if own is not None and (inside := _mean([*unseen.values()])) is not None:
            note = counted(len(unseen), "unseen run")
            own = replace(own, inside=inside, note=note, is_residual=False)
        found[kind] = own or _by_law(result, kind)
    return found


def _by_law(result: LoopFindings, kind: str) -> ExpectedError:
    """Return what is known of a stress that nothing measured: by how much equally good laws differ.

    No number is an error of what nothing tested. N2 is that of the law, unless they differ.
    """
    apart, limit = differing(result, kind), _WORTH_SAYING if kind == "N2" else _APART
    ends = _spread(result, kind)
    there = kind == "N1" and any(record.has_normal_stress for record in result.records)
    unused = "measured but not used" if there else None  # no sample of it is sound
    settled = kind != "N1" or normal_stress_settled(result)
    if apart is not None and (apart >= limit or not settled):
        above = f", laws differ by over {percent_of(limit)}{' of N1' * (kind == 'N2')}"
        above *= apart >= limit
        missing = "not determined"
        note = ", ".join(filter(None, [missing + above, unused]))
        return ExpectedError(missing=missing, note=note, spread=ends)
    found = result.spread_of_laws.get("N2") if kind == "N2" and ends[0] is not None else None
    if found is not None and found.over_n1 is not None:
        at = as_measured([r for r in result.records if not r.held_out], found.over_n1_rate)
        share = f"N2/N1 ≈ {significant(found.over_n1, 2)} at {at}"
        return ExpectedError(note=f"{'0' if abs(found.over_n1) < _NOTHING else share} by this law")
    note = "" if unused is None or ends[0] is None else unused
    return ExpectedError(missing=unused or "not measured", note=note, spread=ends)


_NOTHING = 1e-3  # N2 over N1 that rounding of the integration leaves


def normal_stress_settled(result: LoopFindings) -> bool:
    """Return whether laws that describe the runs as well have one N1: more than linear response."""
    apart = differing(result, "N1")
    only_linear = all(record.control == "oscillation" for record in result.records)
    return apart is not None and apart < _APART and not only_linear


def missed_size(result: LoopFindings) -> float:
    """Return by how much a law misses the runs besides noise, zero where it does not."""
    missed = with_unseen(result)
    return 0.0 if missed is None else float(missed.size or 0.0)


def differing(result: LoopFindings, kind: str) -> float | None:
    """Return by how much laws that fit as well differ in a quantity in the range."""
    return _spread(result, kind)[0]


def _spread(result: LoopFindings, kind: str) -> tuple[float | None, float | None]:
    found = result.spread_of_laws.get(kind)
    if found is None:
        return None, None
    # no law is known to come nearer in N1 than in the stress to which it was fitted
    least = missed_size(result) if kind == "N1" else 0.0
    inside, beyond = (
        None if one is None else max(one, least) for one in (found.inside, found.beyond)
    )
    return inside, beyond


def of_stress(result: LoopFindings) -> ExpectedError:
    """Return the expected error of σ12: that of unseen runs, as the first line has it."""
    errors = unseen_errors(result, "sigma12")
    inside = _mean([*errors.values()])
    own = measured(result, "sigma12") or ExpectedError()
    beyond, at, spread = own.beyond, own.beyond_at, (None, None)
    if beyond is None and (apart := _spread(result, "sigma12")[1]) is not None:
        beyond, spread = apart, (None, apart)
    if inside is None and result.material is not None:
        inside = beyond_noise(result.error_after.fit, result.noise_floor)
        return ExpectedError(inside, beyond, at, note=_FITTED, is_residual=True)
    note = counted(len(errors), "unseen run") if errors else ""
    if inside is None and not own.is_residual:  # of runs of which something else was fitted
        inside, note = own.inside, own.note
    return ExpectedError(inside, beyond, at, note=note, spread=spread)


def measured(result: LoopFindings, kind: str) -> ExpectedError | None:
    """Return the error of what was measured of a quantity, fitted or not; None without."""
    return of_records((*result.records, *result.unfitted), kind, result.noise_floor)


def of_records(
    records: Sequence[RunRecord], kind: str, noise: float | None
) -> ExpectedError | None:
    """Return the error of records of a quantity, of unseen ones if there are any; None without."""
    own = [record for record in records if _is(record, kind)]
    if not own:
        return None
    held = [record for record in own if record.held_out]
    fastest = max((r.fastest for r in records if not r.held_out), default=0.0)
    fast = [r for r in held if r.fastest > FASTER * fastest]
    slow = [r for r in (held or own) if r.fastest <= FASTER * fastest]
    inside, beyond = (
        _mean([beyond_noise(float(r.errors[-1]), _noise(r, noise)) for r in some])
        for some in (slow, fast)
    )
    bare = "axial compliance" * (kind == "N1" and len(held) == len(own))
    unfitted = f"neither fitted nor corrected for {bare}" if bare else "not fitted"
    note = _FITTED if not held else _UNSEEN if len(held) < len(own) else unfitted
    if held and slow:
        note = f"{counted(len(slow), 'run')} at {_rates([r.unshifted for r in slow])}, {note}"
    at = _measured_at(fast, [r for r in records if not r.held_out])
    return ExpectedError(inside, beyond, at, note=note, is_residual=not held, uncorrected=bare)


def _noise(record: RunRecord, noise: float | None) -> float | None:
    """Return the noise of a record: of a force that no fit saw its own, which no floor holds."""
    own = record.held_out and record.quantity in ("N1", "N2")
    return record.scatter / (rms(record.measured) or 1.0) if own else noise


def _measured_at(fast: Sequence[RunRecord], fitted: Sequence[RunRecord]) -> str:
    """Return at which rate and temperature runs beyond the range were measured.

    With the rate that this is at the temperature of the fitted runs, where that is another.
    """
    if not fast:
        return ""
    own, theirs = by_temperature(fitted), by_temperature(fast)
    told = [f"{_rates(runs)} at {degrees(at)}" for at, runs in theirs.items()]
    said = f"measured at {listed(told or [_rates(fast)])}"
    if len(own) == 1 and theirs and not own.keys() & theirs.keys():
        ((at, (first, *_)),) = own.items()
        same = _rates(fast, first.fastest / fitted[0].fastest)
        said += f", equivalent to {same} at {degrees(at)}"
    return said


def _rates(records: Sequence[RunRecord], factor: float = 1.0) -> str:
    rates = [factor * record.fastest for record in records]
    return f"{span((min(rates), max(rates)))} 1/s"


def _is(record: RunRecord, kind: str) -> bool:
    if kind == "uniaxial":
        return record.flow == "uniaxial" and record.quantity == "tensile_stress"
    if kind == "sigma12":
        return record.flow == "shear" and record.quantity in ("sigma12", "strain", *MODULI)
    return record.flow == "shear" and record.quantity == kind


def _mean(errors: Sequence[float]) -> float | None:
    """Return the mean over runs; None of nothing, or where a law diverges."""
    return float(np.mean(errors)) if errors and np.all(np.isfinite(errors)) else None
