"""Which law heads the answer where none is all there is: one with a name, if it predicts as well.

Fitted runs that are left out in turn say by how much each law misses a run that it did not see. A
sum of effects that the field has no name for leads laws with a name only where it misses less than
they do by more than so few runs can scatter.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import islice

import numpy as np
from jaxtyping import Float

from discover.answer.naming import ByMode, named_law
from discover.equations import Equation, StatePart
from discover.errors import InputError
from discover.inference import Posterior
from discover.inference.discrepancy import DiscrepancyModel
from discover.inference.fit import Fit
from discover.inference.left_out import FEWEST_RUNS, left_out, weights_of
from discover.inference.posterior import smallest
from discover.laws import Fluid
from discover.loop.expected_errors import steady_shear
from discover.loop.final_model import augmented_fluid, states_of
from discover.loop.parts import STRUCTURES, NearestLaw, StageParameter
from discover.processor import in_one_thread
from discover.statistics.noise_model import rms
from discover.words import percent_of

_MOST = 8  # Laws of each kind with a name, the likeliest, that are fitted without each run
# Log of odds against the best down to which runs left out do not exclude a law
_AS_WELL = float(np.log(0.05))


@in_one_thread
def with_named_law_first(posterior: Posterior) -> Posterior:
    """Return the posterior with a law of the field ahead, where it predicts runs left out as well.

    Probabilities and the verdict stay. The discrepancy is that of the law that comes first. Where
    none predicts as well, the best of them stands in `memory["named"]` as a `NearestLaw`.
    """
    fitter = posterior.search.fitter
    few = len(posterior.problem.fitted.runs) < FEWEST_RUNS
    if posterior.verdict != "unexplained" or posterior.left is None or few:
        return posterior
    known = posterior.predictive_mixture or ((posterior.left.fit, 1.0),)
    of_the_field = law_of, is_thixotropic_maxwell
    if any(has_name(posterior, known[0][0]) for has_name in of_the_field):
        return posterior
    leading = [fit for fit, _ in known]
    # the likeliest laws with a name are fitted to the end that the search gave up, as far behind
    search = posterior.search
    given_up = (f for f in search.found.values() if f.root is None and np.isfinite(f.log_posterior))
    some = sorted(given_up, key=lambda fit: -fit.log_posterior)
    laws = islice((fit for fit in some if law_of(posterior, fit)), _MOST)
    search.add([search.fitter.start(fit.names, fit.theta, fit.linear) for fit in laws])
    alive = posterior.search.ranked()
    classical, thixotropic = (
        list(islice((fit for fit in alive if has_name(posterior, fit)), _MOST))
        for has_name in of_the_field
    )
    named = [*classical, *thixotropic]
    some = [*leading, *(fit for fit in named if fit not in leading)]
    asked = [fit for fit in some if "missed" not in fit.memory]
    for fit, missed in zip(asked, left_out(fitter, asked), strict=True):
        fit.memory["missed"] = missed
    weights = weights_of(np.array([fit.memory["missed"] for fit in some]))
    at = first_of(weights, [fit in named for fit in some])
    if some[at] not in named:
        if classical:
            best = max(classical, key=lambda fit: weights[some.index(fit)])
            # not in the memory at hand, which posteriors share that another law may head
            memory = {**posterior.memory, "named": _nearest(posterior, best)}
            return replace(posterior, memory=memory)
        return posterior
    chosen = some[at]
    order = [at, *(i for i in np.argsort(-weights, kind="stable") if i != at)]
    return replace(
        posterior,
        left=DiscrepancyModel(fitter, chosen, smallest(posterior.search, chosen)),
        predictive_mixture=tuple((some[i], float(weights[i])) for i in order),
    )


def with_function_first(posterior: Posterior) -> Posterior:
    """Return the posterior with laws ahead that a function of the measurement makes the likeliest.

    Of a function of the fluid the law alone is none that one can use.
    """
    ahead = (one for one in posterior.curves if one.is_of_record and one.reliance > 0.0)
    curve = next(ahead, None)
    if posterior.verdict != "unexplained" or curve is None or not curve.fits[0][0].names:
        return posterior
    return replace(posterior, left=curve.left, predictive_mixture=curve.fits)


def _nearest(posterior: Posterior, fit: Fit) -> NearestLaw:
    """Return a hypothesis whose fluid is a law of the field, with intervals by its own fit.

    Of constants that were declared for each mode: their mean, and least and largest.
    """
    found, fluid = law_of(posterior, fit), _fluid(posterior, fit)
    assert found is not None
    name, values = found
    size = rms(posterior.missed(fit))
    equation = Equation.of_fluid(
        fluid,
        title=f"Best classical law of a closed loop: misses runs left out by {percent_of(size)}.",
    )
    constants = {}
    for key, modes in values.items():
        value, ends = float(np.mean(modes)), (min(modes), max(modes))  # as declared
        for at in fit.free:
            if fit.covariance is not None and np.isclose(fit.theta[at], value, rtol=1e-6, atol=0.0):
                ends = fit.interval(at)
        constants[key] = StageParameter(value, ends, "1")
    rates = [float(np.max(np.abs(run.rate))) for run in posterior.problem.fitted.runs]
    rates = [rate for rate in rates if rate > 0.0]
    falls = bool(rates) and steady_shear(posterior.problem.model, fit.theta, rates)[0] is not None
    return NearestLaw(name, constants, size, equation, falls)


def first_of(weights: Float[np.ndarray, " laws"], named: Sequence[bool]) -> int:
    """Return the best law with a name, where the best of all does not exclude it; else the best."""
    best = int(np.argmax(weights))
    own = np.where(named, weights, 0.0)
    at = int(np.argmax(own))
    return at if own[at] > 0.0 and np.log(own[at] / weights[best]) >= _AS_WELL else best


def is_thixotropic_maxwell(posterior: Posterior, fit: Fit) -> bool:
    """Return whether a hypothesis is a Maxwell fluid with a structure and nothing else.

    The field calls that thixotropic   [Mewis & Wagner 2009, Adv. Colloid Interface Sci. 147, 214].
    """
    states, law = _states_and_law(posterior, fit)
    structures = bool(states) and {state.effect for state in states} <= {*STRUCTURES}
    return structures and law is not None and law[0] == "ucm"


def law_of(posterior: Posterior, fit: Fit) -> tuple[str, dict[str, ByMode]] | None:
    """Return the law of the field that the fluid of a hypothesis is, with its constants."""
    states, law = _states_and_law(posterior, fit)
    return law if states == () else None


def _states_and_law(
    posterior: Posterior, fit: Fit
) -> tuple[tuple[StatePart, ...] | None, tuple[str, dict[str, ByMode]] | None]:
    """Return structure variables of a fluid, and the law of the field that it is without them.

    Kept with the fit: several scans ask it of the same hypotheses.
    """
    if "law" not in fit.memory:
        states = states_of(posterior.problem.model, fit.theta, _present(posterior, fit))
        law = None
        if states is not None:
            with suppress(InputError):
                law = named_law(Equation.of_fluid(_fluid(posterior, fit)))
        fit.memory["law"] = states, law
    return fit.memory["law"]


def _present(posterior: Posterior, fit: Fit) -> list[str]:
    known = posterior.problem.model.declared.effects
    return [*fit.names, *(effect.name for effect in known)]


def _fluid(posterior: Posterior, fit: Fit) -> Fluid:
    return augmented_fluid(posterior.problem.model, fit.theta, _present(posterior, fit))
