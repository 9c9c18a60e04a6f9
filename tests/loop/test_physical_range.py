"""What a fit can only have at the end of a physical range is no finding; data by closed forms."""

import numpy as np
import pytest

from discover.loop import DeclaredModel, run_loop
from discover.closed_loop.search.scoring.physical_range import at_an_end, undetermined
from discover.dataset import Dataset, Run
from discover.effects import make_effect
from discover.forward import AugmentedModel
from discover.protocols import measured_rate, start_up

STRAIN = 0.03
MODULI, TIMES = np.array([3000.0, 1500.0, 500.0]), np.array([0.05, 0.5, 5.0])
CANDIDATES = ["viscous_heating", "softening_by_work", "relaxation_mode", "stress_offset"]


def relaxation(count=120, noise=0.01):
    """Return the stress after a step of 3 % strain, imported as a run whose first sample is it."""
    time = np.geomspace(0.01, 30.0, count)
    stress = STRAIN * MODULI @ np.exp(-time / TIMES[:, None])
    size = np.sqrt(np.mean(stress**2))
    stress += noise * size * np.random.default_rng(0).normal(size=count)
    rate = np.zeros(count)
    rate[0] = STRAIN / time[0]
    flow = measured_rate(time, rate)
    return Run("step.csv", time, flow, rate, stress, rate_is_measured=True)


@pytest.fixture(scope="module")
def relaxed():
    declared = DeclaredModel.maxwell(2000.0, 1.0, fit_modulus=True, fit_relaxation_time=True)
    return run_loop(Dataset("step", (relaxation(),)), declared, effects=CANDIDATES)


@pytest.mark.slow
def test_no_heat_is_found_in_the_relaxation_after_a_step_of_three_per_cent(relaxed):
    names = {stage.effect for stage in relaxed.stages}
    aliases = {alias for stage in relaxed.stages for alias in stage.aliases}
    # what is missing are modes, and no work of 2 J/m³ warms or breaks anything
    assert "viscous_heating" not in names | aliases
    assert "softening_by_work" not in names | aliases
    assert relaxed.verdict == "unexplained" or names == {"relaxation_mode"}


def warming(heating, count=60):
    """Return start-up of a melt that warms, by Euler steps fine enough: 1 MPa at 1 1/s."""
    modulus, time, rate, steps = 1e6, 1.0, 3.0, 400
    at = np.linspace(0.1, 6.0, count)
    stress = heat = 0.0
    record = []
    fine = np.linspace(0.0, at[-1], steps * count + 1)
    for i, h in enumerate(np.diff(fine)):
        if i % steps == 0 and i:
            record.append(stress)
        middle = stress + 0.5 * h * (modulus * rate - stress * np.exp(heat) / time)
        warm = heat + 0.5 * h * heating * stress * rate
        stress += h * (modulus * rate - middle * np.exp(warm) / time)
        heat += h * heating * middle * rate
    record.append(stress)
    record = np.array(record)
    noise = 0.01 * np.sqrt(np.mean(record**2)) * np.random.default_rng(2).normal(size=count)
    flow = start_up(rate)
    return Run("melt.csv", at, flow, np.full(count, rate), record + noise)


@pytest.mark.slow
def test_the_heat_of_a_stiff_melt_is_still_found():
    dataset = Dataset("melt", (warming(2e-8),))
    result = run_loop(dataset, DeclaredModel.maxwell(1e6, 1.0), effects=CANDIDATES)
    assert result.verdict == "effects_added"
    (stage,) = result.stages
    assert "viscous_heating" in (stage.effect, *stage.aliases)
    assert next(iter(stage.parameters.values())).value == pytest.approx(2e-8, rel=0.15)


MODEL = AugmentedModel(
    DeclaredModel.maxwell(100.0, 1.0),
    [make_effect("thixotropy"), make_effect("giesekus_mobility"), make_effect("stress_gain")],
)


def with_values(name, *values):
    theta = MODEL.zero()
    theta[MODEL.positions(name)] = values
    return theta


@pytest.mark.parametrize(
    ("name", "values", "ends"),
    [
        ("thixotropy", (0.5, 1e-3), True),
        ("thixotropy", (1e3, 2.0), True),
        ("thixotropy", (0.5, 2.0), False),
        # structure that never builds up again is something real
        ("thixotropy", (0.5, 1e6), False),
        ("giesekus_mobility", (1.0,), True),
        ("giesekus_mobility", (0.9,), False),
        # an amplitude at zero is dropped for its own reason
        ("giesekus_mobility", (0.0,), False),
        ("stress_gain", (-0.8,), True),
        ("stress_gain", (0.0,), False),
    ],
)
def test_a_value_at_an_end_of_its_range_is_told(name, values, ends):
    assert bool(at_an_end(MODEL, with_values(name, *values), [name])) == ends


@pytest.mark.parametrize(
    ("interval", "left_open"),
    [
        ((0.5, 3.5), False),
        ((1e-3, 4.0), False),  # known from above alone
        ((1e-3, 40.0), True),  # up to twenty times: four decades in all
        ((1e-3, 1e6), True),
    ],
)
def test_a_time_that_is_open_over_decades_is_no_finding(interval, left_open):
    theta = with_values("thixotropy", 0.5, 2.0)
    at = MODEL.positions("thixotropy")
    bounds = {at[0]: (0.4, 0.6), at[1]: interval}
    assert bool(undetermined(MODEL, theta, bounds, "thixotropy", 8.0)) == left_open
    # a structure that takes longer than any run to build up is known well enough
    assert not undetermined(MODEL, theta, bounds, "thixotropy", 1.0)
    # but steady states know no time
    assert bool(undetermined(MODEL, theta, bounds, "thixotropy", 0.0)) == left_open
