"""The fluid of a closed loop as an equation with the box in which it was tested."""

from discover.closed_loop.result import LoopResult, RunRecord
from discover.equations import Equation, Tested, law_terms
from discover.equations.box import box_of, flow_numbers
from discover.equations.equation import mean_relaxation_time
from discover.errors import InputError


def loop_equation(result: LoopResult) -> Equation:
    """Return the augmented fluid as an equation.

    Raises
    ------
    InputError
        If an effect gives the fluid a state, or adds what is no sum of library terms.
    """
    fluid = result.fluid
    if fluid is None:
        states = [s.effect for s in result.stages if s.kind == "constitutive"]
        raise InputError(
            f"The loop added {', '.join(states) or 'an effect'}, which gives the fluid a state "
            "that no law of stress and rate carries, so it cannot be written out as one equation."
        )
    modulus = tuple(float(g) for g in fluid.modulus)
    relaxation_time = tuple(float(time) for time in fluid.relaxation_time)
    time = mean_relaxation_time(modulus, relaxation_time)
    learned_in = box_of(_numbers(r, time) for r in result.records if not r.held_out)
    judged_in = box_of(_numbers(r, time) for r in result.records if r.held_out)
    notes = [f"Verdict of the loop: {result.verdict}."]
    outside = [s.effect for s in result.stages if s.kind != "constitutive"]
    if outside:
        notes.append(
            f"The record also holds {', '.join(outside)}, which is no part of the fluid and is not "
            "in this equation."
        )
    held_out = result.error_after.held_out
    errors = {} if held_out is None else {"sigma12 (mean over runs)": held_out}
    return Equation(
        law_terms(fluid.law),
        modulus,
        relaxation_time,
        fluid.law.linear_relaxation,
        float(fluid.solvent_viscosity),
        title="Declared law with the constitutive effects that a closed loop added.",
        notes=tuple(notes),
        tested=None if learned_in is None else Tested(learned_in, judged_in, errors),
    )


def _numbers(record: RunRecord, time: float) -> tuple[float, float]:
    return flow_numbers(record.time, record.shear_rate, time)
