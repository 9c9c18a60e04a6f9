"""What is open of N1 and N2 where constants may differ from mode to mode."""

from collections.abc import Sequence
from dataclasses import replace

from discover.comparison.fitting.law_by_mode import LawByMode
from discover.comparison.judging.statements import Statement


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
