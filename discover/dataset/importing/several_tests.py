"""The tests of one file: side by side in a table, one below the other, row by row in turn."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from discover.dataset.importing import quantities
from discover.dataset.importing.mapping import Mapping
from discover.dataset.importing.names import plain
from discover.dataset.importing.quantities import QUANTITIES, guess_columns, name_rank
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.text_export import OF_TESTS, Block, plain_words
from discover.dataset.importing.text_rows import Constant, is_number
from discover.dataset.tables import units
from discover.dataset.tables.units import name_and_unit, read_unit

# what a test measures; a table of several tests has one of these several times
_ANSWERS = {
    "stress", "strain", "Gp", "Gpp", "torque", "angle", "tensile_stress", "viscosity", "compliance",
    "relaxation_modulus", "complex_modulus", "complex_viscosity", "phase_angle", "loss_factor",
}  # fmt: skip
_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_LABEL = re.compile(
    rf"(?:(?P<name>[^=:]{{1,30}}?)\s*[=:]\s*)?(?P<value>{_NUMBER})\s*(?P<unit>[^\s0-9].{{0,15}}|1/.+)?"
)
_APART = re.compile(r"[\s_,;@(\[]+(?:(?:at|bei|à)\s+)?")
_COUNTED = re.compile(r"(?P<base>.*(?:[^\W\d_]|[)\]'*]))[\s._#]*\(?(?P<count>[0-9]{1,3})\)?")


class _Head(NamedTuple):
    """A column's name and unit without the label that tells it from others of that name."""

    base: str
    unit: str
    label: str = ""


def tests_side_by_side(block: Block) -> list[Block]:
    """Return the tests that stand side by side in a table, with the columns that they share."""
    first: dict[tuple[str, ...], int] = {}
    for i in block.filled:  # a column that stands there twice is one
        first.setdefault((*block.columns[i], *(row[i] for row in block.cells)), i)
    own = sorted(first.values())
    for heads in (list(map(_head, block.columns)), [_Head(*column) for column in block.columns]):
        count = Counter(plain(heads[i].base) for i in own if heads[i].base)
        repeated = [i for i in own if count[plain(heads[i].base)] > 1]
        groups = _groups(repeated, heads, block.over)
        if len(groups) > 1 and all(
            any(_quantity(heads[i]) in _ANSWERS for i in group) for _, group in groups
        ):
            return list(_columns(block, heads, own, groups))
    return [block]


def _head(column: tuple[str, str]) -> _Head:
    name, unit = column
    inside, *label = re.split(r"\s*[,;@]\s*", unit, maxsplit=1)
    if label:
        return _Head(name, inside, label[0])
    if _is_condition(unit):
        return _Head(name, "", unit)
    if not _quantity(_Head(name, unit)):
        # a condition may stand after the name, as in "G' 20 °C", or a count
        for m in _APART.finditer(name):
            before, after = name[: m.start()], name[m.end() :].strip(" )]")
            if before and _is_condition(after):
                return _Head(*name_and_unit(before, unit), after)
        if counted := _COUNTED.fullmatch(name):
            head = _Head(*name_and_unit(counted["base"], unit), f"no. {counted['count']}")
            if _quantity(head):
                return head
    return _Head(name, unit)


def _quantity(head: _Head) -> str | None:
    ranks = ((key, name_rank(key, head.base, head.unit)) for key in QUANTITIES)
    return next((key for key, rank in ranks if rank is not None), None)


def _groups(
    repeated: Sequence[int], heads: Sequence[_Head], over: Sequence[str]
) -> list[tuple[str, list[int]]]:
    """Return what is said of each of the tests side by side, and its own columns."""
    labels = {i: heads[i].label or (over[i] if over else "") for i in repeated}
    by_label: dict[str, list[int]] = {}
    seen: Counter[str] = Counter()
    in_turn: dict[int, list[int]] = {}
    for i in repeated:
        base = plain(heads[i].base)
        by_label.setdefault(labels[i], []).append(i)
        in_turn.setdefault(seen[base], []).append(i)
        seen[base] += 1
    alone = all(len({plain(heads[i].base) for i in g}) == len(g) for g in by_label.values())
    if all(labels.values()) and alone and len(by_label) > 1:
        return list(by_label.items())
    said = [next(filter(None, (labels[i] for i in group)), "") for group in in_turn.values()]
    said = said if len(set(said)) == len(said) else [""] * len(said)
    return list(zip(said, in_turn.values(), strict=True))


def _columns(
    block: Block, heads: Sequence[_Head], own: Sequence[int], groups: list[tuple[str, list[int]]]
) -> Iterator[Block]:
    """Yield the tests side by side: their own columns, and those that stand there once."""
    taken = {i for _, group in groups for i in group}
    shared: list[int] = []
    starts = [min(group) for _, group in groups]
    for i in (i for i in own if i not in taken):
        before = [k for k, start in enumerate(starts) if start < i]
        if before and _quantity(heads[i]) in _ANSWERS | {"N1", "N2", "normal_force"}:
            groups[before[-1]][1].append(i)  # what one test has more than the others
        else:
            shared.append(i)
    for label, group in groups:
        columns = sorted([*shared, *group])
        part = block.rows(np.flatnonzero(~np.isnan(block.numbers[group]).all(axis=0)))
        names = tuple((heads[i].base, heads[i].unit) for i in columns)
        cells = tuple(tuple(row[i] for i in columns) for row in part.cells)
        part = replace(part, columns=names, cells=cells, over=(), apart=True)
        known = set(guess_columns(part, {}))
        said = [_constant(one, known) for one in label.split(", ")] if label else []
        constants = (*block.constants, *(one for one in said if one is not None))
        of = label or f"columns {min(group) + 1} to {max(group) + 1}"
        yield replace(part, name=", ".join(filter(None, (block.name, of))), constants=constants)


def _is_condition(label: str) -> bool:
    found = _LABEL.fullmatch(label.strip())
    return found is not None and bool(found["name"] or (found["unit"] and _name_of(found["unit"])))


def _constant(label: str, known: set[str]) -> Constant | None:
    """Condition of a test above or beside names; a bare number is what the columns lack."""
    found = _LABEL.fullmatch(label.strip("()[]@ "))
    if found is None or label.startswith("no. "):
        return None
    name, value, unit = found["name"], found["value"], found["unit"]
    if name is not None:
        bare = unit or {"t": "°C"}.get(name.strip().lower(), "")
        return Constant(name.strip(), value, bare)
    if unit:
        of_unit = _name_of(unit)
        return None if of_unit is None else Constant(of_unit, value, unit)
    if "time" in known and not {"shear_rate", "strain", "hencky_rate"} & known:
        return Constant("shear rate", value, "1/s")
    return Constant("temperature", value, "°C")


def _name_of(unit: str) -> str | None:
    if quantities.to_celsius(0.0, unit) is not None:
        return "temperature"
    read = read_unit(unit)
    if read is None or unit.strip() in ("", "-", "1"):
        return None
    if read.cycles or "rad" in unit:
        return "angular frequency" if units.factor_to(read, units.ANGULAR_FREQUENCY) else None
    kinds = ((units.SHEAR_RATE, "shear rate"), (units.SHEAR_STRESS, "shear stress"))
    return next((name for kind, name in kinds if units.factor_to(read, kind) is not None), None)


_FEWEST = 3  # rows of a test
_DRIFT = 3.0  # spread in °C, up to which readings without a gap are one temperature, and no ramp
_BACK = 0.1  # share of the way so far, within which a clock is back at its start
_MOSTLY = 0.6  # share of steps in one direction, from which on values go that way


def tests_in_rows(block: Block, mapping: Mapping, file: str) -> list[Block]:
    """Return the tests that stand one below the other, or row by row in turn."""
    parts = [block]
    for split in (_by_words, _by_temperature, _by_restart, _by_set_value):
        parts = [part for one in parts for part in split(Readings.of(one, mapping, file))]
    if len(parts) == 1:
        return [block]
    names = [name for name, _ in block.columns]
    values = [[{row[i] for row in part.cells} for part in parts] for i in range(len(names))]
    # the columns that have one value in each of the tests, and not one in all
    one_each = [
        name
        for name, of in zip(names, values, strict=True)
        if all(len(one) == 1 for one in of) and len(set.union(*of)) > 1
    ]
    found = []
    for part in parts:
        told_by = dict.fromkeys((*part.told_by, *one_each))
        places = [names.index(name) for name in tuple(told_by)[:2]]
        named = ((part.cells[0][i], *block.columns[i]) for i in places)
        said = (f"{name} {cell} {unit}".strip() if is_number(cell) else cell
                for cell, name, unit in named)  # fmt: skip
        label = ", ".join(said) or f"from line {part.line} on"
        own = ", ".join(filter(None, (block.name, label)))
        found.append(replace(part, name=own, told_by=tuple(told_by)))
    return found


def _by_value(block: Block, values: np.ndarray, column: int) -> list[Block]:
    """Rows of each value of a column, shape (n,), in order; all of them if one has few."""
    _, first, group = np.unique(values, return_index=True, return_inverse=True)
    if len(first) < 2 or np.min(np.bincount(group)) < _FEWEST:
        return [block]
    told_by = *block.told_by, block.columns[column][0]
    parts = (block.rows(np.flatnonzero(group == k)) for k in np.argsort(first))
    return [replace(part, apart=True, told_by=told_by) for part in parts]


def _by_words(readings: Readings) -> list[Block]:
    """Split where a column says of which sample, run or step a row is."""
    block = readings.block
    for i, (name, _) in enumerate(block.columns):
        if found := OF_TESTS.fullmatch(plain_words(name)):
            parts = _by_value(block, np.array([row[i] for row in block.cells]), i)
            if len(parts) > 1:
                return parts if found["sample"] else [replace(one, apart=False) for one in parts]
    return [block]


def _by_temperature(readings: Readings) -> list[Block]:
    """Split where readings of temperature gather about a few values, other than along a record."""
    degrees = readings.alone("temperature")
    known = np.zeros(0, bool) if degrees is None else np.isfinite(degrees)
    if degrees is None or np.sum(known) < 2 * _FEWEST:
        return [readings.block]
    time = _values(readings, "time")
    if time is not None and np.all(np.diff(time) > 0.0) and not _sweeps(readings):
        return [readings.block]
    order = np.sort(degrees[known])
    cuts = order[1:][np.diff(order) > quantities.SAME_TEMPERATURE]
    group = np.searchsorted(cuts - 0.5 * quantities.SAME_TEMPERATURE, degrees)
    # a row without a reading is at the temperature of that before it
    group = group[np.maximum.accumulate(np.where(known, np.arange(len(known)), 0))]
    spreads = [np.ptp(degrees[known & (group == k)]) for k in np.unique(group)]
    if max(spreads) > _DRIFT:
        return [readings.block]
    return _by_value(readings.block, group, readings.columns["temperature"])


def _by_set_value(readings: Readings) -> list[Block]:
    """Split by the column whose values, held over rows, leave a clock that only rises in each."""
    block, time = readings.block, _values(readings, "time")
    if time is None or np.all(np.diff(time) > 0.0):
        return [block]
    best, changes = [block], 0
    for i in range(len(block.columns)):
        cells = np.array([row[i] for row in block.cells])
        values = np.unique(cells)
        if i == readings.columns["time"] or len(values) > len(cells) // _FEWEST:
            continue
        parts = _by_value(block, cells, i)
        rises = all(np.all(np.diff(time[cells == value]) > 0.0) for value in values)
        if len(parts) > 1 and rises and (len(best) == 1 or len(parts) < len(best)):
            best, changes = parts, np.count_nonzero(cells[1:] != cells[:-1])
    # one after the other, as creep and recovery are, they may be one sample's
    in_turn = changes < len(best)
    return [replace(part, apart=block.apart) for part in best] if in_turn else best


def _by_restart(readings: Readings) -> list[Block]:
    block = readings.block
    for key in ("time", "omega", "shear_rate"):
        values = _values(readings, key)
        if values is None or (key == "omega" and _strain_varies(readings)):
            continue
        if key != "time":
            values = np.log(np.maximum(np.abs(values), 1e-300))
        elif np.mean(np.diff(values) > 0.0) < _MOSTLY:
            continue
        if cuts := _restarts(values):
            first, *later = map(block.rows, np.split(np.arange(len(values)), cuts))
            return [first, *(replace(part, apart=key != "time") for part in later)]
    return [block]


def _restarts(values: Float[np.ndarray, " m"]) -> list[int]:
    """Return where values that go one way jump back to where they began."""
    steps = np.diff(values)
    up, down = np.mean(steps > 0.0), np.mean(steps < 0.0)
    if max(up, down) < _MOSTLY:
        return []
    cuts: list[int] = []
    begin = 0
    for i in np.flatnonzero(steps < 0.0 if up > down else steps > 0.0) + 1:
        way = abs(values[i - 1] - values[begin])
        if abs(values[i] - values[begin]) <= _BACK * way:
            cuts.append(int(i))
            begin = int(i)
    return cuts if np.min(np.diff([0, *cuts, len(values)])) >= _FEWEST else []


def _values(readings: Readings, key: str) -> Float[np.ndarray, " m"] | None:
    """Return a column of its own; None if some row lacks a number, or there are few."""
    values = readings.unless_wrong(key) if key in readings.columns else None
    enough = values is not None and len(values) >= 2 * _FEWEST and np.all(np.isfinite(values))
    return values if enough else None


def _sweeps(readings: Readings) -> bool:
    for key in ("omega", "shear_rate"):
        values = _values(readings, key)
        if values is not None and len(np.unique(values)) > len(values) // 4:
            size = np.abs(values)
            if np.max(size) > 3.0 * np.percentile(size, 5.0):
                return True
    return False


def _strain_varies(readings: Readings) -> bool:
    strain = readings.unless_wrong("strain_amplitude")
    size = np.empty(0) if strain is None else np.abs(strain[np.isfinite(strain)])
    return bool(len(size) and np.max(size) > 1.2 * np.min(size))
