"""Linear tests at several temperatures."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pandas as pd
from jaxtyping import Float

from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.dataset.load import SWEEP_FILE, TESTS_FILE, read_sweep
from discover.dataset.material_functions import read_over_time
from discover.dataset.tables import units
from discover.dataset.tables.table import read_table
from discover.errors import InputError, Problems
from discover.words import did_you_mean

SWEEP, RELAXATION, CREEP = SWEEP_FILE.removesuffix(".csv"), "relaxation", "creep"

NAMES = {SWEEP: "sweep", RELAXATION: "relaxation modulus", CREEP: "creep compliance"}
"""What each test is called, by its word in ``tests.csv``."""
_COLUMNS = {
    SWEEP: ("omega_rad_s", "Gp_Pa", "Gpp_Pa"),
    RELAXATION: (units.TIME.column, "relaxation_modulus_Pa"),
    CREEP: (units.TIME.column, "compliance_1_Pa"),
}

# Averages of a table over time that are kept in each decade. Instruments write thousands of samples
# evenly in time, which would give the last decade all the weight
PER_DECADE = 20
_FEWEST = 4

Values = Float[np.ndarray, " n"]


@dataclass(frozen=True)
class LinearTest:
    """A material function at one temperature."""

    kind: str  # ``lve``, ``relaxation`` or ``creep``
    argument: Values  # frequencies in rad/s or times in s, increasing
    values: Float[np.ndarray, "k n"]  # G′ and G″ or G(t) in Pa, or J(t) in 1/Pa
    # relative standard error of averages; zero where nothing was averaged
    spread: Values = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self):
        if not len(self.spread):
            object.__setattr__(self, "spread", np.zeros(len(self.argument)))

    def __len__(self) -> int:
        return len(self.argument)

    @property
    def name(self) -> str:
        """What it is called."""
        return NAMES[self.kind]

    @property
    def sweep(self) -> LinearSweep:
        """As a sweep, which it has to be."""
        return LinearSweep(self.argument, *self.values)

    def moved(self, log_shift: float, log_vertical: float) -> "LinearTest":
        """Return the test as at the reference: ω a_T, t/a_T, G/b_T, J b_T."""
        along, up = directions(self.kind)
        argument = self.argument * 10.0 ** (along * log_shift)
        return replace(self, argument=argument, values=self.values * 10.0 ** (up * log_vertical))

    def select(self, rows: np.ndarray) -> "LinearTest":
        """Return some of its samples."""
        return LinearTest(self.kind, self.argument[rows], self.values[:, rows], self.spread[rows])

    def to_dataframe(self) -> pd.DataFrame:
        """Return it in the columns of its file."""
        columns = (self.argument, *self.values)
        return pd.DataFrame(dict(zip(_COLUMNS[self.kind], columns, strict=True)))


Tests = Mapping[str, Mapping[float, LinearTest]]
"""Linear tests by kind and by temperature in °C."""


def directions(kind: str) -> tuple[int, int]:
    """Return the signs with which log a_T moves arguments and log b_T moves values."""
    return (1 if kind == SWEEP else -1), (1 if kind == CREEP else -1)


def of_sweep(sweep: LinearSweep) -> LinearTest:
    """Return a linear sweep as a linear test."""
    moduli = np.stack([sweep.storage_modulus, sweep.loss_modulus])
    return LinearTest(SWEEP, sweep.angular_frequency, moduli)


def over_time(kind: str, time: Values, values: Values) -> LinearTest:
    """Return a table over time, in Pa or 1/Pa, as a linear test of averages, even in log time.

    Their error is that of the scatter about the straight line through the logs of an interval.
    """
    x, y = np.log10(time), np.log10(values)
    interval = np.floor(PER_DECADE * (x - x[0])).astype(int)
    starts = np.flatnonzero(np.diff(interval, prepend=-1))
    rows = []
    for part_x, part_y in zip(np.split(x, starts[1:]), np.split(y, starts[1:]), strict=True):
        error, n = 0.0, len(part_x)
        if n > 3 and np.ptp(part_x) > 0.0:  # a line has two constants
            left = part_y - np.polyval(np.polyfit(part_x, part_y, 1), part_x)
            error = np.log(10.0) * float(np.sqrt(np.sum(left**2) / (n - 2) / n))
        rows.append((np.mean(part_x), np.mean(part_y), error))
    mean_x, mean_y, spread = np.array(rows).T
    return LinearTest(kind, 10.0**mean_x, 10.0 ** mean_y[None], spread)


def read_linear_tests(root: Path) -> dict[str, dict[float, LinearTest]]:
    """Return the linear tests of a folder by kind and temperature, as ``tests.csv`` lists them.

    Raises InputError if the list or a file is wrong, or no kind of test has two temperatures.
    """
    missing = "Tests at several temperatures are listed there; write one with the columns file, "
    table = read_table(root / TESTS_FILE, TESTS_FILE, missing + "test and temperature_C.")
    problems = Problems()
    for column in ("file", "test", "temperature_C"):
        if column not in table.columns:
            problems.add(
                f"{TESTS_FILE} has no column {column!r}; it has {table.listed}."
                f"{did_you_mean(column, table.columns)} Add it."
            )
    problems.require_none(TESTS_FILE)
    found: dict[str, dict[float, LinearTest]] = {}
    degrees = table.numbers("temperature_C")
    names, tests = table.columns["file"], table.columns["test"]
    for celsius, name, test in zip(degrees.tolist(), names, tests, strict=True):
        kind = test.strip()
        if kind not in NAMES:
            continue
        if Path(name).name != name:
            raise InputError(f"{TESTS_FILE} names {name!r}; put the file itself in the folder.")
        at = found.setdefault(kind, {})
        if celsius in at:
            raise InputError(
                f"{TESTS_FILE} has two tests {kind!r} at {celsius:g} °C; keep one of them."
            )
        path = root / name
        if kind == SWEEP:
            at[celsius] = of_sweep(read_sweep(path))
            continue
        time, values = read_over_time(path, kind)
        # from where it is lost in noise nothing is left to lay over anything
        end = int(np.argmin(np.append(values > 0.0, False)))
        if end < _FEWEST:
            raise InputError(
                f"{path.name} has {end} positive values before the first that is not; "
                f"{_FEWEST} are needed. Remove what is lost in noise, or the file."
            )
        at[celsius] = over_time(kind, time[:end], values[:end])
    if not any(len(at) > 1 for at in found.values()):
        raise InputError(
            f"{TESTS_FILE} lists no kind of linear test (lve, relaxation, creep) at two "
            "temperatures; shifting needs two."
        )
    return found
