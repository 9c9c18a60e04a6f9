"""Rates that were read with noise: whether the fluid felt it, as its own stress says.

A rate that was measured scatters because the motor does, and then the fluid feels it, or because
its reading does. A prediction at the one where the other is true carries noise that no record has.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.dataset.run_table import wave_of
from discover.effects import simplest_terms
from discover.forward.declared import DeclaredModel
from discover.inference.engine.fits import Fitter
from discover.inference.engine.problem import Problem
from discover.protocols import another_between_samples, sampled_rate
from discover.protocols.between_samples import samples_of
from discover.statistics.noise.noise_model import rms
from discover.statistics.noise.whiteness import separate_probability
from discover.words import percent_of

_LEAST = 5e-3
"""Scatter over the size of the rate, below which the stress hardly tells it from none."""

_FEWEST = 24
_SEEMS_NOISE = 0.01
_LIKELIER = 3.0
"""Of log likelihood, from which on smooth rates are believed: twenty times as likely."""


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
    if rms(scatter) < _LEAST * rms(rates) or separate_probability([scatter]) < _SEEMS_NOISE:
        return run
    return replace(run, protocol=sampled_rate(times, smooth), rate=curves(run.time) @ found)


def unfelt_scatter(declared: DeclaredModel, runs: Sequence[Run]) -> str:
    """Return that rates scatter and the stress does not follow; empty where it may.

    Every simple term of the library is fitted at either rate: a law too flexible to be believed
    tells which of them the fluid felt.

    `declared`: the model to start from. `runs`: that are fitted.
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
