"""Terms that no law has by itself, in the place of a law: records by scipy."""

import numpy as np
import pytest
from independent import JohnsonSegalman, start_up

import discover as dc
from discover.dataset import Dataset, Run
from discover.protocols import start_up as protocol

TIMES = np.linspace(0.1, 8.0, 60)
TERM, NAME = "tr(sigma)*gammadot", "non_affine_motion"


@pytest.fixture(scope="module")
def records():
    lot, runs = np.random.default_rng(3), []
    for rate in (0.5, 1.0, 2.0):
        stress = JohnsonSegalman(0.3, 100.0).respond(start_up(rate), TIMES).sigma12
        noise = 0.01 * np.sqrt(np.mean(stress**2)) * lot.standard_normal(len(TIMES))
        rates = np.full(len(TIMES), rate)
        runs.append(Run(f"{rate}.csv", TIMES, protocol(rate), rates, stress + noise))
    return Dataset("runs", tuple(runs))


def asked(records, *effects):
    fluid = dc.Fluid(dc.make_law("ucm"), [100.0], [1.0])
    return dc.close_loop(
        records, fluid, held_out=["2.0.csv"], effects=list(effects), max_effects=1
    ).explanations


def test_a_term_without_a_law_is_no_likelier_than_not(records):
    # it follows every record to the noise, as the law does whose twin it is in shear
    alone = asked(records, TERM)
    assert alone.unexplained_probability >= 0.5
    assert 0.3 < alone.inclusion[TERM] <= 0.5


def test_its_twin_with_a_name_keeps_its_probability(records):
    both = asked(records, TERM, NAME)
    assert both.unexplained_probability < 0.2
    assert {(TERM,), (NAME,)} <= set(both.likeliest_first[0].members)
