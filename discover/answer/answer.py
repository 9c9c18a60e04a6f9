"""A law that one can use: constants, modes, how well it describes, where, and how far off it is."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from discover.answer import sentences
from discover.equations.equation import Equation
from discover.equations.spelling.plain_signs import plain as plain_signs
from discover.plain_numbers import plain
from discover.summary_view import Estimate
from discover.words import LEVEL, effect_title, estimate, interval, readable, significant

TOLERANCE = 0.05
"""Relative discrepancy that is accepted where nobody says otherwise."""

QUANTITIES = ("sigma12", "N1", "N2", "uniaxial")
"""Quantities of which an expected error is given, in the order of the table."""

EMPIRICAL = "empirical fit: "
"""Begin of the title of a sum of effects that the field has no name for."""

Span = tuple[float, float]
"""Least and largest value."""


@dataclass(frozen=True)
class Constant:
    """Constant of a law or of an effect.

    `value`, `ci95`, `unit`: with its 95 % interval, None for one that was declared; ``"1"`` if
        dimensionless.
    """

    name: str  # as studies spell it, such as ``alpha``
    value: float
    ci95: Span | None = None
    unit: str = "1"
    determined: bool = True  # whether the data determine it
    letter: str = ""  # LaTeX, as the equation of its effect has it
    meaning: str = ""  # in a few words, where its letter is not one of the field
    end: Literal["", "low", "high"] = ""  # of its physical range, where the value is there

    @property
    def is_term(self) -> bool:
        """Whether it is the coefficient of a term of the library."""
        return "sigma" in self.name or "gammadot" in self.name

    @property
    def reciprocal(self) -> "Constant":
        """Its reciprocal, where the letter is that of one over it: γ̇c rather than 1/γ̇c."""
        ends = self.ci95 or (self.value, self.value)
        if not self.letter.startswith("1/") or self.unit not in _RECIPROCAL or min(ends) <= 0.0:
            return self
        low, high = ends
        return replace(
            self,
            value=1.0 / self.value,
            ci95=None if self.ci95 is None else (1.0 / high, 1.0 / low),
            unit=_RECIPROCAL[self.unit],
            letter=self.letter.removeprefix("1/"),
            end=_OTHER_END[self.end],
        )

    @property
    def symbol(self) -> str:
        """Letter of the field, such as α."""
        if self.is_term:
            return readable(self.name)
        name = self.name.rpartition(".")[2]
        if name in _SYMBOLS:
            return _SYMBOLS[name][0]
        letter = self.reciprocal.letter
        return plain_signs(letter) if letter else readable(name.replace("_", " "))

    @property
    def said(self) -> str:
        """What it is, in a few words; empty of a term, and where nobody said."""
        name = self.name.rpartition(".")[2]
        said = self.meaning or _SYMBOLS.get(name, ("", ""))[1]
        return said.removeprefix("inverse ") if self.reciprocal is not self else said

    @property
    def number(self) -> str:
        """Value to as many digits as the interval leaves it, with its unit.

        Of what is not determined that of the best fit, which goes with the other constants.
        """
        if not self.determined:
            return f"{significant(self.reciprocal.value, 2)}{self.reciprocal._unit}"
        if (other := self.reciprocal) is not self:
            return other.number
        return f"{self._plain(self.value)}{self._unit}"

    @property
    def interval(self) -> str:
        """95 % interval, or a dash, or that it is not determined."""
        if not self.determined:
            return "not determined alone"
        if (other := self.reciprocal) is not self:
            return other.interval
        if self.bound:
            return self.bound
        low, high = self.ci95 or (math.nan, math.nan)
        first, last = self._rounded(low), self._rounded(high)
        if first and last:
            return f"{first} to {last}" if low < 0.0 else f"{first}–{last}"
        return interval(self.ci95)

    @property
    def digits(self) -> int:
        """Significant digits of the value in an equation: those of the interval, three at most."""
        if not self.has_interval or self.ci95 is None or not self.value:
            return 3
        of_width = math.floor(math.log10(self.ci95[1] - self.ci95[0]))
        return min(max(2 + math.floor(math.log10(abs(self.value))) - of_width, 1), 3)

    @property
    def _unit(self) -> str:
        """Unit as it stands behind a number."""
        return "" if self.unit in ("", "1") else f" {self.unit.replace('^2', '²')}"

    def _plain(self, value: float) -> str:
        """Return a number of this constant without its unit."""
        return self._rounded(value) or estimate(value, self.ci95)

    def _rounded(self, value: float) -> str:
        """Return a number to two digits of the interval's width; empty where it needs a power.

        And to three digits in all, unless the ends of the interval would be one number.
        """
        if self.ci95 is None or not 0.0 < (width := self.ci95[1] - self.ci95[0]) < math.inf:
            return ""
        largest = max(map(abs, (*self.ci95, self.value)))
        of_width, of_value = (math.floor(math.log10(size)) for size in (width, largest))
        decimals = min(1 - of_width, max(2 - of_value, -of_width))
        if decimals < 0 and value:  # a small number beside a large one keeps two digits
            decimals = min(max(decimals, 1 - math.floor(math.log10(abs(value)))), 0)
        if not 1e-3 <= largest < 1e5 or decimals > 6:
            return ""
        text = f"{round(value, decimals) + 0.0:.{max(decimals, 0)}f}"
        if self.ci95[0] > 0.0 and not float(text):  # small, but not zero
            return significant(value, 1)
        return text.replace("-", _MINUS)

    @property
    def has_interval(self) -> bool:
        """Whether it was fitted, so that its value is uncertain."""
        return self.determined and self.ci95 is not None and self.ci95[0] < self.ci95[1]

    @property
    def text(self) -> str:
        """Symbol, value and interval."""
        return self.with_interval(f"{LEVEL} ")

    def with_interval(self, level: str) -> str:
        """Return symbol, value and interval, with what stands before the interval."""
        if not self.determined:
            return f"{self.symbol} not determined"
        return f"{self.symbol}{'' if self.bound else ' ='} {self.measured(level)}"

    def measured(self, level: str) -> str:
        """Return value and interval, with what stands before the interval.

        Of a value near an end of its interval the interval comes first: alone it would look like a
        slip, and no other value goes with the other constants.
        """
        if not self.has_interval:
            return self.number
        if not self.bound and not self.is_skewed:
            return f"{self.number} ({level}{self.interval})"
        level = f"{level.strip()}, " if level.strip() else ""
        return f"{self.interval}{self.reciprocal._unit} ({level}best fit {self.number})"

    @property
    def is_skewed(self) -> bool:
        """Whether the value, the best of all constants together, is near an end of its interval.

        The interval is over all laws that fit as well, in which it may be far from that value.
        """
        one = self.reciprocal  # as it is told
        if not one.has_interval or one.ci95 is None:
            return False
        low, high = one.ci95
        return not _NEAR_END < (one.value - low) / (high - low) < 1.0 - _NEAR_END

    @property
    def is_wide(self) -> bool:
        """Whether its interval spans more than a decade."""
        return (
            self.has_interval
            and self.ci95 is not None
            and 0.0 < _DECADE * self.ci95[0] < self.ci95[1]
        )

    @property
    def bound(self) -> str:
        """Bound that remains of a value at an end of its physical range; empty of one inside.

        Also of a value at an end of an interval of decades, the other end of which says no more.
        """
        one = self.reciprocal
        if one.ci95 is None or not (one.at_limit or one.is_wide):
            return ""
        low, high = one.ci95
        if not one.at_limit:
            share = math.log(one.value / low) / math.log(high / low)
            if _NEAR_END < share < 1.0 - _NEAR_END:
                return ""
        sign, value = ("≥", low) if one.end == "high" else ("≤", high)
        return f"{sign} {one._plain(value)}"

    @property
    def at_limit(self) -> bool:
        """Whether its value is at an end of what is physical."""
        return bool(self.end) and self.has_interval


_MINUS = "−"
_OTHER_END: Mapping[str, Literal["", "low", "high"]] = {"": "", "low": "high", "high": "low"}
_DECADE = 10.0
_NEAR_END = 0.1
"""Share of an interval at its ends in which a value is not near its middle."""
_RECIPROCAL = {"s": "1/s", "1/s": "s", "1/Pa": "Pa", "1": "1"}
_SYMBOLS = {
    "modulus_Pa": ("G", "modulus"),
    "relaxation_time_s": ("λ", "relaxation time"),
    "modulus_factor": ("G/G_0", "moduli of the sweep times"),
    "relaxation_time_factor": ("λ/λ_0", "times of the sweep times"),
    "eta_s": ("η_s", "Newtonian viscosity"),
    "L2": ("L²", "extensibility"),
    "yield_stress_Pa": ("τ_y", "yield stress"),
    "consistency_Pa_sn": ("K", "consistency"),
    "flow_index": ("n", "flow index"),
    "viscosity_Pa_s": ("η", "viscosity"),
    "elastic_modulus_Pa": ("G", "modulus"),
}
"""Symbol and meaning of constants that no effect has."""


@dataclass(frozen=True)
class Mode:
    """Relaxation mode."""

    modulus_Pa: float
    relaxation_time_s: float


@dataclass(frozen=True)
class Suspect:
    """Effect of the instrument or of the flow, which is no part of the fluid."""

    effect: str  # name as studies spell it
    constants: tuple[Constant, ...] = ()  # its constants with their intervals, the amplitude first

    @property
    def amplitude(self) -> Constant | None:
        """Its first constant, a pure number as a percentage."""
        if not self.constants or self.constants[0].unit != "1":
            return self.constants[0] if self.constants else None
        one = self.constants[0]
        ends = None if one.ci95 is None else (100.0 * one.ci95[0], 100.0 * one.ci95[1])
        meaning = "" if one.meaning == one.name.replace("_", " ") else one.meaning
        return replace(one, value=100.0 * one.value, ci95=ends, unit="%", meaning=meaning)

    @property
    def text(self) -> str:
        """Name and amplitude, with its interval."""
        title, amplitude = effect_title(self.effect), self.amplitude
        if amplitude is None:
            return title
        if not amplitude.determined:
            return f"{title} not determined"
        if not self.is_established:
            return f"{title} {amplitude.number} ({LEVEL} {amplitude.interval}), not established"
        if amplitude.bound or amplitude.is_skewed or not amplitude.has_interval:
            return f"{title} {amplitude.measured(f'{LEVEL} ')}"
        share = f" {amplitude.meaning}" if amplitude.unit == "%" and amplitude.meaning else ""
        return f"{title} {amplitude.number}{share} ({LEVEL} {amplitude.interval})"

    @property
    def is_established(self) -> bool:
        """Whether the interval of its amplitude excludes zero."""
        if not self.constants:
            return True
        first = self.constants[0]
        return first.determined and (first.ci95 is None or first.ci95[0] * first.ci95[1] > 0.0)

    @property
    def is_separate(self) -> bool:
        """Whether the runs give it a size of its own."""
        return self.is_established and not any(one.at_limit for one in self.constants[:1])


@dataclass(frozen=True)
class Range:
    """Flows in which a law was fitted or tested.

    `weissenberg`, `deborah`: with the mean relaxation time; None where there is none.
    `strain`, `rate_1_s`: largest strain and rate of the runs, least to largest; None where not
        known.
    `flows`: kinds of flow: ``shear``, ``uniaxial``, ``planar``, ``biaxial``.
    """

    weissenberg: Span | None = None
    deborah: Span | None = None
    strain: Span | None = None
    rate_1_s: Span | None = None
    frequency_rad_s: Span | None = None  # of sweeps, which have no rate of their own
    flows: tuple[str, ...] = ("shear",)
    oscillates: bool = True  # whether De is λω; else λ over the length of a run


@dataclass(frozen=True)
class ExpectedError:
    """Relative error that a prediction of one quantity is expected to have.

    `inside`, `beyond`: inside the rates of the data and beyond them; None where unknown.
    `beyond_at`: how fast that is, and whether it was measured there: ``measured at 3 1/s``.
    `missing`: what stands in place of a number that is unknown.
    `note`: why it is unknown, or on what it rests: ``not measured; constants alone``.
    """

    inside: float | None = None
    beyond: float | None = None
    beyond_at: str = ""
    missing: Literal["not measured", "not determined"] = "not measured"
    note: str = ""
    is_measured: bool = True  # whether records of this quantity tell it, or only the law does
    is_residual: bool = False  # of fitted runs, which is no error to expect

    @property
    def is_known(self) -> bool:
        """Whether there is a number."""
        return self.inside is not None or self.beyond is not None


@dataclass(frozen=True)
class Discrepancy:
    """Size of what no law describes, over the root mean square of the records, without noise.

    `size`, `ci95`: of all runs in the range.
    `grows_with_rate`: power of the shear rate with which it grows; None where the data do not tell.
    """

    size: float
    ci95: Span
    by_run: Mapping[str, float] = field(default_factory=dict)  # by name of the run
    grows_with_rate: float | None = None
    unseen: str = ""  # ``unseen runs`` where it is the error of such; empty: of fitted ones


@dataclass(frozen=True)
class Answer:
    """Answer of a comparison, of a closed loop, of a fit: the law that one can use.

    Page, JSON, summary and text on the console are written from it.

    `constants`: of the law, dimensionless or with units; moduli and times that were fitted among
        them.
    `modes`, `solvent_viscosity_Pa_s`: linear part of the fluid.
    `temperature_C`: of its moduli and times; None where unknown.
    `shift_factors`: a_T, relaxation times over those at `temperature_C`, by temperature of the runs
        in °C, where these were shifted.
    `error`, `noise`: relative residual of the fitted runs, and relative noise, mean over runs.
    `discrepancy`: size of what it leaves, noise removed; None where unknown.
    `expected_error`: by quantity of `QUANTITIES`; one that is missing is not measured.
    `equation`: law written out; None where it cannot be.
    `shown`: law as a page shows it where it cannot be written out, constants that differ from mode
        to mode at their mean.
    `classical`: law of the field to take instead where the law cannot be written out.
    `written`: a law that is no `equation`, by format: ``latex``, ``python``, ``formula`` (LaTeX
        alone; of a law that is `shown`, what its h holds besides).
    `alternative`: what comes next to this law, one short sentence; empty where it is settled.

    Examples
    --------
    >>> answer = Answer(
    ...     "Giesekus", "giesekus", (Constant("alpha", 0.2, (0.199, 0.201)),), (Mode(1.0, 1.0),),
    ...     error=0.01, noise=0.01, fits_to_the_noise=True,
    ...     range=Range((1.0, 2.0), (0.25, 1.0)),
    ... )
    >>> answer.headline.partition(". ")[0]
    'Giesekus, α = 0.200 (95 % CI 0.199–0.201)'
    >>> answer.adequate
    True
    """

    title: str  # law by name, as a rheologist writes it; empty where there is no law to use
    law: str | None = None  # key of `discover.laws.LAWS`; None for a law without a name
    constants: tuple[Constant, ...] = ()
    modes: tuple[Mode, ...] = ()
    solvent_viscosity_Pa_s: float = 0.0
    error: float | None = None
    noise: float | None = None
    fits_to_the_noise: bool = False  # whether what the law leaves is noise
    discrepancy: Discrepancy | None = None
    range: Range = Range()  # where it may be used
    expected_error: Mapping[str, ExpectedError] = field(default_factory=dict)
    next_test: str = ""  # what to measure next, one sentence without *Next:*
    suspects: tuple[Suspect, ...] = ()  # effects of the instrument that were found or are suspected
    equation: Equation | None = field(default=None, repr=False)
    shown: Equation | None = field(default=None, repr=False)
    classical: Equation | None = field(default=None, repr=False)
    written: Mapping[str, str] = field(default_factory=dict, repr=False)
    failed: str = ""  # a test that the law failed, one short sentence; empty where none
    alternative: str = ""
    instead: str = ""  # first line where there is no law to use, such as for pure noise
    tolerance: float = TOLERANCE  # relative discrepancy that is good enough
    temperature_C: float | None = None
    shift_factors: Mapping[float, float] = field(default_factory=dict)

    @property
    def is_empirical(self) -> bool:
        """Whether it is a sum of effects that the field has no name for."""
        return self.title.startswith(EMPIRICAL)

    @property
    def size(self) -> float | None:
        """Relative discrepancy; None where unknown."""
        if self.discrepancy is not None:
            return self.discrepancy.size
        return 0.0 if self.fits_to_the_noise else self.error

    @property
    def adequate(self) -> bool | None:
        """Whether the discrepancy is within the tolerance; None where it is unknown."""
        if not self.title or self.size is None:
            return None
        return self.size <= self.tolerance

    @property
    def estimates(self) -> list[Estimate]:
        """Constants of the law, then those of the instrument, as a summary lists them."""
        own = [(one.name, one, "law") for one in self.constants]
        for suspect in self.suspects:
            own += [(f"{suspect.effect}.{c.name}", c, "instrument") for c in suspect.constants]
        return [
            Estimate((name,), c.value, c.ci95, c.unit, notes={"of": of, "determined": c.determined})
            for name, c, of in own
        ]

    def expected(self, quantity: str) -> ExpectedError:
        """Return the expected error of a quantity."""
        return self.expected_error.get(quantity, ExpectedError())

    def within_tolerance(self, quantity: str) -> bool | None:
        """Return whether a quantity is expected within the tolerance; None where unknown."""
        inside = self.expected(quantity).inside
        return None if inside is None else inside <= self.tolerance

    @property
    def use(self) -> dict[str, Any] | None:
        """What a simulation needs, as the contract writes it; None where there is no law."""
        if not self.title:
            return None
        flows = self.range
        return plain(
            {
                "law": self.law or self.title,
                "constants": {
                    one.name: {"value": one.value, "ci95": one.ci95, "unit": one.unit}
                    for one in self.constants
                },
                "modes": self.modes,
                "solvent_viscosity_Pa_s": self.solvent_viscosity_Pa_s,
                "temperature_C": self.temperature_C,
                "shift_factors": {f"{at:g}": one for at, one in self.shift_factors.items()},
                "range": {
                    "weissenberg": flows.weissenberg,
                    "deborah": flows.deborah,
                    "strain": flows.strain,
                    "rate_1_s": flows.rate_1_s,
                    "frequency_rad_s": flows.frequency_rad_s,
                    "flows": flows.flows,
                },
                "expected_error": {name: self.expected(name).inside for name in QUANTITIES},
                "expected_error_beyond": {name: self.expected(name).beyond for name in QUANTITIES},
                "why_unknown": {
                    name: f"{one.missing}{f': {one.note}' if one.note else ''}"
                    for name in QUANTITIES
                    if not (one := self.expected(name)).is_known
                },
                "suspects": {
                    suspect.effect: {
                        one.name: {"value": one.value, "ci95": one.ci95, "unit": one.unit}
                        for one in suspect.constants
                    }
                    for suspect in self.suspects
                },
            }
        )

    def to_json(self) -> dict[str, Any]:
        """Return ``use``, ``adequate`` and ``tolerance`` as result files hold them."""
        return {"use": self.use, "adequate": self.adequate, "tolerance": self.tolerance}

    @property
    def headline(self) -> str:
        """First line: law, constants, how well it describes, where to use it."""
        return sentences.headline(self)

    @property
    def lines(self) -> list[str]:
        """Answer in a few lines of text, for a terminal and for headers of exported files."""
        return sentences.lines(self)


class HasAnswer:
    """A result with an `answer`, and what follows from it."""

    @property
    def answer(self) -> Answer:
        """The law that one can use."""
        raise NotImplementedError

    @property
    def use(self) -> dict[str, Any] | None:
        """What a simulation needs: law, constants, modes, range, expected error."""
        return self.answer.use

    @property
    def adequate(self) -> bool | None:
        """Whether the discrepancy is within the tolerance; None where nothing is said of it."""
        return self.answer.adequate
