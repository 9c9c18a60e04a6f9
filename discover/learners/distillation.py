"""Distillation: the parameters of one law that best imitate another   [Rodrigues et al., §6]."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from functools import cache
from typing import Any

import equinox as eqx
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy.optimize import least_squares
from scipy.special import expit, logit
from scipy.stats import qmc

from discover.errors import InputError
from discover.forward import Batch, make_batch
from discover.forward.of_fluids import bare_run, observed
from discover.laws import AbstractConstitutiveLaw, Fluid
from discover.laws.base import as_parameter
from discover.laws.registry import LAWS, starting_values
from discover.linear_algebra_threads import in_one_thread
from discover.protocols.protocol import (
    TEST_DURATION,
    TRAINING_DURATION,
    FlowProtocol,
    in_flow,
    paper_test_protocols,
    paper_training_protocols,
    start_up,
)
from discover.simulate.solve import SimulationError, simulate
from discover.words import unknown_name
from tensor_library.algebra import Symmetric

_TOLERANCE, _MOST_STEPS = 1e-10, 200
_RUNAWAY = 1e3  # misfit of a trial that has no finite trajectory: it is always rejected
_WIDTH = 1e-4  # of an unbounded parameter, by which it is moved for a derivative
_INSIDE = 1e-9  # parameters stay this fraction of their range away from its ends

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


def _of_paper(law: str, latex: str) -> Student:
    """Return a law of one constant as the paper teaches it; its LaTeX behind γ̇."""
    named = LAWS[law]
    return Student(law, named.build, named.parameters, (0.2,), rf"{_CONVECTED} = {_RATE}{latex}")


STUDENTS: Mapping[str, Student] = {
    "ucm": Student(
        "ucm",
        MaxwellSurrogate,
        {"g2": (0.0, 20.0), "g3": (0.0, 20.0)},
        (1.0, 1.0),
        rf"{_CONVECTED} = -%s\,{_STRESS} + %s\,{_RATE}",
    ),
    "johnson_segalman": _of_paper(
        "johnson_segalman",
        rf" - {_STRESS} - \frac{{%s}}{{2}}({_STRESS}\cdot{_RATE} + {_RATE}\cdot{_STRESS})",
    ),
    "giesekus": _of_paper("giesekus", rf" - {_STRESS} - %s\,{_STRESS}\cdot{_STRESS}"),
    "ptt_linear": _of_paper("ptt_linear", rf" - (1 + %s\,\operatorname{{tr}}{_STRESS})\,{_STRESS}"),
    "ptt_exponential": _of_paper(
        "ptt_exponential", rf" - \exp(%s\,\operatorname{{tr}}{_STRESS})\,{_STRESS}"
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


# slower than any Maxwell mode with the teacher's times can bear for ever
_EXTENSION = {"extension": in_flow(start_up(0.3), "uniaxial")}


@dataclass(frozen=True)
class Distillation:
    """What a student learned.

    `penalised`, `debiased`: parameters by name, with the penalty and without. `misfit`: rms
    difference of σ12 over the teacher's, debiased, over all training flows. `viscosity_ratio`,
    `relaxation_time_ratio`: of a debiased Maxwell student to the teacher's linear limit. `errors`:
    by test flow, relative L2 errors ``sigma12``, ``N1``, ``N2`` (relative to N1), in extension
    ``tensile_stress``; None where a law diverges.
    """

    student: str
    penalised: Mapping[str, float]
    debiased: Mapping[str, float]
    penalty: float  # κ of the penalised objective
    misfit: float
    viscosity_ratio: float | None
    relaxation_time_ratio: float | None
    errors: Mapping[str, Mapping[str, float] | None]
    latex: str  # the debiased law
    law: AbstractConstitutiveLaw  # the debiased law, dimensionless

    def as_dict(self) -> dict[str, Any]:
        """Return everything but the law, JSON-able."""
        return {one.name: getattr(self, one.name) for one in fields(self) if one.name != "law"}


@dataclass(frozen=True)
class _Lesson:
    """Training problem: target σ12 over the modulus, shape (flows, n), and how to predict it."""

    build: Callable[..., AbstractConstitutiveLaw]
    low: Float[np.ndarray, " p"]
    high: Float[np.ndarray, " p"]
    geometric: Bool[np.ndarray, " p"]
    teacher: Fluid
    batch: Batch
    target: Float[np.ndarray, "flows n"]

    def parameters(self, free: Float[np.ndarray, "*m p"]) -> Float[np.ndarray, "*m p"]:
        """Return parameters inside their bounds from unbounded ones."""
        share = expit(free)
        linear = self.low + (self.high - self.low) * share
        positive = np.where(self.geometric, self.low, 1.0)
        return np.where(self.geometric, positive * (self.high / positive) ** share, linear)

    def free(self, values: Float[np.ndarray, " p"]) -> Float[np.ndarray, " p"]:
        """Return the unbounded parameters of values inside their bounds."""
        low, high = self.low, self.high
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(
                self.geometric,
                np.log(values / low) / np.log(high / low),
                (values - low) / (high - low),
            )
        return logit(np.clip(share, _INSIDE, 1.0 - _INSIDE))

    def taught(self, parameters: Float[np.ndarray, " p"]) -> Fluid:
        """Return the teacher with the student's law."""
        return replace(self.teacher, law=self.build(*parameters))

    def rows(self, free: Float[np.ndarray, "m p"], kappa: float) -> Float[np.ndarray, "m rows"]:
        """Return residuals whose squares add up to the objective."""
        parameters = self.parameters(free)
        with np.errstate(all="ignore"):  # a trial that ran away
            found = observed([self.taught(values) for values in parameters], self.batch)
            stress = found[..., 0] / np.sum(self.teacher.modulus)
            difference = (stress - self.target) / np.sqrt(self.target.shape[1])
        # a trial that diverges is an increase, which the solver rejects
        whole = np.all(np.isfinite(difference), axis=(1, 2), keepdims=True)
        difference = np.where(whole, difference, _RUNAWAY).reshape(len(free), -1)
        return np.concatenate([difference, np.sqrt(kappa * np.abs(parameters))], axis=1)

    def linearised(
        self, free: Float[np.ndarray, " p"], kappa: float
    ) -> tuple[Float[np.ndarray, " rows"], Float[np.ndarray, "rows p"]]:
        """Return the residuals and their central differences, from one call."""
        moves = _WIDTH * np.eye(len(free))
        found = self.rows(free + np.concatenate([np.zeros((1, len(free))), moves, -moves]), kappa)
        base, up, down = np.split(found, [1, 1 + len(free)])
        return base[0], (0.5 / _WIDTH * (up - down)).T


def _teach(lesson: _Lesson, free: Float[np.ndarray, " p"], kappa: float):
    """Return the unbounded parameters of least squares, and the sum of squares there."""

    @cache
    def at(values: tuple[float, ...]):
        return lesson.linearised(np.array(values), kappa)

    ended = least_squares(
        lambda moved: at(tuple(moved))[0],
        free,
        jac=lambda moved: at(tuple(moved))[1],  # pyright: ignore[reportArgumentType]
        ftol=_TOLERANCE,
        xtol=_TOLERANCE,
        gtol=_TOLERANCE,
        max_nfev=_MOST_STEPS,
    )
    return ended.x, 2.0 * ended.cost


@in_one_thread
def distil(
    teacher: AbstractConstitutiveLaw | Fluid,
    student: str | Student,
    protocols: Mapping[str, FlowProtocol] | None = None,
    penalty: float = 0.01,
    n_samples: int = 201,
    duration: float = TRAINING_DURATION,
    tests: Mapping[str, FlowProtocol] | None = None,
) -> Distillation:
    """Teach one law to another by the shear stress alone.

    Minimises Σ over flows of the mean squared difference of σ12 (over the modulus) plus κ Σ
    |parameter|, and the same without the penalty, which biases by some 2 %. The sum over flows, not
    their mean, reproduces the paper's numbers.

    `teacher`: dimensionless law or fluid. `student`: key of `STUDENTS` or `LAWS`, or a `Student`,
    with the teacher's modes; a law beyond the paper's is taught from several starts. `protocols`:
    training flows, by default the paper's eight. `penalty`: κ. `n_samples`, `duration`: of each
    training flow, in the teacher's units. `tests`: flows of `errors`, by default the paper's three
    and uniaxial extension. Raises InputError if the student is unknown or an argument out of range.
    """
    fluid = teacher if isinstance(teacher, Fluid) else Fluid.dimensionless(teacher)
    pupil = student if isinstance(student, Student) else student_of(student)
    if not (np.isfinite(penalty) and penalty >= 0):
        raise InputError(f"penalty must be a number from 0 on; got {penalty}.")
    if n_samples < 2 or not duration > 0:
        raise InputError(
            f"A distillation needs at least 2 samples and a positive duration; got {n_samples} and "
            f"{duration}."
        )
    flows = paper_training_protocols() if protocols is None else dict(protocols)
    if not flows:
        raise InputError("A distillation needs at least one flow; got none.")
    times = np.linspace(0.0, duration, n_samples)
    modulus = float(np.sum(fluid.modulus))
    target = np.stack([simulate(fluid, p, times).shear_stress for p in flows.values()]) / modulus
    runs = [bare_run(flow, times) for flow in flows.values()]
    low, high = (np.array(b) for b in zip(*pupil.bounds.values(), strict=True))

    lesson = _Lesson(
        pupil.build,
        low,
        high,
        # those of the paper's students go in straight lines
        (low > 0.0) & (pupil.name not in STUDENTS),
        fluid,
        make_batch(runs, strain_step=0.2, own=False),
        target,
    )
    starts = (lesson.free(np.array(values)) for values in (pupil.start, *pupil.more_starts))
    taught_from = [_teach(lesson, start, 0.0) for start in starts]
    debiased_free, squares = min(taught_from, key=lambda one: one[1])
    penalised_free, _ = _teach(lesson, debiased_free, float(penalty))
    debiased = lesson.parameters(debiased_free)
    penalised = lesson.parameters(penalised_free)
    taught = lesson.taught(debiased)
    law = taught.law
    scale = np.sqrt(np.sum(np.mean(target**2, axis=1)))
    maxwell = isinstance(law, MaxwellSurrogate)
    test_flows = {**paper_test_protocols(), **_EXTENSION} if tests is None else tests
    return Distillation(
        student=pupil.name,
        penalised=dict(zip(pupil.bounds, map(float, penalised), strict=True)),
        debiased=dict(zip(pupil.bounds, map(float, debiased), strict=True)),
        penalty=float(penalty),
        misfit=float(np.sqrt(squares) / scale),
        viscosity_ratio=float(debiased[1] / debiased[0]) if maxwell else None,
        relaxation_time_ratio=float(1.0 / debiased[0]) if maxwell else None,
        errors={name: compare_fluids(fluid, taught, flow) for name, flow in test_flows.items()},
        latex=pupil.latex % tuple(f"{value:.4g}" for value in debiased),
        law=law,
    )


def compare_fluids(
    truth: Fluid, other: Fluid, protocol: FlowProtocol, duration: float = TEST_DURATION
) -> dict[str, float] | None:
    """Return relative L2 errors ``sigma12``, ``N1``, ``N2`` of one fluid against another in a flow.

    N2's is relative to N1's norm; in extension ``tensile_stress``. None where a fluid diverges.
    """
    times = np.linspace(0.0, duration, 401)
    try:
        reference, judged = (simulate(fluid, protocol, times) for fluid in (truth, other))
    except SimulationError:
        return None

    def norm(values):
        return float(np.linalg.norm(values))

    first = norm(judged.first_normal_stress_difference - reference.first_normal_stress_difference)
    normal_scale = max(norm(reference.first_normal_stress_difference), 1e-300)
    if protocol.kinematics is not None:
        return {"tensile_stress": first / normal_scale}
    shear = norm(judged.shear_stress - reference.shear_stress)
    second = norm(
        judged.second_normal_stress_difference - reference.second_normal_stress_difference
    )
    return {
        "sigma12": shear / max(norm(reference.shear_stress), 1e-300),
        "N1": first / normal_scale,
        "N2": second / normal_scale,
    }
