"""A posterior as the result of a closed loop: everything that is reported, in one object."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.special import chdtri

from discover.answer import Discrepancy
from discover.effects import AbstractEffect
from discover.effects.registry import spelled_distinctly
from discover.forward.declared import DEGREE, constants_of_modes
from discover.identify.twins import oil_twin
from discover.inference.left_out import FEWEST_RUNS
from discover.inference.noise import STATED_TOO_SMALL
from discover.laws import UpperConvectedMaxwell
from discover.loop import final_model
from discover.loop.parts import (
    CandidateScore,
    ConstantByMode,
    ModeConstant,
    Stage,
    StageParameter,
    end_of_range,
)
from discover.loop.path import Path
from discover.loop.runs import errors_of
from discover.loop.sentences import EXPLAINED
from discover.statistics import HALF_BAND
from discover.statistics.whiteness import fast_noise

_DRAWS = 2000
_FREE = 3  # Degree of constants that are free in each mode
# Half width of an interval over the prior's, from which on the runs tell nothing of a mode
_FEWEST_TOLD = 0.5


def _at_ends(
    effect: AbstractEffect, parameters: Mapping[str, Any], left_open: Sequence[str]
) -> list[str]:
    """Return what an effect is, by another name, where its inner constants may be at an end."""
    found = []
    for one in effect.parameters[1:]:
        if one.absent and parameters[one.name].ci95[0] <= one.low:
            found.append(one.absent)
        if one.endless and one.name in left_open:
            found.append(one.endless)
    return found


@dataclass(frozen=True)
class FinishedSearch(Path):
    """What is reported of a posterior: constants, stages, rankings, what is left."""

    @cached_property
    def bounds(self) -> final_model.Bounds:
        """95 % intervals of all that is free in the likeliest hypothesis, by position."""
        found = {}
        for at in self.fit.free:
            ends, value = self.posterior.interval(at), float(self.fit.theta[at])
            low, high = (value, value) if ends is None else ends
            found[at] = min(low, value), max(high, value)
        for name in self._tied:
            at = self.posterior.problem.model.positions(name)[0]
            value, (_, high), prior = float(self.fit.theta[at]), found[at], self.fit.priors[at]
            off = float(np.exp(high / value - 1.0))
            found[at] = value / off, min(value * off, prior.high)
        return found

    @cached_property
    def _tied(self) -> set[str]:
        """Effects whose amplitude only goes with their other constants, as a rate with its time.

        Alone it might be none by its interval, and is not where these are known. Then its order
        alone is known, as theirs is: what is normal along such a ridge is the logarithm.
        """
        fit, found = self.fit, set()
        for name in fit.names:
            first, *others = self.posterior.problem.model.positions(name)
            at = [fit.free.index(one) for one in (first, *others) if one in fit.free]
            if not others or len(at) < 2 or fit.covariance is None:
                continue
            known = np.linalg.inv(fit.covariance[np.ix_(at, at)])
            value, alone = float(fit.theta[first]), HALF_BAND * float(known[0, 0]) ** -0.5
            (low, high) = self.posterior.interval(first) or (value, value)
            if low <= 0.0 < value - alone and high > value:
                found.add(name)
        return found

    @cached_property
    def theta(self) -> Float[np.ndarray, " p"]:
        """Constants of the final fluid: those of the likeliest hypothesis, the bench ideal."""
        theta = self.fit.theta.copy()
        if 1 not in self.posterior.problem.declared.free_positions:
            theta[1] = 0.0  # the clock of the bench
        return theta

    @cached_property
    def by_mode(self) -> dict[str, ConstantByMode]:
        """Constants that may differ from mode to mode, by name."""
        declared = self.posterior.problem.declared
        free = {p.name for p in declared.free_parameters} | {e.name for e in declared.effects}
        there = [name for name in declared.by_mode if name in free or name in self.fit.names]
        return {name: self._by_mode(name) for name in there}

    def _by_mode(self, name: str) -> ConstantByMode:
        fit, model = self.fit, self.posterior.problem.model
        constant, at = model.constant(name)
        places = model.mode_places
        every = [at, *model.varying(name)]
        lot = np.random.default_rng(0).standard_normal((_DRAWS, len(every)))
        chosen = [fit.free.index(one) for one in every]
        assert fit.covariance is not None
        root = np.linalg.cholesky(fit.covariance[np.ix_(chosen, chosen)])
        drawn = fit.coordinates[chosen] + lot @ root.T
        first = fit.priors[at]
        mean = np.array([first.to_value(np.clip(one, *first.ends)) for one in drawn[:, 0]])

        @jax.vmap
        def of_modes(mean, varying):
            shape, own = varying[:DEGREE], varying[DEGREE:]
            low, high = constant.low, constant.high
            return constants_of_modes(mean, low, high, shape, own, jnp.asarray(places))

        spread = np.asarray(of_modes(jnp.asarray(mean), jnp.asarray(drawn[:, 1:])))
        low, high = np.quantile(spread, (0.025, 0.975), axis=0)
        own = jnp.asarray(fit.theta[every])[None]
        values = np.asarray(of_modes(own[:, 0], own[:, 1:]))[0]
        width = constant.high - constant.low
        told = high - low < (_FEWEST_TOLD * width if np.isfinite(width) else 4.0 * np.abs(values))
        times = model.declared.relaxation_time * np.exp(self.theta[1])
        modes = tuple(
            ModeConstant(float(t), float(v), (float(a), float(b)) if k else None, not k)
            for t, v, a, b, k in zip(times, values, low, high, told, strict=True)
        )
        ends = self.bounds[at]
        mean_time = float(times[0] / 10.0 ** places[0])
        evidence = 0.0, float(self.posterior.memory.get("by_mode", 0.0))
        return ConstantByMode(float(fit.theta[at]), ends, "", mean_time, _FREE, evidence, modes)

    @cached_property
    def discrepancy(self) -> Discrepancy | None:
        """Size of what the law leaves; None where no hypothesis can be followed.

        Where runs left out in turn tell it, by how much the law misses these: then their mean, and
        its interval for misses that are normal.
        """
        size, missed = None if self.without_fluid else self.posterior.discrepancy(), self._left_out
        if size is None or self.verdict != "unexplained" or missed is None:
            return size
        if len(missed) < FEWEST_RUNS:
            return size
        mean = float(np.mean(missed))
        ends = np.sqrt(len(missed) / chdtri(len(missed), (0.025, 0.975)))
        low, high = (float(end) * mean for end in ends)
        return replace(size, size=mean, ci95=(low, high), by_run=self.left_out)

    @property
    def left_out(self) -> dict[str, float]:
        """Error besides noise of each fitted run that is left out in turn, by name."""
        names = [run.name for run in self.posterior.problem.fitted.runs]
        if self._left_out is None:
            return {}
        return dict(zip(names, map(float, self._left_out), strict=True))

    @cached_property
    def _left_out(self) -> Float[np.ndarray, " runs"] | None:
        """Error besides noise of each fitted run that is left out; None of a single one."""
        if self.without_fluid or self.posterior.left is None:
            return None
        fit = self.posterior.left.fit
        missed = self.posterior.missed(fit)
        if len(missed) < 2:
            return None
        if self.verdict != "unexplained":
            return missed
        # what the fit takes for noise is not all noise here
        return np.sqrt(np.maximum(fit.memory["missed"] ** 2 - self.noise**2, 0.0))

    def corrections(self) -> dict[str, float]:
        """By how much each effect of the instrument changes the run that it changes most."""
        rows, problem, found = self.posterior.problem.fitted, self.posterior.problem, {}
        for name in self.fit.names:
            if problem.effects[name].kind != "constitutive":
                off = replace(self.fit, theta=problem.without(self.fit.theta, name))
                change = self.predicted(self.fit, rows, False) - self.predicted(off, rows, False)
                found[name] = float(np.max(rows.rms_by_run(change[rows.seen] / rows.size)))
        return found

    def stages(self) -> tuple[Stage, ...]:
        """Return the effects of the likeliest hypothesis, in order."""
        search, found = self.posterior.search, []
        spelled = spelled_distinctly(
            self.posterior.problem.effects[name] for name in self.fit.names
        )
        for i, (before, after) in enumerate(zip(self.path[:-1], self.path[1:], strict=True), 1):
            (name,) = set(after.names) - set(before.names)
            effect, model = self.posterior.problem.effects[name], self.posterior.problem.model
            at = dict(zip((p.name for p in effect.parameters), model.positions(name), strict=True))
            parameters, left_open = {}, [p.name for p in effect.parameters if name in self._tied]
            for p in effect.parameters:
                place = at[p.name]
                value = float(self.fit.theta[place])
                end = end_of_range(value, float(model.low[place]), float(model.high[place]))
                parameters[p.name] = StageParameter(value, self.bounds[place], p.unit, at_end=end)
                open_up = parameters[p.name].is_open_up_to(float(model.high[place]))
                if open_up and p.name not in left_open:
                    left_open.append(p.name)
            if name in self.by_mode:
                parameters[effect.parameters[0].name] = self.by_mode[name]
            gained = 2.0 * (search.rank(after) - search.rank(before))
            aliases = (*self._aliases(name), *_at_ends(effect, parameters, left_open))
            found.append(
                Stage(
                    name, effect.kind, parameters, aliases, errors_of(self.records, i),
                    float(gained), spelled[name].equation, effect.source, effect.check,
                    left_open=tuple(left_open),
                )
            )  # fmt: skip
        return tuple(found)

    def _aliases(self, name: str) -> tuple[str, ...]:
        """Return the effects that take the place of one in twins of the likeliest hypothesis."""
        told = self.posterior.explanations
        own, found = set(self.fit.names), []
        for member in told[0].members[1:] if told else ():
            instead = set(member) - own
            if own - set(member) == {name} and len(instead) == 1:
                found += instead
        return tuple(found)

    def rankings(self) -> tuple[tuple[CandidateScore, ...], ...]:
        """Return the candidates added to each part of the likeliest hypothesis, the best first."""
        search, fitter, found = self.posterior.search, self.posterior.search.fitter, []
        effects = self.posterior.problem.effects
        for fit in self.path:
            scores = []
            for start in search.scored(fit):
                (name,) = set(start.names) - set(fit.names)
                share, _ = start.memory["scored"]
                evidence = error = None
                refitted = search.found.get(frozenset(start.names))
                if refitted is not None and np.isfinite(refitted.log_evidence):
                    evidence = float(2.0 * (search.rank(refitted) - search.rank(fit)))
                    off = (fitter.record(refitted) - fitter.rows.recorded) / fitter.rows.size
                    error = float(np.mean(fitter.rows.rms_by_run(off)))
                scores.append(CandidateScore(name, effects[name].kind, share, evidence, error))
            found.append(tuple(scores))
        return tuple(found)

    @property
    def noise(self) -> float:
        """Relative noise, mean over the fitted runs.

        Where a residual is left, of a law or of a model of what is no signal, only what of it
        changes from sample to sample.
        """
        if (known := self.posterior.problem.noise) is not None:
            is_all = self.verdict in EXPLAINED
            left = errors_of(self.records, -1).fit if is_all else 0.0
            return left if left > STATED_TOO_SMALL * known else known
        sizes = self.fit.noise.sizes
        if self.verdict in ("unexplained", "no_signal"):
            left = [r.relative_residual[-1] for r in self.records if not r.held_out]
            sizes = fast_noise(left, sizes)
        return float(np.mean(sizes))

    @cached_property
    def oil_twin(self) -> dict[str, float] | None:
        """Return the oil behind a slow motor that records the same; None where none does."""
        problem, declared = self.posterior.problem, self.posterior.problem.declared
        names = {*self.fit.names, *(known.name for known in declared.effects)}
        # neither a motor nor an inertia that is there already, nor what is fed back to the rate
        others = (one for one in problem.model.effects if one.name in names - {"solvent_viscosity"})
        alone = all(one.kind == "signal" and one.name != "instrument_inertia" for one in others)
        of_sweep = declared.modulus_covariance is not None  # which shows that the fluid is elastic
        known = of_sweep or 1 not in declared.free_positions or self.verdict not in EXPLAINED
        fluid = final_model.augmented_fluid(problem.model, self.theta, [*names])
        maxwell = isinstance(declared.law, UpperConvectedMaxwell) and fluid.n_modes == 1
        if known or not (alone and maxwell):
            return None
        mode = float(fluid.modulus[0]), float(fluid.relaxation_time[0])
        return oil_twin(*mode, float(fluid.solvent_viscosity), problem.fitted.runs)
