"""Laws in files: JSON, from which all other formats are made, and folders of results."""

import os
import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from discover.dataset.tables.table import read_bytes
from discover.effects.registry import Spelled
from discover.equations.equation import Box, Equation, Tested
from discover.equations.formats.code import numpy_code, sympy_code
from discover.equations.formats.in_a_solver import in_a_solver
from discover.equations.formats.rheotool import rheotool_text
from discover.equations.formats.ufl import ufl_code
from discover.equations.markup import PREAMBLE, SEPARATOR, latex_letters, law_latex
from discover.equations.parts import NamedPart, StatePart
from discover.errors import InputError
from discover.plain_numbers import json_text, parse_json
from discover.validation import Section, validated
from discover.words import unknown_name
from tensor_library.law_terms import LawTerm
from tensor_library.notation import LatexNotation, latex_number

COMPARISON, LOOP, FIT, BATCH = "comparison.json", "loop.json", "fit.json", "batch.json"
AUGMENTED, NEAREST, ANSWER = "augmented", "nearest_law", "answer"
"""Names of the law of a closed loop, of a classical one in its place, and of the law of the answer
of a comparison or a fit."""


def read_result_laws(folder: str | Path) -> dict[str, Equation]:
    """Return the laws in a folder of results by name: those of the learners, or the only one.

    `folder`: of ``discover compare``, ``close-loop`` or ``fit``, or its JSON file. Raises
    InputError if there is no result, it is damaged, or its law cannot be written out.
    """
    return _laws(*read_result(folder))


def read_result(folder: str | Path) -> tuple[Any, str]:
    """Return content and name of the JSON file in a folder of results; InputError if none."""
    path = Path(folder)
    if path.suffix == ".json":
        return read_json(path), path.name
    for name in (COMPARISON, LOOP, FIT):
        if os.path.isfile(path / name):  # Path.is_file raises where a name is too long
            return read_json(path / name), name
    if os.path.isfile(path / BATCH):
        raise InputError(
            f"{path} holds a batch. Give the folder of one study in it, such as {path / 'STUDY'}."
        )
    raise InputError(
        f"{path} holds none of {COMPARISON}, {LOOP} and {FIT}. Give a folder that discover "
        "compare, close-loop or fit has finished."
    )


def choose_law(laws: dict[str, Equation], name: str | None = None) -> Equation:
    """Return the law of this name; without one that of the answer, or of the sparse learner."""
    if name is None:
        return laws.get(ANSWER) or laws.get("tensor_sindy") or next(iter(laws.values()))
    if name not in laws:
        raise InputError(f"There is no law {name!r} in these results; write {' or '.join(laws)}.")
    return laws[name]


def _laws(content: Any, where: str) -> dict[str, Equation]:
    old = f"{where} holds no law: it was written before laws were kept. Run again with --overwrite."
    if not isinstance(content, dict):
        raise InputError(f"{where} is not a result of discover. Run again with --overwrite.")
    answer = content.get("answer_law")
    laws = {} if answer is None else {ANSWER: equation_from_json(answer, f"{where}: answer_law")}
    if isinstance(content.get("law"), str):  # the name of the law that was fitted
        if not laws:
            raise InputError(
                f"{where}: {content['law'][:80]} has no written form. Choose another law."
            )
        return laws
    if "law" in content or "law_missing" in content:
        near = content.get("nearest_law")
        if content.get("law") is None and isinstance(near, dict) and near.get("equation"):
            return {NEAREST: equation_from_json(near["equation"], f"{where}: nearest_law")}
        if content.get("law") is None:
            raise InputError(" ".join(str(content.get("law_missing") or old).split())[:500])
        return {AUGMENTED: equation_from_json(content["law"], f"{where}: law")}
    learners = content.get("learners")
    if not isinstance(learners, dict):
        raise InputError(old)
    learned = {
        str(name): equation_from_json(learner["law"], f"{where}: learners.{name}.law")
        for name, learner in learners.items()
        if isinstance(learner, dict) and learner.get("law") is not None
    }
    if not learned:
        raise InputError(old)
    return learned | laws


def read_json(path: Path) -> Any:
    """Return what a JSON file of results holds."""
    try:
        return parse_json(read_bytes(path, path.name))
    except InputError:
        raise
    except ValueError as error:
        raise InputError(
            f"{path.name} is not valid JSON of a result ({error}). Run again with --overwrite."
        ) from None


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
        "tested": tested and tested.boxes | {"worst_errors": dict(tested.worst_errors)},
    }


def equation_from_json(content: object, where: str = "the law") -> Equation:
    """Return the equation that `equation_to_json` wrote; InputError names a key that is wrong."""
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


def equation_latex(equation: Equation, digits: int = 9) -> str:
    """Return an equation with its modes, solvent and tested box as a piece of a LaTeX document."""
    lines = [PREAMBLE + "".join(f"% {line}\n" for line in equation.header)]
    named = equation.named
    law = law_latex(equation.terms, equation.linear_relaxation, digits, named)
    # what a law with a name defines on the way would not fit into one line
    law, *where = [law] if named is None else law.split(SEPARATOR)
    lines.append(f"\\begin{{equation}}\n  {law}\n\\end{{equation}}\n")
    if where:
        rows = " \\\\\n".join("  " + one.replace(" = ", " &= ", 1) for one in where)
        lines.append(f"\\begin{{align}}\n{rows}\n\\end{{align}}\n")
    for part, spelled in zip(equation.states, equation.spelled_states, strict=True):
        lines.append(_state(part, spelled, digits))
    letters = {} if named is None else latex_letters(named, LatexNotation(digits))
    if named is not None:
        lines += [f"% {letters[n]}: {n} of the law {named.law}" for n in named.constants[0]]
    lines.append("% modes: modulus in Pa, relaxation time in s\n\\begin{align}")
    for k, (g, time) in enumerate(zip(equation.modulus, equation.relaxation_time, strict=True)):
        own = [("G_{k}", g, r"\,\mathrm{Pa}"), (r"\lambda_{k}", time, r"\,\mathrm{s}")]
        own += [(letters[n], named.of_mode(k)[n], "") for n in named.differing] if named else []
        entries = (
            f"{letter.replace('_{k}', f'_{{{k + 1}}}')} &= {latex_number(value, digits)}{unit}"
            for letter, value, unit in own
        )
        lines.append(f"  {', & '.join(entries)} \\\\")
    lines.append(
        f"  \\eta_\\mathrm{{s}} &= {latex_number(equation.solvent_viscosity, digits)}"
        "\\,\\mathrm{Pa\\,s}\n\\end{align}\n"
    )
    return "\n".join(lines)


def _state(part: StatePart, spelled: Spelled, digits: int) -> str:
    """Return the equation of a state of the whole fluid, with its numbers."""
    numbers = ",\\quad ".join(
        f"{spelled.symbols[p.name]} = {latex_number(part.values[p.name], digits)}"
        + (rf"\,\mathrm{{{p.unit}}}" if p.unit else "")
        for p in part.own.parameters
    )
    lines = [f"% {part.effect}, of the whole fluid", "\\begin{gather}"]
    return "\n".join([*lines, f"  {spelled.equation} \\\\", f"  {numbers}", "\\end{gather}\n"])


def _free_of_rounding(write: Callable[..., str]) -> Callable[..., str]:
    """Return a format in which 0.2999999999999975 is 0.3: in twelve digits no rounding is left."""

    def written(equation: Equation, **options: float) -> str:
        text = write(equation, **options)
        return _LONG.sub(lambda one: repr(float(f"{float(one[0]):.12g}")), text)

    return written


_LONG = re.compile(r"\d+\.\d{10,}(e-?\d+)?")

FORMATS: Mapping[str, Callable[..., str]] = {
    "python": _free_of_rounding(numpy_code), "sympy": _free_of_rounding(sympy_code),
    "latex": _free_of_rounding(equation_latex),
    "json": lambda equation: json_text(equation_to_json(equation)),
    "rheotool": _free_of_rounding(rheotool_text), "ufl": _free_of_rounding(ufl_code),
}  # fmt: skip
"""Functions that write an equation, by the name of the format."""


def write_equation(
    equation: Equation,
    form: str,
    density_kg_m3: float | None = None,
    tolerance: float | None = None,
) -> str:
    """Return an equation as text; InputError if a format lacks the law, the option, or itself."""
    if form not in FORMATS:
        raise InputError(unknown_name("format", form, FORMATS))
    if form != "json":  # which holds what was found, and no more
        said = in_a_solver(equation)
        notes = () if said is None else (said if isinstance(said, str) else said.text,)
        equation = replace(equation, notes=(*equation.notes, *notes))
    options = {"density_kg_m3": density_kg_m3, "tolerance": tolerance}
    given = {name: value for name, value in options.items() if value is not None}
    if given and form != "rheotool":
        raise InputError(f"Density and tolerance are for --format rheotool; got --format {form}.")
    return FORMATS[form](equation, **given)
