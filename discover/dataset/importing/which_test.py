"""Which test a block of numbers is: by words, and by the course of its numbers where silent."""

import re
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from discover.dataset.importing.mapping import TestName
from discover.dataset.importing.names import alternatives
from discover.dataset.importing.quantities import SAME_TEMPERATURE
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.series import (
    APART,
    CONSTANT,
    Values,
    alternates,
    every_row_differs,
    held,
    purer,
    spread,
    straight,
    up_and_down,
)
from discover.dataset.importing.text_export import Block
from discover.dataset.tables.table import shown
from discover.dataset.tables.units import SHEAR_RATE, TIME, Quantity, factor_to, read_unit
from discover.words import percent_of

_SAME_FREQUENCY = 1.02
_SAME_AMPLITUDE = 1.2
_FEWEST = 3
_EXACTLY = 1e-3  # spread below which it is a command, not an answer that happens to be constant
_MORE_EXACT = 10.0
_MOVES = 0.2  # share of the largest strain by which one that was held does not change later on
_OF_TENSION = {
    "stress": "tensile_stress", "shear_rate": "hencky_rate", "strain": "hencky_strain",
}  # fmt: skip
_EXTENSIONS = ("uniaxial", "planar", "biaxial")
_SHEAR = re.compile(r"shear|scher|schub|cisaill|cizall|cortante|taglio|xy|12", re.IGNORECASE)
_WITHOUT_CREEP = (
    "and the creep before it, from which it starts, is not in the file: give both in one file, one "
    "after the other"
)
_PATTERNS = {
    test: re.compile(words, re.IGNORECASE) for test, words in alternatives("tests").items()
}
_SAY_THE_TEST, _OTHERS_NAME = (
    re.compile(alternatives("lines")[key], re.IGNORECASE)
    for key in ("lines_of_a_test", "no_lines_of_a_test")
)
_LONGEST = 8  # words of a line beyond which it is prose, of which nothing is taken

Answer = tuple[TestName, str]
"""Which test it is, and what says so."""


class Said(NamedTuple):
    """What words say of a test."""

    test: str  # of ``words.toml``
    words: str  # as the file has them
    by_file_name: bool = False  # nothing else says so, and the numbers overrule it


def said_of(block: Block, file: str) -> Said | None:
    """Test that the words nearest to a block name: step, lines above, file; None if several."""
    for words in (block.name, *_titles(block.above)):
        if (test := _named(words)) is not None:
            return Said(test, words)
    test = _named(re.sub(r"[_-]+", " ", file.rpartition(".")[0] or file))
    return None if test is None else Said(test, file, by_file_name=True)


def _named(words: str) -> str | None:
    found = {t: m.start() for t, pattern in _PATTERNS.items() if (m := pattern.search(words))}
    if {"recovery", "creep"} <= set(found):  # one run, or "recovery after creep"
        found.pop("creep" if found["recovery"] <= found["creep"] else "recovery")
    if {"planar", "biaxial"} & set(found):
        found.pop("uniaxial", None)
    if {"loop", "intervals"} & set(found):  # made of ramps or of steps, and relaxing meanwhile
        found = {test: at for test, at in found.items() if test in ("loop", "intervals")}
    if {"flow_curve", "ramp"} <= set(found):
        return "ramp"
    return next(iter(found)) if len(found) == 1 else None


def _titles(lines: Sequence[Sequence[str]]) -> Iterator[str]:
    for line in reversed(lines):
        cells = [cell.strip(" #%:") for cell in line if cell.strip(" #%:")]
        if not cells or len(cells) > 2:
            continue  # names and units of columns
        key, mark, value = re.sub(r"\s+", " ", ": ".join(cells)).partition(":")
        if not mark:
            key, mark, value = key.partition("=")
        is_title = not mark or (_SAY_THE_TEST.search(key) and not _OTHERS_NAME.search(key))
        words = value if mark else key
        if is_title and len(words.split()) <= _LONGEST:
            yield words.strip()


class Recognised(NamedTuple):
    """What some rows of a block are taken for."""

    kind: TestName
    rows: Bool[np.ndarray, " n"]
    why: str  # what in the block says so


def recognise(readings: Readings) -> Recognised:
    """Which test a block holds, the tests of one table being apart; InputError on wrong units."""
    said = said_of(readings.block, readings.name)
    _find_time(readings)
    _as_extension(readings, said)
    rows = np.ones(len(readings), bool)
    in_time, has = "time" in readings.columns, readings.has
    found: Answer = "none", ""
    if has("omega", "Gp", "Gpp"):
        # samples of a waveform have no frequency, and are no points that lack something; before
        # the tool moves instruments write zeros
        rows = readings.known("omega") > 0.0
        found = _oscillatory(readings, rows & readings.whole("omega", "Gp", "Gpp"))
    elif in_time and has("tensile_stress"):
        flow = said.test if said is not None and said.test in _EXTENSIONS else "uniaxial"
        found = "run", f"an extension, {flow}: a tensile stress over time"
    elif has("Gp", "Gpp") and not has("omega") and "strain" in readings.columns:
        found = "amplitude_sweep", "moduli against strain, without a frequency"
    elif in_time and has("stress") and (has("shear_rate") or has("strain")):
        # rows that lack a number are counted when the rest is taken
        found = _in_time(readings, said)
    elif in_time and has("relaxation_modulus"):
        found = "relaxation", "it has a relaxation modulus over time"
    elif in_time and has("compliance"):
        found = "creep", "it has a compliance over time"
    elif has("stress", "shear_rate"):
        found = _without_time(readings)
    return Recognised(found[0], rows, found[1])


def _find_time(readings: Readings) -> None:
    """Take for the time a column in a unit of time that nothing else is known by, if it rises."""
    if "time" in readings.columns or "time" in readings.mapping.columns:
        return
    for i in _unread_in(readings, TIME):
        values = readings.block.numbers[i]
        values = values[~np.isnan(values)]
        if len(values) >= _FEWEST and np.all(np.diff(values) > 0.0):
            readings.columns["time"] = i
            return


def _as_extension(readings: Readings, said: Said | None) -> None:
    """Take stress, rate, strain for those of an extension, unless called those of shear."""
    tensile = set(_OF_TENSION.values()) & set(readings.columns)
    if not tensile and (said is None or said.test not in _EXTENSIONS):
        return
    for shear, extension in _OF_TENSION.items():
        at = readings.columns.get(shear)
        if at is None and shear == "shear_rate":
            at = next(_unread_in(readings, SHEAR_RATE), None)
        if at is None or extension in readings.columns:
            continue
        if not _SHEAR.search(readings.block.columns[at][0]):
            readings.columns.pop(shear, None)
            readings.columns[extension] = at


def _unread_in(readings: Readings, quantity: Quantity) -> Iterator[int]:
    for i, (name, unit) in enumerate(readings.block.columns):
        known = read_unit(unit) if unit and i not in readings.columns.values() else None
        if name and known is not None and factor_to(known, quantity) is not None:
            yield i


def _oscillatory(readings: Readings, rows: Bool[np.ndarray, " n"]) -> Answer:
    if np.sum(rows) < _FEWEST:
        return "none", f"an oscillation of {int(np.sum(rows))} points"
    omega = readings.known("omega")[rows]
    amplitude = readings.get("strain_amplitude")
    size = np.empty(0) if amplitude is None else amplitude[rows & np.isfinite(amplitude)]
    several = len(size) > 0 and _ratio(size) > _SAME_AMPLITUDE
    low, high = (f"{100 * size.min():.2g}", percent_of(size.max())) if several else ("", "")
    if _ratio(omega) > _SAME_FREQUENCY:
        different = len(np.unique(np.round(np.log(omega) / np.log(_SAME_FREQUENCY))))
        if several and 2 * different <= len(omega):
            return "amplitude_sweep", f"the strain goes from row to row, at {different} frequencies"
        why = f"{different} frequencies, {omega.min():.3g} to {omega.max():.3g} rad/s"
        if several:
            why += f"; the strain is not one but {low} to {high}, taken as small"
        elif not len(size):
            why += "; nothing says how large the strain was, it is taken as small"
        return "frequency_sweep", why
    at_one = f"one frequency, {omega[0]:.3g} rad/s"
    if several:
        return "amplitude_sweep", f"{at_one}, and strains from {low} to {high}"
    temperature = readings.get("temperature")
    if temperature is not None and np.ptp(temperature[rows]) > SAME_TEMPERATURE:
        return "none", f"a temperature sweep: {at_one}, and temperature varies"
    return "none", f"a time sweep: {at_one}, and no strain that varies"


def _ratio(values: Float[np.ndarray, " n"]) -> float:
    low, high = np.min(np.abs(values)), np.max(np.abs(values))
    return float(high / low) if low > 0.0 else np.inf


def _without_time(readings: Readings) -> Answer:
    """Return a flow curve, or why stresses and rates without a time are none."""
    rows = readings.whole("stress", "shear_rate")
    found: Answer = "flow_curve", "it has stress and rate, and no time"
    if np.sum(rows) < _FEWEST:
        return found
    rate, stress = readings.known("shear_rate")[rows], readings.known("stress")[rows]
    ways = up_and_down(rate, stress)
    if alternates(rate) or alternates(stress):
        why = "an oscillation, as rate or stress swing to and fro"
    elif not np.any(rate) or np.ptp(np.percentile(rate, [5.0, 95.0])) < 0.1 * np.max(np.abs(rate)):
        why = "samples at one rate, not a flow curve"
    elif _waits(rate, stress):
        why = "steps of the rate held in turn, not a flow curve"
    elif ways is not None and ways.apart:
        why = f"a loop whose ways up and down are {ways.described} at the same rates, so no flow "
        why += "curve of steady states"
    else:
        return found
    known, columns = readings.columns.values(), readings.block.columns
    unread = [shown(name) for i, (name, _) in enumerate(columns) if name and i not in known]
    remedy = "Export it with its time, or add a column of it"
    if unread:
        remedy = f'Name it, as in --column time="{unread[0]}"; not read: {", ".join(unread[:8])}'
    return "none", f"{why}, and no column is known as its time. {remedy}"


def _waits(rate: Values, stress: Values) -> bool:
    steps = np.flatnonzero(np.abs(np.diff(rate)) > 1e-3 * np.max(np.abs(rate))) + 1
    long = [piece for piece in np.split(stress, steps) if len(piece) > _FEWEST]
    changes = [np.ptp(piece) > APART * np.max(np.abs(piece)) for piece in long]
    return sum(map(len, long)) > 0.8 * len(rate) and any(changes)


def _in_time(readings: Readings, said: Said | None) -> Answer:
    moved = "shear_rate" if readings.has("shear_rate") else "strain"
    kept = readings.whole("time", "stress", moved)
    if np.sum(kept) < _FEWEST:
        return "run", "a transient"
    strain, rate = readings.get("strain"), readings.get("shear_rate")
    strain = None if strain is None or not np.all(np.isfinite(strain[kept])) else strain[kept]
    time, stress = (readings.known(key)[kept] for key in ("time", "stress"))
    course = _Course(time, stress, None if rate is None else rate[kept], strain)
    if course.swings and not course.stress_is_set:  # creep and recovery have a rate of both signs
        if strain is not None and purer(time, stress, strain):
            return "creep", "the stress is a sine and the strain is not"
        return "run", "an oscillation, sample by sample"
    found = None if said is None else course.as_said(said)
    return course.by_numbers() if found is None else found


class _Course:
    """What was recorded over time in s, Pa and 1/s, each of shape (n,); rate or strain is known."""

    def __init__(self, time: Values, stress: Values, rate: Values | None, strain: Values | None):
        self.stress, self.rate, self.strain = stress, rate, strain
        if rate is not None:
            self.moved, self.rate_is_set = rate, held(rate) or straight(time, rate)
        else:
            assert strain is not None
            rises = np.all(np.diff(time) > 0.0)
            self.moved = np.gradient(strain, time) if rises else np.diff(strain)
            self.rate_is_set = straight(time, strain) and not held(strain)
        self.stress_is_set = held(stress)
        self.swings = alternates(self.moved if strain is None else strain) or alternates(stress)
        self.follows_stress = straight(time, stress) and not self.rate_is_set
        self.ways = None if rate is None else up_and_down(rate, stress)
        # the strain later on: what is left of its rise lies before the middle of the record
        late = np.zeros(1) if strain is None else strain[len(strain) // 4 :]
        self.is_held = strain is not None and bool(np.median(strain)) and spread(late) < CONSTANT
        self.goes_on = strain is None or np.ptp(late) > _MOVES * np.max(np.abs(strain))
        # a part of the strain that is there at once, as a given stress makes it
        self.jumps = False
        if strain is not None and len(time) >= 5:
            begins = np.polynomial.Polynomial.fit(time, strain, 1)(0.0)
            with_stress = begins * np.median(stress) > 0.0
            self.jumps = with_stress and abs(begins) > CONSTANT * np.max(np.abs(strain))

    @property
    def drifts(self) -> bool:
        """Whether the rate changes on the whole, not from sample to sample as noise does."""
        moved = np.abs(self.moved)
        third = max(len(moved) // 3, 1)
        scatter = float(np.median(np.abs(np.diff(moved))))
        change = abs(float(np.median(moved[:third]) - np.median(moved[-third:])))
        return change > max(CONSTANT * float(np.median(moved)), 3.0 * scatter)

    def as_said(self, said: Said) -> Answer | None:
        """Return the test that words say; None where they leave it open."""
        only_stress = self.stress_is_set and not self.rate_is_set
        flows = self.rate_is_set and not self.stress_is_set and bool(np.median(np.abs(self.moved)))
        calls = f"it is called {said.words!r}"
        if said.test == "recovery" and not flows and not said.by_file_name:
            return "none", f"a recovery ({calls}), {_WITHOUT_CREEP}"
        excluded = {
            "creep": flows and "the rate is held and the stress is not",
            "relaxation": (flows or only_stress) and self.goes_on and "the strain is not held",
            "start_up": only_stress and self.drifts and "the stress is held and the rate is not",
        }.get(said.test)
        if excluded:
            return None if said.by_file_name else ("none", f"called {said.words!r}, but {excluded}")
        if said.test == "creep":
            return "creep", f"{calls}; the strain is what the stress was answered with"
        if said.test == "relaxation" and self.strain is not None:
            return "relaxation", f"{calls}; the stress relaxes"
        alike = self.ways is not None and not self.ways.apart
        if said.test == "flow_curve" and (every_row_differs(self.moved) or alike):
            return "flow_curve", f"{calls}; every row is another steady state"
        if said.test == "ramp" and self.follows_stress:
            return "creep", "a ramp of stress, which the strain follows"
        by_name = said.by_file_name and said.test != "ramp"
        if said.test in ("ramp", "loop", "intervals") and not only_stress and not by_name:
            return "run", f"{calls}; the rate goes its way in time"
        return None

    def by_numbers(self) -> Answer:
        """Return the test that the numbers show."""
        stress, rate, strain, ways = self.stress, self.rate, self.strain, self.ways
        steps = rate is not None and every_row_differs(rate)
        if self.stress_is_set and np.any(stress):
            exact = spread(stress) < _EXACTLY
            more = max(spread(stress) * _MORE_EXACT, _EXACTLY) <= spread(self.moved)
            drifts = not self.rate_is_set and not steps and self.drifts
            if (exact and (more or self.jumps)) or drifts:
                return "creep", "the stress is held, and the rate is what answers it"
        if not np.any(stress) and strain is not None and np.ptp(strain) > 0.0:
            return "none", f"a recovery, as there is no stress, {_WITHOUT_CREEP}"
        if rate is not None and steps:
            span = f"{np.min(np.abs(rate)):.3g} to {np.max(np.abs(rate)):.3g} 1/s"
            return "flow_curve", f"every row has another rate, {span}"
        if ways is not None and not ways.apart:
            return "flow_curve", "the rate goes up and down in steps, and the stress is the same"
        if self.follows_stress:
            return "creep", "a ramp of stress, which the strain follows"
        if self.is_held and not self.rate_is_set:
            return "relaxation", "the strain is held, and the stress relaxes"
        if ways is not None:
            return "run", (
                f"the rate goes up and down over time, and the stresses of the two ways are "
                f"{ways.described}"
            )
        if rate is not None and np.ptp(rate) > 0.0 and held(rate) and spread(rate) >= CONSTANT:
            return "run", "a flow whose rate goes in steps, over time"
        return "run", "a flow at a given rate, over time"
