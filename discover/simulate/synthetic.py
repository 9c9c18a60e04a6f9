"""Synthetic data sets from a known law."""

from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Complex, Float

from discover.dataset import Dataset, LinearSweep, Run
from discover.errors import InputError
from discover.laws import AbstractConstitutiveLaw
from discover.laws.each_mode import of_each_mode
from discover.laws.multimode import Fluid
from discover.laws.registry import make_law
from discover.plain_numbers import as_number, as_whole_number, short
from discover.programs import compiled
from discover.protocols.protocol import (
    TRAINING_DURATION,
    FlowProtocol,
    paper_training_protocols,
    recorded_at,
    require_flow,
    shear_rates,
)
from discover.simulate.solve import ShearStress, simulate
from discover.statistics.noise_model import rms


@dataclass(frozen=True, repr=False)
class SyntheticDataset(Dataset):
    """A data set whose law is known."""

    truth: Fluid | None = None  # the fluid that made it
    exact: Mapping[str, ShearStress] | None = None  # of each run without noise, by its name
    noise: float = 0.0  # standard deviation over the root-mean-square stress of each run


def synthetic_dataset(
    law: str,
    parameters: Mapping[str, float] | None = None,
    protocol: str | Mapping[str, FlowProtocol] = "paper",
    noise: float = 0.0,
    seed: int = 0,
    n_samples: int = 201,
    duration: float = TRAINING_DURATION,
) -> SyntheticDataset:
    """Return the recorded stress of a named dimensionless law in some flows, with white noise.

    The linear sweep is exact.

    Parameters
    ----------
    law, parameters
        As in `discover.laws.make_law`.
    protocol
        ``"paper"`` for the paper's eight series, or flows by name.
    noise
        Standard deviation of the noise over the root-mean-square shear stress of each run.
    seed
        Seed of the noise; the same seed gives the same data.
    n_samples, duration
        Number of equally spaced samples from 0, and the time of the last.

    Raises
    ------
    InputError
        If an argument is out of range.

    Examples
    --------
    >>> import discover as dc
    >>> data = dc.synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.01, n_samples=51)
    >>> len(data), data[0].stress.shape
    (8, (51,))
    """
    if isinstance(protocol, str) and protocol == "paper":
        protocols: Mapping[str, FlowProtocol] = paper_training_protocols()
    elif isinstance(protocol, Mapping) and protocol:
        protocols = protocol
        for flow in protocols.values():
            require_flow(flow, "synthetic_dataset")
    else:
        raise InputError(
            f"Unknown synthetic protocol {short(protocol)}; write 'paper', or flows by name."
        )
    noise, duration = as_number("noise", noise), as_number("duration", duration)
    n_samples = as_whole_number("n_samples", n_samples, 2, 1_000_000)
    seed = as_whole_number("seed", seed)
    if not 0.0 <= noise <= 10.0:
        raise InputError(f"noise must be a fraction from 0 to 10; got {noise:g}. 0.01 means 1 %.")
    if duration <= 0.0:
        raise InputError(
            f"duration must be a positive number of relaxation times; got {duration:g}."
        )
    fluid = Fluid.dimensionless(make_law(law, parameters))
    times = np.linspace(0.0, duration, n_samples)
    generator = np.random.default_rng(seed)
    runs, exact = [], {}
    for name, flow in protocols.items():
        stress = simulate(fluid, flow, times)
        exact[name] = stress
        recorded = recorded_at(flow, stress.components)
        scale = noise * rms(recorded)
        runs.append(
            Run(
                name=name,
                time=times,
                protocol=flow,
                rate=shear_rates(flow, times),
                stress=recorded + scale * generator.standard_normal(n_samples),
            )
        )
    return SyntheticDataset(
        name=f"synthetic {law}",
        runs=tuple(runs),
        linear_sweep=linear_sweep(fluid),
        provenance=f"computed from the {law} law, noise {noise:g}, seed {seed}",
        truth=fluid,
        exact=exact,
        noise=float(noise),
    )


def linear_sweep(fluid: Fluid) -> LinearSweep:
    """Return G′ and G″ of a fluid, from its law linearised at rest.

    At 25 frequencies, over two decades to each side of the relaxation times.
    """
    times = np.asarray(fluid.relaxation_time)
    omega = np.geomspace(0.01 / times.max(), 100.0 / times.min(), 25)
    _, decays, drives = at_rest(fluid.law, fluid.n_modes)
    modulus = 1j * omega * float(fluid.solvent_viscosity)
    modes = zip(np.asarray(fluid.modulus), times, decays, drives, strict=True)
    for size, time, decay, drive in modes:
        modulus += size * modulus_at_rest(decay, drive, time * omega)
    return LinearSweep(omega, np.real(modulus), np.imag(modulus))


def at_rest(law: AbstractConstitutiveLaw, count: int) -> list[np.ndarray]:
    """Return dσ/dt of so many modes at rest, and its derivatives by the state and the shear rate.

    Dimensionless, shapes (count, s), (count, s, s), (count, s).
    """
    return list(map(np.asarray, _at_rest(law, count)))


def modulus_at_rest(
    decay: Float[np.ndarray, "s s"],
    drive: Float[np.ndarray, " s"],
    frequency: Float[np.ndarray, " n"],
) -> Complex[np.ndarray, " n"]:
    """Return G*/G of one mode at vanishing strain. `frequency`: times λ. Else as of `at_rest`."""
    # iωλ s = A s + b λγ̇, so that G* = iωλ s12/(λγ̇) of a mode with G = 1
    left = 1j * frequency[:, None, None] * np.eye(len(drive)) - decay
    drives = np.broadcast_to(drive[:, None], (len(frequency), len(drive), 1))
    return 1j * frequency * np.linalg.solve(left, drives)[:, 3, 0]


@compiled
def _at_rest(law, count):
    def of_mode(law):
        rest, still = law.rest(), jnp.zeros(())
        return (law.stress_rate(rest, still), *jax.jacfwd(law.stress_rate, (0, 1))(rest, still))

    return of_each_mode(of_mode, law, count)
