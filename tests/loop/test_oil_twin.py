"""Start-ups of an oil behind a slow motor: what nobody declares is fitted, and the twin is told."""

import numpy as np
import pytest

import discover as dc

pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")
VISCOSITY, RISE, NOISE = 10.0, 0.3, 0.01
TIMES = np.linspace(0.02, 3.0, 60)
FEW = ["giesekus_mobility", "stress_offset"]


def looped(measured: bool, **options):
    """A loop with nothing declared on σ = η γ̇ₘ, γ̇ₘ = γ̇ (1 − exp(−t/t_m)), in closed form."""
    runs = []
    for number, rate in enumerate((1.0, 3.0, 10.0)):
        behind = rate * -np.expm1(-TIMES / RISE)
        lot, size = np.random.default_rng(number), VISCOSITY * np.sqrt(np.mean(behind**2))
        stress = VISCOSITY * behind + NOISE * size * lot.standard_normal(len(TIMES))
        flow = dc.measured_rate(TIMES, behind) if measured else dc.start_up(rate)
        told = behind if measured else np.full(len(TIMES), rate)
        runs.append(dc.Run(f"{rate:g}", TIMES, flow, told, stress, rate_is_measured=measured))
    return dc.close_loop(dc.Dataset("oil", tuple(runs)), effects=FEW, max_effects=1, **options)


@pytest.fixture(scope="module")
def commanded():
    return looped(measured=False)


def test_a_modulus_and_a_time_that_nobody_declares_are_fitted(commanded):
    # 180 samples of 1 % noise tell each constant to a per cent; 1 Pa and 1 s are far off
    found = commanded.declared_parameters
    assert found["modulus_Pa"].value == pytest.approx(VISCOSITY / RISE, rel=0.03)
    assert found["relaxation_time_s"].value == pytest.approx(RISE, rel=0.03)


def test_an_oil_behind_a_slow_motor_is_told_beside_the_mode_that_records_the_same(commanded):
    twin = commanded.remaining["oil_twin"]
    assert twin["viscosity"] == pytest.approx(VISCOSITY, rel=0.02)
    assert twin["rise_time"] == pytest.approx(RISE, rel=0.03)
    assert twin["inertia"] == 0.0
    assert "An oil of 10" in commanded.answer.alternative
    assert "motor's angle" in commanded.answer.next_test
    # nor is a normal stress claimed, of which an oil has none
    assert "no nonlinear law determined" in commanded.answer.title


def test_no_such_oil_is_told_where_the_rate_was_measured_at_the_tool():
    # control: the same records beside the rate that made them are those of an oil
    found = looped(measured=True)
    assert not found.remaining.get("oil_twin")
    assert found.material is not None
    assert found.material.law == "newtonian"


def test_no_such_oil_is_told_beside_a_relaxation_time_that_is_known():
    data = dc.Dataset("oil", tuple(_runs_of_a_mode()))
    base = dc.Fluid(dc.make_law("ucm"), VISCOSITY / RISE, RISE)
    assert dc.close_loop(data, base, effects=FEW, max_effects=1).remaining["oil_twin"] is None


def _runs_of_a_mode():
    for number, rate in enumerate((1.0, 10.0)):
        stress = VISCOSITY * rate * -np.expm1(-TIMES / RISE)
        lot, size = np.random.default_rng(number), NOISE * np.sqrt(np.mean(stress**2))
        stress = stress + size * lot.standard_normal(len(TIMES))
        yield dc.Run(f"{rate:g}", TIMES, dc.start_up(rate), np.full(len(TIMES), rate), stress)


def test_an_inertia_behind_the_motor_is_a_solvent_beside_the_mode():
    # σ = η γ̇ₘ + I dγ̇ₘ/dt integrated by itself, and a Maxwell mode with a solvent in closed form
    viscosity, rise, inertia, rate = 8.0, 0.2, 0.5, 3.0
    behind, change = rate * -np.expm1(-TIMES / rise), rate / rise * np.exp(-TIMES / rise)
    solvent = inertia / rise
    mode = (viscosity - solvent) * rate * -np.expm1(-TIMES / rise) + solvent * rate
    np.testing.assert_allclose(mode, viscosity * behind + inertia * change, rtol=1e-12)
    from discover.identify.twins import oil_twin

    found = oil_twin((viscosity - solvent) / rise, rise, solvent, [next(_runs_of_a_mode())])
    exact = {"viscosity": viscosity, "rise_time": rise, "inertia": inertia}
    assert found == {name: pytest.approx(value, rel=1e-12) for name, value in exact.items()}
