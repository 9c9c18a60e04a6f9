"""Laws as JSON, as result files hold them and all other formats are made from."""

from typing import Any, Literal

from pydantic import Field

from discover.equations.equation import Box, Equation, Tested
from discover.equations.parts import NamedPart, StatePart
from discover.errors import InputError
from discover.validation import Section, validated
from tensor_library.law_terms import LawTerm

FORMAT = "discover law 1"


class _Term(Section):
    term: str = Field(max_length=500)
    coefficient: float
    inner: dict[str, float] = Field(default_factory=dict)
    ci95: tuple[float, float] | None = None


class _Mode(Section):
    modulus_Pa: float = Field(gt=0)
    relaxation_time_s: float = Field(gt=0)


class _Box(Section):
    Wi: tuple[float, float]
    De: tuple[float, float]


class _Tested(Section):
    learned_in: _Box
    judged_in: _Box | None = None
    worst_errors: dict[str, float] = Field(default_factory=dict)

    def read(self) -> Tested:
        learned, judged = self.learned_in, self.judged_in
        box = Box(learned.Wi, learned.De)
        return Tested(box, judged and Box(judged.Wi, judged.De), self.worst_errors)


class _Named(Section):
    law: str = Field(max_length=200)
    constants: tuple[dict[str, float], ...] = Field(min_length=1, max_length=1000)


class _State(Section):
    effect: str = Field(max_length=200)
    parameters: dict[str, float]


class _Law(Section):
    format: Literal["discover law 1"]
    title: str = ""
    notes: tuple[str, ...] = ()
    terms: tuple[_Term, ...] = Field(max_length=1000)
    linear_relaxation: bool = True
    modes: tuple[_Mode, ...] = Field(min_length=1, max_length=1000)
    solvent_viscosity_Pa_s: float = Field(default=0.0, ge=0)
    tested: _Tested | None = None
    named: _Named | None = None
    states: tuple[_State, ...] = Field(default=(), max_length=100)


def equation_to_json(equation: Equation) -> dict[str, Any]:
    """Return an equation as JSON-able values; `equation_from_json` undoes it exactly."""
    tested, named, beside = equation.tested, equation.named, {}
    # only where there is one: results without stay as they were
    if named is not None:
        beside["named"] = {"law": named.law, "constants": [dict(c) for c in named.constants]}
    if states := [{"effect": s.effect, "parameters": dict(s.values)} for s in equation.states]:
        beside["states"] = states
    return beside | {
        "format": FORMAT,
        "title": equation.title,
        "notes": list(equation.notes),
        "terms": [
            # in an equation, where there is none as well
            {**term.to_json(), "ci95": None if term.ci95 is None else list(term.ci95)}
            for term in equation.terms
        ],
        "linear_relaxation": equation.linear_relaxation,
        "modes": [
            {"modulus_Pa": g, "relaxation_time_s": time}
            for g, time in zip(equation.modulus, equation.relaxation_time, strict=True)
        ],
        "solvent_viscosity_Pa_s": equation.solvent_viscosity,
        "tested": tested
        and {
            "learned_in": _box(tested.learned_in),
            "judged_in": tested.judged_in and _box(tested.judged_in),
            "worst_errors": dict(tested.worst_errors),
        },
    }


def equation_from_json(content: object, where: str = "the law") -> Equation:
    """Return the equation that `equation_to_json` wrote.

    Raises InputError, naming the key, if something in it is missing, unknown or no number.
    """
    again = "Write the results again with --overwrite."
    try:
        law = validated(_Law, content, where)
    except InputError as error:
        raise InputError(f"{error} {again}") from None
    tested, named = law.tested, law.named
    try:
        return Equation(
            terms=tuple(LawTerm.from_json(term.model_dump()) for term in law.terms),
            modulus=tuple(mode.modulus_Pa for mode in law.modes),
            relaxation_time=tuple(mode.relaxation_time_s for mode in law.modes),
            linear_relaxation=law.linear_relaxation, solvent_viscosity=law.solvent_viscosity_Pa_s,
            title=law.title, notes=law.notes, tested=None if tested is None else tested.read(),
            named=None if named is None else NamedPart(named.law, named.constants),
            states=tuple(StatePart(state.effect, state.parameters) for state in law.states),
        )  # fmt: skip
    except ValueError as error:
        raise InputError(f"{where}: {error} {again}") from None


def _box(box: Box) -> dict[str, list[float]]:
    return {"Wi": list(box.weissenberg), "De": list(box.deborah)}
