"""Linear tests of a folder, moved to one temperature: the tables of a new folder."""

from collections.abc import Mapping
from dataclasses import dataclass

from discover.dataset.linear.linear_agreement import Agreement, linear_agreements
from discover.dataset.linear.linear_tests import SWEEP, LinearTest, Tests
from discover.dataset.linear.superposition import Superposition, superpose
from discover.errors import InputError


@dataclass(frozen=True)
class MovedTests:
    """What a folder of linear tests at several temperatures becomes.

    `found`: tests and shifts.
    `own`: what tables over time ask for by themselves, by kind, where the shifts are the sweeps'.
    `agreements`: how well tests predict one another at each temperature.
    `files`: moved tests as one, by name of the file; None where they do not become one.
    """

    found: Superposition
    own: Mapping[str, Superposition]
    agreements: list[Agreement]
    files: Mapping[str, LinearTest | None]


def move_tests(
    tests: Tests,
    reference: float | None,
    vertical: bool,
    between: tuple[float, float] | None,
) -> MovedTests:
    """Return tests moved to one temperature, with what can be said of them.

    `tests`: by kind and temperature in °C. `reference`: one of the temperatures; the middle one if
    None. `vertical`: whether moduli and compliances too may be moved. `between`: only temperatures
    from one to the other. Raises InputError if too few temperatures are left, or neighbours share
    too few values.
    """
    if between is not None:
        low, high = min(between), max(between)
        tests = {
            kind: chosen
            for kind, at in tests.items()
            if (chosen := {t: one for t, one in at.items() if low <= t <= high})
        }
    found = superpose(tests, reference, vertical)
    own = {}
    for kind, at in tests.items():
        there = {t: at[t] for t in at if t in found.celsius}
        if kind == SWEEP or kind in found.leading or found.reference not in there:
            continue
        try:
            own[kind] = superpose({kind: there}, found.reference, vertical)
        except InputError:  # too few, or apart: the sweeps' shifts are all there is
            continue
    files = {f"{kind}.csv": found.master(kind) for kind in tests}
    return MovedTests(found, own, linear_agreements(tests), files)
