"""Runs and a term library as a problem of the engine, and its linearisation as a sparse problem."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.dataset.run import Run
from discover.effects.library_term import library_term
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.inference.engine.fits import Fit, Fitter
from discover.inference.engine.problem import Problem
from discover.learners.known_part import KnownPart
from tensor_library.library import TermLibrary

_STEP = 1e-4
"""Of the width of a prior: step of a difference."""

_NEGLIGIBLE = 1e-6
"""Prior width below which a nuisance is nothing that a coefficient could be mistaken for."""


def library_problem(
    runs: Sequence[Run], library: TermLibrary, known: KnownPart, use_normal_stresses: bool
) -> Problem:
    """Return the problem of finding library terms beside a known part.

    The records hold the fluid and noise: an instrument's faults are for a closed loop, or for
    `compare`, which takes them out beforehand.

    `runs`: as `as_runs` returns them. `library`: candidate terms. `known`: the known part; errors
    of its moduli are nuisances. `use_normal_stresses`: whether N1 and N2, where measured, are
    fitted too. Raises InputError if normal stresses would be fitted twice, or a covariance is none
    of the moduli.
    """
    fluid, observed = known.fluid, list(runs)
    if use_normal_stresses:
        own = [run.name for run in runs if run.quantity in ("N1", "N2")]
        if own:
            raise InputError(
                f"{own[0]!r} is a record of its own, which use_normal_stresses would fit once "
                "more. Leave out one of the two."
            )
        observed += [run.observing(quantity) for run in runs for quantity in run.beside]
    loadings = [run.loading.deviation for run in runs if run.loading is not None]
    declared = DeclaredModel(
        fluid.law,
        np.asarray(fluid.modulus),
        np.asarray(fluid.relaxation_time),
        float(fluid.solvent_viscosity),
        modulus_covariance=_checked(known.modulus_covariance, len(fluid.modulus)),
    )
    return Problem(
        declared,
        [library_term(term) for term in library.terms],
        observed,
        loading=max(loadings, default=0.0),
        computed=True,
    )


def _checked(covariance, modes: int):
    if covariance is None:
        return None
    values = np.asarray(covariance, dtype=float)
    usable = values.shape in ((modes,) * 2, (modes + 1,) * 2) and np.all(np.isfinite(values))
    if not usable or not np.allclose(values, values.T):
        raise InputError(
            "modulus_covariance must be a symmetric matrix in Pa² with one row for each mode, and "
            f"one for a solvent or none; got the shape {values.shape} for {modes} modes."
        )
    return values


@dataclass(frozen=True)
class LinearModel:
    """y − σ(c₀) + S c₀ ≈ S c: what the records say of the coefficients near a trial law.

    `design`: S by terms, over the noise of the trial law, what nuisances imitate taken out, and
        compressed to as many rows as unknowns: least-squares problems over it are unchanged.
    """

    design: Float[np.ndarray, "rows n"]
    target: Float[np.ndarray, " rows"]  # the left-hand side, likewise

    @classmethod
    def at(cls, fitter: Fitter, fit: Fit, names: Sequence[str]) -> "LinearModel":
        """Return the model at a fitted hypothesis, over the amplitudes of the terms named."""
        assert fit.jacobian is not None
        problem = fitter.problem
        at = [problem.model.positions(name)[0] for name in names]
        steps = np.array([_STEP * problem.amplitude(name).width for name in names])
        steps = np.where(fit.theta[at] + steps > problem.model.high[at], -steps, steps)
        thetas = np.tile(fit.theta, (len(at), 1))
        thetas[np.arange(len(at)), at] += steps
        with np.errstate(over="ignore", invalid="ignore"):  # a term that runs away
            columns = (fitter.predict(list(thetas)) - fit.predicted).T / steps
        columns = np.where(np.all(np.isfinite(columns), axis=0), columns, 0.0)
        record = fitter.record(fit)
        target = fitter.rows.recorded - record + columns @ fit.theta[at]
        widths = np.concatenate([[prior.width for prior in fit.priors.values()], fitter.widths])
        amplitudes = set(at)
        other = [
            i
            for i, width in enumerate(widths)
            if width > _NEGLIGIBLE and not (i < len(fit.free) and fit.free[i] in amplitudes)
        ]
        both = np.column_stack([fit.jacobian[:, other], columns, target])
        white = fitter.noise_of(fit).whitened(both, record, fit.noise)
        if other:
            # nuisances with their priors as further rows, and what they imitate taken out
            prior = np.zeros((len(other), both.shape[1]))
            prior[np.arange(len(other)), np.arange(len(other))] = 1.0 / widths[other]
            white = np.vstack([white, prior])
            basis = np.linalg.qr(white[:, : len(other)])[0]
            white = white[:, len(other) :]
            white = white - basis @ (basis.T @ white)
        triangular = np.asarray(np.linalg.qr(white, mode="r"))
        return cls(triangular[:, :-1], triangular[:, -1])

    def solved(self, support: Sequence[int]) -> Float[np.ndarray, " q"]:
        """Return the least-squares coefficients of some terms."""
        return np.linalg.lstsq(self.design[:, list(support)], self.target, rcond=None)[0]
