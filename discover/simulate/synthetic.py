"""Synthetic data sets from a known law."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from discover.dataset.run import ShearDataset, ShearRun
from discover.errors import InputError
from discover.laws.multimode import Fluid
from discover.laws.registry import make_law
from discover.protocols.paper import TRAINING_DURATION, paper_training_protocols
from discover.protocols.shear import ShearProtocol, shear_rates
from discover.simulate.solve import ShearStress, simulate


@dataclass(frozen=True, repr=False)
class SyntheticDataset(ShearDataset):
    """A data set whose law is known.

    Attributes
    ----------
    truth
        The fluid that made it.
    exact
        Noise-free stresses of each run, normal stresses included.
    """

    truth: Fluid | None = None
    exact: Mapping[str, ShearStress] | None = None


def synthetic_dataset(
    law: str,
    parameters: Mapping[str, float] | None = None,
    protocol: str | Mapping[str, ShearProtocol] = "paper",
    noise: float = 0.0,
    seed: int = 0,
    n_samples: int = 201,
    duration: float = TRAINING_DURATION,
) -> SyntheticDataset:
    """Return σ12 of a named dimensionless law in shear flows, with white noise.

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
    """
    if protocol == "paper":
        protocols: Mapping[str, ShearProtocol] = paper_training_protocols()
    elif isinstance(protocol, Mapping):
        protocols = protocol
    else:
        raise InputError(f"Unknown synthetic protocol {protocol!r}; write 'paper'.")
    if not (np.isfinite(noise) and 0.0 <= noise <= 10.0):
        raise InputError(f"noise must be a fraction from 0 to 10; got {noise}. 0.01 means 1 %.")
    if not 2 <= n_samples <= 1_000_000:
        raise InputError(f"n_samples must be from 2 to a million; got {n_samples}.")
    if not (np.isfinite(duration) and duration > 0):
        raise InputError(f"duration must be a positive number of relaxation times; got {duration}.")
    fluid = Fluid.dimensionless(make_law(law, parameters))
    times = np.linspace(0.0, duration, n_samples)
    generator = np.random.default_rng(seed)
    runs, exact = [], {}
    for name, flow in protocols.items():
        stress = simulate(fluid, flow, times)
        exact[name] = stress
        scale = noise * float(np.sqrt(np.mean(stress.shear_stress**2)))
        runs.append(
            ShearRun(
                name=name,
                time=times,
                protocol=flow,
                shear_rate=shear_rates(flow, times),
                shear_stress=stress.shear_stress + scale * generator.standard_normal(n_samples),
            )
        )
    return SyntheticDataset(
        name=f"synthetic {law}",
        runs=tuple(runs),
        provenance=f"computed from the {law} law, noise {noise:g}, seed {seed}",
        truth=fluid,
        exact=exact,
    )
