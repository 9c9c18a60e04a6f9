"""The answer of a closed loop: the law that one can use."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from discover.answer import Answer, Constant, Mode, Suspect
from discover.answer import modes_in_words as modes
from discover.answer.fields import EMPIRICAL
from discover.answer.naming import ByMode, named_law
from discover.answer.simple_material import SimpleMaterial
from discover.effects.registry import parameters_of
from discover.equations import AugmentedLaw, Equation, law_parts
from discover.equations.formats.rheotool import DENSITY
from discover.errors import InputError
from discover.inference.free_form import FreeForm
from discover.laws.registry import LAWS
from discover.loop import by_quantity
from discover.loop.findings import LoopFindings
from discover.loop.fitted_range import as_measured, range_of, shows_recovery
from discover.loop.parts import STRUCTURES, ConstantByMode, Stage, StageParameter
from discover.loop.runs import RunRecord
from discover.loop.sentences import (
    EXPLAINED,
    suspected,
    untested_by,
    what_to_measure_next,
)
from discover.words import effect_title, effects_title, listed, percent_of, readable, significant

_MOST_ADDED = 2  # Effects added to a law, up to which their sum is told as that law with these
_SETTLED = 0.95  # Probability from which on nothing is said of other laws

LAW_OF_EFFECT = {
    "giesekus_mobility": "giesekus",
    "non_affine_motion": "johnson_segalman",
    "ptt_linear": "ptt_linear",
    "ptt_exponential": "ptt_exponential",
}
"""Laws that an effect makes of an upper-convected Maxwell fluid."""

_NOT_TESTED = {
    "flows": "Not tested on unseen runs.",
    "states": "Not tested on unseen runs or in transients.",
    "transients": "Not tested in transients.",
}


def loop_answer(result: LoopFindings) -> Answer:
    """Return the answer of a closed loop."""
    following = what_to_measure_next(result)
    if result.verdict == "no_signal":
        return Answer(
            "", instead=f"No signal: these runs hold only noise{_scatter(result.records)}, "
            "so no law is given.",
            noise=result.noise_floor, next_test=following, tolerance=result.tolerance,
        )  # fmt: skip
    if result.material is not None:
        return _of_material(result, result.material, following)
    try:
        equation = result.without_answer()
    except InputError:
        equation = None
    linear = equation or result.declared_law
    law, title, constants = _law(result, equation)
    answer = Answer(
        title,
        law,
        constants,
        () if linear is None else tuple(map(Mode, linear.modulus, linear.relaxation_time)),
        0.0 if linear is None else float(linear.solvent_viscosity),
        result.error_after.fit,
        result.noise_floor,
        result.verdict in EXPLAINED,
        by_quantity.with_unseen(result),
        range_of(result.records, equation),
        by_quantity.errors_by_quantity(result),
        following,
        (
            *(_of_function(one) for one in result.free_form if one.in_answer),
            *(
                Suspect(
                    one.effect,
                    _of_stage(result, one),
                    result.corrections.get(one.effect, 0.0),
                    one.of_instrument,
                )
                for one in suspected(result)
            ),
        ),
        failed=_failed(result),
        alternative=_alternative(result),
        best_classical=_best_classical(result),
        tolerance=result.tolerance,
        temperature_C=result.temperature_C,
        shift_factors=_shift_factors(result.records),
        falls_above=_falls_above(result),
    )
    if equation is None:
        near = result.nearest_law
        classical = None if near is None else near.equation
        shown, others = _shown(result)
        written = {"formula": rest_of_h(others)} if others else {}
        answer = replace(answer, shown=shown, classical=classical, written=written)
        return modes.at_use(answer)
    answer = modes.at_use(replace(answer, equation=equation))
    notes = *equation.notes, *answer.lines
    assert answer.equation is not None  # which stays, at another temperature
    return replace(answer, equation=replace(answer.equation, notes=notes))


def _scatter(records: Sequence[RunRecord]) -> str:
    """Return the scatter of recorded stresses, and what hides in it; empty where none has one."""
    own = [one for one in records if one.quantity != "strain" and one.scatter > 0.0]
    if not own:
        return ""
    noise = modes.span((min(one.scatter for one in own), max(one.scatter for one in own)))
    most = modes.short(max(one.mean_below for one in own))
    return f" of {noise} Pa rms; the sample's mean stress is below {most} Pa (95 %)"


def _falls_above(result: LoopFindings) -> str:
    """Return the rate above which the law's flow curve falls, as it was measured; empty of none."""
    spread = result.spread_of_laws.get("sigma12")
    if spread is None or spread.falls_above is None:
        return ""
    fitted = [record for record in result.records if not record.held_out]
    return as_measured(fitted, spread.falls_above).replace(" and ", " at ")


def _shift_factors(records: Sequence[RunRecord]) -> dict[float, float]:
    """Return a_T of shifted runs by their temperature in °C, the hottest first.

    Relaxation times there over those at the temperature to which runs were shifted: times of the
    instrument over those of the law.
    """
    shifted = [record for record in records if record.shift != 1.0]
    found = {one.temperature_C: one.shift for one in shifted if one.temperature_C is not None}
    return dict(sorted(found.items(), reverse=True))


def _shown(result: LoopFindings) -> tuple[Equation | None, list[str]]:
    """Return a law that cannot be written out as a page shows it, constants at the mean mode.

    And the equations of effects that are in its h, but no sum of terms.
    """
    fluid = result.fluid_at_mean if result.fluid is None else result.fluid
    added = [s.equation for s in result.stages if s.kind == "constitutive"]
    if fluid is None:
        return result.declared_law, added
    law, others = fluid.law, ()
    if isinstance(law, AugmentedLaw):
        law, others = law.of_terms()
    try:
        equation = Equation.of_fluid(fluid, law_parts(law), states=tuple(result.states))
    except InputError:
        return result.declared_law, added
    return equation, [one.equation for one in others]


def rest_of_h(equations: Sequence[str]) -> str:
    """Return one equation of what effects add to h, over the stress of a mode; then others."""
    summands, where = [], []
    for one in equations:
        first, *defined = one.split(r",\quad")
        found = re.match(r"h \\mathrel\{([+-])\}= (.*)", first, re.S)
        if found:
            summands.append(("-" if found[1] == "-" else "+" if summands else "") + found[2])
        where += defined if found else [one]
    law = re.sub(r"\\sigma(?!_)", r"\\mathbf{\\tau}", f"h = {' '.join(summands)}")
    return "\n".join([*([law] if summands else []), *where])


def _of_material(result: LoopFindings, material: SimpleMaterial, following: str) -> Answer:
    """Return the answer for a yield stress, a viscous fluid or a solid."""
    found = range_of(result.records)
    to_noise = result.verdict in EXPLAINED
    left = by_quantity.of_fitted(result.records, result.error_after.fit, result.noise_floor)
    answer = Answer(
        material.title,
        material.law,
        material.constants,
        error=result.error_after.fit,
        noise=result.noise_floor,
        fits_to_the_noise=to_noise,
        discrepancy=None if to_noise else left,
        range=found,
        expected_error={"sigma12": by_quantity.of_stress(result)},
        next_test=following,
        failed=_failed(result),
        tolerance=result.tolerance,
        temperature_C=result.temperature_C,
    )
    slowest = 0.0 if found.rate_1_s is None else found.rate_1_s[0]
    written = material.written(answer.lines, slowest, DENSITY)
    return replace(answer, written=written | {"formula": material.formula})


def _failed(result: LoopFindings) -> str:
    """Return what the law was not tested by."""
    if untested := untested_by(result):
        held_out = any(record.held_out for record in result.records)
        return _NOT_TESTED["transients" if untested == "states" and held_out else untested]
    return ""


def _alternative(result: LoopFindings) -> str:
    """Return what describes the same, or is the next likeliest; empty where the law is settled."""
    if twin := result.remaining.get("oil_twin"):
        thick, rises = significant(twin["viscosity"], 3), significant(twin["rise_time"], 2)
        tool = f" and a tool of {significant(twin['inertia'], 2)} Pa s²" * bool(twin["inertia"])
        return f"An oil of {thick} Pa s behind a motor with t_m = {rises} s{tool} records the same."
    told = result.explanations
    own = told.holding([stage.effect for stage in result.stages])
    if result.verdict not in EXPLAINED or own is None:
        return ""
    # what stands in the place of an effect of the instrument is named with it
    named = [
        {*own.effects, other} - {one.effect}
        for one in suspected(result)
        for other in one.of_instrument
    ]
    twins = [one for one in own.twins if not set(own.effects) < set(one) and set(one) not in named]
    if twins:
        return f"{effects_title(twins[0])} predicts these runs alike."
    if own.probability < _SETTLED:
        others = [effects_title(one.effects) for one in told.likeliest_first if one is not own]
        after = f"; next: {others[0] or 'the declared model'}" if others else ""
        return f"Probability of this law {percent_of(own.probability)}{after}."
    return ""


def _best_classical(result: LoopFindings) -> tuple[str, float] | None:
    """Return the best law of the field, in words, and its error, for a sum without a name."""
    if (near := result.nearest_law) is None:
        return None
    constants = [Constant(name, one.value, one.ci95) for name, one in near.constants.items()]
    said = [LAWS[near.law].title, *(f"{one.symbol} = {one.number}" for one in constants)]
    falls = ", non-monotonic flow curve" * near.falls
    return f"{', '.join(said)}{falls}", near.size


def _law(
    result: LoopFindings, equation: Equation | None
) -> tuple[str | None, str, tuple[Constant, ...]]:
    """Return name, title and constants of the law."""
    in_fluid = [stage for stage in result.stages if stage.kind == "constitutive"]
    # as their equations stand (`discover.effects.registry`)
    in_fluid.sort(key=lambda one: (0, one.effect) if one.effect in STRUCTURES else (1, ""))
    found = list(_constants(result.declared_parameters))
    for stage in in_fluid:
        own = _of_stage(result, stage)
        found += _renamed(stage.effect, own, found)
    for known in result.declared_effects:
        if known.kind == "constitutive":
            own = _constants(known.parameters, (), known.effect)
            found += _renamed(known.effect, own, found)
    named = None if equation is None else named_law(equation)
    if named is None:
        base = None if result.declared_law is None else named_law(result.declared_law)
        title = LAWS[base[0]].title if base else "law"
        # what makes a named law of a Maxwell fluid gives its name, and other effects come with it
        names = [stage.effect for stage in in_fluid]
        is_ucm = base is not None and base[0] == "ucm"
        core = next((one for one in names if is_ucm and one in LAW_OF_EFFECT), None)
        known, first = [core], []
        if core is not None:
            title = LAWS[LAW_OF_EFFECT[core]].title
        elif is_ucm and (structure := next((one for one in names if one in STRUCTURES), None)):
            known = [*STRUCTURES]
            if shows_recovery(result.records):
                title = "thixotropic Maxwell"
            else:
                first = [effect_title(structure)]
        added = [effect_title(name) for name in names if name not in known]
        if base is not None:  # constants that were declared
            found = _law_first(base[1], found)
        if first or added:
            title = f"{title} with {listed([*first, *added])}"
        # more constants than runs, which they do not describe either
        many = len(found) > sum(not record.held_out for record in result.records)
        many &= result.verdict not in EXPLAINED
        if many or len(added) > _MOST_ADDED or any(one.is_term for one in found):
            title = EMPIRICAL + title
        return None, title, tuple(found)
    name, values = named
    title = LAWS[name].title
    if name == "ucm" and not shows_a_derivative(result):
        title = "linear viscoelastic (no nonlinear law determined)"
    elif name == "ucm" and equation is not None and equation.solvent_viscosity:
        title = "Oldroyd-B"
    return name, title, tuple(_law_first(values, found))


def shows_a_derivative(result: LoopFindings) -> bool:
    """Return whether runs determine the convected derivative of a law without a nonlinear term.

    Its σ12 in shear is the linear one, so it takes a normal stress or an extension, or that nothing
    nonlinear fits as well.
    """
    seen = [(r.flow, r.quantity) for r in result.records if not r.held_out]
    other = any(flow != "shear" or quantity in ("N1", "N2") for flow, quantity in seen)
    return other or by_quantity.normal_stress_settled(result)


def _law_first(values: Mapping[str, ByMode], found: Sequence[Constant]) -> list[Constant]:
    """Return the constants of a law first, with the intervals of those that were fitted."""
    left, own = list(found), []
    for name, of_modes in values.items():
        close = [
            one for one in left
            if one.name == name or np.isclose(one.value, of_modes[0], rtol=1e-6, atol=0.0)
        ]  # fmt: skip
        one = replace(close[0], name=name) if close else Constant(name, of_modes[0])
        if close:
            left.remove(close[0])
        if len(of_modes) > 1 and one.over_modes is None:
            each = tuple((value, True) for value in of_modes)
            one = replace(one, value=float(np.mean(of_modes)), by_mode=each)
        own.append(one)
    return [*own, *left]


def _of_function(found: FreeForm) -> Suspect:
    """Return a function of the measurement; of the stress, what it takes of that at most."""
    at = int(np.argmax(np.abs(found.value)))
    if found.slot != "recorded_stress" or not found.grid[at]:
        return Suspect(found.title)
    share, low, high = (
        float(one[at] / found.grid[at]) for one in (found.value, found.low95, found.high95)
    )
    where = f"at {significant(float(found.grid[at]), 2)} {found.unit}"
    return Suspect(found.title, (Constant("reading", share, (low, high), meaning=where),))


def _of_stage(result: LoopFindings, stage: Stage) -> tuple[Constant, ...]:
    """Return the constants of an effect that was added, with letters that no other has."""
    letters = result.letters.get(stage.effect, {})
    return _constants(stage.parameters, stage.left_open, stage.effect, letters)


def _constants(
    parameters: Mapping,
    left_open: Sequence[str] = (),
    effect: str = "",
    letters: Mapping[str, str] | None = None,
) -> tuple[Constant, ...]:
    known = parameters_of(effect) if effect else {}
    spelled = letters or {name: one.symbol for name, one in known.items()}
    found = []
    for name, one in parameters.items():
        by_mode = one if isinstance(one, ConstantByMode) and one.degree else None
        fitted = one if isinstance(one, StageParameter) else None
        letter, meaning = spelled.get(name, ""), ""
        if name in known:  # what it is, in a few words; a letter stands for its effect
            words = name.replace("_", " ")
            is_letter = len(words) < 3 or readable(words) != words
            meaning = known[name].meaning or (effect_title(effect) if is_letter else words)
        if by_mode is not None:
            letter = f"{letter or readable(name)}_k"
        found.append(
            Constant(
                name, one.value, one.ci95, one.unit or "1",
                name not in left_open and not (fitted is not None and fitted.is_open),
                letter, meaning, "" if fitted is None else fitted.at_end,
                () if by_mode is None else tuple((m.value, not m.left_open) for m in by_mode.modes),
            )
        )  # fmt: skip
    if effect and found and found[0].may_be_zero:  # an effect that may be absent has no others
        found[1:] = [replace(one, determined=False) for one in found[1:]]
    return tuple(found)


def _renamed(
    effect: str, constants: Sequence[Constant], taken: Sequence[Constant]
) -> list[Constant]:
    """Return constants of an effect: that of a library term has its name, and none has two."""
    if "sigma" in effect or "gammadot" in effect:
        first, *inner = constants
        constants = [replace(first, name=effect), *inner]
    said = {one.name: one.said for one in taken}
    # what is not told apart by its meaning is by the effect
    return [
        replace(
            one,
            name=f"{effect}.{one.name}",
            meaning=one.said + f" ({effect_title(effect)})" * (one.said == said[one.name]),
        )
        if one.name in said
        else one
        for one in constants
    ]
