"""Laws off the declared modes at vanishing strain: whether data tell, and whose fault it is."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from discover.comparison.judging.constants.declared_constants import LINEAR_TERMS, OtherConstant
from discover.comparison.judging.explanation import Explanation
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.soundness.physics import SMALL_STRAIN
from discover.words import percent_of


def with_small_strain_told(
    outcomes: Mapping[str, LearnerOutcome],
    explanation: Explanation,
    others: Sequence[OtherConstant],
) -> dict[str, LearnerOutcome]:
    """Return outcomes whose small-strain check fails only where the data say that it does.

    Noise alone takes the linear part of a law off the declared modes, by as much as its interval
    or, where it has none, by an unknown amount; and a wrong declaration shows there, which is no
    fault of the law that was found.

    Parameters
    ----------
    explanation
        What each law leaves of the training runs.
    others
        Declared constants that the sparse law's linear terms amount to, from `other_constants`;
        empty where no law of the library explains the runs.
    """
    found = dict(outcomes)
    for name, outcome in outcomes.items():
        left = explanation.lack_of_fit.get(name)
        if outcome.physics is None or left is None:
            continue
        checks = [
            _told(check, outcome, left.noise, others)
            if check["name"] == SMALL_STRAIN and check["passed"] is False
            else check
            for check in outcome.physics["checks"]
        ]
        found[name] = replace(outcome, physics={**outcome.physics, "checks": checks})
    return found


def _told(
    check: Mapping[str, Any],
    outcome: LearnerOutcome,
    noise: float,
    others: Sequence[OtherConstant],
) -> dict[str, Any]:
    """Return the check with what the data say of it."""
    value, known_to = float(check["value"]), _interval(outcome)
    limit = noise if known_to is None else known_to
    if value <= limit:
        why = (
            f"that is less than the noise of the records ({percent_of(noise)}), and nothing says "
            "how much better they determine the law's linear part"
            if known_to is None
            else "the intervals of the law's linear terms leave as much"
        )
        text = f"Not tested to better than {percent_of(limit)} by these data: {why}."
    elif others and abs(value - _of(others)) <= limit:
        names = " and ".join(other.name for other in others)
        text = f"That is another {names} than declared, and no fault of the law."
    else:
        return dict(check)
    return {**check, "passed": None, "text": f"{check['text']} {text}"}


def _interval(outcome: LearnerOutcome) -> float | None:
    """Return by how much the intervals of linear terms move the moduli; None without any."""
    linear = [term for term in outcome.terms if term.term in LINEAR_TERMS]
    if outcome.learner != "tensor_sindy" or not linear:
        return None
    halves = [0.5 * (t.ci95[1] - t.ci95[0]) for t in linear if t.ci95 is not None]
    return float(np.sum(halves)) if len(halves) == len(linear) else None


def _of(others: Sequence[OtherConstant]) -> float:
    """Return how far these constants take the moduli off the declared modes.

    f_G iωf_λ/(1 + iωf_λ) over iω/(1 + iω) goes from f_G f_λ, in slow flow, to f_G in fast.
    """
    factors = {other.name: other.factor for other in others}
    stress, time = factors.get("modulus_Pa", 1.0), factors.get("relaxation_time_s", 1.0)
    return max(abs(stress - 1.0), abs(stress * time - 1.0))
