"""The study file: what may be written in it, and nothing else."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr, model_validator

from discover.dataset.linear_viscoelasticity import MOST_MODES
from discover.dataset.loading import LARGEST
from discover.effects.known import known_effects
from discover.errors import Problems
from discover.laws.registry import ANY, LAWS, make_law, starting_value
from discover.learners.registry import learner_names
from discover.learners.settings import DEFAULT_DEGREE
from discover.protocols.classes import FLOW_CLASSES, FlowClass
from discover.validation import Section
from discover.words import unknown_name
from tensor_library.closed_forms import CLOSED_FORMS


def _known_law(name: str) -> str:
    if name not in LAWS:
        raise ValueError(unknown_name("law", name, LAWS))
    return name


def _known_or_learned(name: str) -> str:
    return name if name == "learned" else _known_law(name)


def _known_law_or_several(given: Any) -> Any:
    if isinstance(given, list | tuple):
        if len(set(given)) < 2:
            raise ValueError("law as a list names two laws or more to choose from, each once")
        return tuple(_known_law(str(name)) for name in given)
    return given if given == ANY else _known_or_learned(str(given))


def _known_learner(name: str) -> str:
    if name not in learner_names():
        raise ValueError(unknown_name("learner", name, learner_names()))
    return name


def _known_form(name: str) -> str:
    if name not in CLOSED_FORMS:
        raise ValueError(unknown_name("closed form", name, CLOSED_FORMS))
    return name


ClosedFormName = Annotated[str, AfterValidator(_known_form)]
LearnerName = Annotated[str, AfterValidator(_known_learner)]
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

Role = Literal["fit", "judge"] | None
"""What a table beside the runs is for; by default it judges, unless there is no run to fit."""


def _require_parameters(law: str, parameters: Mapping[str, Any]) -> None:
    """Refuse parameters that a law has not, or that lie outside their ranges."""
    values = {k: starting_value(law, k) if v == "fit" else v for k, v in parameters.items()}
    make_law(law, values)


class Synthetic(Section):
    """Data computed from a known law instead of measured."""

    law: SyntheticLaw
    parameters: dict[str, float] = Field(default_factory=dict)
    protocol: Literal["paper"] = "paper"
    noise: Annotated[float, Field(ge=0, le=10)] = 0.0
    seed: Seed = 0
    samples: Annotated[int, Field(ge=10, le=100_000)] = 201

    @model_validator(mode="after")
    def _names(self):
        _require_parameters(self.law, self.parameters)
        return self


class Data(Section):
    """Where the runs come from and which of them no fit may see."""

    folder: str | None = None
    synthetic: Synthetic | None = None
    material: Annotated[str, Field(max_length=80)] = ""
    fit: tuple[str, ...] | None = None
    held_out: tuple[str, ...] | Literal["each"] = ()
    clock_factor: str | None = None
    rate: Literal["commanded", "measured"] = "commanded"
    rate_before: str | None = None
    observe: (
        tuple[
            Literal[
                "sigma12",
                "tensile_stress",
                "N1",
                "N2",
                "strain",
                "storage_modulus",
                "loss_modulus",
            ],
            ...,
        ]
        | None
    ) = None
    sequence: str | None = None
    flow_curve: Role = None
    relaxation: Role = None
    creep: Role = None
    amplitude_sweep: Role = None
    amplitude_sweep_rad_s: Positive | None = None
    lve: Role = None

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


def _by_hand(given: Any) -> int:
    """Return how many modes a constant is listed for; 0 where it is no list."""
    return len(given) if isinstance(given, tuple) else 0


class Model(Section):
    """The declared law: the known part of what is to be found.

    The modes are one by default, listed by hand (`modulus_Pa` and `relaxation_time_s` as lists), or
    of the sweep: ``modes = "lve"`` as many as it supports, ``modes = 3`` that many. The solvent is
    that of the sweep where none is given, and the sweep is fitted beside one that is.
    """

    law: LawNames = "ucm"
    modulus_Pa: Positive | Literal["fit"] | ByHand = 1.0
    relaxation_time_s: Positive | Literal["fit"] | ByHand = 1.0
    modes: Literal["lve"] | Annotated[int, Field(strict=True, ge=1, le=MOST_MODES)] | None = None
    sweep_rad_s: tuple[Positive, Positive] | None = None
    solvent_viscosity_Pa_s: NotNegative | Literal["fit"] | None = None
    elastic_modulus_Pa: NotNegative | Literal["fit"] | None = None
    parameters: dict[str, float | Literal["fit"]] = Field(default_factory=dict)
    by_mode: tuple[str, ...] = ()
    known_relaxation: bool = True
    effects: dict[str, dict[str, float | Literal["fit"]] | Literal["fit"]] = Field(
        default_factory=dict
    )
    from_: Annotated[str, Field(min_length=1, max_length=1000)] | None = Field(
        default=None, alias="from"
    )

    @model_validator(mode="after")
    def _names(self):
        problems = Problems()
        if isinstance(self.law, str) and self.law in LAWS and self.from_ is None:
            with problems.collected():
                _require_parameters(self.law, self.parameters)
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
        by_hand = _by_hand(self.modulus_Pa), _by_hand(self.relaxation_time_s)
        if by_hand[0] != by_hand[1]:
            raise ValueError(
                "modulus_Pa and relaxation_time_s of modes go together, with as many values; got "
                f"{by_hand[0] or 'no list'} and {by_hand[1] or 'no list'}"
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
    strain: tuple[float, float] | None = None
    effects: tuple[str, ...] | Literal["named"] | None = None
    noise: Annotated[float, Field(gt=0, le=1)] | None = None
    most_samples: Annotated[int, Field(ge=10, le=20_000)] = 400
    explanations: Annotated[int, Field(ge=1, le=64)] = 8
    loading: Annotated[float, Field(gt=0, le=LARGEST)] | None = None

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


class Library(Section):
    """Candidate terms: tensors × invariants up to a degree, plus closed forms."""

    degree: Annotated[int, Field(ge=0, le=2)] = DEFAULT_DEGREE
    closed_forms: tuple[ClosedFormName, ...] = ()


class Sweep(Section):
    """The same comparison again over laws and values of one parameter, as synthetic data.

    The paper's study of linear and exponential PTT over the extensibility is one.
    """

    laws: Annotated[tuple[SyntheticLaw, ...], Field(min_length=1)]
    parameter: str
    values: Annotated[tuple[float, ...], Field(min_length=1, max_length=20)]


class NextExperiment(Section):
    """What the user could measure next."""

    flows: Annotated[tuple[FlowClass, ...], Field(min_length=1)] = FLOW_CLASSES
    observe: Annotated[tuple[Literal["sigma12", "N1", "N2"], ...], Field(min_length=1)] = (
        "sigma12",
        "N1",
        "N2",
    )
    weissenberg_numbers: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.5, 1.0, 2.0, 4.0)
    deborah_numbers: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.25, 0.5, 1.0, 2.0)
    noise: Annotated[float, Field(gt=0, le=1)] | None = None


class Compare(Section):
    """Which learners, which candidate terms, which flows they are judged on."""

    learners: tuple[LearnerName, ...] = ("tensor_sindy", "tbnn_ude")
    library: Library = Library()
    test: Literal["paper"] = "paper"
    optimizer: Literal["stlsq", "sr3", "ssr", "frols"] = "stlsq"
    selection: Literal["bic", "held_out", "one_standard_error"] = "bic"
    max_terms: Annotated[int, Field(ge=1, le=12)] = 5
    recipe: Literal["default", "thorough", "paper"] = "default"
    quick: bool = False
    members: Annotated[int, Field(ge=1, le=64)] = 3
    most_samples: Annotated[int, Field(ge=10, le=20_000)] = 1000
    seed: Seed = 0
    use_normal_stresses: bool = False
    high_deborah: tuple[Positive, ...] = (1.5, 3.0, 6.0, 12.0)
    sweep: Sweep | None = None
    distillation: bool = False
    next: NextExperiment = NextExperiment()
    laws: tuple[SyntheticLaw, ...] = ()
    loading: Annotated[float, Field(gt=0, le=LARGEST)] | None = None

    @model_validator(mode="after")
    def _at_least_one(self):
        if len(set(self.laws)) != len(self.laws):
            raise ValueError("name each of the laws once")
        if not self.learners or len(set(self.learners)) != len(self.learners):
            raise ValueError("name each learner once, and at least one")
        return self


Modes = Positive | Annotated[tuple[Positive, ...], Field(min_length=1)] | None
"""One number, or one for each mode."""


def _count(modes: Modes) -> int:
    return len(modes) if isinstance(modes, tuple) else int(modes is not None)


class OverlayAsked(Section):
    """A curve that the user wants beside the others: a law, or what a file holds."""

    label: Annotated[str, Field(max_length=60)] = ""
    law: SyntheticLaw | None = None
    parameters: dict[str, float] = Field(default_factory=dict)
    modulus_Pa: Modes = None
    relaxation_time_s: Modes = None
    file: Annotated[str, Field(min_length=1, max_length=1000)] | None = None

    @model_validator(mode="after")
    def _one_kind(self):
        if (self.law is None) == (self.file is None):
            raise ValueError('an overlay has either law = "..." or file = "...", not both or none')
        if self.file is not None and (self.parameters or self.modulus_Pa or self.relaxation_time_s):
            raise ValueError("parameters and modes belong to a law, and this overlay is a file")
        if _count(self.modulus_Pa) != _count(self.relaxation_time_s):
            raise ValueError("modulus_Pa and relaxation_time_s go together, with as many values")
        if self.label in ("declared", "augmented", *learner_names()):
            raise ValueError(f"the label {self.label!r} names a curve of the report itself")
        return self


class Report(Section):
    """What the page shows beside the results."""

    overlay: Annotated[tuple[OverlayAsked, ...], Field(max_length=4)] = ()


class Study(Section):
    """One study: data, declared model, and what to do with them."""

    data: Data
    model: Model = Model()
    loop: Loop = Loop()
    compare: Compare = Compare()
    report: Report = Report()
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
