"""A name that constants differing from mode to mode make needless; stresses by scipy."""

from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discover.loop import DeclaredModel, run_loop
from discover.dataset import Dataset, Run
from discover.effects import BY_MODE, make_effect
from discover.forward import AugmentedModel, make_batch
from discover.protocols import oscillatory_shear, start_up

MODULI, TIMES = np.array([100.0, 50.0]), np.array([1.0, 0.1])
FLOWS = {
    "slow": (start_up(1.0), lambda t: 1.0),
    "fast": (start_up(10.0), lambda t: 10.0),
    "wave": (oscillatory_shear(3.0, 1.0), lambda t: 3.0 * np.cos(t)),
    "quick": (oscillatory_shear(10.0, 3.0), lambda t: 10.0 * np.cos(3.0 * t)),
}
SAMPLES = np.concatenate([np.geomspace(0.03, 0.2, 10), np.linspace(0.3, 10.0, 50)])


def stress_of(rate, mobilities, breakdown=0.0, build_up=2.0):
    """Return σ12 of a two-mode Giesekus fluid with Moore's structure."""

    def slope(t, y):
        g, structure, out = rate(t), y[-1], []
        for k, (time, mobility) in enumerate(zip(TIMES, mobilities, strict=True)):
            s11, s22, s12 = y[3 * k : 3 * k + 3]
            out += [
                2 * g * s12 - (s11 + mobility * (s11**2 + s12**2)) / time,
                -(s22 + mobility * (s22**2 + s12**2)) / time,
                g * (1 + s22) - (s12 + mobility * s12 * (s11 + s22)) / time,
            ]
        return [*out, (1 - structure) / build_up - breakdown * abs(g) * structure]

    y = solve_ivp(
        slope, (0, SAMPLES[-1]), [0.0] * 6 + [1.0], t_eval=SAMPLES, method="LSODA",
        rtol=1e-9, atol=1e-10,
    ).y  # fmt: skip
    return y[-1] * (MODULI @ y[[2, 5]])


@cache
def runs(mobilities, breakdown=0.0, noise=0.01):
    generator = np.random.default_rng(0)
    out = []
    for name, (flow, rate) in FLOWS.items():
        stress = stress_of(rate, mobilities, breakdown)
        size = np.sqrt(np.mean(stress**2))
        stress = stress + noise * size * generator.normal(size=len(SAMPLES))
        rates = np.array([rate(t) for t in SAMPLES])
        out.append(Run(name, SAMPLES, flow, rates, stress))
    return tuple(out)


def loop(data, **options):
    declared = DeclaredModel.named(
        "giesekus", {"alpha": 0.3}, MODULI, TIMES, free=["alpha"], **options
    )
    effects = ["thixotropy", "rate_gain"]
    return run_loop(Dataset("two", data), declared, effects=effects, explanations=1)


def test_the_exponent_gives_each_mode_its_own_constant():
    mobilities = (0.1, 0.7)
    model = AugmentedModel(
        DeclaredModel.maxwell(MODULI, TIMES), [make_effect("giesekus_mobility"), BY_MODE]
    )
    theta = model.zero()
    # α_k = α (λ_k/λ̄)^p with λ̄ = 10^(−5/105) s, the mean of log λ by viscosity
    exponent = np.log(mobilities[0] / mobilities[1]) / np.log(TIMES[0] / TIMES[1])
    mean = 10.0 ** (-5.0 / 105.0)
    theta[model.positions("giesekus_mobility")] = mobilities[0] * mean**exponent
    theta[model.positions(BY_MODE.name)] = exponent
    data = runs(mobilities, noise=0.0)
    predicted = model.predict(theta, make_batch(data, strain_step=0.1))
    for row, run in zip(predicted, data, strict=True):
        stress = run.stress
        np.testing.assert_allclose(row[: len(run)], stress, atol=2e-3 * np.max(np.abs(stress)))


@pytest.mark.slow
def test_two_mobilities_are_no_thixotropy_and_each_mode_gets_its_own():
    # without the question by modes thixotropy is named, with a narrow interval, and explains them
    result = loop(runs((0.1, 0.7)))
    assert result.stages == ()
    assert result.verdict == "no_effect_needed"
    for mode, mobility in zip(result.by_mode["alpha"].modes, (0.1, 0.7), strict=True):
        low, high = mode.ci95
        # twice a 95 % interval: two of them must hold at once
        assert low - (high - low) / 2 < mobility < high + (high - low) / 2


@pytest.mark.slow
def test_a_thixotropy_that_is_there_stays():
    result = loop(runs((0.3, 0.3), breakdown=0.05))
    assert result.verdict == "effects_added"
    assert result.stages[0].effect == "thixotropy"
    assert result.stages[0].parameters["breakdown"].value == pytest.approx(0.05, rel=0.2)


@pytest.mark.slow
def test_constants_by_mode_leave_to_an_effect_what_it_explains():
    # mobilities are alike: chosen without the thixotropy, their difference would stand for it
    result = loop(runs((0.3, 0.3), breakdown=0.05), by_mode=("alpha",))
    assert [stage.effect for stage in result.stages] == ["thixotropy"]
    assert result.declared_parameters["alpha"].degree == 0
