"""What is said of linear tests that have to predict one another."""

from collections.abc import Sequence
from itertools import groupby

from discover.dataset.linear.linear_tests import NAMES, Agreement
from discover.report.wording import percent


def agreement_words(agreements: Sequence[Agreement]) -> list[str]:
    """Return whether linear tests predict one another, a sentence for each two."""
    groups = groupby(sorted(agreements, key=_pair), key=_pair)
    said = [_sentence(list(group)) for _, group in groups]
    return [*said, *_apart(agreements)]


def _pair(one: Agreement) -> tuple[str, str]:
    return one.source, one.test


def _sentence(group: list[Agreement]) -> str:
    source, test = NAMES[group[0].source], NAMES[group[0].test]
    off = [one for one in group if not one.agrees]
    good = [one for one in group if one.agrees]
    parts = []
    if good:
        sizes = _range([one.error for one in good])
        parts.append(f"predicts the {test} to {sizes} (root mean square) at {_degrees(good)}")
    if off:
        biases = [one.bias for one in off]
        if all(one.bias > 0.5 * one.error for one in off):
            where = f"lies {_range(biases)} above what was measured on average"
        elif all(one.bias < -0.5 * one.error for one in off):
            where = f"lies {_range([-bias for bias in biases])} below what was measured on average"
        else:
            where = f"is off by {_range([one.error for one in off])} (root mean square)"
        left = _range([one.left for one in off])
        parts.append(
            f"does not predict {'it' if good else f'the {test}'} at {_degrees(off)}: what it "
            f"predicts {where}, and divided by one factor at each temperature {left} would be left"
        )
    return f"The {source} {'; it '.join(parts)}."


def _apart(agreements: Sequence[Agreement]) -> list[str]:
    """Return which of three tests stands apart by one factor, if the two others agree better."""
    kinds = sorted({one.source for one in agreements})
    if len(kinds) < 3:
        return []

    def bias(first: str, second: str) -> float:
        both = [abs(one.bias) for one in agreements if {one.source, one.test} == {first, second}]
        return sum(both) / len(both) if both else float("inf")

    pairs = sorted((bias(a, b), a, b) for i, a in enumerate(kinds) for b in kinds[i + 1 :])
    (least, first, second), (more, *_) = pairs[0], pairs[1]
    third = next(kind for kind in kinds if kind not in (first, second))
    if not (least <= 0.5 * more and more > 0.1):
        return []
    return [
        f"The {NAMES[first]} and the {NAMES[second]} agree on their size to {percent(least)} on "
        f"average, and the {NAMES[third]} stands apart from both, by {percent(more)} or more: a "
        f"gain, a trim or a loading of the {NAMES[third]}, or one that the two others share."
    ]


def _range(values: Sequence[float]) -> str:
    low, high = percent(min(values)), percent(max(values))
    return low if low == high else f"{low.removesuffix(' %')} to {high}"


def _degrees(group: Sequence[Agreement]) -> str:
    return f"{', '.join(f'{one.celsius:g}' for one in group)} °C"


def agreement_lines(agreements: Sequence[Agreement]) -> list[dict[str, str]]:
    """Return the lines of the table on the page."""
    return [
        {
            "source": NAMES[one.source],
            "test": NAMES[one.test],
            "temperature": f"{one.celsius:g}",
            "times": f"{one.times[0]:.3g} to {one.times[1]:.3g}",
            "error": percent(one.error),
            "bias": f"{'+' if one.bias > 0 else '−'}{percent(abs(one.bias))}",
            "left": percent(one.left),
        }
        for one in agreements
    ]
