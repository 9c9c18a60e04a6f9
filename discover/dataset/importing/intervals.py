"""Intervals of one thixotropy test that an export gives one by one: together they are one run.

What a structured fluid does in an interval depends on those before it, so that none of them starts
from rest: rest, breakdown and recovery at three rates   [Mewis & Wagner 2009, Adv. Colloid
Interface Sci. 147-148, 214], or a ramp up and the ramp down after it.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from discover.dataset.importing.in_time import CONSTANT, every_row_differs, spread, up_and_down
from discover.dataset.importing.mapping import Mapping
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.text_export import Block, said_of
from discover.dataset.importing.text_rows import is_number
from discover.errors import InputError

_SAME_RATE = 1.3
_ANOTHER_RATE = 5.0
_SAME_STRESS = 0.1
"""Difference over the stress up to which an interval repeats another, and starts as that did."""

Numbered = tuple[int, Block]


@dataclass(frozen=True)
class _Interval:
    """Rates and stresses of a block, in 1/s and Pa."""

    rate: Float[np.ndarray, " n"]
    stress: Float[np.ndarray, " n"]

    @property
    def level(self) -> float | None:
        """The rate, where it is held."""
        return float(np.median(self.rate)) if spread(self.rate) < CONSTANT else None


def joined_intervals(blocks: Sequence[Numbered], mapping: Mapping, file: str) -> list[Numbered]:
    """Return blocks of a file, those that are intervals of one thixotropy test as one block.

    Words say that they are, or three rates of which the last is the first again, or rates that go
    up and then down with stresses that differ.

    `blocks`: each with its number. `mapping`: what the user says of them; a block that the user
    names a test for is left as it is.
    """
    left, found = list(blocks), []
    while left:
        several = _first_alike(left, mapping, file)
        count = _how_many(several, mapping, file)
        first = left[0]
        found.append(first if count < 2 else (first[0], _as_one(several[:count], mapping, file)))
        left = left[max(count, 1) :]
    return found


def _first_alike(blocks: Sequence[Numbered], mapping: Mapping, file: str) -> list[Block]:
    """Return as many of the first blocks as have the same columns and are nobody's choice."""
    first = blocks[0][1]
    alike: list[Block] = []
    for number, block in blocks:
        chosen = mapping.test_of(file, number)
        # an import that is repeated knows the whole by the number of its first interval
        free = chosen is None or (not alike and chosen == "run")
        other = alike and block.apart  # another sample's, or at another temperature
        if not free or other or block.columns != first.columns:
            break
        alike.append(block)
    return alike


def _how_many(blocks: Sequence[Block], mapping: Mapping, file: str) -> int:
    """Return how many of these blocks, from the first on, are one test."""
    if len(blocks) < 2:
        return 0
    intervals = list(_intervals(blocks, mapping, file))
    said = said_of(blocks[0], file)
    if said is not None and said.test in ("loop", "intervals"):
        return len(intervals)
    if len(intervals) > 1 and _is_loop(intervals[:2]):
        return 2
    if len(intervals) > 2 and (_recovers(intervals[:3]) or _is_loop(intervals[:3])):
        return 3
    return 0


def _intervals(blocks: Sequence[Block], mapping: Mapping, file: str) -> Iterator[_Interval]:
    """Yield the intervals as far as each has a rate and a stress in every row."""
    for block in blocks:
        try:
            readings = Readings.of(block, mapping, file)
            rate, stress = readings.get("shear_rate"), readings.get("stress")
        except InputError:  # said where the block is read
            return
        if rate is None or stress is None or readings.has("omega", "Gp"):
            return
        kept = np.isfinite(rate) & np.isfinite(stress)
        if np.sum(kept) < 3:
            return
        yield _Interval(rate[kept], stress[kept])


def _recovers(three: Sequence[_Interval]) -> bool:
    """Return whether the third rate is the first again, after another, and what it does is not."""
    first, second, third = (interval.level for interval in three)
    if not first or not second or not third or min(first / third, first / second) <= 0.0:
        return False
    if max(first / third, third / first) > _SAME_RATE:
        return False
    if max(first / second, second / first) < _ANOTHER_RATE:
        return False
    before, after = three[0].stress, three[2].stress
    both = min(len(before), len(after))
    apart = np.median(np.abs(before[:both] - after[:both]))
    return bool(apart > _SAME_STRESS * np.max(np.abs(before)))


def _is_loop(ways: Sequence[_Interval]) -> bool:
    """Return whether rates go up and then down, held between them or not, with other stresses."""
    if len(ways) == 3 and ways[1].level is None:
        return False
    up, down = ways[0], ways[-1]
    if not (every_row_differs(up.rate) and every_row_differs(down.rate)):
        return False
    both = up_and_down(
        np.concatenate([up.rate, down.rate]), np.concatenate([up.stress, down.stress])
    )
    return both is not None and both.apart


def _as_one(blocks: Sequence[Block], mapping: Mapping, file: str) -> Block:
    """Return intervals one after the other; a clock that starts again goes on."""
    first = blocks[0]
    at = Readings.of(first, mapping, file).columns.get("time")
    cells: list[tuple[str, ...]] = []
    last = 0.0
    for block in blocks:
        times = [float(row[at]) for row in block.cells if at is not None and is_number(row[at])]
        begin = last if times and cells and times[0] <= last else 0.0
        for row in block.cells:
            if at is not None and is_number(row[at]):
                last = begin + float(row[at])
                row = (*row[:at], repr(last), *row[at + 1 :])
            cells.append(row)
    name = " to ".join(dict.fromkeys(block.name for block in (first, blocks[-1]) if block.name))
    return replace(first, name=name, cells=tuple(cells))
