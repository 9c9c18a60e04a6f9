"""The tests that stand side by side in one table, told apart by names of columns that repeat."""

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

from discover.dataset.importing.header_constants import Constant, name_and_unit
from discover.dataset.importing.mapping import Mapping
from discover.dataset.importing.names import plain
from discover.dataset.importing.quantities import to_celsius
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.text_export import Block
from discover.dataset.importing.text_rows import is_number
from discover.dataset.tables import units
from discover.dataset.tables.unit_text import read_unit

_ANSWERS = {
    "stress", "strain", "Gp", "Gpp", "torque", "angle", "tensile_stress", "viscosity", "compliance",
    "relaxation_modulus", "complex_modulus", "complex_viscosity", "phase_angle", "loss_factor",
}  # fmt: skip
"""What a test measures; a table of several tests has one of these several times."""

_NUMBER = r"[-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?"
_LABEL = re.compile(
    rf"(?:(?P<name>[^=:]{{1,30}}?)\s*[=:]\s*)?(?P<value>{_NUMBER})\s*(?P<unit>[^\s0-9].{{0,15}}|1/.+)?"
)
_APART = re.compile(r"[\s_,;@(\[]+(?:(?:at|bei|à)\s+)?")
_COUNTED = re.compile(r"(?P<base>.*(?:[^\W\d_]|[)\]'*]))[\s._#]*\(?(?P<count>[0-9]{1,3})\)?")


@dataclass(frozen=True)
class _Head:
    """A column's name without what tells it from others of that name."""

    base: str
    unit: str
    label: str


def tests_side_by_side(block: Block) -> list[Block]:
    """Return the tests that stand side by side in a table, with the columns that they share."""
    filled = [i for i in range(len(block.columns)) if any(is_number(row[i]) for row in block.cells)]
    first: dict[tuple[str, ...], int] = {}
    for i in filled:  # a column that stands there twice is one
        first.setdefault((*block.columns[i], *(row[i] for row in block.cells)), i)
    own = sorted(first.values())
    for heads in (_heads(block), [_Head(name, unit, "") for name, unit in block.columns]):
        count = Counter(plain(heads[i].base) for i in own if heads[i].base)
        repeated = [i for i in own if count[plain(heads[i].base)] > 1]
        groups = _groups(repeated, heads, block.over)
        answers = [any(_quantity(heads[i]) in _ANSWERS for i in group) for _, group in groups]
        if len(groups) > 1 and all(answers):
            return list(_columns(block, heads, own, groups))
    return [block]


def _heads(block: Block) -> list[_Head]:
    heads = []
    for name, unit in block.columns:
        head = _Head(name, unit, "")
        inside, *label = re.split(r"\s*[,;@]\s*", unit, maxsplit=1)
        if label:
            head = _Head(name, inside, label[0])
        elif _is_condition(unit):
            head = _Head(name, "", unit)
        elif _quantity(head):
            pass
        elif labelled := _labelled(name):
            head = _Head(*name_and_unit(labelled[0], unit), labelled[1])
        elif counted := _COUNTED.fullmatch(name):
            base, within = name_and_unit(counted["base"], unit)
            if _quantity(_Head(base, within, "")):
                head = _Head(base, within, f"no. {counted['count']}")
        heads.append(head)
    return heads


def _labelled(name: str) -> tuple[str, str] | None:
    """Return a name and the condition that stands after it, as in "G' 20 °C"; None if none does."""
    parts = ((name[: m.start()], name[m.end() :].strip(" )]")) for m in _APART.finditer(name))
    return next((part for part in parts if part[0] and _is_condition(part[1])), None)


def _quantity(head: _Head) -> str | None:
    """Return which quantity a column of this name would be."""
    block = Block("", ((head.base, head.unit),), (("1",),), 1)
    return next(iter(Readings.of(block, Mapping(), "").columns), None)


def _groups(
    repeated: Sequence[int], heads: Sequence[_Head], over: Sequence[str]
) -> list[tuple[str, list[int]]]:
    """Return what is said of each of the tests side by side, and its own columns."""
    labels = {i: heads[i].label or (over[i] if over else "") for i in repeated}
    by_label: dict[str, list[int]] = {}
    for i in repeated:
        by_label.setdefault(labels[i], []).append(i)
    alone = all(
        len({plain(heads[i].base) for i in group}) == len(group) for group in by_label.values()
    )
    if all(labels.values()) and alone and len(by_label) > 1:
        return list(by_label.items())
    seen: Counter[str] = Counter()
    in_turn: dict[int, list[int]] = {}
    for i in repeated:
        base = plain(heads[i].base)
        in_turn.setdefault(seen[base], []).append(i)
        seen[base] += 1
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
    for i in own:
        if i in taken:
            continue
        before = [k for k, start in enumerate(starts) if start < i]
        if before and _quantity(heads[i]) in _ANSWERS | {"N1", "N2", "normal_force"}:
            groups[before[-1]][1].append(i)  # what one test has more than the others
        else:
            shared.append(i)
    for label, group in groups:
        columns = sorted([*shared, *group])
        rows = [row for row in block.cells if any(is_number(row[i]) for i in group)]
        names = tuple((heads[i].base, heads[i].unit) for i in columns)
        cells = tuple(tuple(row[i] for i in columns) for row in rows)
        part = replace(block, columns=names, cells=cells, over=(), apart=True)
        known = set(Readings.of(part, Mapping(), "").columns)
        said = [_constant(one, known) for one in label.split(", ")] if label else []
        constants = (*block.constants, *(one for one in said if one is not None))
        of = label or f"columns {min(group) + 1} to {max(group) + 1}"
        yield replace(part, name=", ".join(filter(None, (block.name, of))), constants=constants)


def _is_condition(label: str) -> bool:
    found = _LABEL.fullmatch(label.strip())
    return found is not None and bool(found["name"] or (found["unit"] and _name_of(found["unit"])))


def _constant(label: str, known: set[str]) -> Constant | None:
    """Return what stands above or beside names as the condition of a test, if it is one.

    A number alone is what the columns lack: the rate of stresses over time, the temperature of all
    else.
    """
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
    if to_celsius(0.0, unit) is not None:
        return "temperature"
    read = read_unit(unit)
    if read is None or unit.strip() in ("", "-", "1"):
        return None
    if read.cycles or "rad" in unit:
        return "angular frequency" if units.factor_to(read, units.ANGULAR_FREQUENCY) else None
    kinds = ((units.SHEAR_RATE, "shear rate"), (units.SHEAR_STRESS, "shear stress"))
    return next((name for kind, name in kinds if units.factor_to(read, kind) is not None), None)
