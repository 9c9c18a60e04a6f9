"""Students of a distillation: laws whose constants are taught to imitate another law."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import equinox as eqx
from jaxtyping import Array, Float
from scipy.stats import qmc

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw, as_parameter
from discover.laws.registry import LAWS, starting_values
from discover.words import unknown_name
from tensor_library.algebra import Symmetric

_POINTS = 5
"""Starts of a law with a name beside its own, spread evenly over its ranges."""


class MaxwellSurrogate(AbstractConstitutiveLaw):
    """Maxwell law with a relaxation rate and a modulus of its own: h = g₂ σ − (g₃ − 1) γ̇.

    In the teacher's units modulus g₃, relaxation time 1/g₂, viscosity g₃/g₂.
    """

    relaxation: Float[Array, ""] = eqx.field(converter=as_parameter)  # g₂
    production: Float[Array, ""] = eqx.field(converter=as_parameter)  # g₃
    linear_relaxation: bool = eqx.field(static=True, default=False)

    def extra_term(self, stress: Symmetric, rate: Symmetric) -> Symmetric:
        """Return h = g₂ σ − (g₃ − 1) γ̇."""
        return self.relaxation * stress - (self.production - 1.0) * rate


@dataclass(frozen=True)
class Student:
    """Law with parameters to teach.

    `build`: from the parameters in the order of `bounds`. `more_starts`: against several minima.
    """

    name: str  # for tables
    build: Callable[..., AbstractConstitutiveLaw]
    bounds: Mapping[str, tuple[float, float]]  # name and admissible range of each parameter
    start: tuple[float, ...]
    latex: str  # the law with ``%s`` where each parameter's value goes
    more_starts: tuple[tuple[float, ...], ...] = ()


_CONVECTED = r"\overset{\nabla}{\boldsymbol{\sigma}}"
_STRESS = r"\boldsymbol{\sigma}"
_RATE = r"\dot{\boldsymbol{\gamma}}"

STUDENTS: Mapping[str, Student] = {
    "ucm": Student(
        "ucm",
        MaxwellSurrogate,
        {"g2": (0.0, 20.0), "g3": (0.0, 20.0)},
        (1.0, 1.0),
        rf"{_CONVECTED} = -%s\,{_STRESS} + %s\,{_RATE}",
    ),
    "johnson_segalman": Student(
        "johnson_segalman",
        LAWS["johnson_segalman"].build,
        {"xi": (0.0, 2.0)},
        (0.2,),
        rf"{_CONVECTED} = {_RATE} - {_STRESS} - \frac{{%s}}{{2}}({_STRESS}\cdot{_RATE}"
        rf" + {_RATE}\cdot{_STRESS})",
    ),
    "giesekus": Student(
        "giesekus",
        LAWS["giesekus"].build,
        {"alpha": (0.0, 1.0)},
        (0.2,),
        rf"{_CONVECTED} = {_RATE} - {_STRESS} - %s\,{_STRESS}\cdot{_STRESS}",
    ),
    "ptt_linear": Student(
        "ptt_linear",
        LAWS["ptt_linear"].build,
        {"epsilon": (0.0, 10.0)},
        (0.2,),
        rf"{_CONVECTED} = {_RATE} - (1 + %s\,\operatorname{{tr}}{_STRESS})\,{_STRESS}",
    ),
    "ptt_exponential": Student(
        "ptt_exponential",
        LAWS["ptt_exponential"].build,
        {"epsilon": (0.0, 10.0)},
        (0.2,),
        rf"{_CONVECTED} = {_RATE} - \exp(%s\,\operatorname{{tr}}{_STRESS})\,{_STRESS}",
    ),
    # The law depends smoothly on 1/L², which is zero for UCM; L² itself may run to infinity
    "fene_p": Student(
        "fene_p",
        lambda inverse: LAWS["fene_p"].build(1.0 / inverse),
        {"inverse_L2": (1e-6, 1.0 / 3.0)},
        (0.05,),
        rf"{_STRESS} = \boldsymbol{{A}}\,(1 - 3/L^2)/(1 - \operatorname{{tr}}\boldsymbol{{A}}/L^2)"
        r" - \boldsymbol{I},\quad 1/L^2 = %s",
    ),
}
"""Students of the paper by the name of their law; any other law with a name can be one too."""


def student_of(law: str) -> Student:
    """Return a law by its key in `STUDENTS` or `LAWS` as a student, all its constants free."""
    if law in STUDENTS:
        return STUDENTS[law]
    if law not in LAWS or not LAWS[law].parameters:
        known = dict.fromkeys([*STUDENTS, *(name for name in LAWS if LAWS[name].parameters)])
        raise InputError(unknown_name("student", law, known))
    entry = LAWS[law]
    ranges = entry.parameters.values()
    shares = qmc.Halton(len(ranges), scramble=False).random(_POINTS + 1)[1:]
    others = tuple(
        tuple(_within(ends, float(at)) for ends, at in zip(ranges, row, strict=True))
        for row in shares
    )
    start = tuple(starting_values(law).values())
    constants = r",\quad ".join(rf"\texttt{{{name}}} = %s" for name in entry.parameters)
    latex = rf"\text{{{entry.title}}}:\quad {constants}".replace("_", r"\_")
    return Student(law, entry.build, entry.parameters, start, latex, others)


def _within(ends: tuple[float, float], share: float) -> float:
    """Return a value within a range; one that leaves out zero spans orders of magnitude."""
    low, high = ends
    return low * (high / low) ** share if low > 0.0 else low + (high - low) * share
