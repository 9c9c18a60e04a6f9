"""Parts of an answer: modes, what is suspected of the instrument, range, errors."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from discover.answer.constant import Constant, Span
from discover.words import LEVEL, effect_title, percent_of

_MOST_NAMES = 3  # Names of one effect; of more the rest is counted


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
    correction: float = 0.0  # by how much it changes a fitted run at most, relative
    alternatives: tuple[str, ...] = ()  # effects that these runs do not distinguish from it

    @property
    def title(self) -> str:
        """Name in words, with those that it may be as well."""
        first, *others = map(effect_title, (self.effect, *self.alternatives))
        if len(others) >= _MOST_NAMES:
            others = [others[0], f"{len(others) - 1} others"]
        *names, last = first, *others
        return f"{', '.join(names)} or {last}" if names else last

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
        title, amplitude = self.title, self.amplitude
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
        return first.determined and not first.may_be_zero

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
    `by_temperature`: of runs that were shifted to one temperature, the flows as they were measured,
        by temperature in °C.
    `flows`: kinds of flow: ``shear``, ``uniaxial``, ``planar``, ``biaxial``.
    """

    weissenberg: Span | None = None
    deborah: Span | None = None
    strain: Span | None = None
    rate_1_s: Span | None = None
    frequency_rad_s: Span | None = None  # of sweeps, which have no rate of their own
    flows: tuple[str, ...] = ("shear",)
    oscillates: bool = True  # whether De is λω; else λ over the length of a run
    by_temperature: Mapping[float, "Range"] = field(default_factory=dict)
    amplitude: Span | None = None  # of the strain, where each run oscillates at a finite one
    steady: bool = False  # whether all runs are tables of steady states
    tests: tuple[str, ...] = ()  # what the other runs are, in words: start-up, steps of rate

    def to_json(self) -> dict[str, Any]:
        """Return the range as result files hold it."""
        own = {key: one for key, one in vars(self).items() if key not in _NOT_WRITTEN}
        measured = {f"{at:g}": one.to_json() for at, one in self.by_temperature.items()}
        return own | {"by_temperature_C": measured} if measured else own


_NOT_WRITTEN = ("oscillates", "by_temperature", "amplitude", "steady", "tests")


@dataclass(frozen=True)
class ExpectedError:
    """Relative error that a prediction of one quantity is expected to have.

    `inside`, `beyond`: inside the rates of the data and beyond them, there never less; None where
        unknown.
    `beyond_at`: how fast that is, and whether it was measured there: ``measured at 3 1/s``.
    `missing`: what stands in place of a number that is unknown.
    `note`: why it is unknown, or on what it rests: ``7 unseen runs``. `spread`: what nothing
    measured differs by between laws that fit as well, inside and at twice the highest rate.
    """

    inside: float | None = None
    beyond: float | None = None
    beyond_at: str = ""
    missing: Literal["not measured", "not determined", "measured but not used"] = "not measured"
    note: str = ""
    is_residual: bool = False  # of fitted runs, which is no error to expect
    spread: tuple[float | None, float | None] = (None, None)
    uncorrected: str = ""  # what of the instrument its records are not corrected for

    def __post_init__(self) -> None:
        # a few faster runs may be missed by less, and laws may differ by less there: by chance
        if self.beyond is not None and self.beyond < (self.inside or 0.0):
            object.__setattr__(self, "beyond", self.inside)
            object.__setattr__(self, "beyond_at", "as in range")

    @property
    def is_known(self) -> bool:
        """Whether there is a number."""
        return self.inside is not None or self.beyond is not None

    @property
    def why_unknown(self) -> str:
        """Why there is no number."""
        if (apart := self.spread[0]) is None:
            return f"{self.missing}: {self.note}".removesuffix(": ")
        return f"{self.note or self.missing}: laws that fit as well differ by {percent_of(apart)}"
