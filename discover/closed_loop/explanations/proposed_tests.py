"""Which test is expected to tell explanations apart.

If explanation i is right, a test is expected to speak against j with a log-likelihood ratio of

    E_ij = ½ dᵀ (S + A_i A_iᵀ + A_j A_jᵀ)⁻¹ d,    d = y_i − y_j,

S of the noise and A Aᵀ of what uncertain constants change: a difference that readjusting them
within their intervals would remove is no evidence   [Box & Hill 1967, Technometrics 9, 57]. What it
is expected to say of which one is right is at least

    −Σ_i p_i ln Σ_j p_j exp(−E_ij/4)

[lower bound of the entropy of a mixture, by the Bhattacharyya distance between normal distributions
of one covariance: Kolchinsky & Tracey 2017, Entropy 19, 361].
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from discover.closed_loop.explanations.beam import Carried
from discover.closed_loop.explanations.possible_tests import PossibleTest, possible_tests
from discover.closed_loop.judging.held_out import root_of_covariance
from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.results.explanation import Explanations
from discover.closed_loop.results.next_test import NextTest, NextTests
from discover.dataset import Run
from discover.forward import AugmentedModel, Batch, make_batch
from discover.identify.design.next_experiment import MOST_EVIDENCE, squared_distance
from discover.statistics.projection import rms
from discover.statistics.residual import summarise

MOST = 6
"""Explanations that are told apart, the likeliest."""

_LEAST_LIKELY = 0.02

_NOT_BELIEVED = 0.9
"""Probability of none of them from which on it is idle to ask which one it is."""

# What half the gap doubles: a velocity of slip, and a strain that the tool takes
_BY_GAP = ("wall_slip", "tool_compliance")


def next_tests(
    model: AugmentedModel,
    batch: Batch,
    carried: Sequence[Carried],
    explanations: Explanations,
    runs: Sequence[Run],
    judgement: Judgement,
) -> NextTests:
    """Return the tests that could be run, the most telling first.

    None for one explanation alone, or where it is hardly any of them.
    """
    weighed = contenders(carried, explanations)
    if len(weighed) < 2 or explanations.unexplained_probability > _NOT_BELIEVED:
        return NextTests()
    share = np.array([p for _, p in weighed])
    share = share / np.sum(share)
    varied = [_varied(model, one, batch) for one, _ in weighed]
    kept = [i for i, run in enumerate(runs) if run.protocol.control == "rate"]
    summary = summarise(weighed[0][0].fit.residual, np.asarray(batch.weight))
    # what they leave of the fitted runs is not independent from sample to sample
    fresh = min(summary.effective_samples / sum(len(run) for run in runs), 1.0)
    left = rms(weighed[0][0].fit.run_errors)
    noise = max(judgement.left.noise, left)
    longest = float(np.max(np.asarray(model.declared.relaxation_time)))
    tests = possible_tests(runs, longest)
    loading = batch.records.deviation_of_loadings
    predicted = _predicted(model, varied, make_batch([t.run for t in tests])) if tests else []
    found = [
        _expected_of(
            test, [of[:, i, : len(test.run)] for of in predicted], share, noise, fresh, loading
        )
        for i, test in enumerate(tests)
    ]
    if kept:
        fastest = max(kept, key=lambda i: float(np.max(np.abs(runs[i].rate))))
        for title, changed in _elsewhere(model):
            altered = [[changed(theta) for theta in thetas] for thetas in varied]
            again = _predicted(model, altered, batch)
            test = PossibleTest(f"{runs[fastest].name} again, {title}", runs[fastest])
            seen = [of[:, fastest, : len(runs[fastest])] for of in again]
            found.append(_expected_of(test, seen, share, noise, fresh, loading))
    told = [one for one in found if one is not None]
    told.sort(key=lambda one: -round(one.nats, 2))  # the simplest first among equals
    names = tuple(one.effects for one, _ in weighed)
    return NextTests(names, tuple(map(float, share)), noise, tuple(told))


def contenders(
    carried: Sequence[Carried], explanations: Explanations
) -> list[tuple[Carried, float]]:
    """Return what may be the explanation, twins each by itself, and how probable each is."""
    of = {
        member: one.probability / len(one.members)
        for one in explanations.likeliest_first
        for member in one.members
    }
    found = [(one, of[one.effects]) for one in carried if one.effects in of]
    found.sort(key=lambda pair: -pair[1])
    return [pair for pair in found[:MOST] if pair[1] >= _LEAST_LIKELY * found[0][1]]


def _varied(model: AugmentedModel, one: Carried, batch: Batch) -> list[np.ndarray]:
    """Return the constants of an explanation, and each combination of them that varies by itself.

    By one standard deviation, towards the inside of the range.
    """
    thetas = [one.fit.theta]
    if one.fit.free:
        free = list(one.fit.free)
        for column in root_of_covariance(batch, one.fit)[0].T:
            theta = one.fit.theta.copy()
            theta[free] += column
            if np.any((theta < model.low) | (theta > model.high)):
                theta[free] -= 2.0 * column
            thetas.append(np.clip(theta, model.low, model.high))
    return thetas


def _predicted(
    model: AugmentedModel, varied: Sequence[Sequence[np.ndarray]], batch: Batch
) -> list[Float[np.ndarray, "_ runs n"]]:
    flat = [theta for thetas in varied for theta in thetas]
    ends = np.cumsum([len(thetas) for thetas in varied])[:-1]
    return np.split(model.predictions(flat, batch), ends)


def _elsewhere(model: AugmentedModel):
    """Return what else may be changed of a run than its flow, and what that does to constants."""
    names = [effect.name for effect in model.effects]
    by_gap = [p for name in _BY_GAP if name in names for p in model.positions(name)[:1]]
    outside = [
        p
        for effect in model.effects
        if effect.kind != "constitutive"
        for p in model.positions(effect.name)
    ]
    zero = model.zero()

    def half(theta: np.ndarray) -> np.ndarray:
        changed = theta.copy()
        changed[by_gap] *= 2.0
        return changed

    def other(theta: np.ndarray) -> np.ndarray:
        changed = theta.copy()
        changed[outside] = zero[outside]
        return changed

    if by_gap:
        yield "with half the gap", half
    if outside:
        yield "on another instrument, without flaws of this one", other


def _expected_of(
    test: PossibleTest,
    predicted: Sequence[Float[np.ndarray, "_ n"]],
    share: Float[np.ndarray, " e"],
    noise: float,
    fresh: float,
    loading: float,
) -> NextTest | None:
    """Return what a test is expected to tell; None if not every explanation can be followed.

    Where loadings differ a factor between two explanations is no difference of these.
    """
    curves = np.stack([of[0] for of in predicted])
    if not np.all(np.isfinite(curves)):
        return None
    is_flow_curve = test.run.protocol.control == "steady"
    size = np.abs(curves[0]) if is_flow_curve else rms(curves[0])
    scale = np.maximum(noise * size, np.finfo(float).tiny) / np.sqrt(fresh)
    factors = [_factor(of / scale) for of in predicted]
    count = len(curves)
    evidence = np.zeros((count, count))
    for i in range(count):
        for j in range(i):
            factor = np.concatenate([factors[i], factors[j]])
            if loading:
                factor = np.vstack([factor, loading * curves[i] / scale])
            apart = 0.5 * squared_distance((curves[i] - curves[j]) / scale, factor)
            evidence[i, j] = evidence[j, i] = min(apart, MOST_EVIDENCE)
    nats = float(-share @ np.log(np.exp(-0.25 * evidence) @ share))
    samples = test.run.rate if is_flow_curve else test.run.time
    return NextTest(test.title, test.run.quantity, nats, evidence, samples, curves, is_flow_curve)


def _factor(group: Float[np.ndarray, "varied n"]) -> Float[np.ndarray, "k n"]:
    """Return F with FᵀF the covariance of a prediction; the prediction itself comes first."""
    varied = group[1:][np.all(np.isfinite(group[1:]), axis=1)]
    return varied - group[0]
