"""What a loop names where a structure is in the fluid, and where none is; data by scipy alone."""

import numpy as np
import pytest
from independent import Giesekus, Structured, Thixotropic, UpperConvectedMaxwell, steps

from discover.dataset import Dataset, Run
from discover.loop import DeclaredModel, run_loop
from discover.protocols import shear_rates, step_rates

TIMES = np.append(np.geomspace(0.05, 6.0, 20), 6.0 + np.geomspace(0.05, 6.0, 20))
RATES = ((0.3, 3.0), (1.0, 0.2), (4.0, 0.5))
CANDIDATES = (
    "thixotropy", "thixotropic_modulus", "thixotropic_relaxation",
    "thixotropic_relaxation_two_times", "giesekus_mobility",
)  # fmt: skip
FLUIDS = {
    "giesekus_mobility": Giesekus(0.3, 100.0, 1.0),
    "thixotropy": Thixotropic(UpperConvectedMaxwell(100.0, 1.0), 0.3, 4.0),
    "thixotropic_relaxation": Structured(0.4, (3.0,), 0.6, mobility=0.0),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", FLUIDS)
def test_a_loop_names_what_is_in_the_fluid_and_no_structure_with_more_constants(name):
    generator = np.random.default_rng(0)
    runs = []
    for rates in RATES:
        flow = step_rates([0.0, 6.0], rates)
        stress = FLUIDS[name].respond(steps([0.0, 6.0], rates), TIMES).sigma12
        noise = 0.01 * np.sqrt(np.mean(stress**2)) * generator.standard_normal(len(TIMES))
        run = Run(str(rates), TIMES, flow, shear_rates(flow, TIMES), stress + noise)
        runs.append(run)
    result = run_loop(
        Dataset(name, tuple(runs)), DeclaredModel.maxwell(100.0, 1.0), effects=CANDIDATES,
        max_effects=2, explanations=1,
    )  # fmt: skip
    assert [stage.effect for stage in result.stages] == [name]
    assert result.verdict == "effects_added"
