"""What is open where constants may differ from mode to mode: N1 and N2, and a coefficient."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.comparison.fitting.coefficients_in_modes import CoefficientsInModes
from discover.comparison.fitting.law_by_mode import LawByMode
from discover.comparison.fitting.other_law_of_a_mode import OtherLaws
from discover.comparison.judging.statements import Statement
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from discover.inference.by_mode.constants import ConstantByMode
from discover.inference.by_mode.other_law_of_a_mode import other_laws_said
from discover.words import listed, percent_of, plainly


def with_intervals_of_modes(
    outcomes: Mapping[str, LearnerOutcome], modes: CoefficientsInModes
) -> dict[str, LearnerOutcome]:
    """Return the outcomes, intervals of the sparse law holding coefficients that differ by mode."""
    sparse = outcomes["tensor_sindy"]
    terms = []
    for term in sparse.terms:
        constant = modes.constants.get(term.term)
        if term.ci95 is not None and constant is not None:
            low, high = zip(term.ci95, constant.ci95, strict=True)
            wider = min(low), max(high)
            term = replace(term, ci95=wider, ci95_given_equal_modes=term.ci95)
        terms.append(term)
    return {**outcomes, "tensor_sindy": replace(sparse, terms=tuple(terms))}


def holding_modes_apart(
    bands: Mapping[str, PredictionBand], modes: CoefficientsInModes
) -> dict[str, PredictionBand]:
    """Return the bands of the sparse law, holding coefficients that differ by mode.

    There is none where those run away.
    """
    return {key: _holding(band, modes.bands.get(key)) for key, band in bands.items()}


def _holding(band: PredictionBand, other: PredictionBand | None) -> PredictionBand:
    if other is None:
        return band
    return replace(
        band,
        low=np.minimum(band.low, other.rivals_low),
        high=np.maximum(band.high, other.rivals_high),
        rivals_low=np.minimum(band.rivals_low, other.rivals_low),
        rivals_high=np.maximum(band.rivals_high, other.rivals_high),
        reason=band.reason or other.reason,
    )


def open_where_modes_differ(
    statements: Sequence[Statement],
    law: LawByMode | None,
    in_library: bool,
    flows: Sequence[Flow] = (),
) -> list[Statement]:
    """Return the statements, N1 and N2 open where constants by mode describe the runs as well.

    A law of several terms and one of few constants that differ from mode to mode may describe the
    same shear stress, and need not have the same normal stresses.

    Parameters
    ----------
    statements
        On what the sparse law predicts, and on declared constants.
    law
        The best law with constants by mode; None where there is none.
    in_library
        Whether the sparse law, the same in every mode, explains the runs.
    flows
        Flows to tell the width of its bands in.
    """
    if law is None or not law.explains or not law.rivals_sparse:
        return list(statements)
    return [
        replace(s, determined="no", text=_text(s, law, in_library, flows))
        if s.quantity in ("N1", "N2")
        else s
        for s in statements
    ]


def _text(statement: Statement, law: LawByMode, in_library: bool, flows: Sequence[Flow]) -> str:
    which = f"with {law.n_constants} constants that differ from mode to mode"
    quantity = statement.quantity
    bands = [law.bands[flow.key] for flow in flows if flow.key in law.bands]
    of_it = ""
    half = 0.5 * max((band.widths()[quantity] for band in bands), default=np.nan)
    if np.isfinite(half):
        of = " of N1" if quantity == "N2" else ""
        of_it = f" If that is the fluid's, its {quantity} is known to ± {percent_of(half)}{of}."
    if in_library:
        return f"A law {which} describes these runs as well.{of_it} {statement.text}"
    return (
        f"No law with the same constants in every mode explains the data, and one {which} does: "
        f"the {quantity} of the law shown is not that of the fluid.{of_it}"
    )


def said_of_each_mode(
    term: str, constant: ConstantByMode | None, n_modes: int, others: OtherLaws | None = None
) -> str:
    """Return what is to be said of a coefficient that is taken to be the same in all modes.

    Parameters
    ----------
    term
        Its spelling.
    constant
        What the runs say of each mode; None where that was not fitted.
    n_modes
        Number of modes.
    others
        Laws of which one mode follows another, that describe the runs as well; None for none.
    """
    names = {} if others is None else others.names
    text = f"The coefficient of {term} is taken to be the same in all {n_modes} modes"
    if constant is None:
        return f"{text}, which was not tested."
    told = [
        f"{plainly(mode.ci95[0])} to {plainly(mode.ci95[1])} at {plainly(mode.relaxation_time_s)} s"
        for mode in constant.told
        if mode.ci95 is not None and mode.relaxation_time_s not in names
    ]
    if not told:
        return f"{text}. These runs determine it in no single one.{other_laws_said(names)}"
    text = f"{text}. If it may differ, these runs allow {listed(told)}"
    left = len(constant.open_times_s)
    text = f"{text}, and leave it open in {left} of them." if left else f"{text}."
    return text + other_laws_said(names)
