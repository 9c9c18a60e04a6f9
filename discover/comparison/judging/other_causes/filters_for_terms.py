"""Terms in whose place a filter of the instrument describes the fitted runs as well.

A mean over a few samples, or a short lag, leaves little of which a test of the residual can say
that it is no noise, and still more than nothing: a small term of the library takes it up. Then the
law without this term and the filter are as good an explanation, and what is said of the fluid has
to hold with either, as it has where a term amounts to another declared constant.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from jaxtyping import Float

from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.other_causes.either_law import bands_of_either, intervals_of_either
from discover.comparison.judging.other_causes.late_answers import ADVICE, does, tells
from discover.comparison.outcomes.flows import Flow, predict
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.rivals.bands import PredictionBand
from discover.inference.evidence import WINDOW
from discover.learners import RecoveredTerm
from discover.statistics.reading.late_answers import Filtered, Response, best_filter
from discover.statistics.residual import fast_part
from discover.study.declared_model import DeclaredModel

_WEAK = 6.0
"""Half-widths of its interval up to which a term may stand for a filter that nothing else shows."""

_MOST = 6  # weak terms whose sets are all tried


@dataclass(frozen=True)
class FilterForTerms:
    """A filter that does as well as some terms of a law.

    Attributes
    ----------
    terms
        Which, by their spelling.
    filtered
        The filter.
    coefficients
        Of the law with the filter, in the order of its terms; zero of those in whose place it is.
    predictions
        Of this law in each flow, by its key; None where it runs away.
    """

    terms: tuple[str, ...]
    filtered: Filtered
    coefficients: Float[np.ndarray, " terms"]
    predictions: Mapping[str, Mapping[str, np.ndarray] | None]

    @property
    def said(self) -> str:
        """What is to be known of it, in words."""
        one = len(self.terms) == 1
        return (
            f"{', '.join(self.terms)} may be no {'term' if one else 'terms'} of the fluid: without "
            f"{'it' if one else 'them'} the runs are described as well if the instrument "
            f"{does(self.filtered.kind, self.filtered.time)}. Intervals and bands hold either; "
            f"{ADVICE}"
        )


def filter_for_terms(
    chosen: LearnerOutcome, model: DeclaredModel, flows: Sequence[Flow]
) -> FilterForTerms | None:
    """Return the filter that describes the fitted runs as well as weak terms do; None if none does.

    To first order in the coefficients. As well means not less probable than the law found by more
    than Occam's window, a time for a term; and the filter has to be needed without the terms.

    Parameters
    ----------
    chosen
        What the sparse learner found, which explains the runs.
    model
        The known part.
    flows
        In which its law is simulated; the fitted ones from rest at a given rate say something.
    """
    weak = [i for i, term in enumerate(chosen.terms) if _weak(term)]
    training = [flow for flow in flows if flow.kind == "training"]
    if not weak or len(weak) > _MOST or not all(tells(flow) for flow in training):
        return None
    law = MovedLaw.of(chosen.terms, model)
    start = law.start
    told = [_response(law, flow) for flow in training]
    runs = [one for one in told if one is not None]
    if not runs or len(runs) < len(told):
        return None
    noise = [fast_part(run.residual) for run in runs]
    full = best_filter(runs, noise) if all(noise) else None
    if full is None:
        return None
    window, samples = float(np.log(WINDOW)), sum(len(run.times) for run in runs)
    best: tuple[float, tuple[int, ...], Filtered] | None = None
    for size in range(1, len(weak) + 1):
        for out in combinations(weak, size):
            found = best_filter([_left_out(run, start, out) for run in runs], noise)
            if found is None or found.gain < window:
                continue
            # one constant more than the law without the terms has
            behind = 0.5 * (found.after - full.before) * found.worth
            behind -= 0.5 * (size - 1) * float(np.log(samples * found.worth))
            if behind <= window and (best is None or behind < best[0]):
                best = behind, out, found
    if best is None:
        return None
    _, out, found = best
    kept = [i for i in range(len(start)) if i not in out]
    values = np.zeros_like(start)
    values[kept] = start[kept] + found.steps
    fluid = law.fluid(values)
    predictions = {
        flow.key: predict(fluid, flow) for flow in flows if flow.key in chosen.predictions
    }
    names = tuple(chosen.terms[i].term for i in out)
    return FilterForTerms(names, found, values, predictions)


def holding_filters(
    outcomes: Mapping[str, LearnerOutcome],
    bands: Mapping[str, PredictionBand],
    chosen: LearnerOutcome,
    model: DeclaredModel,
    flows: Sequence[Flow],
) -> tuple[dict[str, LearnerOutcome], dict[str, PredictionBand], tuple[str, ...]]:
    """Return outcomes and bands that hold a filter in place of terms too, and what is to be known.

    Parameters
    ----------
    outcomes
        By learner, of which the sparse law's intervals may get wider.
    bands
        Of its law, by the key of the flow.
    chosen, model, flows
        As in `filter_for_terms`.
    """
    found = filter_for_terms(chosen, model, flows)
    if found is None:
        return dict(outcomes), dict(bands), ()
    wider = intervals_of_either(outcomes, found.coefficients, found.terms)
    return wider, bands_of_either(bands, found.predictions), (found.said,)


def _weak(term: RecoveredTerm) -> bool:
    if term.ci95 is None:
        return False
    half = 0.5 * (term.ci95[1] - term.ci95[0])
    return bool(abs(term.coefficient) < _WEAK * half)


def _response(law: MovedLaw, flow: Flow) -> Response | None:
    """Return a run as the law predicts it, one column for each coefficient; None if not."""
    told = law.derivatives(flow)
    if told is None or flow.measured is None:
        return None
    predicted, slopes = told
    residual = predicted[:, 0] - np.asarray(flow.measured, dtype=float)
    times = np.asarray(flow.times, dtype=float)
    return Response(times, predicted[:, 0], residual, slopes[..., 0])


def _left_out(run: Response, start: np.ndarray, out: Sequence[int]) -> Response:
    """Return the same of the law without some of its terms."""
    change = -np.asarray(start)[list(out)] @ run.columns[list(out)]
    return Response(
        run.times,
        run.predicted + change,
        run.residual + change,
        np.delete(run.columns, list(out), axis=0),
    )
