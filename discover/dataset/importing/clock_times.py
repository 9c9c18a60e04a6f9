"""Times that are written as clocks: 00:02:30.5, 12:15:24 PM, 2024-01-05T12:15:24."""

import re
from collections.abc import Sequence
from datetime import UTC, datetime

import numpy as np
from jaxtyping import Float

_DATE = (
    r"(?:(?P<year>\d{4})[-/.](?P<month>\d{1,2})[-/.](?P<day>\d{1,2})"
    r"|(?P<first>\d{1,2})(?P<mark>[-/.])(?P<second>\d{1,2})(?P=mark)(?P<last>\d{4}|\d{2}))[T ,]+"
)
_CLOCK = re.compile(
    rf"(?:{_DATE}|(?P<days>\d{{1,5}})(?:\.| ?d(?:ays?)?,? +))?"
    r"(?:(?P<hours>\d{1,4}):)?(?P<minutes>\d{1,4}):(?P<seconds>\d{1,2}(?:[.,]\d*)?)"
    r"\s*(?P<half>[AaPp]\.?[Mm]\.?)?\s*(?:Z|[+-]\d{2}:?\d{2})?"
)
_DAY = 86400.0


def is_clock(cell: str) -> bool:
    """Return whether a cell is a clock's reading, a duration with colons or a time stamp."""
    return ":" in cell and _CLOCK.fullmatch(cell) is not None


def seconds(cells: Sequence[str], unit: str = "") -> Float[np.ndarray, " n"]:
    """Return readings of a clock in s, nan where a cell is none.

    Durations are as they stand. Clocks of the day and time stamps count from the first, since they
    are later than the whole record is long; past midnight they go on.

    `cells`: as `is_clock` knows them. `unit`: as the export writes it; ``hh:mm`` says that the
    first of two numbers is hours.
    """
    matches = [_CLOCK.fullmatch(cell) if ":" in cell else None for cell in cells]
    # 5/1 is the fifth of January unless some second number is no month; with slashes, AM and PM it
    # is the first of May
    found = [m for m in matches if m]
    months = [int(m["second"]) for m in found if m["second"]]
    days = [int(m["first"]) for m in found if m["first"]]
    american = any(m["half"] and m["mark"] == "/" for m in found) and max(days, default=0) <= 12
    american = american or max(months, default=0) > 12
    in_hours = re.fullmatch(r"h+\W?m+(?:in)?", unit.strip().lower()) is not None
    values = np.array([_reading(m, american, in_hours) for m in matches])
    known = np.flatnonzero(np.isfinite(values))
    if not len(known):
        return values
    clock = values[known]
    # a day goes by where a clock without a date falls back by more than half of one
    clock = clock + _DAY * np.cumsum(np.diff(clock, prepend=clock[0]) < -0.5 * _DAY)
    if any(m["year"] or m["last"] for m in found) or clock[0] > max(np.ptp(clock), 60.0):
        clock = clock - clock[0]
    values[known] = clock
    return values


def _reading(match: re.Match | None, american: bool, in_hours: bool) -> float:
    if match is None:
        return np.nan
    numbers = [float((match[key] or "0").replace(",", ".")) for key in _UNITS]
    if in_hours and match["hours"] is None:
        numbers = [numbers[1], numbers[2], 0.0]
    if match["half"]:
        numbers[0] = numbers[0] % 12 + 12.0 * (match["half"][0] in "Pp")
    time = 3600.0 * numbers[0] + 60.0 * numbers[1] + numbers[2] + _DAY * int(match["days"] or 0)
    if match["year"]:
        date = int(match["year"]), int(match["month"]), int(match["day"])
    elif match["last"]:
        day, month = int(match["first"]), int(match["second"])
        year = int(match["last"])
        date = (year if year > 99 else 2000 + year, *((day, month) if american else (month, day)))
    else:
        return time
    try:
        return datetime(*date, tzinfo=UTC).timestamp() + time
    except ValueError:  # no such day
        return np.nan


_UNITS = ("hours", "minutes", "seconds")
