"""Records in time: what was imposed, rate, stress or strain, and so which test it is.

What words say of the test is believed before the numbers are asked; where the two exclude each
other nothing is taken. Numbers tell what was imposed by its course: a command is held, in one step
or several, or follows a straight line, and an answer does neither.
"""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float
from scipy.interpolate import PchipInterpolator

from discover.dataset.importing.mapping import TestName
from discover.dataset.importing.oscillations import alternates, purer
from discover.dataset.importing.text_export import Said

CONSTANT = 0.03
"""Spread, of the middle nine tenths of the samples, up to which an imposed quantity is constant."""
AT_REST = 0.02
"""Rate or stress over the largest, below which it is none."""
EXACTLY = 1e-3
"""Spread below which a quantity is a command, not an answer that happens to be constant."""

_MORE_EXACT = 10.0
_JUMP = 0.1
_STRAIGHT = 0.003
_FEWEST_HELD = 3
_MOVES = 0.2
"""Share of the largest strain by which a strain that was held does not change later on."""

# Steady states differ on the way up and down by their scatter. Ten per cent is more than a gap or a
# temperature does within one measurement
APART = 0.1
_ABOVE_SCATTER = 4.0
_FEWEST_OF_BRANCH = 4

Values = Float[np.ndarray, " n"]


@dataclass(frozen=True)
class Course:
    """What was recorded over time; at least one of rate and strain is known.

    `time`, `stress`, `rate`, `strain` in s, Pa and 1/s, each of shape (n,).
    """

    time: Values
    stress: Values
    rate: Values | None
    strain: Values | None

    @property
    def moved(self) -> Values:
        """The rate, or the change of the strain where no rate was recorded."""
        if self.rate is not None:
            return self.rate
        assert self.strain is not None
        rises = np.all(np.diff(self.time) > 0.0)
        return np.gradient(self.strain, self.time) if rises else np.diff(self.strain)


def kind_of_course(course: Course, said: Said | None) -> tuple[TestName, str]:
    """Return which test a record is, and what says so."""
    strain, stress = course.strain, course.stress
    swings = alternates(strain if strain is not None else course.moved) or alternates(stress)
    if swings and not held(stress):  # creep and recovery have a rate of both signs
        if strain is not None and purer(course.time, stress, strain):
            return "creep", "the stress is a sine and the strain is not"
        return "run", "an oscillation, sample by sample"
    if said is not None:
        found = _as_said(course, said)
        if found is not None:
            return found
    return _by_numbers(course)


def _as_said(course: Course, said: Said) -> tuple[TestName, str] | None:
    """Return the test that words say; None where they leave it open."""
    by_rate, by_stress = _rate_is_set(course), held(course.stress)
    only_stress = by_stress and not by_rate
    flows = by_rate and not by_stress and bool(np.median(np.abs(course.moved)))
    calls = f"it is called {said.words!r}"
    if said.test == "recovery" and not flows and not said.by_file_name:
        return "none", f"a recovery ({calls}), {_WITHOUT_CREEP}"
    excluded = {
        "creep": flows and "the rate is held and the stress is not",
        "relaxation": (flows or only_stress) and _goes_on(course) and "the strain is not held",
        "start_up": only_stress and _drifts(course) and "the stress is held and the rate is not",
    }.get(said.test)
    if excluded:
        return None if said.by_file_name else ("none", f"called {said.words!r}, but {excluded}")
    if said.test == "creep":
        return "creep", f"{calls}; the strain is what the stress was answered with"
    if said.test == "relaxation" and course.strain is not None:
        return "relaxation", f"{calls}; the stress relaxes"
    if said.test == "flow_curve" and (every_row_differs(course.moved) or _steps_alike(course)):
        return "flow_curve", f"{calls}; every row is another steady state"
    if said.test == "ramp":
        if _follows_stress(course):
            return "creep", "a ramp of stress, which the strain follows"
        return None if only_stress else ("run", f"{calls}; the rate goes its way in time")
    if said.test in ("loop", "intervals") and not only_stress and not said.by_file_name:
        return "run", f"{calls}; the rate goes its way in time"
    return None


def _by_numbers(course: Course) -> tuple[TestName, str]:
    stress, rate, strain = course.stress, course.rate, course.strain
    by_rate, by_stress = _rate_is_set(course), held(stress)
    if by_stress and np.any(stress):
        exact = spread(stress) < EXACTLY
        steps = rate is not None and every_row_differs(rate)
        more = max(spread(stress) * _MORE_EXACT, EXACTLY) <= spread(course.moved)
        if (exact and (more or _jumps(course))) or (not by_rate and not steps and _drifts(course)):
            return "creep", "the stress is held, and the rate is what answers it"
    if not np.any(np.abs(stress) > 0.0) and strain is not None and np.ptp(strain) > 0.0:
        return "none", f"a recovery, as there is no stress, {_WITHOUT_CREEP}"
    if rate is not None and every_row_differs(rate):
        span = f"{np.min(np.abs(rate)):.3g} to {np.max(np.abs(rate)):.3g} 1/s"
        return "flow_curve", f"every row has another rate, {span}"
    if rate is not None and _steps_alike(course):
        return "flow_curve", "the rate goes up and down in steps, and the stress is the same"
    if straight(course.time, stress) and _follows_stress(course):
        return "creep", "a ramp of stress, which the strain follows"
    if strain is not None and not by_rate:
        # held: what is left of the rise of the strain lies before the middle of the record
        late = strain[len(strain) // 4 :]
        if abs(np.median(strain)) > 0.0 and spread(late) < CONSTANT:
            return "relaxation", "the strain is held, and the stress relaxes"
    ways = None if rate is None else up_and_down(rate, stress)
    if ways is not None and ways.apart:
        return "run", (
            f"the rate goes up and down over time, and the stresses of the two ways are "
            f"{ways.described}"
        )
    if rate is not None and np.ptp(rate) > 0.0 and held(rate) and spread(rate) >= CONSTANT:
        return "run", "a flow whose rate goes in steps, over time"
    return "run", "a flow at a given rate, over time"


_WITHOUT_CREEP = (
    "and the creep before it, from which it starts, is not in the file: give both in one file, one "
    "after the other"
)


def _follows_stress(course: Course) -> bool:
    """Return whether the stress is a smooth ramp and the rate is not."""
    smooth = straight(course.time, course.stress) or _rougher(
        course.time, course.moved, course.stress
    )
    return smooth and not _rate_is_set(course)


def _rate_is_set(course: Course) -> bool:
    if course.rate is not None:
        return held(course.rate) or straight(course.time, course.rate)
    assert course.strain is not None
    return straight(course.time, course.strain) and not held(course.strain)


def _goes_on(course: Course) -> bool:
    """Return whether the strain changes later on in the record, so that it was not held."""
    if course.strain is not None:
        late = course.strain[len(course.strain) // 4 :]
        return bool(np.ptp(late) > _MOVES * np.max(np.abs(course.strain)))
    return True


def _drifts(course: Course) -> bool:
    """Return whether the rate changes on the whole, not from sample to sample as noise does."""
    moved = np.abs(course.moved)
    third = max(len(moved) // 3, 1)
    first, last = moved[:third], moved[-third:]
    scatter = np.median(np.abs(np.diff(moved)))
    change = abs(float(np.median(first) - np.median(last)))
    return change > max(CONSTANT * float(np.median(moved)), 3.0 * float(scatter))


def _jumps(course: Course) -> bool:
    """Return whether the strain has a part that is there at once, as a given stress makes it."""
    if course.strain is None or len(course.time) < 5:
        return False
    line = np.polynomial.Polynomial.fit(course.time, course.strain, 1)
    return bool(line(0.0) * np.median(course.stress) > 0.0) and bool(
        abs(line(0.0)) > CONSTANT * np.max(np.abs(course.strain))
    )


def _steps_alike(course: Course) -> bool:
    if course.rate is None:
        return False
    ways = up_and_down(course.rate, course.stress)
    return ways is not None and not ways.apart


@dataclass(frozen=True)
class UpAndDown:
    """Stresses on the way down over those at the same rates on the way up, as logarithms.

    `logarithms`: shape (m,).
    `scatter`: standard deviation of the logarithm of a stress.
    """

    logarithms: Float[np.ndarray, " m"]
    scatter: float

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
    """Return by how much stresses differ on the way up and down; None if rates go one way only.

    `rate`, `stress` in 1/s and Pa, in the order in which they were measured. Rows of one sign are
    compared.
    """
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
        way
        for way in zip([0, *cuts], [*(cuts + 1), len(x)], strict=True)
        if way[1] - way[0] >= _FEWEST_OF_BRANCH
    ]
    if len(ways) < 2 or len(cuts) > len(x) // _FEWEST_OF_BRANCH:
        return None
    found, bends = [], []
    for (a, b), (c, d) in pairwise(ways):
        (first, one), (second, other) = _in_order(x[a:b], y[a:b]), _in_order(x[c:d], y[c:d])
        both = (first >= second[0]) & (first <= second[-1])
        if (x[b - 1] - x[a]) * (x[d - 1] - x[c]) < 0.0 and both.any():
            found.append(np.interp(first[both], second, other) - one[both])
        bends += [_bends(first, one), _bends(second, other)]
    off = np.concatenate(bends) if bends else np.empty(0)
    if not found or not len(off):
        return None
    scatter = 1.4826 * float(np.median(np.abs(off))) / np.sqrt(1.5)
    return UpAndDown(np.concatenate(found), scatter)


def _in_order(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    places, first = np.unique(x, return_index=True)
    return places, y[first]


def _bends(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    share = (x[1:-1] - x[:-2]) / (x[2:] - x[:-2])
    return y[1:-1] - (y[:-2] + share * (y[2:] - y[:-2]))


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
    """Return the strain that a rate has made since t = 0, shape (n,).

    `time` in s, from the start of the test, increasing. `rate` in 1/s; before the first sample it
    is taken as there.
    """
    before = max(float(time[0]), 0.0) * float(rate[0])
    if len(time) < 2:
        return np.full(len(time), before)
    made = PchipInterpolator(time, rate).antiderivative()(time)
    return before + made - made[0]


def _rougher(time: Values, answer: Values, imposed: Values) -> bool:
    """Return whether one record is rougher than another by a factor of ten."""

    def roughness(values):
        middle = np.interp(time[1:-1], time[::2], values[::2])
        return np.median(np.abs(values[1:-1] - middle)) / (np.ptp(values) or 1.0)

    return bool(roughness(answer) > 10.0 * roughness(imposed))
