"""Table of errors: what unseen runs measured, then what nothing tested and laws differ by."""

from typing import Any, NamedTuple

from discover.answer.sentences import SYMBOLS, at_most, worst_run
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


def errors(answer: Any) -> list[Errors]:
    """Return errors of unseen runs, with the worst and the best classical law; then the untested.

    Quantities of which nothing is known for the same reason share a row.
    """
    measured, by_law, apart = [], [], False
    for name, symbol in SYMBOLS.items():
        one = answer.expected(name)
        near, far = ("" if value is None else at_most(value) for value in one.spread)
        if one.is_known:
            beyond, at = "not measured", ""
            if one.beyond is not None:
                beyond, at = at_most(one.beyond), one.beyond_at or _BY_LAWS
            measured.append(Row(symbol, _note(answer, one), _inside(answer, one), beyond, at))
        if near:
            apart = True
            by_law.append(Row(symbol, one.note, near, far))
        elif not one.is_known:
            row = Row(symbol, "", one.note or one.missing, None)
            if by_law and by_law[-1] == row._replace(symbol=by_law[-1].symbol):
                row = row._replace(symbol=f"{by_law.pop().symbol}, {symbol}")
            by_law.append(row)
    if (worst := worst_run(answer)) is not None:
        measured.insert(1, Row("worst run in range", *worst))  # below σ12
    if answer.best_classical is not None:
        near, error = answer.best_classical
        measured.append(Row("best classical law", near, percent_of(error)))
    if answer.falls_above:
        told = f"falls above {answer.falls_above}"
        by_law.append(Row("steady flow curve", "of this law", told, None))
    heads = (_INSIDE, _TWICE) if apart else ("", "")
    title = f"{_UNTESTED}{': spread between equally good laws (not an error)' * apart}"
    blocks = Errors(_title(answer), (_INSIDE, _BEYOND), measured), Errors(title, heads, by_law)
    return [one for one in blocks if one.rows]


_INSIDE, _BEYOND = "in\N{NO-BREAK SPACE}range", "beyond the range"
_UNTESTED, _TWICE = "Never tested", "at twice the highest rate"
_BY_LAWS = f"untested: equally good laws {_TWICE}"


def _title(answer: Any) -> str:
    """Return what the errors are, and the noise that they do not hold."""
    residual = answer.expected("sigma12").is_residual
    of = "Residual of the fitted runs" if residual else "Error on unseen runs above noise"
    return of + (f" ({'noise ' * residual}{percent_of(answer.noise)})" if answer.noise else "")


def _note(answer: Any, one: Any) -> str:
    """Return on what an error rests, and that it is more than the tolerance."""
    missed = "above tolerance" * ((one.inside or 0.0) > answer.tolerance)
    return ", ".join(filter(None, [one.note, missed]))


def _inside(answer: Any, one: Any) -> str:
    """Return the error in the range; of what the verdict calls noise, that it is."""
    if one.inside is None:
        return "not measured"
    is_noise = not one.inside or (one.is_residual and answer.fits_to_the_noise)
    return "within noise" if is_noise else at_most(one.inside)
