"""Records in which a curve is looked for: a start-up and three oscillations, the last to judge."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from independent.flow import Flow, oscillation, start_up
from independent.instruments import Instrument, Recording
from independent.material import Material

NOISE = 0.01
JUDGE = "judge.csv"
FLOWS = {
    "up.csv": (start_up(1.5), 6.0),
    "swing.csv": (oscillation(2.0, 1.0), 10.0),
    "wide.csv": (oscillation(4.0, 0.5), 12.0),
    JUDGE: (oscillation(3.0, 0.8), 10.0),
}


def as_it_is(run: Recording, flow: Flow) -> np.ndarray:
    """Return the stress as it is recorded."""
    del flow
    return run.stress


def curve_records(
    material: Material,
    instrument: Instrument | None = None,
    read: Callable[[Recording, Flow], np.ndarray] = as_it_is,
    seed: int = 0,
) -> dict[str, Recording]:
    """Return runs of 120 samples with white noise, of which `read` makes the stress in a flow."""
    generator, runs = np.random.default_rng(seed), {}
    for name, (flow, end) in FLOWS.items():
        run = (instrument or Instrument()).record(material, flow, np.linspace(0.02, end, 120))
        stress = read(run, flow)
        size = NOISE * np.sqrt(np.mean(stress**2))
        runs[name] = replace(run, stress=stress + size * generator.standard_normal(stress.size))
    return runs
