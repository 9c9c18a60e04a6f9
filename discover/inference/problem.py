"""A model, the records that it is held against, and what is known of its constants beforehand."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.effects import (
    AbstractEffect,
    ConstitutiveEffect,
    EffectParameter,
    make_effect,
)
from discover.effects.library_term import LibraryTerm
from discover.forward import AugmentedModel, DeclaredModel, data_scales
from discover.forward.declared import LARGEST
from discover.inference.priors import Prior
from discover.inference.rows import TORQUE, Rows, transducer_of
from discover.inference.variables import SLIP_CURVE
from discover.statistics import root_of
from discover.statistics.noise_model import rms

_TYPICAL = 0.2
"""Of a record, what an effect that is there changes it by: half are smaller, half larger."""

_FIRST = 3.0
"""First trials of an amplitude, which is the least width of its prior."""

_SPREAD = 1.5
"""Standard deviation of the logarithm of a time or a rate whose size alone is known."""

_FEW = 30.0
"""Ratio of the ends of a range from which on only the order of a constant is known."""

_STARTS = (1.0, 0.2, 5.0, 0.04)
"""Multiples of the first trial of an inner time from which fits start."""

NONE = 0.3
"""Prior probability that something has no name; on development seeds of judged worlds anything from
0.2 to 0.5 is as good, and records that cannot tell are not called unexplained."""

LOG_ODDS_OF_NONE = float(np.log(NONE / (1.0 - NONE)))

TERM_ODDS = 0.15
"""Prior odds of a term that no law is known by, over those of an effect with a name."""


@dataclass(frozen=True)
class Nuisance:
    """What every sound instrument has a little of, as an effect with a narrow prior.

    `effect`: name of the effect whose amplitude it is. `sound`: standard deviation in a sound
    instrument, in the scale of the effect's first trial. `source`: where that comes from.
    """

    effect: str
    sound: float
    source: str


NUISANCES = (
    Nuisance("rate_gain", 1.0, "gap and angle of a cone are made to 1 % (ISO 3219-2:2021)"),
    Nuisance("tool_compliance", 0.5, "half of a strain of 1 % at the stress of a strain of one"),
    Nuisance("time_delay", 0.05, "a fortieth of the sampling interval"),
)
"""Effects that a sound instrument has a little of; `first_trial` of a gain is 1 %."""

SOUND_GAIN = 0.01
"""Relative deviation of the calibration of a transducer, as of a torque   [ISO 6721-10:2015]."""

SOUND_CLOCK = 0.01
"""Relative deviation of relaxation times: temperature is held to 0.1 to 0.2 K, and a melt's times
change by 5 % in 1 K (Ferry 1980, ch. 11)."""

BY_MODE = (1.0, 0.5)
"""Standard deviations of slope and curvature over a decade of relaxation time, by which a constant
differs from mode to mode; in e-foldings."""

OWN_OF_A_MODE = 0.3
"""Standard deviation by which the constant of one mode deviates from that."""

SCATTER_OF_RUNS = 0.001
"""Usual size of zero and drift of a run, and of its gain over that of all, over the root mean
square of its record: to which a torque is tared, and to which the same loading repeats. And of the
zero that all runs of a transducer have, over that of a typical one."""

SCATTER_KNOWN = 1.0
"""Degrees of freedom by which that is known: of six instruments one scatters by 0.5 %."""


class Problem:
    """Records of runs under one model with all its candidates.

    `declared`: the model to start from. `candidates`: effects that may be there. `fitted`,
    `predicted`: runs that are fitted, and those that are predicted. `loading`: relative deviation
    by which loadings of the sample differ, if each run is its own. `noise`: of the records,
    relative to their size, where it is known. `computed`: whether the records were computed,
    without what every sound instrument has a little of.
    """

    def __init__(
        self,
        declared: DeclaredModel,
        candidates: Sequence[AbstractEffect],
        fitted: Sequence[Run],
        predicted: Sequence[Run] = (),
        loading: float = 0.0,
        noise: float | None = None,
        computed: bool = False,
    ):
        names = {e.name for e in candidates} | {e.name for e in declared.effects}
        beside = [make_effect(n.effect) for n in NUISANCES if n.effect not in names]
        self.declared, self.candidates = declared, tuple(candidates)
        self.noise, self.computed, self.loads_anew = noise, computed, bool(loading)
        self.loading = loading or (0.0 if computed else SCATTER_OF_RUNS)
        self.scales = data_scales(fitted, predicted)
        self.fitted, self.predicted = Rows.of(fitted), Rows.of(predicted) if predicted else None
        # the torque comes first
        read_by = {*map(transducer_of, [*fitted, *predicted])}
        self.transducers = tuple(sorted(read_by, key=lambda one: (one != TORQUE, one)))
        self.levels = np.array([self._level(one) for one in self.transducers])
        effects = [*candidates, *beside, SLIP_CURVE]
        self.model = AugmentedModel(declared, effects, self.scales)
        self.effects: dict[str, AbstractEffect] = {e.name: e for e in self.model.effects}
        self.zero, self.moduli = self.model.zero(), self.model.moduli
        self._priors = self._known()
        self._widths = self._signatures()
        self._odds = sum(self.odds(effect.name) for effect in candidates)
        covariance = declared.modulus_covariance
        self.modulus_root = None if covariance is None else root_of(covariance)

    def _level(self, transducer: str) -> float:
        """Return the typical size of what a transducer reads in the fitted runs."""
        own = [rms(run.recorded) for run in self.fitted.runs if transducer_of(run) == transducer]
        return float(np.median(own)) if own else 0.0

    # what is known ---------------------------------------------------------------------------

    def _known(self) -> dict[int, Prior]:
        """Return priors of what is always free: the declared constants, and the bench."""
        model, found, sizes = self.model, {}, {"one": 1.0} | self.scales
        units = {
            at: sizes.get(parameter.scale, 1.0)
            for known in model.declared.effects
            for at, parameter in zip(
                model.positions(known.name), known.effect.parameters, strict=True
            )
        }
        for position in model.free_positions:
            low, high = float(model.low[position]), float(model.high[position])
            if low > 0.0 and high > _FEW * low:
                start = float(np.clip(self.zero[position], low, high))
                found[position] = Prior("logarithm", start, 3.0, low, high)
            else:
                width = min(high - low, 10.0 * units.get(position, 1.0))
                middle = float(self.zero[position])
                found[position] = Prior("normal", middle, width, low, high)
        declared = {known.name for known in model.declared.effects}
        for name in (*declared, *(p.name for p in model.declared.free_parameters)):
            found |= self._by_mode(name)
        if not self.computed:
            found.setdefault(1, Prior("normal", 0.0, SOUND_CLOCK))
        for nuisance in NUISANCES:
            effect = self.effects[nuisance.effect]
            first = effect.parameters[0]
            position = model.positions(effect.name)[0]
            if self.computed or position in found or effect.name in declared:
                continue
            found[position] = Prior(
                "normal", 0.0, nuisance.sound * first.first_trial * sizes[first.scale],
                float(model.low[position]), float(model.high[position]),
            )  # fmt: skip
        for position in range(model.instants.start, model.instants.stop):
            found[position] = Prior("normal", 0.5, 0.29, 0.0, 1.0)
        return found

    def narrow(self, ranges: Mapping[int, tuple[float, float]]) -> None:
        """Narrow the ranges of constants that are always free, by position."""
        for position, (low, high) in ranges.items():
            self.model.low[position], self.model.high[position] = low, high
        self._priors = self._known()

    def _by_mode(self, name: str) -> dict[int, Prior]:
        """Return the priors of what varies a constant from mode to mode, on its link's scale."""
        varying = self.model.varying(name)
        widths = [*BY_MODE, *[OWN_OF_A_MODE] * (len(varying) - len(BY_MODE))]
        ends = -LARGEST, LARGEST
        return {at: Prior("normal", 0.0, w, *ends) for at, w in zip(varying, widths, strict=False)}

    def _signatures(self) -> dict[str, float]:
        """Return the amplitude of each effect that changes the records as much as is typical."""
        rows, model = self.fitted, self.model
        names = [e.name for e in self.candidates]
        at = [model.positions(name)[0] for name in names]
        steps = 1e-3 * np.abs(model.first_trial[at])
        thetas = np.tile(self.zero, (len(at) + 1, 1))
        thetas[np.arange(len(at)), at] += steps
        with np.errstate(over="ignore", invalid="ignore"):  # an effect that runs away
            found = rows.flat(model.predictions(thetas, rows.batch))
            change = (found[:-1] - found[-1]) / rows.size / steps[:, None]
            change = np.nan_to_num(change, nan=0.0, posinf=0.0, neginf=0.0)
            size = np.sqrt(np.mean(change**2, axis=1))
        # where the declared model is far off, little of an effect changes much
        first = _FIRST * np.abs(model.first_trial[at])
        widths = np.where(size > 0, _TYPICAL / np.maximum(size, 1e-300), first)
        widths = np.maximum(widths, first)
        ends = np.maximum(np.abs(model.low[at]), np.abs(model.high[at]))
        return dict(zip(names, np.minimum(widths, ends), strict=True))

    def priors(self, names: Sequence[str]) -> dict[int, Prior]:
        """Return the priors of all that is free where some effects are there."""
        found = dict(self._priors)
        for name in names:
            positions, effect = self.model.positions(name), self.effects[name]
            found[positions[0]] = self.amplitude(name)
            for position, parameter in zip(positions[1:], effect.parameters[1:], strict=True):
                found[position] = self._inner(position, parameter)
            found |= self._by_mode(name)
        return found

    def amplitude(self, name: str) -> Prior:
        """Return the prior of the amplitude of an effect that is there."""
        at, model = self.model.positions(name)[0], self.model
        ends = float(model.low[at]), float(model.high[at])
        sound = self.effects[name].parameters[0].sound
        if sound is not None:
            return Prior("normal", *sound, *ends)
        return Prior("amplitude", 0.0, self._widths[name], *ends)

    def _inner(self, position: int, parameter: EffectParameter) -> Prior:
        low, high = float(self.model.low[position]), float(self.model.high[position])
        start = float(np.clip(self.zero[position], low, high))
        if _is_of_unknown_order(parameter) and start > 0.0:
            return Prior("logarithm", start, _SPREAD, max(low, 1e-6 * start), high)
        return Prior("normal", start, 0.4 * (high - low), low, high)

    def starts(self, name: str) -> list[dict[int, float]]:
        """Return inner constants to start an effect from."""
        positions, effect = self.model.positions(name)[1:], self.effects[name]
        priors = [
            self._inner(at, p) for at, p in zip(positions, effect.parameters[1:], strict=True)
        ]
        middles = {at: prior.middle for at, prior in zip(positions, priors, strict=True)}
        of_order = {at: p for at, p in zip(positions, priors, strict=True) if p.is_logarithm}
        return [
            middles
            | {at: float(np.clip(x * p.middle, p.low, p.high)) for at, p in of_order.items()}
            for x in (_STARTS if of_order else (1.0,))
        ]

    @property
    def fits_times(self) -> bool:
        """Whether one factor on all relaxation times is a constant to be fitted."""
        return 1 in self.declared.free_positions

    def other_times(
        self, names: Sequence[str], theta: Float[np.ndarray, " p"]
    ) -> list[Float[np.ndarray, " p"]]:
        """Return vectors of the same viscosity with other relaxation times, where these are fitted.

        Of a time too short or too long to be seen the records say nothing: no step leads back. A
        term first changes the viscosity as its amplitude times the square of the time; of one such
        product slow flows are the same, and no step leads along it either.
        """
        if not self.fits_times:
            return []
        terms = (e for e in map(self.effects.get, names) if isinstance(e, ConstitutiveEffect))
        at = [self.model.positions(e.name)[0] for e in terms if e.adds_term]
        found = []
        for stretch in _STARTS:
            other = theta.copy()
            other[1] = np.log(stretch)
            other[at] *= np.exp(2.0 * (theta[1] - other[1]))
            if 0 in self.declared.free_positions:
                other[0] += theta[1] - other[1]
            found.append(other)
        return found

    def odds(self, name: str) -> float:
        """Return the prior odds of an effect over those of one with a name."""
        return TERM_ODDS if isinstance(self.effects[name], LibraryTerm) else 1.0

    def log_prior(self, names: Sequence[str]) -> float:
        """Return the log prior of a set: one effect of all is expected."""
        return float(sum(self.log_odds_of(self.odds(name)) for name in names))

    def leaves_second_difference_open(self, names: Sequence[str]) -> bool:
        """Return whether a hypothesis, with what is declared, says nothing of N2."""
        known = (one.effect for one in self.declared.effects)
        some = (*known, *(self.effects[name] for name in names))
        return any(getattr(one, "leaves_second_difference_open", False) for one in some)

    def log_odds_of(self, odds: float) -> float:
        """Return the log prior of one thing more, of its odds over those of an effect by name."""
        return float(np.log(odds / self._odds))

    def without(self, theta: Float[np.ndarray, " p"], *names: str) -> Float[np.ndarray, " p"]:
        """Return a vector without some effects."""
        out = theta.copy()
        for name in names:
            positions = [*self.model.positions(name), *self.model.varying(name)]
            out[positions] = self.zero[positions]
        return out


def _is_of_unknown_order(parameter: EffectParameter) -> bool:
    """Return whether only the order of an inner constant is known."""
    return (parameter.low <= 0.0 and parameter.scale != "one") or (
        parameter.low > 0.0 and parameter.high > _FEW * parameter.low
    )
