"""What is open where constants may differ from mode to mode: N1 and N2, and a coefficient."""

from collections.abc import Sequence
from dataclasses import replace

from discover.comparison.fitting.law_by_mode import LawByMode
from discover.comparison.judging.statements import Statement
from discover.inference.constants import ConstantByMode
from discover.words import plainly


def open_where_modes_differ(
    statements: Sequence[Statement], law: LawByMode | None, in_library: bool
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
    """
    if law is None or not law.explains or not law.rivals_sparse:
        return list(statements)
    which = f"with {law.n_constants} constants that differ from mode to mode"
    return [
        replace(s, determined="no", text=_text(s, which, in_library))
        if s.quantity in ("N1", "N2")
        else s
        for s in statements
    ]


def _text(statement: Statement, which: str, in_library: bool) -> str:
    if in_library:
        return f"A law {which} describes these runs as well. {statement.text}"
    return (
        f"No law with the same constants in every mode explains the data, and one {which} does: "
        f"the {statement.quantity} of the law shown is not that of the fluid."
    )


def said_of_each_mode(term: str, constant: ConstantByMode | None, n_modes: int) -> str:
    """Return what is to be said of a coefficient that is taken to be the same in all modes.

    Parameters
    ----------
    term
        Spelling of the only term.
    constant
        What the runs say of each mode; None where that was not fitted.
    n_modes
        Number of modes.
    """
    text = f"The coefficient of {term} is taken to be the same in all {n_modes} modes"
    if constant is None:
        return f"{text}, which was not tested."
    known = [mode for mode in constant.modes if mode.ci95 is not None]
    known.sort(key=lambda mode: mode.width)
    if not known:
        return f"{text}. These runs determine it in no single one."
    ends = known if len(known) < 3 else [known[0], known[-1]]
    told = [
        f"{plainly(mode.ci95[0])} to {plainly(mode.ci95[1])} at {plainly(mode.relaxation_time_s)} s"
        for mode in ends
        if mode.ci95 is not None
    ]
    text = f"{text}. If it may differ, these runs allow {' and '.join(told)}"
    left = len(constant.modes) - len(known)
    return f"{text}, and leave it open in {left} of them." if left else f"{text}."
