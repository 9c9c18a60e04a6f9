"""Values of a study's keys that several of its sections have."""

from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any

from pydantic import AfterValidator, BeforeValidator, Field

from discover.dataset.linear_viscoelasticity import MOST_MODES
from discover.laws.registry import ANY, LAWS, make_law, starting_value
from discover.learners.registry import learner_names
from discover.words import unknown_name
from tensor_library.closed_forms import CLOSED_FORMS


def _one_of(kind: str, known: Callable[[], Iterable[str]]) -> Callable[[str], str]:
    def check(name: str) -> str:
        if name not in known():
            raise ValueError(unknown_name(kind, name, known()))
        return name

    return check


_known_law = _one_of("law", lambda: LAWS)


def _known_law_or_several(given: Any) -> Any:
    if isinstance(given, list | tuple):
        if len(set(given)) < 2:
            raise ValueError("law as a list names two laws or more to choose from, each once")
        return tuple(_known_law(str(name)) for name in given)
    return given if given in (ANY, "learned") else _known_law(str(given))


ClosedFormName = Annotated[str, AfterValidator(_one_of("closed form", lambda: CLOSED_FORMS))]
LearnerName = Annotated[str, AfterValidator(_one_of("learner", learner_names))]
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
