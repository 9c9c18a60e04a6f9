"""Long holds of a rate on a clock that slows down change no answer; records by scipy."""

from functools import cache

import numpy as np
import pytest
from independent import Giesekus, steps

import discover as dc
from discover.forward import make_batch
from discover.forward.grid import STRAIN_STEP
from discover.forward.of_fluids import observed
from discover.learners.runs import with_shorter_holds
from discover.protocols import measured_rate, oscillatory_shear, step_rates
from tensor_library.library import build_library

MODULUS, TIME, MOBILITY = 2.0, 0.02, 0.4
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
LIBRARY = build_library(degree=0)


@cache
def records(noise=0.01, seed=0):
    """Giesekus at a low rate for 2 s, then held at a high one for a minute."""
    generator, runs = np.random.default_rng(seed), []
    for rate in (10.0, 40.0, 100.0):
        flow, law = ([0.0, 2.0], [1.0, rate]), Giesekus(MOBILITY, MODULUS, TIME)
        times = np.append(np.geomspace(2e-3, 1.9, 15), 2.0 + np.geomspace(2e-3, 60.0, 40))
        exact = law.respond(steps(*flow), times).sigma12
        off = noise * np.sqrt(np.mean(exact**2)) * generator.standard_normal(times.size)
        rates = np.where(times < 2.0, 1.0, rate)
        runs.append(dc.Run(f"to_{rate:g}", times, step_rates(*flow), rates, exact + off))
    return runs


def predicted(runs, law):
    batch = make_batch(runs, STRAIN_STEP, relaxation_time=TIME)
    fluid = dc.Fluid(dc.make_law(*law), MODULUS, TIME)
    return observed([fluid], batch)[0, :, :, 0], np.max(np.sum(batch.parts[0].pieces, axis=1))


@pytest.mark.parametrize(
    "law",
    [
        ("giesekus", {"alpha": 0.4}),
        pytest.param(("johnson_segalman", {"xi": 0.3}), marks=pytest.mark.slow),
    ],
)
def test_laws_record_the_same_on_shortened_runs_in_few_steps(law):
    runs = records(noise=0.0)
    whole, many = predicted(runs, law)
    shorter, few = predicted(with_shorter_holds(runs, TIME), law)
    np.testing.assert_allclose(shorter, whole, atol=1e-5 * np.max(np.abs(whole)))
    assert 3 * few < many


def test_what_is_held_only_shortly_or_not_at_all_stays_as_it_is():
    times = np.linspace(0.01, 60.0, 400)
    for flow in (
        oscillatory_shear(4.0, 1.0),
        measured_rate(times, 4.0 * np.cos(times)),
        measured_rate(times, np.geomspace(10.0, 0.01, times.size)),
    ):
        run = dc.Run("a", times, flow, np.ones(times.size), np.ones(times.size))
        assert with_shorter_holds([run], TIME)[0] is run
    runs = records()
    assert all(a is b for a, b in zip(with_shorter_holds(runs, 2.0), runs, strict=True))


@pytest.mark.slow
def test_the_sparse_law_is_found_on_whole_holds():
    found = dc.TensorSINDy(LIBRARY, base=BASE, max_terms=2).fit(records())
    assert [term.term for term in found.terms_] == ["sigma.sigma"]
    low, high = found.terms_[0].ci95
    assert low < MOBILITY < high
