"""Rules for the dense library's band, and what each holds of the records of `band_rules`."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from discover.statistics.one_more import one_more
from discover.statistics.weighted_quantiles import weighted_quantiles

Case = Mapping[str, Any]
Band = dict[str, tuple[np.ndarray, np.ndarray]]
Rule = Callable[[Case, Mapping[str, Any]], Band]

QUANTITIES = ("sigma12", "N1", "N2")
WHOLE = 0.9
"""A run counts as held with so many of its samples in the band."""

_NAMED_NEARLY_FITS = 1.1
_LARGEST_RATIO = 2.0 / 7.0
_ROUNDING = 1e-5
_WITHIN = 1.96


def held_out(case: Case) -> list[Mapping[str, Any]]:
    """Return the runs that judge."""
    return [flow for flow in case["flows"] if flow["kind"] == "held_out"]


def draws(case: Case, flow: Mapping[str, Any]):
    """Return predictions of all laws in a flow, which can be followed, and of which optimum.

    Shapes (laws, samples, 3), (laws,), (laws,).
    """
    shown = [f["key"] for f in case["flows"] if f["kind"] in ("training", "held_out", "test")]
    values = case["predicted"][0][:, shown.index(flow["key"]), : len(flow["times"])]
    optima = case["details"]["optima"]
    owner = np.repeat(np.arange(len(optima)), [o["draws"] for o in optima])
    return values, np.all(np.isfinite(values), axis=(1, 2)), owner


def as_it_was(case: Case, flow: Mapping[str, Any]) -> Band:
    """Return what holds 95 % of the weight."""
    values, kept, _ = draws(case, flow)
    low, high = weighted_quantiles(values[kept], case["weights"][kept], (0.025, 0.975))
    return {q: (low[:, i], high[:, i]) for i, q in enumerate(QUANTITIES)}


def times(factor: float) -> Rule:
    """Return the rule that widens a band about its middle."""

    def rule(case, flow):
        values, kept, _ = draws(case, flow)
        middle = weighted_quantiles(values[kept], case["weights"][kept], (0.5,))[0]
        of = {q: middle[:, i] for i, q in enumerate(QUANTITIES)}
        own = as_it_was(case, flow)
        return {q: tuple(of[q] + factor * (end - of[q]) for end in own[q]) for q in QUANTITIES}

    return rule


def hull(case: Case, flow: Mapping[str, Any]) -> Band:
    """Return what holds all draws."""
    values, kept, _ = draws(case, flow)
    return _joined(as_it_was(case, flow), values[kept].min(axis=0), values[kept].max(axis=0))


def nearest(case: Case, flow: Mapping[str, Any]) -> Band:
    """Return what the quarter of the draws holds that comes nearest to σ12 of the runs held out."""
    values, kept, _ = draws(case, flow)
    off = np.zeros(len(values))
    for run in held_out(case):
        predicted, told, _ = draws(case, run)
        kept, record = kept & told, run["ref"]["sigma12"]
        with np.errstate(all="ignore"):
            off += np.mean((predicted[..., 0] - record) ** 2, axis=1) / np.mean(record**2)
    places = np.flatnonzero(kept)
    places = places[np.argsort(off[places])][: max(3, len(places) // 4)]
    low, high = values[places].min(axis=0), values[places].max(axis=0)
    return {q: (low[:, i], high[:, i]) for i, q in enumerate(QUANTITIES)}


def one_more_law(by: str) -> Rule:
    """Return the rule that allows for one more optimum, or one more named law."""

    def rule(case, flow):
        values, kept, owner = draws(case, flow)
        if by == "reference":
            names = [o["reference"] for o in case["details"]["optima"]]
            owner = np.unique(names, return_inverse=True)[1][owner]
        own = as_it_was(case, flow)
        if len(np.unique(owner[kept])) < 2:
            return own  # what is kept draws none
        # a law that has gone far is as far as the band, and no farther
        ends = [np.stack([own[q][i] for q in QUANTITIES], axis=-1) for i in (0, 1)]
        return _joined(own, *one_more(np.clip(values[kept], *ends), owner[kept]))

    return rule


def kept(case: Case, flow: Mapping[str, Any]) -> Band:
    """Return the band that allows for one more optimum in N1 where no named law fits."""
    own = as_it_was(case, flow)
    best = min(o["reference_misfit"] for o in case["details"]["optima"])
    if best <= _NAMED_NEARLY_FITS * case["details"]["noise"]["relative"]:
        return own
    return {**own, "N1": one_more_law("optimum")(case, flow)["N1"]}


def any_n2(rule: Rule) -> Rule:
    """Return a rule with all N2 from zero to −2/7 N1, but for laws of the library."""

    def widened(case, flow):
        band = rule(case, flow)
        if case["library_laws"]:
            return band
        ends = [-_LARGEST_RATIO * end for end in band["N1"]]
        ends.append(np.zeros_like(ends[0]))
        low, high = band["N2"]
        n2 = np.minimum(low, np.min(ends, axis=0)), np.maximum(high, np.max(ends, axis=0))
        return {**band, "N2": n2}

    return widened


RULES: Mapping[str, Rule] = {
    "as before": as_it_was,
    "half-widths times 1.25": times(1.25),
    "half-widths times 1.5": times(1.5),
    "hull of all draws": hull,
    "the quarter of the draws nearest to σ12 held out": nearest,
    "one more named law": one_more_law("reference"),
    "one more optimum": one_more_law("optimum"),
    "N2 from zero to −2/7 N1 too": any_n2(as_it_was),
    "one more optimum for N1, and that for N2": any_n2(kept),
}


def table(cases: Sequence[Case]) -> str:
    """Return how many runs each rule holds and its median half-width, with and without refuting."""
    outside = [case for case in cases if not case["library_laws"]]
    inside = [case for case in cases if case["library_laws"]]
    unrefuted = [
        {**c, "refuted_bands": c["dense_bands"], "final_bands": c["dense_bands"]} for c in outside
    ]
    lines = [f"{len(outside)} cases outside of the library, {len(inside)} inside: N1; N2"]
    for name, rule in RULES.items():
        parts = [_told(some, rule) for some in (outside, unrefuted, inside)]
        lines.append(f"{name:50} {parts[0]} | not refuted: {parts[1]} | inside: {parts[2]}")
    return "\n".join(lines)


def _told(cases: Sequence[Case], rule: Rule) -> str:
    found: dict[str, list[tuple[float, float]]] = {"N1": [], "N2": []}
    for case in cases:
        for flow in held_out(case):
            if case["refuted_bands"].get(flow["key"]) is None:
                continue
            band = _beside_named(case, flow, rule(case, flow))
            for quantity, rows in found.items():
                rows.append(_score(case, flow, quantity, band[quantity]))
    told = []
    for rows in found.values():
        held = sum(inside >= WHOLE for inside, _ in rows)
        width = 100 * np.median([half for _, half in rows]) if rows else np.nan
        told.append(f"{held} of {len(rows)}, ± {width:.0f} %")
    return "; ".join(told)


def _score(case: Case, flow, quantity: str, band) -> tuple[float, float]:
    """Return the share of samples inside a band, and half its width over N1."""
    run = case["exact"][flow["name"]]
    at = np.abs(run["time"][:, None] - flow["times"]).argmin(axis=0)
    there = np.isclose(run["time"][at], flow["times"], atol=1e-9)
    truth, first = run[quantity][at[there]], run["N1"][at[there]]
    size = np.sqrt(np.mean(first**2))
    low, high = band[0][there] - _ROUNDING * size, band[1][there] + _ROUNDING * size
    half = 0.5 * np.sqrt(np.mean((high - low) ** 2)) / size
    return float(np.mean((low <= truth) & (truth <= high))), float(half)


def _beside_named(case: Case, flow, band: Band) -> Band:
    """Return the hull with effects that have a name, where the band that was drawn was one."""
    key = flow["key"]
    own, drawn = case["refuted_bands"][key], case["final_bands"][key]
    if all(np.array_equal(own[q], drawn[q]) for q in QUANTITIES):
        return band
    told = [one["predicted"][key] for one in case["named"] if key in one["predicted"]]
    return {
        q: (
            np.min([band[q][0], *(m - _WITHIN * d for m, d in (one[q] for one in told))], axis=0),
            np.max([band[q][1], *(m + _WITHIN * d for m, d in (one[q] for one in told))], axis=0),
        )
        for q in QUANTITIES
    }


def _joined(band: Band, low: np.ndarray, high: np.ndarray) -> Band:
    return {
        q: (np.minimum(band[q][0], low[:, i]), np.maximum(band[q][1], high[:, i]))
        for i, q in enumerate(QUANTITIES)
    }
