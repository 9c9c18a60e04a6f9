"""Modes of a law, and the temperature and shift factors of its times, in words."""

import math
from dataclasses import replace
from typing import Any, TypeVar

from discover.answer.fields import AnswerFields
from discover.words import significant

_Answer = TypeVar("_Answer", bound=AnswerFields)


def degrees(temperature: float) -> str:
    """Return a temperature in °C."""
    return f"{temperature:.0f} °C".replace("-", "−")


def reduced_to(temperature_C: float | None) -> str:
    """Return the temperature to which times and rates of shifted runs were reduced."""
    return "the reference temperature" if temperature_C is None else degrees(temperature_C)


def scaled(factor: float) -> str:
    """Return what makes times of those at the reference temperature, in words."""
    by, way = (1.0 / factor, "divide") if factor < 1.0 else (factor, "multiply")
    return f"{way} by {significant(by, 3)}"


def at_use(answer: _Answer) -> _Answer:
    """Return an answer with its law at the temperature of the fitted runs, if they have one."""
    at, factors, modes = [*answer.range.by_temperature], answer.shift_factors, answer.modes
    by = factors.get(at[0]) if len(at) == 1 and answer.temperature_C is not None else None
    if by is None:
        return answer
    laws = {name: getattr(answer, name) for name in ("equation", "shown", "classical")}
    rest = {t: a / by for t, a in {**factors, answer.temperature_C: 1.0}.items() if t != at[0]}
    return replace(
        answer,
        constants=tuple(one.of_times(by) for one in answer.constants),
        modes=tuple(replace(m, relaxation_time_s=by * m.relaxation_time_s) for m in modes),
        solvent_viscosity_Pa_s=by * answer.solvent_viscosity_Pa_s,
        temperature_C=at[0],
        shift_factors=dict(sorted(rest.items(), reverse=True)),
        range=replace(answer.range, rate_1_s=answer.range.by_temperature[at[0]].rate_1_s),
        **{name: one and one.of_times(by) for name, one in laws.items()},
    )


def shifts(answer: AnswerFields) -> list[tuple[float, float]]:
    """Return temperatures of shifted runs with their factors: of many the first and the last."""
    found = [*answer.shift_factors.items()]
    return found if len(found) <= MOST_SHIFTS else [found[0], found[-1]]


MOST_SHIFTS = 3


def shifted(answer: AnswerFields) -> str:
    """Return at which temperature times hold, and what shortens them; empty where nothing does."""
    if not answer.shift_factors:
        return ""
    said = [
        f"{scaled(float(factor))} for {degrees(at)} (a_T = {significant(factor, 3)})"
        for at, factor in shifts(answer)
    ]
    return f"Moduli and times are for {reduced_to(answer.temperature_C)}; times: {', '.join(said)}."


def is_plain(answer: AnswerFields) -> bool:
    """Return whether the law has no units: one mode of 1 Pa and 1 s."""
    return [(m.modulus_Pa, m.relaxation_time_s) for m in answer.modes] == [(1.0, 1.0)]


def span(ends: tuple[float, float]) -> str:
    """Return a range in numbers of two digits."""
    low, high = map(short, ends)
    # else the power of the one would be taken for that of both
    dash = " to " if "×" in high and "×" not in low else "–"
    return low if low == high else f"{low}{dash}{high}"


def short(value: float) -> str:
    """Return a number with two digits."""
    return significant(value, 2)


def linear_part(answer: AnswerFields) -> str:
    """Return modulus and time of one mode, of several the ends of the times; solvent and shifts."""
    modes = answer.modes
    if len(modes) == 1:
        (mode,) = modes
        found = [f"G = {as_constant(answer, mode.modulus_Pa)} Pa"]
        found.append(f"λ = {as_constant(answer, mode.relaxation_time_s)} s")
    else:
        times = sorted(mode.relaxation_time_s for mode in modes)
        found = [f"λ from {as_constant(answer, times[0])} to {as_constant(answer, times[-1])} s"]
    if answer.solvent_viscosity_Pa_s:
        found.append(f"η_s = {as_constant(answer, answer.solvent_viscosity_Pa_s)} Pa s")
    found += [f"a_T = {significant(one, 3)} at {degrees(at)}" for at, one in shifts(answer)]
    return ", ".join(found)


FEW_MODES = 4
"""Relaxation modes up to which their table is open."""


def table(answer: AnswerFields) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows of the modes, with constants that differ between them.

    From the shortest time to the longest, then one that was added; in brackets what the runs do not
    determine.
    """
    each = [one for one in answer.constants if one.over_modes is not None]
    rows = []
    order = sorted(answer.modes, key=lambda one: (is_added(answer, one), one.relaxation_time_s))
    for number, mode in enumerate(order, 1):
        at = answer.modes.index(mode)
        told = [one.of_mode(at) for one in each]
        linear = zip((mode.modulus_Pa, mode.relaxation_time_s), OF_SWEEP, strict=True)
        name = f"{number}{' (added)' * is_added(answer, mode)}"
        rows.append([name, *(as_constant(answer, *one) for one in linear), *told])
    return ["mode", "G (Pa)", "λ (s)", *(one.symbol for one in each)], rows


def origin(answer: AnswerFields) -> str:
    """Return whether modes were given or fitted, and how many were added, in brackets."""
    added = sum(is_added(answer, one) for one in answer.modes)
    own = {one.name for one in answer.constants if one.ci95 is not None}
    how = "given, rescaled" if own & OF_SWEEP.keys() else "given"
    how = "fitted" if own & {"modulus_Pa", "relaxation_time_s"} else how
    return f" ({len(answer.modes) - added} {how}, {added} added)" if added else f" ({how})"


OF_SWEEP = {"modulus_factor": "moduli", "relaxation_time_factor": "relaxation times"}
"""Factors on moduli or times of the sweep that the runs want, and on what."""


def is_added(answer: AnswerFields, mode: Any) -> bool:
    """Return whether a mode was added to those that were declared."""
    added = (one.value for one in answer.constants if one.letter.startswith("G_+"))
    return any(math.isclose(mode.modulus_Pa, one, rel_tol=1e-6) for one in added)


def as_constant(answer: AnswerFields, value: float, factor: str = "") -> str:
    """Return a modulus, time or viscosity with the digits that it has among the constants.

    Two where a factor of these, such as ``modulus_factor``, is among them.
    """
    own = (one for one in answer.constants if math.isclose(one.value, value, rel_tol=1e-6))
    found = next((one.number.removesuffix(f" {one.unit}") for one in own), "")
    scaled = any(one.name == factor for one in answer.constants)
    return found or significant(value, 2 if scaled else 3)
