"""The page on time–temperature superposition: whether tests became one, and by which shifts."""

from collections.abc import Mapping, Sequence

import numpy as np

from discover.dataset.linear.linear_spectra import Agreement
from discover.dataset.linear.linear_tests import NAMES, SWEEP
from discover.dataset.linear.superposition import FAILED, SUPERPOSED, ShiftLaw, Superposition
from discover.report.data.linear_agreement import agreement_lines, agreement_words
from discover.report.page import render
from discover.report.parts import attempt
from discover.report.plots.superposition import superposition_pictures
from discover.report.wording import percent
from discover.statistics import HALF_BAND

_DESCRIBES = 0.1
"""Decades of a_T, root mean square, by which a law may miss the shifts and still describe them."""

_UNKNOWN = 0.3
"""Standard error in decades from which on a shift factor is said not to be determined: 95 % would
span a factor of four either way."""

_SYMBOLS = {"C1": ("C1", ""), "C2_K": ("C2", "K"), "activation_energy_J_mol": ("E", "J/mol")}
_PLURALS = {kind: f"{name}s" for kind, name in NAMES.items()} | {"relaxation": "relaxation moduli"}


def superposition_words(
    found: Superposition, own: Mapping[str, Superposition] | None = None
) -> list[str]:
    """Return what can be said of a superposition, a sentence each.

    `found`: tests and shifts. `own`: what tables over time ask for by themselves, by kind, where
    the shifts are the sweeps'.
    """
    said = [_verdict(found, kind) for kind in found.leading]
    if found.verdict == "not_superposed":
        return said
    led = [kind for kind in found.tests if kind not in found.leading]
    said += [_verdict(found, kind) for kind in led if found.misfits(kind)]
    said += [_own_words(found, one, kind) for kind, one in (own or {}).items()]
    open_ = [
        f"{found.celsius[i]:g}" for i in np.flatnonzero(np.max(found.error, axis=1) > _UNKNOWN)
    ]
    if open_:
        said.append(
            f"At {', '.join(open_)} °C these data do not determine the shift factors: where the "
            "curves overlap they are straight lines, which slide along themselves."
        )
    if found.apart:
        degrees = ", ".join(f"{t:g}" for t in found.apart)
        said.append(f"The tests at {degrees} °C are not moved: no test of their kind to compare.")
    return [*said, *(_law_words(law, found) for law in found.laws)]


def _verdict(found: Superposition, kind: str) -> str:
    misfits = found.misfits(kind)
    if not misfits:  # shifts that nothing determines may leave no overlap
        return (
            f"Whether the {_PLURALS[kind]} superpose is doubtful: moved by the shifts found, those "
            "of neighbouring temperatures do not overlap."
        )
    (cold, warm), size = max(misfits.items(), key=lambda item: item[1])
    worst, where = percent(size), f"{cold:g} and {warm:g} °C"
    own = kind in found.leading
    moved = "" if own else f" with the shifts of the {_PLURALS[found.leading[0]]}"
    what = _PLURALS[kind]
    verdict = found.verdict_of(kind)
    if verdict == "superposed":
        return f"The {what} superpose{moved}: the worst overlap, of {where}, is off by {worst}."
    if verdict == "doubtful":
        return (
            f"Whether the {what} superpose{moved} is doubtful: those at {where} are off by {worst} "
            "where they overlap, more than two loadings of one sample usually are "
            f"({percent(SUPERPOSED)})."
        )
    one = "sweep" if kind == SWEEP else "table"
    return (
        f"The {what} do not superpose{moved}: those at {where} are off by {worst} where they "
        f"overlap ({percent(FAILED)} or more). No single {one} stands for them; leave temperatures "
        "out with --between, or allow a shift of the moduli with --vertical."
    )


def _own_words(found: Superposition, own: Superposition, kind: str) -> str:
    """Return whether tables by themselves ask for the shifts that the sweeps gave."""
    other = []
    for i, degrees in enumerate(found.celsius):
        j = np.flatnonzero(own.celsius == degrees)
        if not len(j) or degrees == found.reference:
            continue
        apart = abs(own.log_shift[j[0]] - found.log_shift[i])
        if apart > HALF_BAND * float(np.hypot(own.error[j[0], 0], found.error[i, 0])):
            theirs, ours = own.factors(int(j[0]))[0], found.factors(i)[0]
            other.append(f"at {degrees:g} °C {_factor(theirs)} and not {_factor(ours)}")
    if not other:
        return f"The {_PLURALS[kind]} by themselves ask for the same a_T, within the intervals."
    return f"The {_PLURALS[kind]} by themselves ask for another a_T: {'; '.join(other)}."


def _factor(factor: tuple[float, float, float]) -> str:
    value, low, high = factor
    return f"{value:.3g} (95 %: {low:.3g} to {high:.3g})"


def _law_words(law: ShiftLaw, found: Superposition) -> str:
    if law.error > _DESCRIBES:
        return (
            f"{law.name} does not describe the shifts: off by {law.error:.2g} decades (root mean "
            "square)."
        )
    parts = []
    for key, value in law.values.items():
        symbol, unit = _SYMBOLS[key]
        interval = law.intervals[key]
        known = (
            "not determined by these shifts"
            if interval is None
            else f"95 %: {interval[0]:.4g} to {interval[1]:.4g}"
        )
        parts.append(f"{symbol} = {f'{value:.4g} {unit}'.strip()} ({known})")
    return (
        f"{law.name} at {found.reference:g} °C: {', '.join(parts)}; off by {law.error:.2g} "
        "decades (root mean square)."
    )


def superposition_page(
    found: Superposition,
    name: str,
    agreements: Sequence[Agreement],
    own: Mapping[str, Superposition] | None,
) -> str:
    """Return the page."""
    pictures = attempt("The pictures", lambda: superposition_pictures(found))
    kinds = [kind for kind in found.tests if found.misfits(kind)]
    misfits = {kind: found.misfits(kind) for kind in kinds}
    return render(
        "superposition.html",
        name=name,
        words=superposition_words(found, own),
        agreements=agreement_words(agreements),
        agreement_lines=agreement_lines(agreements),
        doubtful=found.verdict != "superposed",
        pictures=pictures if isinstance(pictures, list) else [],
        missing=None if isinstance(pictures, list) else pictures.sentence,
        kinds=[_PLURALS[kind] for kind in kinds],
        lines=[
            {
                "temperature": f"{degrees:g}",
                "a": _table_factor(found, i, 0),
                "b": _table_factor(found, i, 1),
                "misfits": [
                    next((percent(m) for (cold, _), m in pairs.items() if cold == degrees), "")
                    for pairs in misfits.values()
                ],
            }
            for i, degrees in enumerate(found.celsius)
        ],
    )


def _table_factor(found: Superposition, at: int, which: int) -> str:
    value, low, high = found.factors(at)[which]
    if low == high:
        return f"{value:.4g}"
    if found.error[at, which] > _UNKNOWN:
        return "not determined"
    return f"{value:.4g} ({low:.4g} to {high:.4g})"
