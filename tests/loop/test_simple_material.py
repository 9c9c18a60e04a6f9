"""A yield stress, a viscous fluid, a solid are named; laws that relax are not taken for one."""

from dataclasses import replace

import numpy as np
import pytest
from independent import Giesekus
from independent.noise import white
from noisy_runs import run_at, run_of_wave

import discover as dc
from discover.answer.simple_material import SimpleMaterial, material_of
from discover.dataset import Dataset, LinearSweep, Run
from discover.forward import DeclaredModel
from discover.inference.closed_forms import recorded
from discover.inference.simple_materials import SimpleFit
from discover.loop import run_loop
from discover.loop.simple import check_of
from discover.protocols import imposed_stress, measured_rate, steady_rates
from discover.protocols import oscillations as oscillations_of

pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")
RATES = np.geomspace(0.01, 100.0, 25)
FREQUENCIES = np.geomspace(0.1, 100.0, 25)
FEW = ["solvent_viscosity", "giesekus_mobility", "yield_stress"]


def noisy(values, noise, seed=0):
    return values * (1.0 + noise * np.random.default_rng(seed).standard_normal(len(values)))


def flow_curve(stress, rates=RATES, noise=0.02):
    times = np.arange(1.0, len(rates) + 1.0)
    return Run("flow_curve.csv", times, steady_rates(rates), rates, noisy(stress(rates), noise))


def giesekus(rates, alpha):
    """Steady shear stress of a Giesekus fluid with λ = 1 s."""
    return np.array([Giesekus(alpha, 100.0).steady_shear(rate)[0] for rate in rates])


def sweep(storage, loss, noise=0.01):
    lot, size = np.random.default_rng(1), noise * np.hypot(storage, loss)
    moduli = [one + size * lot.standard_normal(len(size)) for one in (storage, loss)]
    data = Dataset("sweep", (), LinearSweep(FREQUENCIES, *np.maximum(moduli, 1e-9)))
    return list(data.with_material_functions(["lve"]).runs)


def start_ups(stress, noise=0.01):
    times = np.linspace(0.05, 10.0, 100)
    return [
        run_at(rate, times, noisy(stress(times, rate), noise, seed))
        for seed, rate in enumerate((0.1, 1.0))
    ]


def creep(compliance, noise=0.01):
    """Creep at two stresses of what has a compliance in 1/Pa of the time in s."""
    times = np.linspace(0.1, 20.0, 60)
    return [
        crept(times, level * np.ones(60), noisy(level * compliance(times), noise, seed))
        for seed, level in enumerate((10.0, 30.0))
    ]


def crept(times, stress, strain):
    rate = np.gradient(strain, times)
    return Run(f"{stress[0]:g}", times, imposed_stress(times, stress), rate, stress, strain=strain)


def material_in(runs, modulus=1.0) -> SimpleMaterial | None:
    declared = DeclaredModel.named("ucm", {}, [modulus], [1.0])
    return run_loop(Dataset("runs", tuple(runs)), declared, effects=FEW, max_effects=1).material


def test_a_maxwell_mode_is_exact_in_long_steps_of_a_rate_that_grows_evenly():
    times = np.array([0.0, 3.0, 4.0, 9.0])  # steps of one and a half to six relaxation times
    run = Run("ramp", times, measured_rate(times, times), times, np.ones(4))
    stress = recorded("maxwell", (10.0, 1.5, 0.0), run)
    # G λ (t − λ (1 − exp(−t/λ))): the integral of the rate t, faded
    exact = 10.0 * 1.5 * (times + 1.5 * np.expm1(-times / 1.5))
    np.testing.assert_allclose(stress, exact, rtol=1e-12)  # rounding


@pytest.mark.parametrize(
    ("runs", "law", "constants"),
    [
        ([flow_curve(lambda r: 12.0 + 3.0 * r**0.45)], "herschel_bulkley", (12.0, 3.0, 0.45)),
        ([flow_curve(lambda r: 5.0 + 0.2 * r)], "herschel_bulkley", (5.0, 0.2, 1.0)),
        ([flow_curve(lambda r: 2.0 * r)], "newtonian", (2.0,)),
        (start_ups(lambda t, rate: 5.0 * rate + 0.0 * t), "newtonian", (5.0,)),
        (sweep(np.full(25, 50.0), 2.0 * FREQUENCIES), "kelvin_voigt", (50.0, 2.0)),
        (start_ups(lambda t, rate: rate * (50.0 * t + 20.0)), "kelvin_voigt", (50.0, 20.0)),
        (creep(lambda t: -np.expm1(-t / 2.0) / 50.0), "kelvin_voigt", (50.0, 100.0)),
        (creep(lambda t: 0.02 + 0.0 * t), "kelvin_voigt", (50.0, 0.0)),
        (creep(lambda t: t / 20.0), "newtonian", (20.0,)),
    ],
)
def test_a_simple_material_is_named_with_its_constants(runs, law, constants):
    found = material_in(runs)
    assert found.law == law
    for constant, truth in zip(found.constants, constants, strict=True):
        low, high = constant.ci95
        # twice the 95 % interval: six worlds of one seed each, three constants
        assert abs(constant.value - truth) < 2.0 * (high - low)


def test_a_yield_stress_is_tested_by_creep_at_stresses_below_and_above_its_interval():
    ends = (11.0, 13.0), (2.0, 4.0), (0.4, 0.6)
    fluid = material_of(SimpleFit("herschel_bulkley", (12.0, 3.0, 0.5), ends, 0.01, 5.0))
    # a tenth below the one end and above the other; ((14 − 12)/3)² = 0.44
    said = "Creep at 9.9 and 14 Pa until steady: this law gives 0 and 0.44 1/s."
    assert check_of(fluid) == said


@pytest.mark.parametrize("alpha", [0.1, 0.5, 0.9])
def test_a_giesekus_flow_curve_is_no_yield_stress(alpha):
    for rates in (RATES, np.geomspace(1.0, 1000.0, 25)):
        curve = flow_curve(lambda r: giesekus(r, alpha), rates)
        assert material_in([curve], modulus=100.0) is None


def test_moduli_at_one_frequency_are_no_solid():
    strain, level = np.geomspace(1e-3, 1e-2, 12), np.ones(12)
    moduli = 30.0 * level, 60.0 * level
    whole = Run(
        "amplitudes", np.arange(1.0, 13.0), oscillations_of(strain, 2.0 * level), 2.0 * strain,
        np.hypot(*moduli) * strain, strain=strain, storage_modulus=moduli[0],
        loss_modulus=moduli[1],
    )  # fmt: skip
    assert material_in(whole.records) is None


@pytest.mark.parametrize("noise", [0.003, 0.03])
def test_waves_of_one_frequency_that_may_have_gone_on_before_are_no_solid(noise):
    # closed form of a Maxwell fluid in steady alternation, ω = λ = 1; control: a start-up as well,
    # which a solid and a fluid do not follow alike
    times = np.linspace(0.0, 12.0, 120)
    shape = np.sin(times) + np.cos(times)
    waves = [
        run_of_wave(size, 1.0, times, noisy(50.0 * size * shape, noise, seed))
        for seed, size in enumerate((0.5, 2.0))
    ]
    assert material_in(waves) is None
    solid = material_in([*waves, *start_ups(lambda t, rate: rate * (50.0 * t + 50.0), noise)])
    assert solid.law == "kelvin_voigt"


def test_a_maxwell_fluid_and_a_power_law_are_none_of_them():
    w = FREQUENCIES
    assert material_in(sweep(100.0 * w**2 / (1.0 + w**2), 100.0 * w / (1.0 + w**2))) is None
    assert material_in(start_ups(lambda t, rate: 100.0 * rate * (1.0 - np.exp(-t)))) is None
    assert material_in([flow_curve(lambda r: 3.0 * r**0.5)]) is None
    assert material_in(creep(lambda t: (1.0 + t) / 100.0), modulus=100.0) is None


def test_creep_and_recovery_of_a_solid_in_closed_form_follow_its_equation():
    times, modulus, viscosity = np.linspace(0.02, 10.0, 500), 30.0, 60.0
    stress = np.where(times < 5.0, 20.0, 0.0)
    # G γ + η γ̇ = σ: towards σ/G within η/G = 2 s, from 4.98 s on back to 0
    last = times[times < 5.0][-1]
    strain = -20.0 / modulus * np.expm1(-np.minimum(times, last) / 2.0)
    strain *= np.exp(-np.maximum(times - last, 0.0) / 2.0)
    found = recorded("kelvin_voigt", (modulus, viscosity), crept(times, stress, strain))
    # a jump takes a thousandth of the 0.02 s between two samples
    np.testing.assert_allclose(found, strain, atol=1e-4 * np.max(strain))


@pytest.mark.parametrize(
    ("stress", "law"),
    [
        (lambda r: 3.0 * r**0.5, "power_law"),
        (lambda r: (0.1 + 4.9 * (1.0 + (0.8 * r) ** 2.0) ** (-0.3)) * r, "carreau_yasuda"),
    ],
)
def test_a_flow_curve_that_thins_shows_no_elasticity_where_no_time_is_known(stress, law):
    free = ["modulus_Pa", "relaxation_time_s"]
    declared = DeclaredModel.named("ucm", {}, [1.0], [1.0], free=free)
    curve = Dataset("curve", (flow_curve(stress),))
    found = run_loop(curve, declared, effects=FEW, max_effects=1)
    assert found.material.law == law
    # control: beside a time that is known the same curve is one of a fluid that relaxes
    assert material_in(curve.runs) is None


def test_a_normal_stress_recorded_besides_makes_no_viscous_fluid_unless_it_is_noise():
    declared = DeclaredModel.named(
        "ucm", {}, [1.0], [1.0], free=["modulus_Pa", "relaxation_time_s"]
    )
    curve = flow_curve(lambda r: 3.0 * r**0.5)
    lot = np.random.default_rng(4)
    elastic = 2.0 * RATES * (1.0 + 0.03 * lot.standard_normal(len(RATES)))
    noise = 0.05 * curve.stress * lot.standard_normal(len(RATES))
    found = []
    for normal in (elastic, noise):
        run = replace(curve, first_normal_stress_difference=normal)
        result = run_loop(Dataset("curve", (run,)), declared, effects=FEW, max_effects=1)
        found.append(result.material and result.material.law)
    assert found == [None, "power_law"]


def test_a_loop_and_a_comparison_name_a_yield_stress_alike_and_ask_no_learner(tmp_path):
    data = Dataset("carbopol", (flow_curve(lambda r: 15.0 + 4.0 * r**0.5),))
    found = run_loop(data, DeclaredModel.named("ucm", {}, [1.0], [1.0]))
    assert found.answer.headline.startswith("Yield-stress fluid (Herschel–Bulkley), τ_y = 1")
    assert found.use["law"] == "herschel_bulkley"
    assert found.use["constants"]["yield_stress_Pa"]["unit"] == "Pa"
    assert "stress(rate)" in found.answer.written["python"]
    assert "Use for steady shear stress only, 0.01–100 1/s" in found.answer.written["python"]
    data = Dataset("carbopol", (flow_curve(lambda r: 15.0 + 4.0 * r**0.5),))
    lines = []
    compared = dc.compare(data, tolerance=0.2, progress=lambda line, share: lines.append(line))
    assert not any("tensor_sindy" in line for line in lines)
    assert compared.answer.lines == dc.close_loop(data, tolerance=0.2).answer.lines
    assert compared.answer.tolerance == 0.2
    assert compared.adequate
    assert compared.undetermined == ["N1", "N2"]
    names = ["yield_stress_Pa", "consistency_Pa_sn", "flow_index"]
    assert list(compared.summary().loc["answer"].index) == names
    page = compared.to_html(tmp_path / "page.html").read_text("utf-8")
    assert "Yield-stress fluid" in page
    assert "Laws found" not in page


@pytest.mark.parametrize(
    ("free", "law"), [(["modulus_Pa", "relaxation_time_s"], "newtonian"), (["modulus_Pa"], None)]
)
def test_a_constant_viscosity_is_no_elastic_fluid_unless_its_time_is_declared(free, law):
    # the declared mode starts where a study starts it: it has the viscosity of the curve
    declared = DeclaredModel.named("ucm", {}, [6.0], [0.5], free=free)
    data = Dataset("oil", (flow_curve(lambda r: 3.0 * r),))
    found = run_loop(data, declared)
    assert (found.material.law if found.material else None) == law
    if law:
        assert found.use["constants"]["viscosity_Pa_s"]["value"] == pytest.approx(3.0, rel=0.02)
        assert "lambda" not in found.answer.written["rheotool"]


def oscillations(stress, noise):
    times, runs = np.linspace(0.0, 12.0, 60), []
    for amplitude in (0.5, 5.0):
        rate, lot = amplitude * np.cos(times), np.random.default_rng(int(10 * amplitude))
        values = white(stress(times, rate, amplitude), noise, lot)
        runs.append(run_of_wave(amplitude, 1.0, times, values))
    return Dataset("oscillations", tuple(runs))


def thinned(times, rate, amplitude):
    return (0.1 + 4.9 * (1.0 + (0.8 * np.abs(rate)) ** 2.0) ** (-0.3)) * rate


def yielding(times, rate, amplitude, yields=8.0):
    return np.sign(rate) * (yields + 4.0 * np.abs(rate) ** 0.6)


def of_a_power(times, rate, amplitude):
    return yielding(times, rate, amplitude, yields=0.0)


def maxwell(times, rate, amplitude):
    """Return σ12 of one mode of 5 Pa and 1 s from rest under γ̇0 cos t, by hand."""
    return 2.5 * amplitude * (np.cos(times) + np.sin(times) - np.exp(-times))


@pytest.mark.parametrize("noise", [pytest.param(0.0, marks=pytest.mark.slow), 0.01])
@pytest.mark.parametrize(
    ("stress", "law"),
    [
        (lambda t, rate, a: 3.0 * rate, "newtonian"),
        (thinned, "carreau_yasuda"),
        (yielding, "herschel_bulkley"),
        (of_a_power, "power_law"),
        (maxwell, None),
    ],
)
def test_a_fluid_without_elasticity_is_named_where_effects_are_listed(stress, law, noise):
    free = ["modulus_Pa", "relaxation_time_s"]
    declared = DeclaredModel.named("ucm", {}, [1.0], [1.0], free=free)
    found = run_loop(oscillations(stress, noise), declared, effects=["solvent_viscosity"])
    assert found.verdict != "unexplained"
    assert (found.material.law if found.material else None) == law
    # a viscosity that thins is no solvent, which has one viscosity
    effect = {"newtonian": "solvent_viscosity", "herschel_bulkley": "yield_stress"}.get(law, law)
    assert [stage.effect for stage in found.stages] == ([effect] if effect else [])
    if law == "newtonian":
        # the gain of a sound bench is known to 1 %
        assert found.use["constants"]["viscosity_Pa_s"]["value"] == pytest.approx(3.0, rel=0.03)
    if law == "herschel_bulkley":
        # four standard errors of what a quarter of the samples, at the slowest rates, say of it
        assert found.use["constants"]["yield_stress_Pa"]["value"] == pytest.approx(8.0, rel=0.05)
