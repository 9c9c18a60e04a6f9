"""One model that holds the declared law and every candidate effect, compiled once.

An effect at zero amplitude changes nothing, so a subset of effects is a vector with zeros, never
another program. All trial vectors go through one kernel (`discover.forward.side_by_side`).
"""

from collections.abc import Mapping, Sequence
from functools import cached_property
from itertools import pairwise

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.dataset.run import Run
from discover.effects import AbstractEffect
from discover.forward.declared import LARGEST, DeclaredModel, FreeParameter, Structure, decades
from discover.forward.flows import Batch
from discover.forward.predictor import Predictor, Trials
from discover.forward.program import program_of
from discover.statistics.noise_model import rms

# Of the upper end of its range, to which the first trial of a parameter is kept
_TRIAL_SHARE = 0.5


class AugmentedModel:
    """The declared model with a list of effects, as functions of one parameter vector.

    Models that differ in numbers alone share one program for each shape of the runs. The vector
    holds the declared parameters, those of `effects`, of known effects not among these, and last
    the instants at which rates step. `scales`: sizes that scale parameters; see `data_scales`.
    """

    def __init__(
        self,
        declared: DeclaredModel,
        effects: Sequence[AbstractEffect],
        scales: Mapping[str, float] | None = None,
    ):
        self.declared = declared
        names = {effect.name for effect in effects}
        known = (known.effect for known in declared.effects if known.name not in names)
        self.effects = (*effects, *known)
        free = declared.free_parameters
        structure = Structure(
            self.effects,
            tuple(p.name for p in free),
            # a law without free parameters is data; with them, its values are rebuilt
            declared.law_name if free else "",
            declared.parameters if free else (),
            declared.fit_modulus,
            tuple((n, at.start, at.stop) for n, at in declared.by_mode_slices.items()),
            declared.step_instants,
        )
        every_effect = structure.with_every_effect()
        program = program_of(structure)
        self._predictor = Predictor(declared, program, program_of(every_effect))
        fluid = program.fluid
        self.slices, self.size, self.instants = fluid.slices, fluid.size, fluid.instants
        parameters = [p for effect in self.effects for p in effect.parameters]
        sizes = {"one": 1.0} | dict(scales or {})
        units = [sizes.get(p.range_scale, 1.0) for p in parameters]
        lows = [p.low * unit for p, unit in zip(parameters, units, strict=True)]
        highs = [p.high * unit for p, unit in zip(parameters, units, strict=True)]
        varying = [LARGEST] * (declared.size - 2 - len(free))
        steps = declared.step_instants
        before = [-10.0, -10.0, *(p.low for p in free), *np.negative(varying)]
        self.low = np.array([*before, *lows, *[0.0] * steps])
        self.high = np.array(
            [10.0, 10.0, *(p.high for p in free), *varying, *highs, *[1.0] * steps]
        )
        trials = [p.first_trial * sizes.get(p.scale, 1.0) for p in parameters]
        # well inside the range, whatever the data's own size suggests
        trials = [
            float(np.clip(trial, max(low, _TRIAL_SHARE * low), _TRIAL_SHARE * high))
            for trial, low, high in zip(trials, lows, highs, strict=True)
        ]
        first = [0.01] * (2 + len(free)) + [1.0] * len(varying)
        self.first_trial = np.array([*first, *trials, *[0.5] * steps])

    def zero(self) -> Float[np.ndarray, " p"]:
        """Return the vector with amplitudes zero and inner parameters at start; rates step halfway.

        Known effects have their values, and where these are fitted, a first trial.
        """
        theta = np.zeros(self.size)
        theta[self.instants] = self.first_trial[self.instants]
        for i, parameter in enumerate(self.declared.free_parameters):
            theta[2 + i] = parameter.start
        for effect in self.effects:
            for i in range(1, len(effect.parameters)):
                position = self.slices[effect.name].start + i
                theta[position] = self.first_trial[position]
        for known in self.declared.effects:
            for position, value in zip(self.positions(known.name), known.values, strict=True):
                theta[position] = self.first_trial[position] if value is None else value
        return theta

    @property
    def free_positions(self) -> list[int]:
        """Positions of what is fitted of the declared model, its known effects included."""
        free = self.declared.free_positions
        for known in self.declared.effects:
            pairs = zip(self.positions(known.name), known.values, strict=True)
            free += [position for position, value in pairs if value is None]
        return [*free, *range(self.instants.start, self.instants.stop)]

    def positions(self, name: str) -> list[int]:
        """Return the positions of an effect's parameters in the vector."""
        at = self.slices[name]
        return list(range(at.start, at.stop))

    def varying(self, name: str) -> list[int]:
        """Return the positions of what varies a constant by mode; none where it is no such one."""
        at = self.declared.by_mode_slices.get(name, slice(0))
        return list(range(at.start or 0, at.stop))

    @property
    def mode_places(self) -> Float[np.ndarray, " k"]:
        """log10(λ/λ̄) of the declared modes; see `decades`."""
        modulus, times = self.declared.modulus, self.declared.relaxation_time
        return np.asarray(decades(jnp.asarray(modulus), jnp.asarray(times)))

    def constant(self, name: str) -> tuple[FreeParameter, int]:
        """Return a constant by mode, of the law or the amplitude of an effect, and its position."""
        for i, parameter in enumerate(self.declared.free_parameters):
            if parameter.name == name:
                return parameter, 2 + i
        at = self.slices[name].start
        start, low, high = (float(of[at]) for of in (self.first_trial, self.low, self.high))
        return FreeParameter(name, start, low, high), at

    def predict(self, theta, batch: Batch) -> Float[np.ndarray, "runs n"]:
        """Return the predicted records: stresses or moduli in Pa, or strains at a given stress."""
        return self.predictions([theta], batch)[0]

    def predictions(
        self,
        thetas: Sequence[np.ndarray] | np.ndarray,
        batch: Batch,
        moduli: Float[np.ndarray, "trials c"] | None = None,
    ) -> Float[np.ndarray, "trials runs n"]:
        """Return the predicted records of parameter vectors.

        `moduli`: of the declared modes in Pa for each vector, and behind them the viscosity of the
        solvent in Pa s; as declared by default. One that an error of a sweep moves may be negative.
        """
        return self._predicted(thetas, batch, moduli, normal=False)[..., 0]

    def observables(
        self,
        thetas: Sequence[np.ndarray] | np.ndarray,
        batch: Batch,
        moduli: Float[np.ndarray, "trials c"] | None = None,
    ) -> Float[np.ndarray, "trials runs n 3"]:
        """Return the predicted records, N1 = σ11 − σ22 and N2 = σ22 − σ33 in Pa.

        All come from one integration. N1 and N2 are NaN where a test has none, as a sweep.
        """
        return self._predicted(thetas, batch, moduli, normal=True)

    def _predicted(self, thetas, batch: Batch, moduli, normal: bool):
        if moduli is None:
            moduli = np.broadcast_to(self.moduli, (len(thetas), len(self.moduli)))
        trials = Trials(np.asarray(thetas, dtype=float), moduli)
        out = np.zeros((len(thetas), *batch.recorded.shape, 3 if normal else 1))
        for i, rows in enumerate(batch.rows):
            found = self._predictor.of_part(trials, batch, i, normal)
            out[:, rows, : found.shape[2]] = found
        return out

    @cached_property
    def moduli(self) -> Float[np.ndarray, " c"]:
        """Moduli of the declared modes in Pa, and behind them the viscosity of the solvent."""
        return np.append(self.declared.modulus, float(self.declared.solvent_viscosity))


# Of a radian: the time in which a change of a periodic stress is seen, in its phase
_SEEN = 0.1


def data_scales(runs: Sequence[Run], others: Sequence[Run] = ()) -> dict[str, float]:
    """Return the size of the properties in which effects scale their first trials.

    Times are on the instrument's clock, but for ``run_time``, which is the material's. Of `others`
    the temperatures count, and the shifts to these.
    """
    sweeps = [run for run in runs if run.protocol.control == "oscillation"]
    timed = [run for run in runs if run.protocol.control != "oscillation"]
    gaps = [float(np.min(np.diff(run.time))) / run.clock_factor for run in timed if len(run) > 1]
    lengths = [float(run.time[-1]) / run.clock_factor for run in timed]
    strains = [
        float(np.sum(np.abs(run.rate[1:]) * np.diff(run.time)))
        + abs(float(run.rate[0])) * float(run.time[0])
        + (0.0 if run.strain is None else abs(float(run.strain[0])))
        for run in timed
    ]
    strains += [float(np.max(np.abs(run.strain))) for run in sweeps if run.strain is not None]
    material_lengths = [float(run.time[-1]) for run in timed]
    # an oscillation changes within a radian; what is seen of it is a part of that
    radians = [1.0 / float(np.median(run.angular_frequency)) for run in sweeps]
    gaps += [_SEEN * radian for radian in radians]
    lengths, material_lengths = lengths + radians, material_lengths + radians
    stresses = [rms(run.stress) for run in runs]
    rates = [float(np.max(np.abs(run.rate))) for run in runs]
    stress, gap = float(np.median(stresses)) or 1.0, float(np.median(gaps or [1.0]))
    rate, length = float(np.median(rates)) or 1.0, float(np.median(lengths)) or 1.0
    strain = float(np.median(strains)) or 1.0
    return {
        "sampling_time": gap,
        "run_time": float(np.median(material_lengths)) or 1.0,
        "inverse_rate": 1.0 / rate,
        "strain": strain,
        "stress": stress,
        "inverse_stress": 1.0 / stress,
        "compliance": min(1.0, strain) / stress,  # that of a tool does not depend on the strain
        "fluidity": rate / stress,
        "viscosity": stress / rate,
        "stress_rate": stress / length,
        "rate": rate,
        "inertia": stress * gap / rate,
        "softening_by_heat": softening_by_heat([*runs, *others]),
        "shift_factor": float(np.median([run.clock_factor for run in runs])),
    }


_GLASS = 0.8
"""−d ln a_T/dT at a glass transition, in 1/K   [Ferry 1980, ch. 11: 2.303 · 17.44/51.6 K]."""

_HEAT_CAPACITY = 1e6
"""Least heat capacity per volume of a liquid, in J/(m³ K)."""


def softening_by_heat(runs: Sequence[Run]) -> float:
    """Return by how much a unit of work can shorten relaxation times by its heat, in 1/Pa.

    −d ln a_T/dT is the steepest between two temperatures to whose shift factors runs were shifted;
    that of a glass transition where these are not known.
    """
    shifts = {
        round(run.temperature_C): np.log(run.clock_factor)
        for run in runs
        if run.temperature_C is not None
    }
    at = sorted(shifts)
    slopes = [(shifts[b] - shifts[a]) / (b - a) for a, b in pairwise(at)]
    steepest = max(slopes, default=0.0)
    return (steepest if steepest > 0.0 else _GLASS) / _HEAT_CAPACITY
