"""What is open of N1 and N2 where constants may differ from mode to mode."""

from collections.abc import Sequence
from dataclasses import replace

from discover.comparison.fitting.law_by_mode import LawByMode
from discover.comparison.judging.statements import Statement


def open_where_modes_differ(
    statements: Sequence[Statement], law: LawByMode | None
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
    """
    if law is None or not law.explains or not law.rivals_sparse:
        return list(statements)
    reason = (
        f"A law with {law.n_constants} constants that differ from mode to mode describes these "
        "runs as well."
    )
    return [
        replace(s, determined="no", text=f"{reason} {s.text}")
        if s.of_law and s.quantity != "sigma12" and not s.undetermined
        else s
        for s in statements
    ]
