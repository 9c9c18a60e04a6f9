"""What a closed loop asks of its result in sentences: doubt, tests, what to measure next."""

from collections.abc import Sequence
from typing import Any

from discover import words
from discover.answer.law_in_words import differ
from discover.answer.modes_in_words import OF_SWEEP, reduced_to, span
from discover.answer.sentences import A_TRANSIENT, MUCH, SYMBOLS
from discover.effects.registry import make_effect
from discover.loop.by_quantity import differing, measured, normal_stress_settled, with_unseen
from discover.loop.findings import LoopFindings
from discover.loop.fitted_range import as_measured, by_temperature, described
from discover.loop.runs import RunRecord

MOST_NAMES = 3

EXPLAINED = ("effects_added", "no_effect_needed")

_EVEN = 0.5
_MUCH_FASTER = 10.0  # Rate over the fastest at which there was no signal, to measure at next


def several(names: Sequence[str]) -> str:
    """Return the first of several names, and how many more there are."""
    shown = list(names[:MOST_NAMES])
    if more := len(names) - len(shown):
        shown.append(f"{more} more")
    return " and ".join(shown)


def untested_by(result: LoopFindings) -> str:
    """Return why no run could have refuted what fits the runs; empty where one could."""
    return str(result.remaining.get("untested") or "") if result.verdict in EXPLAINED else ""


def suspected(result: LoopFindings) -> list[Any]:
    """Return the effects that are no part of the fluid, those with a size and the surest first."""
    own = [stage for stage in result.stages if stage.kind != "constitutive"]

    def order(stage: Any) -> tuple[bool, float]:
        ends = next((one.ci95 for one in stage.parameters.values()), None) or (1.0, 1.0)
        return ends[0] * ends[1] <= 0.0, -stage.evidence  # those that may be zero come last

    return sorted(own, key=order)


def doubted(result: LoopFindings) -> float | None:
    """Return the probability of what was added, where that is less than even; None otherwise.

    Effects each of which is likelier there than not are not doubted, however many others may stand
    with them.
    """
    if result.verdict != "effects_added":
        return None
    told, names = result.explanations, [stage.effect for stage in result.stages]
    own = told.holding(names)
    if own is None or own.probability >= _EVEN:
        return None
    if all(told.inclusion.get(name, 0.0) >= _EVEN for name in names):
        return None
    return own.probability


def what_to_measure_next(result: LoopFindings) -> str:
    """Return what would say most: more signal, a check of an effect, another test."""
    if result.verdict == "no_signal":
        # stress of a fluid that thins grows less than its rate
        faster = as_measured(result.records, _MUCH_FASTER * max(r.fastest for r in result.records))
        return (
            "Check that the sensor is connected and the sample loaded; use a larger plate or cone, "
            f"a more sensitive transducer, or a shear rate of {faster} or more."
        )
    if result.material is not None:
        return result.stages[0].check
    untested = untested_by(result)
    if untested == "states":
        return A_TRANSIENT
    if result.remaining.get("oil_twin"):
        return f"Measure N1, or {_as_clause(make_effect('rate_rise_time').check)}."
    if told := _telling_test(result):
        return told
    if told := _of_sweep(result):
        return told
    if untested:
        return "Fit another run, or hold one out: at another rate, or of another test."
    if told := next((_CHECKS[one.slot] for one in result.free_form if one.in_answer), ""):
        return told.format(**_extreme(result))
    if told := _of_unfitted(result):
        return told
    if result.verdict == "unexplained":
        if own := suspected(result):  # of the instrument
            return f"To confirm {words.effect_title(own[0].effect)}, {_as_clause(own[0].check)}."
        fitted = [record for record in result.records if not record.held_out]
        if len({one.temperature_C for one in fitted} - {None}) > 1 and not by_temperature(fitted):
            return "Fit runs of one temperature, or shift their times to one (clock_factor)."
        return _of_another_stress(result) or _by_geometry(result)
    # the stage to confirm first: one with aliases before one without
    with_aliases = [stage for stage in result.stages if stage.aliases]
    doubtful = next(iter([*with_aliases, *result.stages]), None)
    if (doubtful is None or not doubtful.aliases) and (told := _of_predicted_n1(result)):
        return told
    if doubtful is None:
        return f"Measure at twice {_fastest(result.records)}: it tests the model hardest."
    check, title = _as_clause(doubtful.check), words.effect_title(doubtful.effect)
    if not doubtful.aliases:
        return f"To confirm {title}, {check}."
    others = several([*map(words.effect_title, doubtful.aliases)])
    return f"To distinguish {title} from {others}, {check}."


_CHECKS = {
    "recorded_stress": "Repeat {strongest} with a smaller plate or cone.",
    "drift": "Record the stress before the flow starts and after it ends.",
    "response": "Repeat {fastest} at a tenth of its rate.",
    "slip": "Repeat {strongest} with another gap.",
}


def _extreme(result: LoopFindings) -> dict[str, str]:
    """Return the fitted runs of the largest stress and of the largest rate, in words."""
    own = [r for r in result.records if not r.held_out and r.quantity not in ("N1", "N2")]
    strongest = max(own, key=lambda one: float(abs(one.measured).max()))
    fastest = max(own, key=lambda one: one.fastest)
    return {"strongest": described(strongest), "fastest": described(fastest)}


def _of_sweep(result: LoopFindings) -> str:
    """Return that the sweep is to be repeated where the runs have other moduli or times."""
    for name, one in result.declared_parameters.items():
        if name in OF_SWEEP and not one.is_open and differ(one.ci95, result.tolerance):
            are = f"{OF_SWEEP[name]} are {span(one.ci95)} ×"
            return f"Measure sweep and runs on one loading: the runs' {are} the sweep's."
    return ""


def _of_unfitted(result: LoopFindings) -> str:
    """Return what was measured besides, not fitted and missed; empty where nothing."""
    for kind in ("uniaxial", "N1"):
        found = measured(result, kind)
        fitted = any(kind in (r.flow, r.quantity) and not r.held_out for r in result.records)
        if found is not None and (found.inside or 0.0) > result.tolerance and not fitted:
            first = f"Fit {SYMBOLS[kind]}, corrected for {found.uncorrected}."
            return first if found.uncorrected else f"Fit the recorded {SYMBOLS[kind]} too."
    return ""


def _fastest(records: Sequence[RunRecord]) -> str:
    """Return the rate of the fastest run as it was measured, with its temperature if shifted."""
    return as_measured(records) if records else "that of the fastest run"


def _as_clause(check: str) -> str:
    """Return the check of an effect as it goes on in a sentence; N2 keeps its capital."""
    check = check.rstrip(". ")
    return check if check[1:2].isdigit() else check[:1].lower() + check[1:]


def _of_another_stress(result: LoopFindings) -> str:
    """Return the stress that laws differ in which fit as well; empty where none is open.

    And where they miss what was measured by more than tolerance and noise: it then comes first.
    """
    missed = with_unseen(result)
    if missed is not None and missed.size > max(result.tolerance, result.noise_floor):
        return ""
    for kind, title in _OTHERS.items():
        apart = differing(result, kind)
        if apart is None or not result.tolerance < apart <= MUCH:
            continue
        if measured(result, kind) is None and _is_in_reach(result, kind):
            apart_by = f"equally good laws differ by {words.percent_of(apart)}"
            return f"{title} at {_fastest(_sheared(result))}: {apart_by}."
    return ""


def _of_predicted_n1(result: LoopFindings) -> str:
    """Return that N1 tests a law which predicts it; empty where it does not, or no one can."""
    fitted = any(record.quantity == "N1" for record in result.records)
    if fitted or not normal_stress_settled(result) or not _is_in_reach(result, "N1"):
        return ""
    if any(record.has_normal_stress for record in result.records):
        return "Fit N1 too, which runs recorded: the law predicts it, and observe leaves it out."
    found = result.spread_of_laws["N1"].steady
    what = "" if found is None else f": the law predicts {words.significant(found, 2)} Pa"
    return f"Measure N1 in steady shear at {_fastest(_sheared(result))}{what}."


def _sheared(result: LoopFindings) -> list[RunRecord]:
    return [r for r in result.records if r.flow == "shear" and not r.held_out]


def _is_in_reach(result: LoopFindings, kind: str) -> bool:
    """Return whether a stress can be measured, at the fastest fitted rate."""
    if not (shear := _sheared(result)):
        return False
    rate = max(record.unshifted.fastest for record in shear)
    stress = result.spread_of_laws[kind].stress
    if kind == "N1":
        return stress is None or stress >= _LEAST_NORMAL_STRESS
    thick = stress is None or stress >= _LEAST_TENSILE_VISCOSITY * rate
    return thick and rate <= _FASTEST_EXTENSION


# Extension rate in 1/s that rheometers do not exceed [Sentmanat 2004, Rheol. Acta 43, 657].
_FASTEST_EXTENSION = 30.0
# Tensile stress over rate in Pa s below which a strip does not keep its shape until it is drawn:
# instruments for extension at a given rate take melts   [Sentmanat 2004]
_LEAST_TENSILE_VISCOSITY = 1e3
# N1 in Pa below which no rheometer tells it: axial transducers resolve some 1e-3 N, and N1 is
# 2F/(πR²) on a cone of R = 25 mm   [Macosko 1994, Rheology, ch. 8].
_LEAST_NORMAL_STRESS = 1.0
# Stresses that tell laws apart which agree in σ12, the easier measurement first
_OTHERS = {"N1": "Measure N1", "uniaxial": "Measure uniaxial extension"}


def _by_geometry(result: LoopFindings) -> str:
    """Return which run to repeat where nothing says whether instrument or fluid is amiss.

    The fitted one that is missed most, by its own size.
    """
    by_run = {} if result.discrepancy is None else result.discrepancy.by_run
    own = _sheared(result) or [record for record in result.records if not record.held_out]
    sizes = {record.name: by_run.get(record.name, float(record.errors[-1])) for record in own}
    worst = max(own, key=lambda record: sizes[record.name], default=None)
    run = "one run" if worst is None else described(worst)
    return f"Repeat {run} with another gap to separate instrument from model error."


def _telling_test(result: LoopFindings) -> str:
    """Return the test that distinguishes the likeliest explanation from others; empty if none."""
    following = result.next_tests
    best = following.best
    if best is None:
        return ""
    titles = [words.effects_title(effects) for effects in following.explanations]
    first, *_ = best.pairs
    chosen = first[0]
    others = several([titles[j] for i, j in best.pairs if i == chosen])
    what = f" ({words.FIGURE_SYMBOLS[best.quantity]})" if best.quantity != "sigma12" else ""
    title = f"{best.title[:1].upper()}{best.title[1:]}"
    if any(record.shift != 1.0 for record in result.records):
        title += f", reduced to {reduced_to(result.temperature_C)}"
    return f"{title}{what}: it should distinguish {titles[chosen]} from {others}."
