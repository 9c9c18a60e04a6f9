"""Rates that were read: when they step, and whether the fluid felt their noise.

A rate that was measured scatters because the motor does, and then the fluid feels it, or because
its reading does: its own stress says. A prediction at the one where the other is true carries noise
that no record has. When a rate steps between two samples these do not tell it: that is fitted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.dataset.run_table import wave_of
from discover.effects import simplest_terms
from discover.forward import AugmentedModel, DeclaredModel
from discover.inference.fits import Fitter
from discover.inference.problem import Problem
from discover.protocols import another_between_samples, sampled_rate
from discover.protocols.between_samples import samples_of, steps_between_samples
from discover.statistics.noise_model import rms
from discover.statistics.whiteness import independence_probability
from discover.words import percent_of

_LEAST = 5e-3  # Scatter over the size of the rate, below which the stress hardly tells it from none
_FEWEST = 24
_SEEMS_NOISE = 0.01
# Of log likelihood, from which on smooth rates are believed: twenty times as likely
_LIKELIER = 3.0


def smoothed(run: Run) -> Run:
    """Return a run at the constant rate, or the wave, about which that was read with noise.

    As it is where its rate was commanded, or scatters about another curve.
    """
    protocol = run.protocol
    if len(run.time) < _FEWEST or not run.from_rest or run.rate_steps:
        return run
    if another_between_samples(protocol, run.time) is None or float(protocol.begins) < 0.0:
        return run
    times, rates = samples_of(protocol, run.time)
    wave = wave_of(times, rates)

    def curves(at: Float[np.ndarray, " n"]) -> Float[np.ndarray, "n c"]:
        if wave is None:
            return np.ones((len(at), 1))
        return np.stack([np.ones_like(at), np.cos(wave[0] * at), np.sin(wave[0] * at)], axis=1)

    found = np.linalg.lstsq(curves(times), rates, rcond=None)[0]
    smooth = curves(times) @ found
    scatter = rates - smooth
    if rms(scatter) < _LEAST * rms(rates) or independence_probability([scatter]) < _SEEMS_NOISE:
        return run
    return replace(run, protocol=sampled_rate(times, smooth), rate=curves(run.time) @ found)


def rate_reading_noise(declared: DeclaredModel, runs: Sequence[Run]) -> str:
    """Return that rates scatter and the stress does not follow; empty where it may.

    Every simple term of the library is fitted at either rate: a law too flexible to be believed
    tells which of them the fluid felt.
    """
    smooth = [smoothed(run) for run in runs]
    scatter = [
        rms(one.rate - run.rate) / rms(run.rate)
        for run, one in zip(runs, smooth, strict=True)
        if one is not run
    ]
    if not scatter:
        return ""
    terms, found = simplest_terms(), []
    for some in (runs, smooth):
        problem = Problem(declared, terms, some)
        fitter = Fitter(problem, problem.fitted)
        start = fitter.start([term.name for term in terms], problem.zero)
        (fit,) = fitter.fit([start], derivatives=False)
        found.append(fit.log_likelihood)
    if not np.all(np.isfinite(found)) or found[1] - found[0] < _LIKELIER:
        return ""
    return (
        f"The rates that were read scatter by {percent_of(max(scatter))} from sample to sample, "
        "which the stress does not follow: the constant rate, or the wave, in their midst is taken"
    )


_MOST = 40  # Steps whose instants are fitted, at most: each costs a constant


def with_rate_steps(run: Run) -> Run:
    """Return a run that names the steps of its rate whose instants its samples do not tell."""
    return replace(run, rate_steps=steps_between_samples(run.protocol, run.time, run.rate))


def with_step_instants(
    declared: DeclaredModel, fitted: Sequence[Run], held_out: Sequence[Run]
) -> tuple[DeclaredModel, list[Run], list[Run]]:
    """Return the declared model and the runs with a place for the instant of each fitted step.

    Of more than `_MOST` those with the largest change of strain are fitted, and a straight line
    stands for each of the others. What else a fitted run recorded shares its instants.
    """
    largest: dict[tuple[str, float], float] = {}
    for run in fitted:
        for step in run.rate_steps:
            if step.start < run.time[-1]:
                size = abs(step.change) * (step.end - step.start)
                largest[run.source, step.start] = size
    kept = sorted(largest, key=lambda key: -largest[key])[:_MOST]
    places = {key: place for place, key in enumerate(key for key in largest if key in kept)}

    def placed(run: Run, is_fitted: bool) -> Run:
        steps = (
            replace(step, place=places.get((run.source, step.start)))
            for step in run.rate_steps
            if not is_fitted or (run.source, step.start) in places
        )
        return replace(run, rate_steps=tuple(steps))

    return (
        replace(declared, step_instants=len(places)),
        [placed(run, True) for run in fitted],
        [placed(run, False) for run in held_out],
    )


def instants_found(
    model: AugmentedModel,
    theta: Float[np.ndarray, " p"],
    bounds: Mapping[int, tuple[float, float]],
    runs: Sequence[Run],
    held_out: Sequence[Run],
) -> dict[str, list[dict[str, Any]]]:
    """Return the instants as JSON-able values, by name of the run."""
    found: dict[str, list[dict[str, Any]]] = {}
    for run in (*runs, *held_out):
        for step in run.rate_steps:
            share, ci95 = step.share, None
            if step.place is not None:
                at = model.instants.start + step.place
                share = float(theta[at])
                ci95 = [step.at(end) for end in bounds[at]] if at in bounds else None
            line = {"between_s": [step.start, step.end], "instant_s": step.at(share), "ci95": ci95}
            found.setdefault(run.source, []).append(line)
    return found
