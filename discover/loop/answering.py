"""The answer of a closed loop: the law that one can use."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from discover.answer import (
    Answer,
    Constant,
    Discrepancy,
    ExpectedError,
    Mode,
    Range,
    Suspect,
    sentences,
)
from discover.answer.naming import named_law
from discover.answer.simple_material import SimpleMaterial
from discover.effects.base import EffectParameter
from discover.effects.registry import parameters_of
from discover.equations import Equation, law_parts
from discover.equations.formats.rheotool import DENSITY
from discover.equations.parts import AugmentedLaw
from discover.errors import InputError
from discover.inference.by_mode.constants import StageParameter
from discover.laws.registry import LAWS
from discover.loop.run_record import RunRecord
from discover.loop.sentences import EXPLAINED, untested_by, what_to_measure_next
from discover.words import effect_title, effects_title, listed, percent_of, readable

_APART = 0.2
"""Relative difference between laws from which on a quantity is not determined."""

_WORTH_SAYING = 0.05
"""Relative difference between laws that is told of a quantity that nothing tested."""

_MUCH = 2.0
"""Relative difference from which on its size says nothing."""

_FASTER = 1.01
"""Rate over the fastest fitted one, from which on a run lies beyond the range."""

_SETTLED = 0.95
"""Probability from which on nothing is said of other laws."""

_TO_NOISE = 1.5
"""Misfit over the change from sample to sample up to which a simple material leaves only noise."""

LAW_OF_EFFECT = {
    "giesekus_mobility": "giesekus",
    "non_affine_motion": "johnson_segalman",
    "ptt_linear": "ptt_linear",
    "ptt_exponential": "ptt_exponential",
}
"""Laws that an effect makes of an upper convected Maxwell fluid."""

_NOT_TESTED = {
    "flows": "Fitted, not tested: no run was held out.",
    "states": "Fitted, not tested: only steady or periodic states were measured.",
}


def loop_answer(result: Any) -> Answer:
    """Return the answer of a closed loop."""
    following = what_to_measure_next(result)
    if result.verdict == "no_signal":
        return Answer(
            "", instead="No signal: these runs hold no more than noise, so no law is given.",
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
        None if result.discrepancy is None else Discrepancy(**result.discrepancy),
        range_of(result.records, equation),
        _expected(result, title.partition(" with ")[0] if law else "this law"),
        following,
        tuple(
            Suspect(stage.effect, _constants(stage.parameters, stage.left_open, stage.effect))
            for stage in result.stages
            if stage.kind != "constitutive"
        ),
        failed=_failed(result),
        alternative=_alternative(result),
        tolerance=result.tolerance,
    )
    if equation is None:
        near = result.nearest_law
        classical = None if near is None else near.equation
        shown, others = _shown(result)
        written = {"formula": rest_of_h(others)} if others else {}
        return replace(answer, shown=shown, classical=classical, written=written)
    return replace(answer, equation=replace(equation, notes=(*equation.notes, *answer.lines)))


def _shown(result: Any) -> tuple[Equation | None, list[str]]:
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


def _of_material(result: Any, material: SimpleMaterial, following: str) -> Answer:
    """Return the answer for a yield stress, a viscous fluid or a solid."""
    found = range_of(result.records)
    inelastic = ExpectedError(missing="not determined", note="this law has no normal stress")
    to_noise = result.error_after.fit <= _TO_NOISE * result.noise_floor
    size = result.error_after.fit
    by_run = {r.name: float(r.errors[-1]) for r in result.records if not r.held_out}
    answer = Answer(
        material.title,
        material.law,
        material.constants,
        error=size,
        noise=result.noise_floor,
        fits_to_the_noise=to_noise,
        discrepancy=None if to_noise else Discrepancy(size, (size, size), by_run),
        range=found,
        expected_error={"sigma12": _of_stress(result), "N1": inelastic, "N2": inelastic},
        next_test=following,
        failed=_failed(result),
        tolerance=result.tolerance,
    )
    slowest = 0.0 if found.rate_1_s is None else found.rate_1_s[0]
    written = material.written(answer.lines, slowest, DENSITY)
    return replace(answer, written=written | {"formula": material.formula})


def _failed(result: Any) -> str:
    """Return what the law was not tested by, or failed."""
    if untested := untested_by(result):
        return _NOT_TESTED[untested]
    chance = result.remaining.get("probability")
    if result.verdict == "unexplained" and chance is not None and chance < 0.05:
        p = "< 0.001" if chance < 1e-3 else f"= {chance:.2g}"
        return f"No law reaches the noise (p {p})."
    return ""


def _alternative(result: Any) -> str:
    """Return what comes next: a law of the field for a sum without a name, or the next likeliest.

    Empty where the law is settled.
    """
    told = result.explanations
    own = told.holding([stage.effect for stage in result.stages])
    if result.verdict in EXPLAINED and own is not None and own.probability < _SETTLED:
        others = [effects_title(one.effects) for one in told.likeliest_first if one is not own]
        after = f"; next: {others[0] or 'the declared model'}" if others else ""
        return f"Probability {percent_of(own.probability)}{after}."
    if result.nearest_law is None:
        return ""
    near = result.nearest_law
    constants = [Constant(name, one.value, one.ci95) for name, one in near.constants.items()]
    said = [LAWS[near.law].title, *sentences.constants(constants)]
    return f"Best classical law: {', '.join(said)}, to {percent_of(near.size)}."


def _law(result: Any, equation: Equation | None) -> tuple[str | None, str, tuple[Constant, ...]]:
    """Return name, title and constants of the law."""
    in_fluid = [stage for stage in result.stages if stage.kind == "constitutive"]
    found = list(_constants(result.declared_parameters))
    for stage in in_fluid:
        own = _constants(stage.parameters, stage.left_open, stage.effect)
        found += _renamed(stage.effect, own, found)
    for known in result.declared_effects:
        if known.kind == "constitutive":
            own = _constants(known.parameters, (), known.effect)
            found += _renamed(known.effect, own, found)
    named = None if equation is None else named_law(equation)
    solvent = equation is not None and equation.solvent_viscosity > 0.0
    if named is None:
        base = None if result.declared_law is None else named_law(result.declared_law)
        title = LAWS[base[0]].title if base else "law"
        # what makes a named law of a Maxwell fluid gives its name, and other effects come with it
        names = [stage.effect for stage in in_fluid]
        core = next((n for n in names if base and base[0] == "ucm" and n in LAW_OF_EFFECT), None)
        if core is not None:
            title = LAWS[LAW_OF_EFFECT[core]].title
        added = [effect_title(name) for name in names if name != core]
        if base is not None:  # constants that were declared
            found = _beside(base[1], found)
        return None, f"{title} with {listed(added)}" if added else title, tuple(found)
    name, values = named
    title = LAWS[name].title + (" with solvent" if solvent else "")
    return name, title, tuple(_beside(values, found))


def _beside(values: Mapping[str, float], found: Sequence[Constant]) -> list[Constant]:
    """Return the constants of a law first, with the intervals of those that were fitted."""
    left, own = list(found), []
    for name, value in values.items():
        close = [
            one for one in left
            if one.name == name or np.isclose(one.value, value, rtol=1e-6, atol=0.0)
        ]  # fmt: skip
        if close:
            left.remove(close[0])
            own.append(replace(close[0], name=name))
        else:
            own.append(Constant(name, value))
    return [*own, *left]


def _constants(
    parameters: Mapping, left_open: Sequence[str] = (), effect: str = ""
) -> tuple[Constant, ...]:
    known = parameters_of(effect) if effect else {}
    return tuple(
        Constant(
            name,
            one.value,
            one.ci95,
            one.unit or "1",
            name not in left_open and not (isinstance(one, StageParameter) and one.is_open),
            known[name].symbol if name in known else "",
            _meaning(effect, known[name]) if name in known else "",
        )
        for name, one in parameters.items()
    )


def _meaning(effect: str, parameter: EffectParameter) -> str:
    """Return what a parameter is, in a few words; a letter stands for its effect."""
    words = parameter.name.replace("_", " ")
    is_letter = len(words) < 3 or readable(words) != words
    return parameter.meaning or (effect_title(effect) if is_letter else words)


def _renamed(
    effect: str, constants: Sequence[Constant], taken: Sequence[Constant]
) -> list[Constant]:
    """Return constants of an effect: that of a library term has its name, and none has two."""
    if "sigma" in effect or "gammadot" in effect:
        first, *inner = constants
        constants = [replace(first, name=effect), *inner]
    names = [one.name for one in taken]
    return [
        replace(one, name=f"{effect}.{one.name}") if one.name in names else one for one in constants
    ]


def range_of(records: Sequence[RunRecord], equation: Equation | None = None) -> Range:
    """Return the flows of the fitted runs, in numbers without units if the equation has them.

    Of a flow curve each sample has a rate of its own, of other runs the largest counts.
    """
    fitted = [record for record in records if not record.held_out]
    flows = tuple(dict.fromkeys(record.flow for record in fitted)) or ("shear",)
    strains = [float(np.nanmax(np.abs(r.strain))) for r in fitted if np.any(np.isfinite(r.strain))]
    strain = (0.0, max(strains)) if strains else None
    if fitted and all(record.control == "oscillation" for record in fitted):
        frequencies = np.concatenate([record.rate / record.strain for record in fitted])
        ends = float(np.min(frequencies)), float(np.max(frequencies))
        return Range(None, None, strain, None, ends, flows)
    rates = [
        float(rate)
        for r in fitted
        for rate in ([_fastest(r)] if r.is_transient else np.abs(r.rate))
        if rate > 0.0 and r.control != "oscillation"
    ]
    box = None if equation is None or equation.tested is None else equation.tested.learned_in
    return Range(
        None if box is None else box.weissenberg,
        None if box is None else box.deborah,
        strain,
        (min(rates), max(rates)) if rates else None,
        None,
        flows,
        any(np.min(r.rate) < 0.0 < np.max(r.rate) for r in fitted),
    )


def _fastest(record: RunRecord) -> float:
    return float(np.max(np.abs(record.rate)))


def _expected(result: Any, name: str) -> dict[str, ExpectedError]:
    """Return expected errors: of what was measured, else by how far equally good laws differ."""
    found = {"sigma12": _of_stress(result)}
    for kind in ("N1", "N2", "uniaxial"):
        own = measured(result.records, kind)
        if own is not None:
            found[kind] = own
            continue
        spread = result.spread_of_laws.get(kind)
        apart = None if spread is None else spread.inside
        differ = "" if apart is None else f"laws differ by {_at_most(apart)}"
        if kind == "N1" and apart is not None and apart < _APART and not _only(result, kind):
            beyond = None if spread is None else spread.beyond
            note = f"if {name}; not measured"
            found[kind] = ExpectedError(apart, beyond, note=note, is_measured=False)
        elif kind == "N1":
            found[kind] = ExpectedError(missing="not determined", note=differ)
        elif kind == "N2":
            told = (
                f"{differ} of N1"
                if apart and apart > _WORTH_SAYING
                else "shear stress does not fix it"
            )
            found[kind] = ExpectedError(missing="not determined", note=told)
        else:
            found[kind] = ExpectedError(note=differ if apart and apart > _WORTH_SAYING else "")
    return found


def _at_most(apart: float) -> str:
    """Return by how much laws differ; of laws that diverge only that it is much."""
    return percent_of(apart) if apart <= _MUCH else f"more than {percent_of(_MUCH)}"


def _only(result: Any, kind: str) -> bool:
    """Return whether nothing but linear response was measured."""
    return all(record.control == "oscillation" for record in result.records)


def _of_stress(result: Any) -> ExpectedError:
    fastest = max((_fastest(r) for r in result.records if not r.held_out), default=0.0)
    held = [r for r in result.records if r.held_out and _is(r, "sigma12")]
    slow = [r for r in held if _fastest(r) <= _FASTER * fastest]
    fast = [r for r in held if _fastest(r) > _FASTER * fastest]
    inside, beyond = _mean(slow), _mean(fast)
    spread = result.spread_of_laws.get("sigma12")
    if beyond is None and spread is not None and spread.beyond is not None:
        beyond = max(spread.beyond, inside or result.left_out_error or 0.0)
    if result.folds and result.error_after.held_out is not None:
        return ExpectedError(result.error_after.held_out, beyond, note="runs left out in turn")
    if inside is None and result.material is not None:
        return ExpectedError(result.error_after.fit, beyond, note="fitted runs, noise included")
    if inside is None and result.left_out_error is not None:
        return ExpectedError(result.left_out_error, beyond, note="runs left out, noise removed")
    return ExpectedError(inside, beyond, note="unseen runs, noise included" if held else "")


def measured(records: Sequence[RunRecord], kind: str) -> ExpectedError | None:
    """Return the error of what was measured, of unseen runs if there are any; None without."""
    own = [record for record in records if _is(record, kind)]
    if not own:
        return None
    held = [record for record in own if record.held_out]
    fastest = max((_fastest(r) for r in records if not r.held_out), default=0.0)
    fast = [record for record in held if _fastest(record) > _FASTER * fastest]
    slow = [record for record in (held or own) if _fastest(record) <= _FASTER * fastest]
    return ExpectedError(_mean(slow), _mean(fast), note="unseen runs" if held else "fitted runs")


def _is(record: RunRecord, kind: str) -> bool:
    if kind == "uniaxial":
        return record.flow == "uniaxial" and record.quantity == "tensile_stress"
    if kind == "sigma12":
        return record.flow == "shear" and record.quantity in ("sigma12", "strain")
    return record.flow == "shear" and record.quantity == kind


def _mean(records: Sequence[RunRecord]) -> float | None:
    errors = [float(record.errors[-1]) for record in records]
    return float(np.mean(errors)) if errors and np.all(np.isfinite(errors)) else None
