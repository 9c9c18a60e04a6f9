"""Parts of the result of a closed loop: errors, constants, effects, explanations, laws."""

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass, field
from typing import Any, Literal

from discover.effects.registry import named_effects
from discover.equations import Equation, equation_to_json
from discover.laws import LAWS

STRUCTURES = (
    "thixotropy",
    "thixotropic_modulus",
    "thixotropic_modulus_by_stress",
    "thixotropic_relaxation",
    "thixotropic_relaxation_by_stress",
    "thixotropic_relaxation_two_times",
)
"""Effects that make a thixotropic fluid of an upper-convected Maxwell fluid."""

Verdict = Literal["effects_added", "no_effect_needed", "unexplained", "no_signal"]


@dataclass(frozen=True)
class ErrorPair:
    """Relative errors, mean over runs: on the fitted runs and on those held out, if any."""

    fit: float
    held_out: float | None


# Factor above the value from which on an interval tells nothing: two decades, beyond which records
# tell no time   [Davies & Anderssen 1997, J. Non-Newtonian Fluid Mech. 73, 163].
_OPEN = 100.0
_DECADE = 10.0  # The same on both sides
_ROUNDING = 1e-9


@dataclass(frozen=True)
class StageParameter:
    """A parameter of an effect as finally fitted."""

    value: float  # that of the effects that were found
    ci95: tuple[float, float]  # 95 % interval over all explanations that have the parameter
    unit: str
    at_end: Literal["", "low", "high"] = field(default="", kw_only=True)  # of its physical range

    @property
    def is_open(self) -> bool:
        """Whether these data leave it open: two decades above it, or a decade on both sides."""
        low, high = self.ci95
        both = 0.0 < low < abs(self.value) / _DECADE and high > _DECADE * abs(self.value)
        return both or high > _OPEN * abs(self.value)

    def is_open_up_to(self, end: float) -> bool:
        """Whether it is open in a range: from two decades below its upper end, to that end."""
        low, high = self.ci95
        # a logarithm there and back errs by a rounding
        at_the_end = high >= (1.0 - _ROUNDING) * end
        return self.is_open or (at_the_end and end > _OPEN * max(low, 0.0))


def end_of_range(value: float, low: float, high: float) -> Literal["", "low", "high"]:
    """Return at which end of a range a value is, but for a rounding; empty inside it."""
    off = _ROUNDING * abs(value)
    return "low" if value <= low + off else "high" if value >= high - off else ""


@dataclass(frozen=True)
class ModeConstant:
    """The constant of one mode.

    `left_open`: whether the interval leaves hardly a value out, so that what stands here comes from
    the other modes and the smooth function alone.
    """

    relaxation_time_s: float
    value: float
    ci95: tuple[float, float] | None  # given that it is a smooth function of the time
    left_open: bool


@dataclass(frozen=True)
class ConstantByMode(StageParameter):
    """A constant by mode; `value` and `ci95` are those at the mean time.

    `degree`: 3 is free in each mode that the runs tell; of earlier results that of a polynomial in
    log λ.
    """

    mean_time_s: float  # mean relaxation time by viscosity
    degree: int
    evidence: tuple[float, ...]  # the last is that over one constant
    modes: tuple[ModeConstant, ...]  # in the order of the declared modes

    @property
    def values(self) -> tuple[float, ...]:
        """Value of each mode."""
        return tuple(mode.value for mode in self.modes)


@dataclass(frozen=True)
class Stage:
    """An effect that was added.

    `effect`, `kind`: its name and kind. `parameters`: its parameters in the final model. `aliases`:
    effects that these data cannot tell from it. `error`: errors after this stage. `evidence`: twice
    the log of the posterior odds that it adds. `equation`, `source`, `check`: what it adds, where
    that comes from, and how to confirm it in the laboratory. `left_open`: names of constants that
    the runs do not determine.
    """

    effect: str
    kind: str
    parameters: dict[str, StageParameter]
    aliases: tuple[str, ...]
    error: ErrorPair
    evidence: float
    equation: str
    source: str
    check: str
    left_open: tuple[str, ...] = field(default=(), kw_only=True)

    @property
    def of_instrument(self) -> tuple[str, ...]:
        """Those of `aliases` that are effects of the instrument or of the flow in it."""
        known = named_effects()
        return tuple(a for a in self.aliases if a in known and known[a].kind != "constitutive")


@dataclass(frozen=True)
class KnownParameter:
    """A parameter of an effect that was declared; its 95 % interval, where it was fitted."""

    value: float
    ci95: tuple[float, float] | None
    unit: str


@dataclass(frozen=True)
class DeclaredEffect:
    """An effect that was part of the declared model, with its parameters in the final model."""

    effect: str
    kind: str
    parameters: dict[str, KnownParameter | ConstantByMode]


@dataclass(frozen=True)
class CandidateScore:
    """A candidate effect at one stage.

    `effect`, `kind`: its name and kind. `score`: share of the squared residual that it explains to
    first order, 0 to 1, given what is fitted already. `evidence`: twice the log of the posterior
    odds that it adds, where it was refitted. `error`: mean relative error on the fitted runs after
    that.
    """

    effect: str
    kind: str
    score: float
    evidence: float | None = None
    error: float | None = None


@dataclass(frozen=True)
class Explanation:
    """A set of effects that may be what the declared model lacks; empty where it lacks nothing.

    `effects`: their names. `probability`: of this set and its twins together. `error`: mean
    relative errors of the runs fitted and held out. `parameters`: values of the parameters of each
    effect. `twins`: other sets that predict these records alike.
    """

    effects: tuple[str, ...]
    probability: float
    error: ErrorPair
    parameters: Mapping[str, Mapping[str, float]]
    twins: tuple[tuple[str, ...], ...] = ()

    @property
    def members(self) -> tuple[tuple[str, ...], ...]:
        """The set itself and its twins."""
        return (self.effects, *self.twins)


@dataclass(frozen=True)
class Explanations:
    """The posterior over sets of effects.

    `likeliest_first`: their probabilities add up to 1 with `unexplained_probability`.
    `unexplained_probability`: that it is none of them. `inclusion`, `inclusion_by_kind`:
    probability that an effect, or some effect of a kind, is in the explanation. Twins share that of
    their class in equal parts.
    """

    likeliest_first: tuple[Explanation, ...] = ()
    unexplained_probability: float = 1.0
    inclusion: Mapping[str, float] = field(default_factory=dict)
    inclusion_by_kind: Mapping[str, float] = field(default_factory=dict)

    def holding(self, effects: Collection[str]) -> Explanation | None:
        """Return the explanation of which these effects, in any order, are a member."""
        asked = set(effects)
        found = (e for e in self.likeliest_first if any(set(m) == asked for m in e.members))
        return next(found, None)

    def to_json(self) -> dict[str, Any]:
        """Return what ``loop.json`` holds of them."""
        return {
            "explanations": self.likeliest_first,
            "unexplained_probability": self.unexplained_probability,
            "inclusion": self.inclusion,
            "inclusion_by_kind": self.inclusion_by_kind,
        }


@dataclass(frozen=True)
class LawFit:
    """A named law with its likeliest further effects, among others of which one is chosen.

    `law`: key of `LAWS`. `parameters`: its constants. `at_end`: those of them at an end of their
    range, where they are no finding. `error`: mean relative errors of the runs fitted and held out;
    None where it cannot be integrated through the fitted ones. `probability`: of the law among
    these, by the fitted runs; None likewise. `effects`: its likeliest further effects.
    """

    law: str
    parameters: Mapping[str, float]
    at_end: tuple[str, ...] = ()
    error: ErrorPair | None = None
    probability: float | None = None
    effects: tuple[str, ...] = ()

    @property
    def title(self) -> str:
        """Name as a rheologist writes it, with the constants."""
        return LAWS[self.law].described(self.parameters)

    def to_json(self) -> dict[str, Any]:
        """Return the fit as ``loop.json`` holds it."""
        return {**asdict(self), "title": LAWS[self.law].title}


@dataclass(frozen=True)
class NearestLaw:
    """The best law with a name, where the answer is a sum of terms that has none.

    `law`: name of the law, as in `discover.laws`. `constants`: by name, with their 95 % intervals
    by the fitted runs. `size`: root-mean-square relative error of fitted runs that are left out in
    turn. `equation`: the law with its modes, for exports. `falls`: whether its steady shear stress
    falls somewhere between the rates of the runs.
    """

    law: str
    constants: Mapping[str, StageParameter]
    size: float
    equation: Equation
    falls: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return the law as ``loop.json`` holds it."""
        constants = {
            name: {"value": one.value, "ci95": one.ci95, "unit": one.unit}
            for name, one in self.constants.items()
        }
        return {
            "law": self.law,
            "constants": constants,
            "size": self.size,
            "equation": equation_to_json(self.equation),
        }


@dataclass(frozen=True)
class Fold:
    """A loop that left one run out, where each run is held out in turn.

    `run`: the run left out. `verdict`, `effects`: what the loop said of the other runs, and what it
    added. `error_before`, `error_after`: relative error of the run left out.
    """

    run: str
    verdict: Verdict
    effects: tuple[str, ...]
    error_before: float
    error_after: float


@dataclass(frozen=True)
class Spread:
    """Root-mean-square difference between laws that describe the runs as well.

    `inside`, `beyond`: over the rms of the quantity (N2: of N1), in flows inside and beyond the
    fitted rates; None where a law diverges. `over_n1`: N2 of the reported law itself over its N1,
    by their rms, with the sign of N2/N1; None of other quantities. The largest in flows inside, of
    which `over_n1_rate` in 1/s is the rate. `stress`: the quantity
    itself by the reported law, rms in Pa of the fastest flow inside; None where it diverges.
    `falls_above`, `steady`: of σ12 and of N1, see `steady_shear`.
    """

    inside: float | None
    beyond: float | None
    over_n1: float | None = None
    stress: float | None = None
    falls_above: float | None = None
    over_n1_rate: float | None = None
    steady: float | None = None
