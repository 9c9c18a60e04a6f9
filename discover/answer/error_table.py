"""Table of errors: what unseen runs measured, then what nothing tested and laws differ by."""

from typing import Any, NamedTuple

from discover.answer.fields import AnswerFields
from discover.answer.sentences import (
    ESTIMATED,
    SYMBOLS,
    after_noise,
    at_most,
    only_quantity,
    worst_run,
)
from discover.words import percent_of


class Row(NamedTuple):
    """Quantity, on what its numbers rest, and these in the range and beyond.

    `beyond`: None where `inside` says of both why there is no number.
    """

    symbol: str
    note: str
    inside: str
    beyond: str | None = ""
    beyond_at: str = ""


class Errors(NamedTuple):
    """Rows under one heading, and the headings of their numbers."""

    title: str
    heads: tuple[str, str]
    rows: list[Row]

    @property
    def text(self) -> str:
        """The rows as text goes on."""
        told = []
        for row in self.rows:
            inside, at = f"{row.inside} ({row.note})", f" ({row.beyond_at})" * bool(row.beyond_at)
            beyond = f"{self.heads[1]} {row.beyond}{at}" if row.beyond else ""
            cells = filter(None, [inside.removesuffix(" ()"), beyond])
            told.append(f"{row.symbol} {', '.join(cells)}")
        return f"{self.title}: {'; '.join(told)}."


def errors(answer: AnswerFields) -> list[Errors]:
    """Return errors of unseen runs, with the worst and the best classical law; then the untested.

    Quantities of which nothing is known for the same reason share a row.
    """
    measured, by_law, apart = [], [], False
    for name, symbol in SYMBOLS.items():
        one = answer.expected(name)
        near, far = ("" if value is None else at_most(value) for value in one.spread)
        beyond = "" if one.beyond is None or far else at_most(one.beyond)
        if one.inside is not None or beyond:
            at = one.beyond_at * bool(beyond)
            measured.append(Row(symbol, one.note, _inside(answer, one), beyond, at))
        if near or far:
            apart = True
            seen = _NOT_MEASURED if one.inside is None else ""
            by_law.append(Row(symbol, one.note * bool(near), near or seen, far))
        elif not one.is_known:
            row = Row(symbol, "", one.note or one.missing, None)
            if by_law and by_law[-1] == row._replace(symbol=by_law[-1].symbol):
                row = row._replace(symbol=f"{by_law.pop().symbol}, {symbol}")
            by_law.append(row)
    of = f"{only_quantity(answer)}, ".removeprefix(", ")
    if (worst := worst_run(answer)) is not None:
        of_run = "" if worst[0].endswith(")") else of  # such a name has its quantity
        measured.insert(1, Row(f"{of_run}worst run in range", *worst))  # below σ12
    if answer.best_classical is not None:
        near, error = answer.best_classical
        measured.append(Row(f"{of}best classical law", near, percent_of(error)))
    is_far = any(row.beyond for row in measured)
    heads = (_INSIDE, _TWICE) if apart else ("", "")
    title = f"{_UNTESTED}{'; spread between equally good laws (not an error)' * apart}"
    first = (_INSIDE, _BEYOND * is_far)
    blocks = Errors(_title(answer), first, measured), Errors(title, heads, by_law)
    return [one for one in blocks if one.rows]


_INSIDE, _BEYOND = "in\N{NO-BREAK SPACE}range", "beyond the range"
_UNTESTED, _TWICE, _NOT_MEASURED = "Never tested", "at twice the highest rate", "not measured"


def _title(answer: AnswerFields) -> str:
    """Return what the errors are, and the noise that they do not hold."""
    stress, found = answer.expected("sigma12"), answer.discrepancy
    of = "Residual of the fitted runs" if stress.is_residual else "Mean error on unseen runs"
    if stress.inside is None and found is not None and not found.unseen:
        of = ESTIMATED
    return of + after_noise(answer)


def _inside(answer: AnswerFields, one: Any) -> str:
    """Return the error in the range; of what the verdict calls noise, that there is none."""
    if one.inside is None:
        return _NOT_MEASURED
    is_noise = not one.inside or (one.is_residual and answer.fits_to_the_noise)
    return "none detected" if is_noise else at_most(one.inside)
