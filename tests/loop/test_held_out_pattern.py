"""A held-out run that is missed by less than three times the fitted misfit may still refute."""

import numpy as np
import pytest
from independent import Giesekus
from independent import start_up as flow_of
from independent.noise import white

from discover.loop import DeclaredModel, run_loop
from discover.dataset import Dataset, Run
from discover.protocols import start_up

TIMES = np.geomspace(0.05, 10.0, 80)
RATES = {"slow": 0.5, "fast": 2.0, "held": 4.0}
DECLARED = DeclaredModel.maxwell(100.0, 1.0)


def loop(held_mobility):
    """Return the loop on a Giesekus fluid, of which the held-out run may be another."""
    generator = np.random.default_rng(2)
    runs = []
    for name, rate in RATES.items():
        alpha = held_mobility if name == "held" else 0.3
        exact = Giesekus(alpha, 100.0).respond(flow_of(rate), TIMES).sigma12
        record = white(exact, 0.01, generator)
        runs.append(Run(name, TIMES, start_up(rate), np.full(len(TIMES), rate), record))
    return run_loop(
        Dataset("made", tuple(runs)), DECLARED, held_out=["held"],
        effects=["giesekus_mobility", "stress_offset"], max_effects=1,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(("mobility", "verdict"), [(0.3, "effects_added"), (0.315, "unexplained")])
def test_a_pattern_in_what_no_fit_saw_refutes_what_explains_the_fitted_runs(mobility, verdict):
    result = loop(mobility)
    assert [stage.effect for stage in result.stages] == ["giesekus_mobility"]
    assert result.error_after.held_out < 3.0 * result.error_after.fit
    assert result.verdict == verdict
    assert result.remaining["carries_over"] == (verdict == "effects_added")
