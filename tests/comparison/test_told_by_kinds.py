"""What each kind of test determined, told by both commands of records by scipy."""

import numpy as np
import pytest
from discover.learners.tensor_sindy.told_by_kinds import told_by_kinds
from discover.report.told_by import told_by_table
from independent import Giesekus, start_up

import discover as dc
from discover.learners.tensor_sindy import TensorSINDy
from discover.protocols.control import steady_rates
from tensor_library.library import build_library

MODULUS, TIME, MOBILITY, NOISE = 100.0, 1.0, 0.3, 0.01
MATERIAL = Giesekus(MOBILITY, MODULUS, TIME)
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)


def noisy(values, seed, size):
    return values + NOISE * size * np.random.default_rng(seed).standard_normal(len(values))


def started(rate):
    times = np.linspace(0.05, 8.0, 60)
    stress = MATERIAL.respond(start_up(rate), times).sigma12
    stress = noisy(stress, int(10 * rate), np.sqrt(np.mean(stress**2)))
    return dc.Run(f"at_{rate:g}", times, dc.start_up(rate), np.full(60, rate), stress)


def flow_curve():
    rates = np.geomspace(0.1, 10.0, 20)
    stress = np.array([MATERIAL.steady_shear(rate)[0] for rate in rates])
    counted = np.arange(1.0, 21.0)
    return dc.Run("curve", counted, steady_rates(rates), rates, noisy(stress, 1, stress))


def data(*runs):
    return dc.Dataset("told", runs)


@pytest.mark.slow
def test_the_loop_tells_what_each_kind_of_test_determined(tmp_path):
    loop = dc.close_loop(
        data(started(0.5), started(3.0), flow_curve()), BASE, effects=["giesekus_mobility"],
        held_out=data(started(6.0)),
    )  # fmt: skip
    told = {one.name: one for one in loop.told_by}
    own = told["alpha of giesekus_mobility"]
    alpha = loop.stages[0].parameters["alpha"]
    low, high = alpha.ci95_given_effects
    # the interval holds small faults of reading too, of 0.5 to 2 %, and the table noise alone: of
    # 1 % in 140 samples, to which each run's σ12 answers by 0.1 to 0.3 of a relative change of α
    assert own.together < 0.5 * (high - low) / alpha.value
    assert 2.0 * 0.01 / np.sqrt(140) / 0.3 < own.together < 2.0 * 0.01 / np.sqrt(140) / 0.1
    assert set(own.alone) == {"start-up", "flow curve"}
    # twenty samples beside a hundred and twenty; they weigh as much as sixty, so together can be a
    # little worse than the start-ups alone
    assert own.alone["start-up"] < own.alone["flow curve"] < 1.0
    assert own.together < 1.1 * own.alone["start-up"]
    assert told["prediction of at_6"].together < 0.02
    assert loop.to_json()["told_by"][0]["alone"].keys() == own.alone.keys()
    assert "What each kind of test determined" in loop.to_html(tmp_path / "loop.html").read_text()


@pytest.mark.slow
def test_of_one_kind_of_test_nothing_is_told(tmp_path):
    loop = dc.close_loop(data(started(0.5), started(3.0)), BASE, effects=["giesekus_mobility"])
    assert loop.told_by == ()
    assert told_by_table(loop.told_by) is None
    assert (
        "What each kind of test determined" not in loop.to_html(tmp_path / "loop.html").read_text()
    )


@pytest.mark.slow
def test_a_sparse_law_tells_it_too():
    runs = [started(0.5), started(3.0), flow_curve()]
    sparse = TensorSINDy(build_library(degree=0), modulus=MODULUS, relaxation_time=TIME).fit(runs)
    (term,) = sparse.result_.terms
    chosen = sparse.path_[sparse.result_.details["chosen"]]
    told = {one.name: one for one in told_by_kinds(sparse.search_, chosen, runs)}
    own = told["coefficient of sigma.sigma"]
    low, high = term.ci95
    assert own.together == pytest.approx(0.5 * (high - low) / term.coefficient, rel=0.02)
    assert own.together < own.alone["start-up"] < own.alone["flow curve"]
    # N1 of a Giesekus fluid moves less than its mobility
    assert told["N1 in the start-up, if this is the law"].together < own.together
    assert told_by_kinds(sparse.search_, chosen, [runs[0]] * 3) == ()
