"""The next test: which one is expected to tell hypotheses apart.

If hypothesis i is right, a test is expected to speak against j with a log likelihood ratio of

    E_ij = ½ dᵀ (S + A_i A_iᵀ + A_j A_jᵀ)⁻¹ d,    d = y_i − y_j,

S of the noise and A Aᵀ of what uncertain constants change: a difference that readjusting them
within their intervals would remove is no evidence   [Box & Hill 1967, Technometrics 9, 57]. What it
is expected to say of which one is right is at least

    −Σ_i p_i ln Σ_j p_j exp(−E_ij/4)

[lower bound of the entropy of a mixture, by the Bhattacharyya distance between normal distributions
of one covariance: Kolchinsky & Tracey 2017, Entropy 19, 361].
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.forward import make_batch
from discover.forward.of_fluids import bare_run
from discover.inference.bands import distinct, moved
from discover.inference.fit import Fit
from discover.inference.posterior import Posterior
from discover.protocols import (
    after_steady_flow,
    after_step_strain,
    imposed_stress,
    in_flow,
    oscillatory_shear,
    start_up,
    steady_rates,
    step_rates,
)
from discover.protocols.kinematics import FOLLOWED, RecordedQuantity
from discover.statistics.noise_model import rms, squared_mahalanobis_distance

BEYOND = 3.0
"""How far the slowest and fastest test lie beyond the rates that were fitted."""

_SAMPLES = 101
_STATES = 25
_SHORTEST = 1e-3  # of a test: its first sample

# Strain of a start-up, which may be longer where relaxation asks for it; Hencky strain of extension
_STRAIN, _LONGEST_STRAIN, _HENCKY = 20.0, 100.0, 3.0
_RELAXED = 3.0

_AMPLITUDES, _CYCLES = (1.0, 5.0), 5.0
_STEPS = (0.5, 3.0)


def possible_tests(runs: Sequence[Run], relaxation_time: float) -> list[Run]:
    """Return tests of every kind, the simplest to run first; none without a run at a given rate.

    Each is named in words, with numbers, and zero is recorded in it. `relaxation_time`: the
    longest, in s.
    """
    at_rate = [run for run in runs if run.protocol.control in FOLLOWED]
    rates = [float(np.max(np.abs(run.rate))) for run in at_rate]
    rates = [rate for rate in rates if rate > 0.0]
    if not rates:
        return []
    slowest, fastest = min(rates), max(rates)
    whole = _duration(fastest, relaxation_time)
    even = np.linspace(0.0, whole, _SAMPLES)
    found = [
        _start_up(rate, _duration(rate, relaxation_time))
        for rate in sorted({slowest / BEYOND, slowest, fastest, BEYOND * fastest})
    ]
    title = f"start-up of shear at {fastest:.3g} 1/s"
    half, third = 0.5 * whole, whole / 3
    turned = step_rates([0.0, half], [fastest, -fastest])
    found.append(bare_run(turned, even, f"{title}, reversed after {half:.3g} s"))
    paused = step_rates([0.0, third, 2 * third], [fastest, 0.0, fastest])
    found.append(bare_run(paused, even, f"{title}, stopped for {third:.3g} s and begun again"))
    after = np.geomspace(_SHORTEST * relaxation_time, _RELAXED * relaxation_time, _SAMPLES)
    stopped = after_steady_flow(start_up(0.0), fastest, end=float(after[-1]))
    title = f"relaxation after steady shear at {fastest:.3g} 1/s"
    found.append(bare_run(stopped, after, title))
    for strain in _STEPS:
        begun = after_step_strain(start_up(0.0), strain, first=float(after[0]))
        found.append(bare_run(begun, after, f"relaxation after a step of strain of {strain:g}"))
    for amplitude in _AMPLITUDES:
        frequency = fastest / amplitude
        times = np.linspace(0.0, 2.0 * np.pi * _CYCLES / frequency, _SAMPLES)
        title = f"oscillatory shear of amplitude {amplitude:g} at {frequency:.3g} rad/s, from rest"
        found.append(bare_run(oscillatory_shear(fastest, frequency), times, title))
    states = np.geomspace(slowest / BEYOND, BEYOND * fastest, _STATES)
    title = f"flow curve from {states[0]:.3g} to {states[-1]:.3g} 1/s"
    found.append(bare_run(steady_rates(states), np.arange(1.0, _STATES + 1.0), title))
    if any(run.protocol.control == "stress" for run in runs):
        found += _creep(at_rate, relaxation_time)
    fast = _start_up(fastest, whole)
    normal = replace(fast, first_normal_stress_difference=np.zeros(len(fast)))
    found.append(replace(normal.observing("N1"), name=f"N1 in {fast.name}"))
    for kind in ("uniaxial", "planar", "biaxial"):
        for rate in sorted({slowest, fastest}):
            times = np.linspace(0.0, _HENCKY / rate, _SAMPLES)
            title = f"start-up of {kind} extension at {rate:.3g} 1/s"
            found.append(bare_run(in_flow(start_up(rate), kind), times, title))
    return found


def _duration(rate: float, relaxation_time: float) -> float:
    wanted = max(_STRAIN / rate, _RELAXED * relaxation_time)
    return min(wanted, _LONGEST_STRAIN / rate)


def _start_up(rate: float, duration: float) -> Run:
    times = np.geomspace(_SHORTEST * duration, duration, _SAMPLES)
    return bare_run(start_up(rate), times, f"start-up of shear at {rate:.3g} 1/s")


def _creep(runs: Sequence[Run], relaxation_time: float) -> list[Run]:
    """Return creep at the stress that the runs reach; none where they reach none."""
    stresses = [float(np.max(np.abs(run.stress))) for run in runs if run.flow == "shear"]
    rates = [float(np.max(np.abs(run.rate))) for run in runs if run.flow == "shear"]
    if not stresses or min(stresses) == 0.0:
        return []
    fastest = int(np.argmax(rates))
    stress = 0.5 * stresses[fastest]
    times = np.geomspace(_SHORTEST * relaxation_time, _RELAXED * relaxation_time, _SAMPLES)
    imposed = np.full(_SAMPLES, stress)
    # only sets the pace of integration, which a creep of unknown speed must not make endless
    strain = np.minimum(rates[fastest] * times, _STRAIN)
    protocol, title = imposed_stress(times, imposed), f"creep at {stress:.3g} Pa"
    return [Run(title, times, protocol, np.zeros(_SAMPLES), imposed, strain=strain)]


DECISIVE = 5.0
"""Log odds from which on a test decides: one against 150."""

_MOST = 6
"""Hypotheses that are told apart, the likeliest."""

_LEAST_LIKELY = 0.02
_NOT_BELIEVED = 0.9
"""Probability of none of them from which on it is idle to ask which one it is."""

_MOST_EVIDENCE = 500.0

_BY_GAP = ("wall_slip", "tool_compliance")
"""What half the gap doubles: a velocity of slip, and a strain that the tool takes."""


@dataclass(frozen=True)
class NextTest:
    """One test, and what it is expected to decide.

    `title`: in words, with numbers. `quantity`: what is recorded. `nats`: information that it is
    expected to give on which hypothesis is right. `evidence`: expected logarithm of the odds
    between each pair of hypotheses, shape (e, e). `samples`, `curves`: where each hypothesis
    predicts what, shapes (n,) and (e, n): times in s, of a flow curve the rates in 1/s.
    `is_flow_curve`: whether it is one.
    """

    title: str
    quantity: RecordedQuantity
    nats: float
    evidence: Float[np.ndarray, "e e"]
    samples: Float[np.ndarray, " n"]
    curves: Float[np.ndarray, "e n"]
    is_flow_curve: bool = False

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """Pairs of hypotheses between which it is expected to decide."""
        decided = np.argwhere(np.triu(self.evidence, 1) >= DECISIVE)
        return tuple((int(i), int(j)) for i, j in decided)


@dataclass(frozen=True)
class NextTests:
    """The tests that were weighed, the most telling first.

    `explanations`: sets of effects that are to be told apart, the likeliest first; twins each by
    itself. `probabilities`: of each, were it one of them. `noise`: relative, with what the
    likeliest leaves of the fitted runs. `tests`: among those that could be run.
    """

    explanations: tuple[tuple[str, ...], ...] = ()
    probabilities: tuple[float, ...] = ()
    noise: float = 0.0
    tests: tuple[NextTest, ...] = field(default_factory=tuple)

    @property
    def open_nats(self) -> float:
        """What is not known of which hypothesis is right: the most that a test can tell."""
        p = np.array([one for one in self.probabilities if one > 0.0])
        return float(-np.sum(p * np.log(p)))

    @property
    def best(self) -> NextTest | None:
        """The test that tells most, if any decides between two of them."""
        return next((one for one in self.tests if one.pairs), None)

    def to_json(self) -> dict[str, Any]:
        """Return what ``loop.json`` holds of them."""
        return {
            "explanations": self.explanations,
            "probabilities": self.probabilities,
            "open_nats": self.open_nats,
            "noise": self.noise,
            "tests": [
                {
                    "test": one.title,
                    "observe": one.quantity,
                    "nats": one.nats,
                    "separates": [
                        [self.explanations[i], self.explanations[j]] for i, j in one.pairs
                    ],
                }
                for one in self.tests
            ],
        }


def design(posterior: Posterior) -> NextTests:
    """Return the tests that could be run, the most telling first.

    None for one hypothesis alone, or where it is hardly any of them.
    """
    weighed = _contenders(posterior)
    if len(weighed) < 2 or posterior.unexplained > _NOT_BELIEVED:
        return NextTests()
    problem, share = posterior.problem, np.array([p for _, p in weighed])
    share = share / np.sum(share)
    varied = [_Varied.of(posterior, fit) for fit, _ in weighed]
    best, runs = weighed[0][0], problem.fitted.runs
    noise = max(best.noise.common, posterior.search.fitter.misfit(best))
    fresh = (1.0 - best.noise.correlation) / (1.0 + best.noise.correlation)
    longest = float(np.max(np.asarray(problem.declared.relaxation_time)))
    tests = possible_tests(runs, longest)

    def weigh(tests: Sequence[Run], varied: Sequence[_Varied]) -> Iterator[NextTest]:
        for test, predicted in zip(tests, _predicted(posterior, varied, tests), strict=True):
            one = _expected_of(test, predicted, varied, share, noise, fresh, problem.loading)
            if one is not None:
                yield one

    found = list(weigh(tests, varied))
    kept = [run for run in runs if run.protocol.control == "rate"]
    if kept:
        fastest = max(kept, key=lambda run: float(np.max(np.abs(run.rate))))
        for title, changed in _elsewhere(posterior):
            again = replace(fastest, name=f"{fastest.name} again, {title}")
            found += weigh([again], [replace(v, thetas=changed(v.thetas)) for v in varied])
    found.sort(key=lambda one: -round(one.nats, 2))  # the simplest first among equals
    names = tuple(fit.names for fit, _ in weighed)
    return NextTests(names, tuple(map(float, share)), noise, tuple(found))


def _contenders(posterior: Posterior) -> list[tuple[Fit, float]]:
    """Return what may be right, twins each by itself, and how probable each is."""
    smallest = {names for one in posterior.explanations for names in one.members}
    found = [(fit, p) for fit, p in posterior.fits if fit.names in smallest][:_MOST]
    return [pair for pair in found if pair[1] >= _LEAST_LIKELY * found[0][1]]


@dataclass(frozen=True)
class _Varied:
    """Constants and moduli of a fit, then those moved by `credible_steps` with their weights."""

    weights: Float[np.ndarray, " steps"]
    thetas: Float[np.ndarray, "varied p"]
    moduli: Float[np.ndarray, "varied c"]

    @classmethod
    def of(cls, posterior: Posterior, fit: Fit) -> "_Varied":
        weights, thetas, moduli, _ = moved(posterior, fit)
        own, _ = distinct(np.column_stack([thetas, moduli]))
        return cls(weights[own[1:]], thetas[own], moduli[own])

    def factor(self, group: Float[np.ndarray, "varied n"]) -> Float[np.ndarray, "k n"]:
        """Return F with FᵀF the covariance of a prediction, of it and its variations."""
        sound = np.all(np.isfinite(group[1:]), axis=1)
        return (np.sqrt(self.weights)[:, None] * (group[1:] - group[0]))[sound]


def _predicted(
    posterior: Posterior, varied: Sequence[_Varied], tests: Sequence[Run]
) -> Iterator[list[Float[np.ndarray, "_ n"]]]:
    """Return what each hypothesis predicts of each test, with its variations."""
    if not tests:
        return
    thetas, moduli = (np.concatenate([getattr(v, n) for v in varied]) for n in ("thetas", "moduli"))
    ends = np.cumsum([len(one.thetas) for one in varied])[:-1]
    with np.errstate(all="ignore"):
        found = posterior.problem.model.predictions(thetas, make_batch(tests), moduli)
    for i, test in enumerate(tests):
        yield np.split(found[:, i, : len(test)], ends)


def _elsewhere(
    posterior: Posterior,
) -> Iterator[tuple[str, Callable[[np.ndarray], np.ndarray]]]:
    """Yield what else may be changed of a run than its flow, and what that does to constants."""
    problem = posterior.problem
    model, zero = problem.model, problem.zero
    names = sorted({name for fit, _ in posterior.fits for name in fit.names})
    by_gap = [model.positions(name)[0] for name in _BY_GAP if name in names]
    outside = [
        p for name in names if problem.effects[name].kind != "constitutive"
        for p in model.positions(name)
    ]  # fmt: skip

    def half(thetas: np.ndarray) -> np.ndarray:
        changed = thetas.copy()
        changed[:, by_gap] *= 2.0
        return changed

    def other(thetas: np.ndarray) -> np.ndarray:
        changed = thetas.copy()
        changed[:, outside] = zero[outside]
        return changed

    if by_gap:
        yield "with half the gap", half
    if outside:
        yield "on another instrument, without flaws of this one", other


def _expected_of(
    test: Run,
    predicted: Sequence[Float[np.ndarray, "_ n"]],
    varied: Sequence[_Varied],
    share: Float[np.ndarray, " e"],
    noise: float,
    fresh: float,
    loading: float,
) -> NextTest | None:
    """Return what a test is expected to tell; None if not every hypothesis can be followed.

    Where loadings differ a factor between two hypotheses is no difference of these.
    """
    curves = np.stack([of[0] for of in predicted])
    if not np.all(np.isfinite(curves)):
        return None
    is_flow_curve = test.protocol.control == "steady"
    size = np.abs(curves[0]) if is_flow_curve else rms(curves[0])
    scale = np.maximum(noise * size, np.finfo(float).tiny) / np.sqrt(fresh)
    factors = [one.factor(of / scale) for one, of in zip(varied, predicted, strict=True)]
    count = len(curves)
    evidence = np.zeros((count, count))
    for i in range(count):
        for j in range(i):
            factor = np.concatenate([factors[i], factors[j]])
            if loading:
                factor = np.vstack([factor, loading * curves[i] / scale])
            apart = 0.5 * squared_mahalanobis_distance((curves[i] - curves[j]) / scale, factor)
            evidence[i, j] = evidence[j, i] = min(apart, _MOST_EVIDENCE)
    nats = float(-share @ np.log(np.exp(-0.25 * evidence) @ share))
    samples = test.rate if is_flow_curve else test.time
    return NextTest(test.name, test.quantity, nats, evidence, samples, curves, is_flow_curve)
