"""What a comparison found: whether a law explains the data, its terms and constants."""

import numpy as np

from discover.comparison.comparison import Comparison
from discover.comparison.fitting.law_by_mode import LawByMode
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.statements import no_flow_left, only_states
from discover.comparison.outcomes.constant import in_words
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.exact.relations import spell_briefly
from discover.report.comparison.asked import law_of
from discover.report.plots.by_mode import by_mode_in_brief
from discover.report.wording import (
    estimate,
    interval,
    percent,
    readable,
    sentence,
    significant,
    terms_text,
)
from discover.statistics import LackOfFit
from discover.statistics.residual import STRUCTURE
from discover.words import listed

CORRELATED = 0.3
"""A correlation of neighbours that is worth its number in a sentence."""


def what_was_found(comparison: Comparison) -> str:
    """Return whether a law explains the data, and what each learner found."""
    explanation = comparison.explanation
    if explanation.verdict == "no_signal":
        return (
            "No signal: the records hold nothing that a law could be told from, so no law is "
            "reported as found."
        )
    parts = [_how_it_stands(comparison)]
    for name, one in explanation.lack_of_fit.items():
        if one.verdict != "explained":
            parts.append(f"{law_of(name)} leaves {_left(one)}")
    if (sparse := comparison.outcomes.get("tensor_sindy")) is not None:
        parts += _by_regression(comparison, sparse)
    if comparison.by_mode is not None and comparison.by_mode.rivals_sparse:
        parts.append(_by_mode(comparison, comparison.by_mode))
    network = comparison.outcomes.get("tbnn_ude")
    if network is not None and "tbnn_ude" in explanation.by:
        parts.append(_by_network(network))
    return sentence([*parts, *_where_usable(comparison)])


def _how_it_stands(comparison: Comparison) -> str:
    """Return the verdict in words, and whether anything tested it."""
    explanation = comparison.explanation
    if explanation.verdict != "explained":
        many = len(explanation.lack_of_fit) > 1
        which = "neither law explains" if many else "the law does not explain"
        return f"unexplained: {which} the data"
    names = " and ".join(law_of(name) for name in explanation.by)
    end = "s" if len(explanation.by) == 1 else ""
    sparse = comparison.outcomes.get("tensor_sindy")
    n_terms = len(sparse.terms) if sparse is not None and explanation.in_library else 0
    unasked = no_flow_left(comparison.flows, n_terms) and not comparison.judged
    if unasked or only_states(comparison.flows):
        return f"fitted, not tested: {names} fit{end} what was measured, and {_rests(explanation)}"
    return f"explained: {names} explain{end} the data, and {_rests(explanation)}"


def _by_regression(comparison: Comparison, sparse: LearnerOutcome) -> list[str]:
    """Return the terms and constants that were found, or why they are no finding."""
    if comparison.explanation.in_library:
        # a term that is a wrong declaration in other words is no finding beside the law
        beside = [readable(s.brief) for s in comparison.statements if s.brief]
        return [_terms_found(comparison, sparse), *beside, *_constants_found(sparse)]
    n = len(sparse.terms)
    if not n:
        return ["sparse regression found no term that helps"]
    if n == 1:
        return ["sparse regression's term describes the data and is no finding"]
    return [f"sparse regression's {n} terms describe the data and are no finding"]


def _by_network(network: LearnerOutcome) -> str:
    """Return the largest term of the network in words of the library."""
    if not network.terms:
        return "projected onto the library, the neural network has no term"
    largest = max(network.terms, key=lambda t: abs(t.coefficient))
    return (
        "projected onto the library, the neural network's largest term is "
        f"{significant(largest.coefficient)} {readable(largest.term)}{_of_projection(network)}"
    )


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
            f"what {law_of(name)} leaves ({percent(one.misfit)}) {one.rest}"
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
            law = law_of(name)
            parts.append(f"{law}, {' and '.join(why)}, is for the fitted range only")
    return parts


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
        if len(rival.law.coefficients) <= len(own) and {*rival.law.coefficients} != own
    ]
    if not alike:
        return ""
    if len(alike) == 1:
        return f", or {readable(spell_briefly(alike[0].law.coefficients))}, which fits as well"
    return f", or one of {len(alike)} other laws as simple, which fit as well"


def _constants_found(sparse: LearnerOutcome) -> list[str]:
    said = []
    for constant in sparse.constants.values():
        name = in_words(constant.name, one_mode=bool(constant.unit))
        text = f"{name} is {estimate(constant.value, constant.ci95)}"
        text += f" {constant.unit}" if constant.unit else ""
        said.append(f"{text} (95 % interval {interval(constant.ci95)})")
    return [f"fitted along with it, {' and '.join(said)}"] if said else []
