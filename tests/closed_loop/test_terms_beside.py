"""Runs that are loadings of their own, of laws in and outside the dictionary: records by scipy."""

import numpy as np
import pytest
from independent import Giesekus, oscillation, start_up
from independent.pom_pom import ExtendedPomPom

import discover as dc
from discover.dataset import Dataset, Run
from discover.protocols import oscillatory_shear
from discover.protocols import start_up as protocol

pytestmark = pytest.mark.usefixtures("effects_alone")

GROWTH, WAVE = np.linspace(0.1, 8.0, 80), np.linspace(0.1, 12.0, 120)
FLOWS = {
    "slow.csv": (start_up(0.5), protocol(0.5), GROWTH),
    "middle.csv": (start_up(1.0), protocol(1.0), GROWTH),
    "fast.csv": (start_up(2.0), protocol(2.0), GROWTH),
    "wave.csv": (oscillation(2.0, 1.0), oscillatory_shear(2.0, 1.0), WAVE),
    "held.csv": (start_up(3.0), protocol(3.0), GROWTH),
}


def closed(fluid, seed, **options):
    lot, runs = np.random.default_rng(seed), []
    for name, (flow, own, times) in FLOWS.items():
        exact = fluid.respond(flow, times).sigma12
        factor = 1.0 + 0.03 * lot.standard_normal()
        noise = 0.01 * np.sqrt(np.mean(exact**2)) * lot.standard_normal(len(times))
        rates = np.asarray(flow.rate(times), float) + 0.0 * times
        runs.append(Run(name, times, own, rates, factor * exact + noise))
    base = dc.Fluid(dc.make_law("ucm"), [100.0], [1.0])
    effects = ["giesekus_mobility", "convective_constraint_release"]
    data = Dataset("runs", tuple(runs))
    return dc.close_loop(
        data, base, held_out=["held.csv"], effects=effects, loading=0.03, **options
    )


# two effects follow its runs to less than the noise, and miss the one held out by 1 to 2 %
@pytest.mark.parametrize("seed", [5001, pytest.param(5002, marks=pytest.mark.slow)])
def test_a_law_outside_the_dictionary_is_not_explained_by_loadings(seed):
    found = closed(ExtendedPomPom(5.0, 0.1, 0.4, 100.0), seed)
    assert found.verdict == "unexplained"
    assert "follows terms of the library" in found.remaining["description"]
    # who gives a noise knows what is in it
    if seed == 5002:
        given = closed(ExtendedPomPom(5.0, 0.1, 0.4, 100.0), seed, noise=0.012)
        assert "follows terms of the library" not in given.remaining["description"]


@pytest.mark.parametrize("seed", [5001, 5002])
def test_a_law_of_the_dictionary_stays_explained(seed):
    found = closed(Giesekus(0.3, 100.0), seed)
    assert [stage.effect for stage in found.stages] == ["giesekus_mobility"]
    assert found.verdict == "effects_added"
