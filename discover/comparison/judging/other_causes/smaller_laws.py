"""Laws of fewer terms that explain the runs as well on a bench that is a little off.

What a gap, a calibration, a clock or a bath that is a per cent off changes in all runs alike is
like no term of the library, but terms take it up: as one term more, or as quite other terms than
those of the fluid. Then the law of fewer terms is as good an explanation, and what is said of the
fluid has to hold with either (`discover.comparison.judging.other_causes.bench`).
"""

from collections.abc import Mapping, Sequence
from itertools import combinations

import numpy as np

from discover.comparison.judging.as_predicted import SPARSE
from discover.comparison.judging.explanation import Explanation
from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.other_causes.bench import WIDTH, Bench
from discover.comparison.judging.other_causes.bench_faults import OnBench
from discover.comparison.judging.other_causes.either_law import bands_within, intervals_of_other
from discover.comparison.judging.refutation import Refutation, hold_against
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from discover.inference.evidence import WINDOW
from tensor_library.law_terms import LawTerms

_MOST = 8  # terms of a law whose subsets are all weighed
_FITTED = 6  # of these, the likeliest to first order
_SLACK = 3.0  # of the log evidence, for what is to first order

_FARTHEST = 3.0 * WIDTH
"""Relative misfit that faults of a bench may account for."""

_ADVICE = (
    "check gap, calibration, temperature and the zero of the clock; a rate_gain, a stress_gain or "
    "a time_delay can be fitted along, under [model] effects"
)


def hold_against_smaller_laws(
    explanation: Explanation,
    outcomes: Mapping[str, LearnerOutcome],
    flows: Sequence[Flow],
    law: MovedLaw | None,
) -> Explanation:
    """Return what explains the runs better than other terms, and fewer, on a bench a little off.

    Parameters
    ----------
    explanation
        What explains the runs, those held out among them.
    outcomes
        By learner.
    flows
        Of which the fitted ones say something.
    law
        The sparse law, with the constants that were fitted along; None for none.
    """
    if law is None or SPARSE not in explanation.by:
        return explanation
    own = set(law.terms.coefficients)
    path = outcomes[SPARSE].details.get("path", ())
    farthest = float(np.hypot(explanation.lack_of_fit[SPARSE].misfit, _FARTHEST))
    others = [
        LawTerms.from_json(one).coefficients
        for one in path
        if 0 < len(one["support"]) < len(own)
        and not own.issuperset(one["support"])
        and one["misfit"] <= farthest
    ]
    bench, fit = _on_bench(law, flows, others) if others else (None, None)
    if bench is None or fit is None:
        return explanation
    found = _as_good(bench, fit, others)
    if not found:
        return explanation
    reason = (
        f"another law of fewer terms, {found[0].text}, describes the records as well if "
        f"{found[0].faults.text}"
    )
    return hold_against(
        explanation, lambda name: Refutation(reason, _ADVICE) if name == SPARSE else None
    )


def holding_smaller_laws(
    outcomes: Mapping[str, LearnerOutcome],
    bands: Mapping[str, PredictionBand],
    law: MovedLaw,
    flows: Sequence[Flow],
) -> tuple[dict[str, LearnerOutcome], dict[str, PredictionBand], tuple[str, ...]]:
    """Return outcomes and bands that hold without some of the terms too, and what is to be known.

    Parameters
    ----------
    outcomes
        By learner, of which the sparse law's intervals may get wider.
    bands
        Of its law, by the key of the flow.
    law, flows
        As in `hold_against_smaller_laws`.
    """
    wider, held, terms = dict(outcomes), dict(bands), tuple(law.terms.coefficients)
    bench, fit = _on_bench(law, flows, ()) if 1 < len(terms) <= _MOST else (None, None)
    if bench is None or fit is None:
        return wider, held, ()
    found = _as_good(bench, fit, _worth_fitting(bench, fit, law.terms.coefficients))
    if not found:
        return wider, held, ()
    banded = [flow for flow in flows if flow.key in held]
    for one in found:
        wider = intervals_of_other(wider, one.coefficients)
        held = bands_within(held, bench.limits(one, banded))
    out = [term for term in terms if any(term not in one.coefficients for one in found)]
    said = (
        f"{', '.join(out)} may be no {'term' if len(out) == 1 else 'terms'} of the fluid: "
        f"{found[0].text} describes the runs as well if {found[0].faults.text}. Intervals and "
        f"bands hold either; {_ADVICE}."
    )
    return wider, held, (said,)


def _on_bench(
    law: MovedLaw, flows: Sequence[Flow], others: Sequence[Mapping[str, float]]
) -> tuple[Bench | None, OnBench | None]:
    """Return the bench for the law found and others, and the law found on it."""
    terms = list(dict.fromkeys(term for one in others for term in one))
    bench = Bench.of(law, terms, [flow for flow in flows if flow.kind == "training"])
    return bench, None if bench is None else bench.fit(law.terms.coefficients)


def _worth_fitting(
    bench: Bench, fit: OnBench, terms: Mapping[str, float]
) -> list[dict[str, float]]:
    """Return the laws of fewer terms that may be as probable, to first order about the law found.

    By Wald's test of the coefficients that are left out, beside all that is off on the bench.
    """
    names = list(fit.coefficients)
    values = np.array([fit.coefficients[name][0] for name in names])
    covariance = (fit.root.T @ fit.root)[: len(names), : len(names)]
    saved = 0.5 * float(np.log(bench.samples))
    found = []
    for size in range(1, len(names)):
        for out in combinations(range(len(names)), size):
            gone = values[list(out)]
            own = covariance[np.ix_(out, out)]
            behind = 0.5 * float(gone @ np.linalg.pinv(own) @ gone) - size * saved
            if behind <= np.log(WINDOW) + _SLACK:
                found.append((behind, out))
    return [
        {name: terms[name] for i, name in enumerate(names) if i not in out}
        for _, out in sorted(found)[:_FITTED]
    ]


def _as_good(bench: Bench, own: OnBench, others: Sequence[Mapping[str, float]]) -> list[OnBench]:
    """Return which laws are no less probable than the law found by more than Occam's window.

    All of them on a bench that may be off, the likeliest first.
    """
    found = [one for start in others if (one := bench.fit(start)) is not None]
    good = [one for one in found if one.cost - own.cost <= np.log(WINDOW)]
    return sorted(good, key=lambda one: one.cost)
