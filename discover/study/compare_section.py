"""The section ``[compare]`` of a study file."""

from typing import Annotated, Literal

from pydantic import Field, model_validator

from discover.dataset.run import LARGEST
from discover.learners.settings import DEFAULT_DEGREE
from discover.protocols.kinematics import FLOW_CLASSES, FlowClass
from discover.study.key_values import ClosedFormName, LearnerName, Positive, Seed, SyntheticLaw
from discover.validation import Section


class Library(Section):
    """Candidate terms: tensors × invariants up to a degree, plus closed forms."""

    degree: Annotated[int, Field(ge=0, le=2)] = DEFAULT_DEGREE
    """Highest degree in the invariants of the coefficients."""
    closed_forms: tuple[ClosedFormName, ...] = ()
    """Closed forms besides, such as `"exp"`."""


class Sweep(Section):
    """The same comparison again over laws and values of one parameter, as synthetic data.

    The paper's study of linear and exponential PTT over the extensibility is one.
    """

    laws: Annotated[tuple[SyntheticLaw, ...], Field(min_length=1)]
    """Laws that make the data."""
    parameter: str
    """Parameter that is varied."""
    values: Annotated[tuple[float, ...], Field(min_length=1, max_length=20)]
    """Its values."""


class NextExperiment(Section):
    """What the user could measure next."""

    flows: Annotated[tuple[FlowClass, ...], Field(min_length=1)] = FLOW_CLASSES
    """Classes of flow that could be measured."""
    observe: Annotated[tuple[Literal["sigma12", "N1", "N2"], ...], Field(min_length=1)] = (
        "sigma12",
        "N1",
        "N2",
    )
    """What could be recorded."""
    weissenberg_numbers: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.5, 1.0, 2.0, 4.0)
    """Weissenberg numbers that could be reached."""
    deborah_numbers: Annotated[tuple[Positive, ...], Field(min_length=1)] = (0.25, 0.5, 1.0, 2.0)
    """Deborah numbers that could be reached."""
    noise: Annotated[float, Field(gt=0, le=1)] | None = None
    """Relative noise of the next experiment."""


class Compare(Section):
    """Which learners, which candidate terms, which flows they are judged on."""

    learners: tuple[LearnerName, ...] = ("tensor_sindy", "tbnn_ude")
    """Learners to compare."""
    library: Library = Library()
    """Candidate terms."""
    test: Literal["paper"] = "paper"
    """Flows on which the laws are tested where the truth is known."""
    optimizer: Literal["stlsq", "sr3", "ssr", "frols"] = "stlsq"
    """Proposes the sets of terms."""
    selection: Literal["evidence", "held_out", "one_standard_error", "bic"] = "evidence"
    """Chooses the number of terms."""
    max_terms: Annotated[int, Field(ge=1, le=12)] = 5
    """Most terms of a law."""
    recipe: Literal["default", "thorough", "paper"] = "default"
    """How the network is trained."""
    quick: bool = False
    """Fewer training steps, for a first look."""
    members: Annotated[int, Field(ge=1, le=64)] = 3
    """Networks that are trained."""
    most_samples: Annotated[int, Field(ge=10, le=20_000)] = 1000
    """Most samples of a run that are used."""
    seed: Seed = 0
    """Of the learners."""
    use_normal_stresses: bool = False
    """Whether measured N1 and N2 are fitted too."""
    high_deborah: tuple[Positive, ...] = (1.5, 3.0, 6.0, 12.0)
    """Deborah numbers of the Lissajous figures."""
    sweep: Sweep | None = None
    """The same comparison over a parameter of synthetic data."""
    distillation: bool = False
    """Whether simpler laws are taught by the true one."""
    next: NextExperiment = NextExperiment()
    """What could be measured next."""
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
