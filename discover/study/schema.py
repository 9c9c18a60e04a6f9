"""The study file: what may be written in it, and nothing else."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr, model_validator

from discover.answer import TOLERANCE
from discover.dataset.linear_viscoelasticity import MOST_MODES
from discover.dataset.run import LARGEST
from discover.dataset.tables.units import ABSOLUTE_ZERO
from discover.effects.registry import known_effects
from discover.errors import Problems
from discover.laws.registry import ANY, LAWS, make_law, starting_value
from discover.learners.registry import learner_names
from discover.learners.settings import DEFAULT_DEGREE
from discover.validation import Section, one_of
from tensor_library.closed_forms import CLOSED_FORMS

_known_law = one_of("law", lambda: LAWS)


def _known_law_or_several(given: Any) -> Any:
    if isinstance(given, list | tuple):
        if len(set(given)) < 2:
            raise ValueError("law as a list names two laws or more to choose from, each once")
        return tuple(_known_law(str(name)) for name in given)
    return given if given in (ANY, "learned") else _known_law(str(given))


ClosedFormName = Annotated[str, AfterValidator(one_of("closed form", lambda: CLOSED_FORMS))]
LearnerName = Annotated[str, AfterValidator(one_of("learner", learner_names))]
SyntheticLaw = Annotated[str, AfterValidator(_known_law)]
LawNames = Annotated[str | tuple[str, ...], BeforeValidator(_known_law_or_several)]
Seed = Annotated[int, Field(ge=0, lt=2**32)]  # what every random generator here takes
# wider than any instrument, and narrow enough that squares and ratios compute
_LEAST, _MOST = 1e-15, 1e15


def _not_tiny(value: float) -> float:
    if value < _LEAST:
        raise ValueError(f"should be at least {_LEAST:g}; got {value:g}")
    return value


Positive = Annotated[float, Field(gt=0, le=_MOST), AfterValidator(_not_tiny)]

NotNegative = Annotated[float, Field(ge=0, le=_MOST)]
ByHand = Annotated[tuple[Positive, ...], Field(min_length=1, max_length=MOST_MODES)]
"""A constant of each relaxation mode."""


def require_parameters(law: str, parameters: Mapping[str, Any]) -> None:
    """Refuse parameters that a law has not, or that lie outside their ranges."""
    values = {k: starting_value(law, k) if v == "fit" else v for k, v in parameters.items()}
    make_law(law, values)


class Library(Section):
    """Candidate terms: tensors × invariants up to a degree, plus closed forms."""

    degree: Annotated[int, Field(ge=0, le=2)] = DEFAULT_DEGREE
    """Highest degree in the invariants of the coefficients."""
    closed_forms: tuple[ClosedFormName, ...] = ()
    """Closed forms besides, such as `"exp"`."""


Recorded = Literal[
    "sigma12", "tensile_stress", "N1", "N2", "strain", "storage_modulus", "loss_modulus"
]


class NextExperiment(Section):
    """Oscillations that could be measured: errors in them are mapped where the truth is known."""

    weissenberg_numbers: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.5, 1.0, 2.0, 4.0)
    """Weissenberg numbers that could be reached."""
    deborah_numbers: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.25, 0.5, 1.0, 2.0)
    """Deborah numbers that could be reached."""


class Compare(Section):
    """Which learners, which candidate terms, which flows they are tested on."""

    learners: tuple[LearnerName, ...] = ("tensor_sindy", "tbnn_ude")
    """Learners to compare."""
    library: Library = Library()
    """Candidate terms."""
    test: Literal["paper"] = "paper"
    """Flows on which the laws are tested where the truth is known."""
    optimizer: Literal["stlsq", "sr3", "ssr", "frols"] = "stlsq"
    """Proposes the sets of terms."""
    max_terms: Annotated[int, Field(ge=1, le=12)] = 5
    """Most terms of a law."""
    recipe: Literal["default", "thorough", "paper"] = "default"
    """How the network is trained."""
    quick: bool = False
    """Fewer training steps, for a first look."""
    members: Annotated[int, Field(ge=1, le=64)] = 3
    """Networks of the ensemble."""
    most_samples: Annotated[int, Field(ge=10, le=20_000)] = 1000
    """Most samples of a run that are used."""
    seed: Seed = 0
    """Of the learners."""
    use_normal_stresses: bool = False
    """Whether measured N1 and N2 are fitted too."""
    high_deborah: tuple[Positive, ...] = (1.5, 3.0, 6.0, 12.0)
    """Deborah numbers of the Lissajous figures."""
    next: NextExperiment = NextExperiment()
    """Oscillations over which errors are mapped where the truth is known."""
    laws: tuple[SyntheticLaw, ...] = ()
    """Named laws that are fitted to the same runs."""
    loading: Annotated[float, Field(gt=0, le=LARGEST)] | None = None
    """Relative scatter of the loadings, where each run is a loading of its own."""

    @model_validator(mode="after")
    def _at_least_one(self):
        if len(set(self.laws)) != len(self.laws):
            raise ValueError("name each of the laws once")
        if not self.learners or len(set(self.learners)) != len(self.learners):
            raise ValueError("name each learner once, and at least one")
        return self


Role = Literal["fit", "judge"] | None
"""What a table next to the runs is for; by default it tests, unless there is no run to fit."""


class Synthetic(Section):
    """Data computed from a known law instead of measured."""

    law: SyntheticLaw
    """Name of the law that makes the data; `discover laws` lists them."""
    parameters: dict[str, float] = Field(default_factory=dict)
    """Its parameters by name, dimensionless."""
    protocol: Literal["paper"] = "paper"
    """The eight shear series of the paper."""
    noise: Annotated[float, Field(ge=0, le=10)] = 0.0
    """Standard deviation of the noise over the rms of each run."""
    seed: Seed = 0
    """Of the noise."""
    samples: Annotated[int, Field(ge=10, le=100_000)] = 201
    """Samples of each run."""

    @model_validator(mode="after")
    def _names(self):
        require_parameters(self.law, self.parameters)
        return self


class Data(Section):
    """Where the runs come from and which of them no fit may see."""

    folder: str | None = None
    """Data folder; a relative path starts at the study file, then at `DISCOVER_DATA`, then at the
    working directory."""
    synthetic: Synthetic | None = None
    """Data computed from a known law, in place of a folder."""
    material: Annotated[str, Field(max_length=80)] = ""
    """Name of the material, for titles."""
    temperature_C: Annotated[float, Field(ge=ABSOLUTE_ZERO)] | None = None
    """Temperature of the moduli and times in °C: of shifted data the reference. By default that of
    `runs.csv`."""
    fit: tuple[str, ...] | None = None
    """Runs to fit, by file name; all that are not held out where left out."""
    held_out: tuple[str, ...] | Literal["each"] = ()
    """Runs that only test the result, by file name, or `"each"`: each in turn."""
    clock_factor: str | None = None
    """Column of `runs.csv` with instrument time = time / factor."""
    rate: Literal["commanded", "measured"] = "commanded"
    """Whether `shear_rate_1_s` was commanded or measured."""
    rate_before: str | None = None
    """Column of `runs.csv` with the rate of the steady flow before each run, in 1/s."""
    observe: tuple[Recorded, ...] | None = None
    """What is fitted of what was recorded; every stress but N1 and N2 where left out. The rest
    tests the result."""
    sequence: str | None = None
    """Column of `runs.csv` that orders runs made one after another on one sample."""
    flow_curve: Role = None
    """Role of `flow_curve.csv`."""
    relaxation: Role = None
    """Role of `relaxation.csv`."""
    creep: Role = None
    """Role of `creep.csv`."""
    amplitude_sweep: Role = None
    """Role of `amplitude_sweep.csv`."""
    amplitude_sweep_rad_s: Positive | None = None
    """Frequency of `amplitude_sweep.csv` in rad/s where the file has none."""
    lve: Role = None
    """Role of `lve.csv`, which also gives the modes of `modes = "lve"`."""

    @model_validator(mode="after")
    def _one_source(self):
        if (self.folder is None) == (self.synthetic is None):
            raise ValueError('write either folder = "..." or synthetic = {...}, not both or none')
        if self.observe == ():
            raise ValueError("observe must name what is fitted; leave it out to fit every stress")
        if self.fit == ():
            raise ValueError("fit names no run; name some, or leave it out to fit all not held out")
        both = set(self.fit or ()) & set(() if self.held_out == "each" else self.held_out)
        if both:
            raise ValueError(f"the run {sorted(both)[0]!r} is both in fit and in held_out")
        return self


class Model(Section):
    """The declared law: the known part of what is to be found.

    Modes: one, listed by hand, or of the sweep, as is the solvent where none is given.
    """

    law: LawNames = "ucm"
    """Known part: the name of a law, `"learned"`, several names or `"any"` to choose from."""
    modulus_Pa: Positive | Literal["fit"] | ByHand | None = None
    """Modulus in Pa, a list for modes, or `"fit"`, as where left out; of computed data 1."""
    relaxation_time_s: Positive | Literal["fit"] | ByHand | None = None
    """Relaxation time in s, likewise. Without both, modes are those of `lve.csv` where there is
    one."""
    modes: Literal["lve"] | Annotated[int, Field(strict=True, ge=1, le=MOST_MODES)] | None = None
    """Modes from `lve.csv`: `"lve"` for as many as it supports, or a number of them."""
    sweep_rad_s: tuple[Positive, Positive] | None = None
    """Range [low, high] of the sweep's frequencies that count, in rad/s."""
    solvent_viscosity_Pa_s: NotNegative | Literal["fit"] | None = None
    """Solvent viscosity in Pa s, or `"fit"`; that of the sweep where left out."""
    elastic_modulus_Pa: NotNegative | Literal["fit"] | None = None
    """Elastic constant of a solid in Pa, or `"fit"` from the sweep."""
    parameters: dict[str, float | Literal["fit"]] = Field(default_factory=dict)
    """Parameters of the law by name: numbers, or `"fit"`."""
    by_mode: tuple[str, ...] = ()
    """Constants that may differ from mode to mode, as a smooth function of the relaxation time."""
    known_relaxation: bool = True
    """Whether the linear term −σ/λ is known; if not, the learners find it."""
    effects: dict[str, dict[str, float | Literal["fit"]] | Literal["fit"]] = Field(
        default_factory=dict
    )
    """Known effects added to the law, with values or `"fit"`; `discover effects` lists them."""
    from_: Annotated[str | None, Field(min_length=1, max_length=1000, alias="from")] = None
    """Result folder whose law, modes and effects are taken over."""

    @model_validator(mode="after")
    def _names(self):
        problems = Problems()
        if isinstance(self.law, str) and self.law in LAWS and self.from_ is None:
            with problems.collected():
                require_parameters(self.law, self.parameters)
        with problems.collected():
            known_effects(self.effects, "effects")
        problems.require_none()
        return self

    @model_validator(mode="after")
    def _window(self):
        given = [key for key in type(self).model_fields if key in self.model_fields_set]
        beside = [key for key in given if key not in ("from_", "effects")]
        if self.from_ is not None and beside:
            raise ValueError(
                f"from takes law, modes and constants from a result, and {beside[0]} is given too; "
                "leave one of them out"
            )
        if self.choice and (self.parameters or self.by_mode or not self.known_relaxation):
            raise ValueError(
                "law names several laws, all of whose constants are fitted; leave out parameters, "
                "by_mode and known_relaxation, or name one law"
            )
        if self.sweep_rad_s is not None and self.modes is None:
            raise ValueError('sweep_rad_s limits the sweep of modes = "lve"; write that too')
        constants = (self.modulus_Pa, self.relaxation_time_s)
        by_hand = [len(one) if isinstance(one, tuple) else 0 for one in constants]
        if by_hand[0] != by_hand[1]:
            raise ValueError(
                "modulus_Pa and relaxation_time_s of modes go together, with as many values; got "
                f"{by_hand[0] or 'no list'} and {by_hand[1] or 'no list'}; write a list of each"
            )
        if by_hand[0] and self.modes is not None:
            raise ValueError(
                f"modes = {self.modes!r} takes the modes from the sweep, and modulus_Pa lists them "
                "too; leave one of them out"
            )
        if self.elastic_modulus_Pa == "fit" and self.modes is None:
            raise ValueError(
                'elastic_modulus_Pa = "fit" is fitted to the sweep, which modes = "lve" or a '
                "number of modes reads; write one of them, or the value in Pa"
            )
        if self.sweep_rad_s is not None and not self.sweep_rad_s[0] < self.sweep_rad_s[1]:
            raise ValueError(f"sweep_rad_s must be [low, high]; got {list(self.sweep_rad_s)}")
        return self

    @property
    def choice(self) -> tuple[str, ...]:
        """Laws to choose from; none where one is declared."""
        if self.law == ANY:
            return tuple(name for name, law in LAWS.items() if law.is_one_mode)
        return () if isinstance(self.law, str) else self.law


class Loop(Section):
    """How far the closed loop may go."""

    max_effects: Annotated[int, Field(ge=0, le=10)] = 3
    """Most effects that are added."""
    strain: tuple[float, float] | None = None
    """Range [low, high] of strain that is fitted and tested."""
    effects: tuple[str, ...] | Literal["named"] | None = None
    """Candidates by name or by term, or `"named"`; all where left out."""
    noise: Annotated[float, Field(gt=0, le=1)] | None = None
    """Relative noise, where it is known."""
    most_samples: Annotated[int, Field(ge=10, le=20_000)] = 400
    """Most samples of a run that are used."""
    explanations: Annotated[int, Field(ge=1, le=64)] = 8
    """Most explanations that are carried side by side."""
    loading: Annotated[float, Field(gt=0, le=LARGEST)] | None = None
    """Relative scatter of the loadings, where each run is a loading of its own."""

    @model_validator(mode="after")
    def _window(self):
        if self.effects == ():
            raise ValueError(
                "effects names no effect; name some, leave it out for all, or write "
                "max_effects = 0 for none"
            )
        if self.strain is not None and not 0 <= self.strain[0] < self.strain[1]:
            raise ValueError(f"strain must be [low, high] with 0 <= low < high; got {self.strain}")
        return self


class Verdict(Section):
    """Size of the discrepancy that the user accepts."""

    tolerance: Annotated[float, Field(gt=0, le=1)] = TOLERANCE
    """Relative discrepancy that is accepted; 0.05 means 5 %."""


class Study(Section):
    """One study: data, declared model, and what to do with them."""

    data: Data
    """Where the runs come from, and which test the result."""
    model: Model = Model()
    """The known part of the law."""
    loop: Loop = Loop()
    """How far `discover close-loop` goes."""
    compare: Compare = Compare()
    """What `discover compare` runs."""
    verdict: Verdict = Verdict()
    """What is accepted."""
    _path: Path | None = PrivateAttr(default=None)
    _text: str = PrivateAttr(default="")

    @property
    def path(self) -> Path | None:
        """The file that the study was read from."""
        return self._path

    @property
    def text(self) -> str:
        """The text of that file when it was read; it may be edited while the study runs."""
        return self._text

    @property
    def name(self) -> str:
        """Name for titles: the study file's, or the data's."""
        if self._path is not None:
            return self._path.stem
        return self.data.folder or f"synthetic {self.data.synthetic.law}"  # type: ignore[union-attr]
