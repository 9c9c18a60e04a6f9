"""Effects whose inner constant is at an end of its range are something else as well."""

import numpy as np
import pytest
from hostile_fluids import PartlyRetracting
from independent import RoliePoly
from independent.flow import oscillation

from discover.dataset import Dataset, Run
from discover.loop import DeclaredModel, run_loop
from discover.protocols import oscillatory_shear, shear_rates

TIMES = np.linspace(0.1, 12.0, 60)


def runs_of(fluid):
    generator = np.random.default_rng(0)
    for amplitude in (2.0, 4.0, 6.0):
        flow = oscillatory_shear(amplitude, 1.0)
        stress = fluid.respond(oscillation(amplitude, 1.0), TIMES).sigma12
        noise = 0.01 * np.sqrt(np.mean(stress**2)) * generator.standard_normal(len(TIMES))
        yield Run(f"{amplitude}", TIMES, flow, shear_rates(flow, TIMES), stress + noise)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("fluid", "aliases"),
    [
        (PartlyRetracting(0.5), ("partly_retracting_strands",)),
        (RoliePoly(1.0, stretch_time=0.0, modulus=100.0), ()),  # all released constraints count
    ],
)
def test_release_without_constraints_is_told_as_strands_that_retract_partly(fluid, aliases):
    result = run_loop(
        Dataset("strands", tuple(runs_of(fluid))), DeclaredModel.maxwell(100.0, 1.0),
        effects=("convective_constraint_release", "giesekus_mobility", "ptt_linear"),
        max_effects=1,
    )  # fmt: skip
    assert [stage.effect for stage in result.stages] == ["convective_constraint_release"]
    assert result.stages[0].aliases == aliases
