"""Is what a law leaves of the runs that it was learned from noise? The posterior says."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from discover.dataset.run import Run
from discover.effects.registry import KnownEffect, built_in_effects
from discover.forward import DeclaredModel
from discover.inference.fits import Fitter
from discover.inference.noise import STATED_TOO_SMALL
from discover.inference.posterior import posterior_of
from discover.inference.problem import Problem
from discover.inference.search import Search
from discover.laws import Fluid, UpperConvectedMaxwell
from discover.laws.expansion import LibraryExpansion, in_shared_form
from discover.learners.files import kept_in_files
from discover.statistics.noise_model import rms
from discover.statistics.whiteness import fast_noise
from discover.words import percent_of

FitVerdict = Literal["explained", "unexplained", "no_signal"]

ONLY_NOISE = 0.9
"""A law that misses a record by more of it than this says nothing of it."""

_SLOW = 0.6
"""Correlation of noise from which on a smooth misfit of up to three times its size may hide."""


@kept_in_files
@dataclass(frozen=True)
class LackOfFit:
    """What a law leaves of the records that it was learned from."""

    verdict: FitVerdict  # "no_signal" if the records hold nothing that a law could be told from
    misfit: float  # root-mean-square residual over rms measurement, mean over runs
    noise: float  # relative noise of the records, mean over runs
    lag_one_correlation: float  # of that noise, from sample to sample
    probability: float  # that the law is all there is

    @property
    def described(self) -> str:
        """How well the law describes the records it was learned from, in one sentence."""
        if self.verdict == "no_signal":
            return "The runs hold no signal: noise alone is as likely."
        if not np.isfinite(self.misfit):
            return "Does not describe the fitted runs: the integration diverges in one of them."
        if self.verdict == "explained":
            said = f"Fits within the noise of {percent_of(self.noise)}"
            slow = self.lag_one_correlation
            if slow < _SLOW:
                return f"{said}."
            return f"{said}, if that is correlated to {slow:.2g} from sample to sample."
        return (
            f"Describes the fitted runs to {percent_of(self.misfit)}; the rest is systematic "
            f"(noise: {percent_of(self.noise)})."
        )


def declared_as(known: Fluid) -> DeclaredModel:
    """Return a fluid as the declared model of a problem, of which nothing is to be fitted."""
    covariance = known.modulus_covariance
    return DeclaredModel(
        known.law,
        np.asarray(known.modulus),
        np.asarray(known.relaxation_time),
        float(known.solvent_viscosity),
        modulus_covariance=None if covariance is None else np.asarray(covariance),
    )


def _with_terms_as_effects(model: DeclaredModel) -> DeclaredModel:
    """Return a model whose law's terms are effects beside the law below, if all are built in.

    Code of that law with effects holds these terms: a search has made it, and no other is needed.
    """
    law = model.law
    below = getattr(law, "base", None)
    terms = in_shared_form(law if below is None else replace(law, base=None))
    if not isinstance(terms, LibraryExpansion):
        return model
    effects = built_in_effects()
    values = zip(terms.library.names, np.asarray(terms.coefficients), strict=True)
    present = {name: float(value) for name, value in values if value != 0.0}
    if not present.keys() <= effects.keys():
        return model
    known = tuple(KnownEffect(effects[name], (value,)) for name, value in present.items())
    core = UpperConvectedMaxwell(law.linear_relaxation) if below is None else below
    return replace(model, law=core, effects=known)


def lack_of_fit(
    fluid: Fluid,
    runs: Sequence[Run],
    noise: float | None = None,
    loading: float = 0.0,
    computed: bool = True,
) -> LackOfFit:
    """Return what a fluid leaves of runs, and how probable it is that it is all there is.

    `noise`, `loading`, `computed`: as of a `Problem`.
    """
    declared = _with_terms_as_effects(declared_as(fluid))
    problem = Problem(declared, (), runs, loading=loading, noise=noise, computed=computed)
    fitter = Fitter(problem, problem.fitted)
    search = Search(fitter)
    (fit,) = search.add([fitter.start((), problem.zero)])
    if not np.isfinite(fit.log_evidence):
        return LackOfFit("unexplained", np.nan, np.nan, 0.0, 0.0)
    posterior, rows = posterior_of(search), problem.fitted
    left = (fitter.record(fit) - rows.recorded) / rows.size
    by_run = [left[rows.run == i] for i in range(len(runs))]
    misfit = float(np.mean(list(map(rms, by_run))))
    beside = fit.noise.correlation, 1.0 - posterior.unexplained
    if posterior.verdict == "unexplained":
        size = float(np.mean(fast_noise(by_run, fit.noise.sizes))) if noise is None else noise
        return LackOfFit("unexplained", misfit, size, *beside)
    verdict: FitVerdict = "explained" if misfit <= ONLY_NOISE else "no_signal"
    stated_well = noise is not None and misfit <= STATED_TOO_SMALL * noise
    return LackOfFit(verdict, misfit, noise if noise and stated_well else misfit, *beside)
