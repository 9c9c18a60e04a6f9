"""Records in time: what was imposed, rate, stress or strain, and so which test it is.

What words say of the test is believed before the numbers are asked; where the two exclude each
other nothing is taken. Numbers tell what was imposed by its course: a command is held, in one step
or several, or follows a straight line, and an answer does neither. Intervals of a thixotropy test
are one run: what a structured fluid does in one depends on those before it   [Mewis & Wagner 2009,
Adv. Colloid Interface Sci. 147-148, 214].
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from discover.dataset.importing.mapping import Mapping, TestName
from discover.dataset.importing.oscillations import alternates, purer
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.text_export import Block, Said, said_of
from discover.dataset.importing.text_rows import is_number
from discover.dataset.records.thinning import SPREAD_OF_BENDS, bends

CONSTANT = 0.03  # spread of the middle nine tenths up to which an imposed quantity is constant
AT_REST = 0.02  # rate or stress over the largest, below which it is none
EXACTLY = 1e-3  # spread below which it is a command, not an answer that happens to be constant
_MORE_EXACT = 10.0
_JUMP = 0.1
_STRAIGHT = 0.003
_FEWEST_HELD = 3
_MOVES = 0.2  # share of the largest strain by which one that was held does not change later on
# Steady states differ on the way up and down by their scatter. Ten per cent is more than a gap or a
# temperature does within one measurement
APART = 0.1
_ABOVE_SCATTER = 4.0
_FEWEST_OF_BRANCH = 4
_SAME_RATE, _ANOTHER_RATE = 1.3, 5.0
_SAME_STRESS = 0.1  # over the stress: an interval repeats another, and starts as that did
_WITHOUT_CREEP = (
    "and the creep before it, from which it starts, is not in the file: give both in one file, one "
    "after the other"
)

Values = Float[np.ndarray, " n"]
Numbered = tuple[int, Block]


@dataclass(frozen=True)
class Course:
    """What was recorded over time in s, Pa and 1/s, each of shape (n,); rate or strain is known."""

    time: Values
    stress: Values
    rate: Values | None
    strain: Values | None

    @cached_property
    def moved(self) -> Values:
        """The rate, or the change of the strain where no rate was recorded."""
        if self.rate is not None:
            return self.rate
        assert self.strain is not None
        rises = np.all(np.diff(self.time) > 0.0)
        return np.gradient(self.strain, self.time) if rises else np.diff(self.strain)

    @cached_property
    def rate_is_set(self) -> bool:
        """Whether the rate is held or goes straight, or the strain does the latter."""
        if self.rate is not None:
            return held(self.rate) or straight(self.time, self.rate)
        assert self.strain is not None
        return straight(self.time, self.strain) and not held(self.strain)

    @cached_property
    def stress_is_set(self) -> bool:
        """Whether the stress is held."""
        return held(self.stress)

    @property
    def follows_stress(self) -> bool:
        """Whether the stress is a ramp, and neither rate nor strain goes straight."""
        return straight(self.time, self.stress) and not self.rate_is_set

    @property
    def goes_on(self) -> bool:
        """Whether the strain changes later on in the record, so that it was not held."""
        if self.strain is None:
            return True
        late = self.strain[len(self.strain) // 4 :]
        return bool(np.ptp(late) > _MOVES * np.max(np.abs(self.strain)))

    @property
    def drifts(self) -> bool:
        """Whether the rate changes on the whole, not from sample to sample as noise does."""
        moved = np.abs(self.moved)
        third = max(len(moved) // 3, 1)
        scatter = float(np.median(np.abs(np.diff(moved))))
        change = abs(float(np.median(moved[:third]) - np.median(moved[-third:])))
        return change > max(CONSTANT * float(np.median(moved)), 3.0 * scatter)

    @property
    def jumps(self) -> bool:
        """Whether the strain has a part that is there at once, as a given stress makes it."""
        if self.strain is None or len(self.time) < 5:
            return False
        begins = np.polynomial.Polynomial.fit(self.time, self.strain, 1)(0.0)
        with_stress = begins * np.median(self.stress) > 0.0
        return bool(with_stress and abs(begins) > CONSTANT * np.max(np.abs(self.strain)))

    @cached_property
    def ways(self) -> "UpAndDown | None":
        """How far the stresses of the ways up and down in rate are apart."""
        return None if self.rate is None else up_and_down(self.rate, self.stress)


def kind_of_course(course: Course, said: Said | None) -> tuple[TestName, str]:
    """Return which test a record is, and what says so."""
    strain, stress = course.strain, course.stress
    swings = alternates(strain if strain is not None else course.moved) or alternates(stress)
    if swings and not course.stress_is_set:  # creep and recovery have a rate of both signs
        if strain is not None and purer(course.time, stress, strain):
            return "creep", "the stress is a sine and the strain is not"
        return "run", "an oscillation, sample by sample"
    found = None if said is None else _as_said(course, said)
    return _by_numbers(course) if found is None else found


def _as_said(course: Course, said: Said) -> tuple[TestName, str] | None:
    """Return the test that words say; None where they leave it open."""
    by_rate, by_stress = course.rate_is_set, course.stress_is_set
    only_stress = by_stress and not by_rate
    flows = by_rate and not by_stress and bool(np.median(np.abs(course.moved)))
    calls = f"it is called {said.words!r}"
    if said.test == "recovery" and not flows and not said.by_file_name:
        return "none", f"a recovery ({calls}), {_WITHOUT_CREEP}"
    excluded = {
        "creep": flows and "the rate is held and the stress is not",
        "relaxation": (flows or only_stress) and course.goes_on and "the strain is not held",
        "start_up": only_stress and course.drifts and "the stress is held and the rate is not",
    }.get(said.test)
    if excluded:
        return None if said.by_file_name else ("none", f"called {said.words!r}, but {excluded}")
    if said.test == "creep":
        return "creep", f"{calls}; the strain is what the stress was answered with"
    if said.test == "relaxation" and course.strain is not None:
        return "relaxation", f"{calls}; the stress relaxes"
    alike = course.ways is not None and not course.ways.apart
    if said.test == "flow_curve" and (every_row_differs(course.moved) or alike):
        return "flow_curve", f"{calls}; every row is another steady state"
    if said.test == "ramp" and course.follows_stress:
        return "creep", "a ramp of stress, which the strain follows"
    by_name = said.by_file_name and said.test != "ramp"
    if said.test in ("ramp", "loop", "intervals") and not only_stress and not by_name:
        return "run", f"{calls}; the rate goes its way in time"
    return None


def _by_numbers(course: Course) -> tuple[TestName, str]:
    stress, rate, strain, ways = course.stress, course.rate, course.strain, course.ways
    by_rate = course.rate_is_set
    steps = rate is not None and every_row_differs(rate)
    if course.stress_is_set and np.any(stress):
        exact = spread(stress) < EXACTLY
        more = max(spread(stress) * _MORE_EXACT, EXACTLY) <= spread(course.moved)
        drifts = not by_rate and not steps and course.drifts
        if (exact and (more or course.jumps)) or drifts:
            return "creep", "the stress is held, and the rate is what answers it"
    if not np.any(np.abs(stress) > 0.0) and strain is not None and np.ptp(strain) > 0.0:
        return "none", f"a recovery, as there is no stress, {_WITHOUT_CREEP}"
    if rate is not None and steps:
        span = f"{np.min(np.abs(rate)):.3g} to {np.max(np.abs(rate)):.3g} 1/s"
        return "flow_curve", f"every row has another rate, {span}"
    if ways is not None and not ways.apart:
        return "flow_curve", "the rate goes up and down in steps, and the stress is the same"
    if course.follows_stress:
        return "creep", "a ramp of stress, which the strain follows"
    if strain is not None and not by_rate:
        # held: what is left of the rise of the strain lies before the middle of the record
        late = strain[len(strain) // 4 :]
        if abs(np.median(strain)) > 0.0 and spread(late) < CONSTANT:
            return "relaxation", "the strain is held, and the stress relaxes"
    if ways is not None:
        return "run", (
            f"the rate goes up and down over time, and the stresses of the two ways are "
            f"{ways.described}"
        )
    if rate is not None and np.ptp(rate) > 0.0 and held(rate) and spread(rate) >= CONSTANT:
        return "run", "a flow whose rate goes in steps, over time"
    return "run", "a flow at a given rate, over time"


class UpAndDown(NamedTuple):
    """Stresses on the way down over those at the same rates on the way up."""

    logarithms: Float[np.ndarray, " m"]
    scatter: float  # standard deviation of the logarithm of a stress

    @property
    def apart(self) -> bool:
        """Whether the two ways differ by more than scatter, so that these are no steady states."""
        most = float(np.percentile(np.abs(self.logarithms), 80.0))
        return most > max(APART, _ABOVE_SCATTER * self.scatter)

    @property
    def described(self) -> str:
        """How far they are apart."""
        low, high = np.percentile(np.abs(np.expm1(self.logarithms)), [10.0, 90.0])
        return f"{100 * low:.0f} to {100 * high:.0f} % apart"


def up_and_down(rate: Values, stress: Values) -> UpAndDown | None:
    """Difference of stresses on the ways up and down; None if rates go one way only."""
    use = (rate * np.sign(np.median(rate)) > 0.0) & (stress * np.sign(np.median(stress)) > 0.0)
    if np.sum(use) < 2 * _FEWEST_OF_BRANCH or np.mean(use) < 0.7:
        return None
    x, y = np.log(np.abs(rate[use])), np.log(np.abs(stress[use]))
    if np.ptp(x) < np.log(1.5):
        return None
    steps = np.diff(x)
    turns = np.sign(steps) * (np.abs(steps) > 0.01)
    moving = np.flatnonzero(turns)
    cuts = moving[1:][turns[moving[1:]] != turns[moving[:-1]]]
    ways = [
        slice(a, b)
        for a, b in zip([0, *cuts], [*(cuts + 1), len(x)], strict=True)
        if b - a >= _FEWEST_OF_BRANCH
    ]
    if len(ways) < 2 or len(cuts) > len(x) // _FEWEST_OF_BRANCH:
        return None
    found, off = [], []
    for way, back in pairwise(ways):
        (first, one), (second, other) = (_in_order(x[w], y[w]) for w in (way, back))
        both = (first >= second[0]) & (first <= second[-1])
        if (x[way][-1] - x[way][0]) * (x[back][-1] - x[back][0]) < 0.0 and both.any():
            found.append(np.interp(first[both], second, other) - one[both])
        off += [bends(first, one), bends(second, other)]
    left = np.abs(np.concatenate(off)) if off else np.empty(0)
    if not found or not len(left):
        return None
    return UpAndDown(np.concatenate(found), float(SPREAD_OF_BENDS * np.median(left)))


def _in_order(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    places, first = np.unique(x, return_index=True)
    return places, y[first]


def spread(values: Values) -> float:
    """Return the width of the middle nine tenths of values over their median; inf if that is 0."""
    low, middle, high = np.percentile(values, [5.0, 50.0, 95.0])
    return float((high - low) / abs(middle)) if middle else np.inf


def held(values: Values) -> bool:
    """Return whether nearly all of a record is held, at one level or at several in turn."""
    size = float(np.max(np.abs(values)))
    if size == 0.0 or spread(values) < CONSTANT:
        return True
    jumps = np.flatnonzero(np.abs(np.diff(values)) > _JUMP * size)
    kept = 0
    for piece in np.split(values, jumps + 1):
        low, middle, high = np.abs(np.percentile(piece, [5.0, 50.0, 95.0]))
        constant = abs(high - low) <= CONSTANT * middle or max(low, high) < AT_REST * size
        kept += len(piece) if constant and len(piece) >= _FEWEST_HELD else 0
    return len(jumps) > 0 and kept >= 0.9 * len(values)


def straight(time: Values, values: Values) -> bool:
    """Return whether a record follows a straight line in time."""
    if len(values) < 5 or not np.ptp(time) or not np.ptp(values):
        return False
    line = np.polynomial.Polynomial.fit(time, values, 1)
    return bool(np.percentile(np.abs(values - line(time)), 95.0) < _STRAIGHT * np.ptp(values))


def every_row_differs(rate: Values) -> bool:
    """Return whether every row has another rate, in order, over a factor of three or more."""
    size = np.abs(rate)
    if len(rate) < 3 or np.any(size == 0.0) or not (np.all(rate > 0) or np.all(rate < 0)):
        return False
    steps = np.diff(np.log(size))
    larger = np.abs(steps) > 0.01
    one_way = max(np.mean(steps[larger] > 0), np.mean(steps[larger] < 0)) if larger.any() else 0.0
    return bool(np.mean(larger) > 0.9 and one_way > 0.9 and size.max() > 3.0 * size.min())


def strain_of(time: Values, rate: Values) -> Values:
    """Strain that a rate in 1/s, shape (n,), has made since t = 0; constant before the first."""
    before = max(float(time[0]), 0.0) * float(rate[0])
    if len(time) < 2:
        return np.full(len(time), before)
    made = PchipInterpolator(time, rate).antiderivative()(time)
    return before + made - made[0]


def joined_intervals(blocks: Sequence[Numbered], mapping: Mapping, file: str) -> list[Numbered]:
    """Return numbered blocks of a file, those that are intervals of one thixotropy test as one.

    Words say that they are, or three rates of which the last is the first again, or rates that go
    up and then down with stresses that differ. A block that the user names a test for is left.
    """
    left, found = list(blocks), []
    while left:
        number, first = left[0]
        several: list[Block] = []
        for at, block in left:  # as many as have the same columns and are nobody's choice
            chosen = mapping.test_of(file, at)
            # an import that is repeated knows the whole by the number of its first interval
            free = chosen is None or (not several and chosen == "run")
            if not free or (several and block.apart) or block.columns != first.columns:
                break
            several.append(block)
        count = _how_many(several, mapping, file)
        found.append((number, first if count < 2 else _as_one(several[:count], mapping, file)))
        left = left[max(count, 1) :]
    return found


def _how_many(blocks: Sequence[Block], mapping: Mapping, file: str) -> int:
    """Return how many of these blocks, from the first on, are one test."""
    if len(blocks) < 2:
        return 0
    said = said_of(blocks[0], file)
    all_are = said is not None and said.test in ("loop", "intervals")
    ways: list[tuple[np.ndarray, np.ndarray]] = []  # rates and stresses
    for block in blocks if all_are else blocks[:3]:
        readings = Readings.of(block, mapping, file)
        rate, stress = map(readings.unless_wrong, ("shear_rate", "stress"))
        if rate is None or stress is None or readings.has("omega", "Gp"):
            break
        kept = np.isfinite(rate) & np.isfinite(stress)
        if np.sum(kept) < 3:
            break
        ways.append((rate[kept], stress[kept]))
    if all_are:
        return len(ways)
    if len(ways) > 1 and _is_loop(*ways[:2]):
        return 2
    if len(ways) < 3:
        return 0
    held = [float(np.median(rate)) if spread(rate) < CONSTANT else 0.0 for rate, _ in ways]
    loops = held[1] and _is_loop(ways[0], ways[2])
    return 3 if loops or _recovers(held, ways[0][1], ways[2][1]) else 0


def _recovers(held: Sequence[float], before: np.ndarray, after: np.ndarray) -> bool:
    """Return whether the third rate is the first again, after another, and what it does is not."""
    first, second, third = held
    if not (first and second and third) or min(first / third, first / second) <= 0.0:
        return False
    again, other = abs(np.log(first / third)), abs(np.log(first / second))
    if again > np.log(_SAME_RATE) or other < np.log(_ANOTHER_RATE):
        return False
    both = min(len(before), len(after))
    apart = np.median(np.abs(before[:both] - after[:both]))
    return bool(apart > _SAME_STRESS * np.max(np.abs(before)))


def _is_loop(up: tuple[np.ndarray, np.ndarray], down: tuple[np.ndarray, np.ndarray]) -> bool:
    """Return whether rates go up and then down with other stresses."""
    if not (every_row_differs(up[0]) and every_row_differs(down[0])):
        return False
    both = up_and_down(*(np.concatenate(pair) for pair in zip(up, down, strict=True)))
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
