"""The verdict on a comparison: what was found, how sure, what to measure next."""

from collections.abc import Sequence

import numpy as np

from discover.comparison.comparison import Comparison
from discover.comparison.fitting.law_by_mode import LawByMode
from discover.comparison.fitting.sampled_rates import coarse_rates_of
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.identifiability import SEPARATED
from discover.comparison.judging.next_measurement import NextMeasurement
from discover.comparison.judging.statements import no_flow_left, only_states
from discover.comparison.outcomes.constant import in_words
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.dataset.coarse_rates import MORE_SAMPLES, CoarseRates
from discover.identify.exact.relations import spell_briefly
from discover.protocols.kinematics import in_words as quantities_in_words
from discover.report.plots.by_mode import by_mode_in_brief
from discover.report.wording import (
    A_TRANSIENT,
    SYMBOLS,
    estimate,
    interval,
    learner_as_subject,
    percent,
    readable,
    sentence,
    significant,
    terms_text,
    worst,
)
from discover.statistics import LackOfFit
from discover.statistics.residual import STRUCTURE
from discover.words import listed

CORRELATED = 0.3
"""A correlation of neighbours that is worth its number in a sentence."""


def comparison_verdict(comparison: Comparison) -> list[str]:
    """Return the verdict on a comparison: an answer to each of `QUESTIONS`, in order."""
    return [_found(comparison), _how_sure(comparison), _next(comparison)]


def _found(comparison: Comparison) -> str:
    explanation = comparison.explanation
    if explanation.verdict == "no_signal":
        return (
            "No signal: the records hold nothing that a law could be told from, so no law is "
            "reported as found."
        )
    left = explanation.lack_of_fit
    sparse = comparison.outcomes.get("tensor_sindy")
    network = comparison.outcomes.get("tbnn_ude")
    parts = []
    if explanation.verdict == "explained":
        names = " and ".join(_law_of(name) for name in explanation.by)
        one = len(explanation.by) == 1
        n_terms = len(sparse.terms) if sparse is not None and explanation.in_library else 0
        unasked = no_flow_left(comparison.flows, n_terms) and not comparison.judged
        if unasked or only_states(comparison.flows):
            verb = "fits" if one else "fit"
            parts.append(
                f"fitted, not tested: {names} {verb} what was measured, and {_rests(explanation)}"
            )
        else:
            verb = "explains" if one else "explain"
            parts.append(f"explained: {names} {verb} the data, and {_rests(explanation)}")
    else:
        several = "neither law explains" if len(left) > 1 else "the law does not explain"
        parts.append(f"unexplained: {several} the data")
    for name, one in left.items():
        if one.verdict != "explained":
            parts.append(f"{_law_of(name)} leaves {_left(one)}")
    if sparse is not None and explanation.in_library:
        parts.append(_terms_found(comparison, sparse))
        # a term that is a wrong declaration in other words is no finding beside the law
        parts += [readable(s.brief) for s in comparison.statements if s.brief]
        parts += _constants_found(sparse)
    elif sparse is not None and not sparse.terms:
        parts.append("sparse regression found no term that helps")
    elif sparse is not None:
        n = len(sparse.terms)
        parts.append(
            f"sparse regression's {n} terms describe the data and are no finding"
            if n > 1
            else "sparse regression's term describes the data and is no finding"
        )
    if comparison.by_mode is not None and comparison.by_mode.rivals_sparse:
        parts.append(_by_mode(comparison, comparison.by_mode))
    if network is not None and network.terms and "tbnn_ude" in explanation.by:
        largest = max(network.terms, key=lambda t: abs(t.coefficient))
        parts.append(
            f"projected onto the library, the neural network's largest term is "
            f"{significant(largest.coefficient)} {readable(largest.term)}{_of_projection(network)}"
        )
    elif network is not None and "tbnn_ude" in explanation.by:
        parts.append("projected onto the library, the neural network has no term")
    return sentence([*parts, *_where_usable(comparison)])


def _by_mode(comparison: Comparison, law: LawByMode) -> str:
    """Return what constants that differ from mode to mode make of the data."""
    constants = ", ".join(by_mode_in_brief(name, one) for name, one in law.constants.items())
    which = (
        f"a law whose constants differ from mode to mode ({constants}; {law.n_constants} constants)"
    )
    if law.refuted:
        return (
            f"{which} leaves {percent(law.left.misfit)} and is not the fluid's: {law.left.reason}"
        )
    left = f"{percent(law.left.misfit)}, which {'is noise' if law.explains else 'is not noise'}"
    missed = [error for error in law.errors.values() if error is not None]
    if len(missed) < len(law.errors):
        unseen = ", and runs away in a run held out"
    else:
        unseen = (
            f", and misses runs held out by {percent(float(np.mean(missed)))}" if missed else ""
        )
        normal = [one for row in comparison.errors_by_mode().values() if (one := row.get("N1"))]
        unseen += f", their N1 by up to {percent(max(normal))}" if normal else ""
    return f"{which} leaves {left}{unseen}"


def _rests(explanation: Explanation) -> str:
    """Return what the laws that explain the data leave of them."""
    told = [explanation.lack_of_fit[name] for name in explanation.by]
    if len({one.rest for one in told}) > 1:
        each = [
            f"what {_law_of(name)} leaves ({percent(one.misfit)}) {one.rest}"
            for name, one in zip(explanation.by, told, strict=True)
        ]
        return listed(each)
    left = "what is left" if len(told) == 1 else "what each leaves"
    return f"{left} ({' and '.join(percent(one.misfit) for one in told)}) {told[0].rest}"


def _of_projection(network: LearnerOutcome) -> str:
    """Return how well the words describe the network; empty where nobody asked."""
    missed = network.details.get("projection_misfit")
    if missed is None:
        return ""
    n = len(network.terms)
    return (
        f" (its {n} term{'s' if n > 1 else ''} miss{'' if n > 1 else 'es'} {percent(missed)} of it)"
    )


_LIMITS = {
    "conformation tensor positive definite": "whose conformation tensor loses positive "
    "definiteness in {where}",
    "integrates beyond training": "whose stress runs away in {where}",
}


def _where_usable(comparison: Comparison) -> list[str]:
    """Return which laws are good for nothing beyond the fitted runs, and why."""
    parts = []
    for name in comparison.outcomes:
        checks = (comparison.physics.get(name) or {}).get("checks", ())
        failed = {c["name"]: c for c in checks if c["passed"] is False}
        why = [text.format(**failed[check]) for check, text in _LIMITS.items() if check in failed]
        if why:
            law = _law_of(name)
            parts.append(f"{law}, {' and '.join(why)}, is for the fitted range only")
    return parts


def _law_of(learner: str) -> str:
    return f"{_within(learner)}'s law"


def _within(learner: str) -> str:
    """Return a learner as it stands within a sentence."""
    name = learner_as_subject(learner)
    return name[:1].lower() + name[1:]


def _left(one: LackOfFit) -> str:
    """Return what a law leaves of the data, in words."""
    if not np.isfinite(one.misfit):
        return f"everything, for {one.reason}"
    noise = f"where noise is {percent(one.noise)}"
    if one.noise_unsure:
        noise = f"of which {percent(one.noise)} changes from sample to sample, as noise does"
    text = f"{percent(one.misfit)}, {noise}"
    if one.lag_one_correlation > CORRELATED:
        text += f", with neighbouring samples correlated to {one.lag_one_correlation:.2g}"
    elif one.misfit <= STRUCTURE * one.noise:
        # else it would seem that nothing is missing
        text += f", but {one.reason}"
    return f"{text}; {one.likeness}" if one.likeness else text


_MOST_TERMS = 4
"""More are a table and no sentence."""


def _terms_found(comparison: Comparison, sparse: LearnerOutcome) -> str:
    text = f"if the law is in the library, it is {terms_text(sparse)}"
    if len(sparse.terms) > _MOST_TERMS:
        text = f"if the law is in the library, it has {len(sparse.terms)} terms (Laws found)"
    text += _or_another(comparison, sparse)
    if comparison.truth is None:
        return text
    wanted = {t.term for t in comparison.truth}
    found = {t.term for t in sparse.terms}
    if found == wanted:
        return f"{text}, exactly the terms of the law that made the data"
    missing = ", ".join(map(readable, sorted(wanted - found))) or "none"
    extra = ", ".join(map(readable, sorted(found - wanted))) or "none"
    return (
        f"{text} (terms of the law that made the data not found: {missing}, superfluous: {extra})"
    )


def _or_another(comparison: Comparison, sparse: LearnerOutcome) -> str:
    """Return that laws of the library as simple as the one found fit too; empty if none does."""
    own = {term.term for term in sparse.terms}
    alike = [
        rival
        for rival in comparison.rivals
        if len(rival.terms) <= len(own) and {*rival.terms} != own
    ]
    if not alike:
        return ""
    if len(alike) == 1:
        return f", or {readable(spell_briefly(alike[0].terms))}, which fits as well"
    return f", or one of {len(alike)} other laws as simple, which fit as well"


def _constants_found(sparse: LearnerOutcome) -> list[str]:
    said = []
    for constant in sparse.constants.values():
        name = in_words(constant.name, one_mode=bool(constant.unit))
        text = f"{name} is {estimate(constant.value, constant.ci95)}"
        text += f" {constant.unit}" if constant.unit else ""
        said.append(f"{text} (95 % interval {interval(constant.ci95)})")
    return [f"fitted along with it, {' and '.join(said)}"] if said else []


def _how_sure(comparison: Comparison) -> str:
    if comparison.verdict == "no_signal":
        return "Nothing is determined by these data: neither a law nor N1 nor N2."
    parts = [part for name in comparison.outcomes for part in _unseen(comparison, name)]
    if not parts:
        parts.append("nothing was held out, so no prediction was put to the test")
    if (coarse := _coarse(comparison)) is not None:
        parts.append(coarse.sentence.rstrip("."))
    parts += _determined(comparison)
    for name, report in comparison.physics.items():
        failed = [c["name"] for c in (report or {}).get("checks", ()) if c["passed"] is False]
        if failed:
            parts.append(
                f"{_within(name)}'s law fails {len(failed)} of the checks of physical "
                f"soundness ({', '.join(failed)})"
            )
    parts += _noise_from(comparison)
    return " ".join(sentence([part]) for part in parts)


def _room(comparison: Comparison) -> list[str]:
    """Return how far N1 and N2 move between laws that describe σ12 about as well."""
    open_ = [s.quantity for s in comparison.statements if s.undetermined]
    said = [
        f"{name} differs by up to {percent(size)}{' of N1' if name == 'N2' else ''}"
        for name, size in comparison.room_left.items()
        if name in open_ and size >= SEPARATED
    ]
    which = "between laws on this page that describe σ12 about as well"
    return [f"{which}, {' and '.join(said)}"] if said else []


def _noise_from(comparison: Comparison) -> list[str]:
    """Return what is taken for error of the records, and where that is known from."""
    told = comparison.explanation
    if comparison.noise is not None or told.noise_given or not told.lack_of_fit:
        return []
    changing = [one.changing for one in told.lack_of_fit.values() if one.changing is not None]
    parts = [f"{percent(min(changing))} from sample to sample"] if changing else []
    if told.sweep_error > 0.0:
        parts.append(f"{percent(told.sweep_error)} that the modes miss their own sweep by")
    if told.repeats is not None:
        parts.append(f"{percent(told.repeats.error)} that repeated runs differ by")
    return [f"nobody told the noise; taken for error is {listed(parts)}"] if parts else []


def _coarse(comparison: Comparison) -> CoarseRates | None:
    """Return what rates read in too few samples leave open of the first law that they do."""
    for name, outcome in comparison.outcomes.items():
        coarse = coarse_rates_of(outcome)
        # intervals of a law that explains nothing are no claim, whatever moves them
        if coarse is not None and (coarse.shows or name in comparison.explanation.by):
            return coarse
    return None


def _unseen(comparison: Comparison, name: str) -> list[str]:
    """Return what becomes of a law in flows that no fit saw, inside the fitted range and beyond."""
    predictions = comparison.outcomes[name].predictions
    inside = [flow for flow in comparison.judged if comparison.placement(flow).inside]
    beyond = [flow for flow in comparison.judged if not comparison.placement(flow).inside]
    parts, runaway = [], []
    for flows, where in ((inside, "inside the fitted range"), (beyond, "beyond the fitted range")):
        lost = [flow.title for flow in flows if predictions[flow.key] is None]
        runaway += [f"{listed(lost)}, {where}"] if lost else []
        errors = {flow.name: comparison.errors(name, flow) for flow in flows}
        recorded = quantities_in_words(flow.protocol.quantity for flow in flows)
        said = [
            f"{symbol} by up to {percent(value)}"
            f"{_without_outliers(comparison, name, flows) if quantity == 'sigma12' else ''}"
            for symbol, quantity in ((recorded, "sigma12"), ("N1", "N1"), ("N2", "N2 (of N1)"))
            if (value := worst(errors, quantity.split()[0])) is not None
        ]
        if said:
            parts.append(f"{listed(said)} {where}")
    law = _within(name)
    told = [f"in flows that no fit saw, {law} misses {', and '.join(parts)}"]
    return (told if parts else []) + (
        [f"{law}'s stress runs away in {', and in '.join(runaway)}"] if runaway else []
    )


def _without_outliers(comparison: Comparison, name: str, flows: Sequence[Flow]) -> str:
    """Return the largest error without the samples that do not judge; empty where all do."""
    count = sum(len(comparison.outliers(name, flow)) for flow in flows)
    if not count:
        return ""
    errors = []
    for flow in flows:
        error = comparison.error_without_outliers(name, flow)
        errors.append(comparison.errors(name, flow)["sigma12"] if error is None else error)
    which = "the outlier that does" if count == 1 else f"the {count} outliers that do"
    largest = percent(max((error for error in errors if error is not None), default=None))
    whole = percent(worst({flow.name: comparison.errors(name, flow) for flow in flows}, "sigma12"))
    return "" if largest == whole else f" ({largest} without {which} not count)"


def _open(comparison: Comparison) -> str:
    """Return the quantities that the data leave open, in words; empty if none."""
    return " and ".join(s.title for s in comparison.statements if s.undetermined and s.of_law)


def _determined(comparison: Comparison) -> list[str]:
    """Return what is said of N1, N2 and the coefficients."""
    parts = []
    names = _open(comparison)
    parts += _room(comparison)
    if "tensor_sindy" in comparison.outcomes and not comparison.explanation.in_library:
        by_mode = comparison.by_mode
        which = (
            "with the same constants in every mode"
            if by_mode is not None and by_mode.explains
            else "that was tried"
        )
        parts.append(
            f"since no law {which} explains the data, nothing is determined by them, "
            f"neither {names.replace(' and ', ' nor ')} nor any coefficient"
        )
        return parts
    if names:
        parts.append(
            f"not determined by these data: {names} (shown is the choice of the law that fits)"
        )
    if decided := [s.title for s in comparison.statements if not s.undetermined]:
        parts.append(
            f"{' and '.join(decided)} follow{'s' if len(decided) == 1 else ''} from σ12 only if "
            "the law is in the library"
        )
    return parts


def _next(comparison: Comparison) -> str:
    explanation = comparison.explanation
    if explanation.verdict == "no_signal":
        return (
            "Measure where the stress stands out of the noise: at higher rates, with a more "
            "sensitive transducer, or with a larger sample."
        )
    if _coarse(comparison) is not None:
        return MORE_SAMPLES
    if comparison.by_mode is not None and comparison.by_mode.explains:
        names = ", ".join(f'"{name}"' for name in comparison.by_mode.constants)
        return (
            "Have discover close-loop fit these constants too: [model] by_mode = "
            f"[{names}] gives their intervals, what else the runs show, and an export."
        )
    lacking = "tensor_sindy" in comparison.outcomes and not explanation.in_library
    if lacking or explanation.verdict == "unexplained":
        return (
            "Before measuring more, find what the law lacks: discover close-loop tries effects of "
            "the instrument and of the flow on the same runs, and [compare] library and max_terms "
            "allow more terms."
        )
    following = comparison.next_measurement
    if only_states(comparison.flows):
        return A_TRANSIENT
    if following.proposals:
        return _proposal(following)
    if not any(flow.in_shear for flow in comparison.flows_of("training")):
        return "Measure in shear: extension alone does not say what the fluid does there."
    if names := _open(comparison):
        return f"Measure {names}: nothing else decides between laws that give the same σ12."
    rates = [flow.largest_rate for flow in comparison.flows_of("training")]
    unit = "" if comparison.noise is not None else " 1/s"
    return (
        "No rival law is known, so what tests this one hardest is a flow unlike those fitted: "
        f"a shear rate above {significant(max(rates), 3)}{unit}."
    )


def _proposal(following: NextMeasurement) -> str:
    best = following.proposals[0]
    n_rivals = len(following.laws) - 1
    laws = "the one rival law" if n_rivals == 1 else f"the {n_rivals} rival laws"
    leave = f"{laws} that these data leave in the library"
    if not best.falling:
        return f"None of the experiments allowed is expected to rule out {leave}."
    what = " and ".join(SYMBOLS[name] for name in best.observed)
    fall = len(best.falling)
    outcome = leave if fall == n_rivals else f"{fall} of {leave}"
    return (
        f"Measure {what} in {best.experiment.title}: at {percent(following.noise)} noise it is "
        f"expected to rule out {outcome}."
    )
