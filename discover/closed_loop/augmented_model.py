"""One model that holds the declared law and every candidate effect, compiled once.

An effect at zero amplitude changes nothing, so a subset of effects is a vector of parameters with
zeros, never another program. Runs are padded to one grid and mapped over; so are trial vectors.
"""

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from discover.closed_loop.declared import DeclaredModel
from discover.dataset import ShearRun
from discover.effects import (
    AbstractEffect,
    ConstitutiveEffect,
    KinematicEffect,
    LibraryTerm,
    Record,
    SignalEffect,
)
from discover.simulate.exponential_runge_kutta import phi_functions
from discover.simulate.grid import make_grid
from tensor_library.integrity_basis import integrity_basis
from tensor_library.invariants import scalar_invariants

# An instrument effect acts within the first samples, so the first gap is divided this often
_EARLY_STEPS = 0.5 ** np.arange(6)


class RunBatch(eqx.Module):
    """Runs on padded grids, with a leading axis of runs.

    Attributes
    ----------
    times
        Half-step grid: step ends and middles in turn, shape (runs, 2 s − 1), in s.
    commanded_rate
        Shear rate there, in 1/s.
    sample_index
        Position of the samples among step ends, shape (runs, n).
    weight
        1/(rms stress · √samples) at samples, 0 at padding: the squared residuals of a run then
        sum to its squared relative error.
    stress
        Measured shear stress in Pa, shape (runs, n).
    clock_factor
        Shape (runs,).
    """

    times: Float[Array, "runs m"]
    commanded_rate: Float[Array, "runs m"]
    sample_index: Array
    weight: Float[Array, "runs n"]
    stress: Float[Array, "runs n"]
    clock_factor: Float[Array, " runs"]


def make_batch(runs: Sequence[ShearRun], strain_step: float = 0.25) -> RunBatch:
    """Return runs as a batch.

    Parameters
    ----------
    runs
        One or more runs.
    strain_step
        Largest strain of one step.
    """
    grids = []
    for run in runs:
        # a window may have cut the first samples off, but not what the instrument did by then
        gap = min([run.time[0], *np.diff(run.time)] if run.time[0] > 0 else np.diff(run.time))
        early = gap * _EARLY_STEPS
        anchors = np.unique(np.concatenate([run.time, early[early < run.time[-1]]]))
        grid, _ = make_grid(run.protocol, anchors, strain_step=strain_step)
        grids.append((grid, np.searchsorted(grid, run.time)))
    n_steps = max(2, *(len(g) for g, _ in grids)) if len(grids) > 1 else max(2, len(grids[0][0]))
    n_samples = max(len(run) for run in runs)
    rows = []
    for run, (grid, index) in zip(runs, grids, strict=True):
        spacing = grid[-1] - grid[-2] if len(grid) > 1 else 1.0
        padded = np.concatenate([grid, grid[-1] + spacing * np.arange(1, n_steps - len(grid) + 1)])
        half = np.empty(2 * n_steps - 1)
        half[::2] = padded
        half[1::2] = 0.5 * (padded[1:] + padded[:-1])
        rate = np.array(jax.vmap(run.protocol.shear_rate)(jnp.asarray(half)))
        # beyond its last sample a run is padding: no flow, nothing to blow up
        rate[half > grid[-1]] = 0.0
        n = len(run)
        size = np.sqrt(np.mean(run.shear_stress**2))
        scale = 1.0 / ((size if size > 0 else 1.0) * np.sqrt(n))
        pad = (0, n_samples - n)
        rows.append(
            (
                half,
                rate,
                np.pad(index, pad, mode="edge"),
                np.pad(np.full(n, scale), pad),
                np.pad(run.shear_stress, pad),
                run.clock_factor,
            )
        )
    return RunBatch(*(jnp.asarray(np.stack(column)) for column in zip(*rows, strict=True)))


def data_scales(runs: Sequence[ShearRun]) -> dict[str, float]:
    """Return the size of the properties in which effects scale their first trials.

    Times are on the instrument's clock.
    """
    gaps = [float(np.min(np.diff(run.time))) / run.clock_factor for run in runs if len(run) > 1]
    lengths = [float(run.time[-1]) / run.clock_factor for run in runs]
    stresses = [float(np.sqrt(np.mean(run.shear_stress**2))) for run in runs]
    rates = [float(np.max(np.abs(run.shear_rate))) for run in runs]
    stress, gap = float(np.median(stresses)) or 1.0, float(np.median(gaps or [1.0]))
    rate, length = float(np.median(rates)) or 1.0, float(np.median(lengths)) or 1.0
    return {
        "sampling_time": gap,
        "stress": stress,
        "viscosity": stress / rate,
        "stress_rate": stress / length,
        "inertia": stress * gap / rate,
    }


class _Library:
    """Library terms as one coefficient matrix, basis tensors × monomials of the invariants."""

    def __init__(self, terms: Sequence[LibraryTerm], positions: Sequence[int]):
        self.positions = np.asarray(positions, dtype=int)
        self.powers = tuple(dict.fromkeys(term.term.powers for term in terms))
        self.rows = np.array([term.term.tensor for term in terms], dtype=int)
        self.columns = np.array([self.powers.index(t.term.powers) for t in terms], dtype=int)

    def matrix(self, theta):
        empty = jnp.zeros((8, len(self.powers)))
        return empty.at[self.rows, self.columns].add(theta[self.positions])

    def extra_term(self, matrix, stress, rate):
        invariants = scalar_invariants(stress, rate)
        monomials = []
        for powers in self.powers:
            value = jnp.ones(())
            for i, power in enumerate(powers):
                for _ in range(power):
                    value = value * invariants[i]
            monomials.append(value)
        return jnp.tensordot(matrix @ jnp.stack(monomials), integrity_basis(stress, rate), axes=1)


class AugmentedModel:
    """The declared model with a list of effects, as functions of one parameter vector.

    Parameters
    ----------
    declared
        The declared model.
    effects
        Candidates; their parameters follow one another in the vector, after the declared ones.
    scales
        Size of each property of the data in which parameters are scaled; see `data_scales`.
    """

    def __init__(
        self,
        declared: DeclaredModel,
        effects: Sequence[AbstractEffect],
        scales: Mapping[str, float] | None = None,
    ):
        self.declared = declared
        self.effects = tuple(effects)
        self.slices: dict[str, slice] = {}
        # first the logarithms of the factors on moduli and times, then the law's free parameters
        free = declared.free_parameters
        position = 2 + len(free)
        for effect in self.effects:
            self.slices[effect.name] = slice(position, position + len(effect.parameters))
            position += len(effect.parameters)
        self.size = position
        parameters = [p for effect in self.effects for p in effect.parameters]
        self.low = np.array([-10.0, -10.0, *(p.low for p in [*free, *parameters])])
        self.high = np.array([10.0, 10.0, *(p.high for p in [*free, *parameters])])
        sizes = {"one": 1.0} | dict(scales or {})
        self.first_trial = np.array(
            [0.01] * (2 + len(free)) + [p.first_trial * sizes.get(p.scale, 1.0) for p in parameters]
        )
        terms = [e for e in self.effects if isinstance(e, LibraryTerm)]
        closed = [t for t in terms if t.term.closed_form is not None]
        plain = [t for t in terms if t.term.closed_form is None]
        self._library = _Library(plain, [self.slices[t.name].start for t in plain])
        self._constitutive = [
            e
            for e in self.effects
            if isinstance(e, ConstitutiveEffect) and (e not in terms or e in closed)
        ]
        self._kinematic = [e for e in self.effects if isinstance(e, KinematicEffect)]
        self._signal = [e for e in self.effects if isinstance(e, SignalEffect)]
        self._predict = jax.jit(jax.vmap(self._predict_run, in_axes=(None, 0)))
        self._residual = jax.jit(jax.vmap(self._residuals, in_axes=(0, None)))

    def zero(self) -> Float[np.ndarray, " p"]:
        """Return the vector of the declared model: amplitudes zero, inner parameters at start."""
        theta = np.zeros(self.size)
        for i, parameter in enumerate(self.declared.free_parameters):
            theta[2 + i] = parameter.start
        for effect in self.effects:
            for i in range(1, len(effect.parameters)):
                position = self.slices[effect.name].start + i
                theta[position] = self.first_trial[position]
        return theta

    def positions(self, name: str) -> list[int]:
        """Return the positions of an effect's parameters in the vector."""
        at = self.slices[name]
        return list(range(at.start, at.stop))

    def predict(self, theta, batch: RunBatch) -> Float[np.ndarray, "runs n"]:
        """Return the predicted records, in Pa."""
        return np.asarray(self._predict(jnp.asarray(theta), batch))

    def residuals(self, thetas, batch: RunBatch) -> Float[np.ndarray, "trials runs n"]:
        """Return the weighted residuals of several parameter vectors; not finite if one fails."""
        return np.array(self._residual(jnp.asarray(thetas), batch))

    def _residuals(self, theta, batch):
        predicted = jax.vmap(self._predict_run, in_axes=(None, 0))(theta, batch)
        return (predicted - batch.stress) * batch.weight

    def _predict_run(self, theta, run):
        instrument_times = run.times / run.clock_factor
        felt = run.commanded_rate
        for effect in self._kinematic:
            felt = effect.felt_rate(theta[self.slices[effect.name]], instrument_times, felt)
        stress = self._integrate(theta, run.times[::2], felt)
        stress = stress + self.declared.solvent_viscosity * felt[::2]
        record = Record(run.times[::2], felt[::2], stress, run.clock_factor)
        for effect in self._constitutive:
            added = effect.instantaneous_stress(theta[self.slices[effect.name]], record.shear_rate)
            record = Record(
                record.times, record.shear_rate, record.stress + added, run.clock_factor
            )
        for effect in self._signal:
            changed = effect.recorded_stress(theta[self.slices[effect.name]], record)
            record = Record(record.times, record.shear_rate, changed, run.clock_factor)
        return record.stress[run.sample_index]

    def _integrate(self, theta, times, rate):
        """Return σ12 at step ends: Krogstad's method, modes along the last axis."""
        law = self.declared.law_with(theta[2 : 2 + len(self.declared.free_parameters)])
        # factors that are not fitted stay constants: no trial and no derivative passes through
        modulus = jnp.asarray(self.declared.modulus)
        relaxation_time = jnp.asarray(self.declared.relaxation_time)
        if self.declared.fit_modulus:
            modulus = modulus * jnp.exp(theta[0])
        if self.declared.fit_relaxation_time:
            relaxation_time = relaxation_time * jnp.exp(theta[1])
        matrix = self._library.matrix(theta)

        def mode_rate(stress, shear_rate):
            zero = jnp.zeros_like(shear_rate)
            deformation = jnp.stack([zero, zero, zero, shear_rate])
            change = law.stress_rate(stress, shear_rate)
            if self._library.powers:
                change = change - self._library.extra_term(matrix, stress, deformation)
            for effect in self._constitutive:
                values = theta[self.slices[effect.name]]
                change = change - effect.extra_term(values, stress, deformation)
            # the linear relaxation is integrated exactly and so is taken out here
            return change + stress if law.linear_relaxation else change

        all_modes = jax.vmap(mode_rate, in_axes=(-1, 0), out_axes=-1)
        decay = 1.0 / relaxation_time if law.linear_relaxation else jnp.zeros_like(relaxation_time)

        def slope(state, shear_rate):
            return all_modes(state, relaxation_time * shear_rate)

        # weights of all steps at once, outside the loop: they rarely depend on the parameters
        width = jnp.diff(times)[:, None]
        h = width / relaxation_time
        z = -decay * width
        half_first, half_second, _ = phi_functions(0.5 * z)
        first, second, third = phi_functions(z)
        weights = (
            jnp.exp(0.5 * z),
            jnp.exp(z),
            0.5 * h * half_first,
            h * (0.5 * half_first - half_second),
            h * half_second,
            h * (first - 2.0 * second),
            2.0 * h * second,
            h * (first - 3.0 * second + 4.0 * third),
            h * (2.0 * second - 4.0 * third),
            h * (4.0 * third - second),
        )

        def step(state, inputs):
            first_rate, middle_rate, last_rate, weights = inputs
            half, full, a21, a31, a32, a41, a43, b1, b23, b4 = weights
            n1 = slope(state, first_rate)
            n2 = slope(half * state + a21 * n1, middle_rate)
            n3 = slope(half * state + a31 * n1 + a32 * n2, middle_rate)
            n4 = slope(full * state + a41 * n1 + a43 * n3, last_rate)
            after = full * state + b1 * n1 + b23 * (n2 + n3) + b4 * n4
            return after, after[3] @ modulus

        start = jnp.zeros((4, len(self.declared.modulus)))
        inputs = (rate[:-2:2], rate[1::2], rate[2::2], weights)
        _, stress = jax.lax.scan(step, start, inputs)
        return jnp.concatenate([jnp.zeros(1), stress])
