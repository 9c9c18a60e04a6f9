"""The page on time–temperature superposition: whether sweeps became one, and by which shifts."""

from collections.abc import Sequence

from discover.dataset.linear_agreement import Agreement
from discover.dataset.superposition import FAILED, SUPERPOSED, ShiftLaw, Superposition
from discover.report.page import render
from discover.report.parts import attempt
from discover.report.plots.superposition import superposition_pictures
from discover.report.wording import percent

_DESCRIBES = 0.1
"""Decades of a_T, root mean square, by which a law may miss the shifts and still describe them."""

_SYMBOLS = {"C1": ("C1", ""), "C2_K": ("C2", "K"), "activation_energy_J_mol": ("E", "J/mol")}


def superposition_words(found: Superposition) -> list[str]:
    """Return what can be said of a superposition, a sentence each.

    Parameters
    ----------
    found
        Sweeps and shifts.
    """
    at = int(found.misfit.argmax())
    worst = percent(float(found.misfit[at]))
    where = f"{found.celsius[at]:g} and {found.celsius[at + 1]:g} °C"
    first = {
        "superposed": f"The sweeps superpose: the worst overlap, of {where}, is off by {worst}.",
        "doubtful": (
            f"Whether the sweeps superpose is doubtful: those at {where} are off by {worst} where "
            "they overlap, more than two loadings of one sample usually are "
            f"({percent(SUPERPOSED)})."
        ),
        "not_superposed": (
            f"The sweeps do not superpose: those at {where} are off by {worst} where they overlap "
            f"({percent(FAILED)} or more). No single sweep stands for them; leave temperatures out "
            "with --between, or allow a shift of the moduli with --vertical."
        ),
    }[found.verdict]
    laws = () if found.verdict == "not_superposed" else found.laws
    return [first, *(_law_words(law, found) for law in laws)]


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


def agreement_words(agreements: Sequence[Agreement]) -> list[str]:
    """Return whether sweeps predict relaxation and creep, a sentence each.

    Parameters
    ----------
    agreements
        One for each test.
    """
    said = []
    for one in agreements:
        where = f"{one.times[0]:.3g} to {one.times[1]:.3g} s"
        what = "the relaxation modulus" if one.test == "relaxation" else "the creep compliance"
        if one.agrees:
            text = f"the sweep predicts {what} to {percent(one.error)} (root mean square, {where})."
        else:
            side = "above" if one.bias > 0.0 else "below"
            text = (
                f"the sweep does not predict {what}: it lies {percent(abs(one.bias))} {side} what "
                f"was measured, on average over {where}; divided by one factor "
                f"{percent(one.left)} would be left."
            )
        said.append(f"At {one.celsius:g} °C {text}")
    return said


def superposition_page(
    found: Superposition, name: str, agreements: Sequence[Agreement] = ()
) -> str:
    """Return the page.

    Parameters
    ----------
    found
        Sweeps and shifts.
    name
        Of the data.
    agreements
        Of the sweeps with other linear tests.
    """
    pictures = attempt("The pictures", lambda: superposition_pictures(found))
    return render(
        "superposition.html",
        name=name,
        words=superposition_words(found),
        agreements=agreement_words(agreements),
        doubtful=found.verdict != "superposed",
        pictures=pictures if isinstance(pictures, list) else [],
        missing=None if isinstance(pictures, list) else pictures.sentence,
        lines=[
            {
                "temperature": f"{degrees:g}",
                "a": f"{10.0 ** found.log_shift[i]:.4g}",
                "b": f"{10.0 ** found.log_vertical[i]:.4g}",
                "misfit": percent(float(found.misfit[i])) if i < len(found.misfit) else "",
            }
            for i, degrees in enumerate(found.celsius)
        ],
    )
