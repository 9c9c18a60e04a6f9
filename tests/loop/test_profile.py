"""Intervals reach as far as the misfit allows, and what only a product tells is told as one.

Flow curves in closed form: a Maxwell fluid whose stress a structure lowers has in steady shear
σ12 = G λ γ̇/(1 + k t γ̇) + η γ̇: nothing but the product of breakdown k and build-up time t is seen.
"""

from typing import Any

import numpy as np
import pytest
from independent.folders import write_table
from scipy.optimize import brentq, minimize_scalar
from scipy.stats import t as student

import discover as dc
from discover.forward import DeclaredModel
from discover.effects import make_effect
from discover.forward import AugmentedModel, data_scales, make_batch
from discover.inference.by_mode.constants import StageParameter
from discover.inference.fit_uncertainty import intervals
from discover.inference.problem import FitProblem
from discover.inference.profile import profiled
from discover.report.loop.verdict import loop_verdict

MODULUS, PRODUCT, SOLVENT = 100.0, 0.5, 1.0


def steady(rates, modulus=MODULUS, product=PRODUCT):
    return modulus * rates / (1.0 + product * rates) + SOLVENT * rates


def curve(folder, rates, noise, seed=0):
    off = 1.0 + noise * np.random.default_rng(seed).standard_normal(rates.size)
    stress = steady(rates) * off
    write_table(folder / "flow_curve.csv", {"shear_rate_1_s": rates, "stress_Pa": stress})
    return dc.load_dataset(folder).with_material_functions(), stress


def test_a_flow_curve_tells_the_product_of_breakdown_and_build_up_time_and_neither_alone(tmp_path):
    data, _ = curve(tmp_path, np.geomspace(0.05, 20.0, 40), 0.01)
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, 1.0, SOLVENT)
    loop = dc.close_loop(data, base, effects=["thixotropy"], explanations=1)
    (stage,) = loop.stages
    assert stage.left_open == ("breakdown", "build_up_time")
    (together,) = stage.told_together
    low, high = together.ci95
    assert low < PRODUCT < high
    # one constant beside 40 samples of 1 %: about 1 % of the product
    assert high - low < 0.05 * PRODUCT
    assert (together.name, together.unit) == ("breakdown × build_up_time", "s")
    # either may be what the other's range leaves it
    least, most = stage.parameters["breakdown"].ci95
    assert least < 1e-6
    assert most > 100.0
    assert "alone not determined by these data" in loop_verdict(loop)[0]
    # a White-Metzner fluid of the same viscosity has the same curve, and no structure
    assert loop_verdict(loop)[0].startswith("Fitted, not tested")
    assert (
        loop.explanations.inclusion["thixotropy"] < 0.5 < loop.explanations.unexplained_probability
    )


def fitted(data):
    """Return the problem with modulus and breakdown free, and its fit."""
    declared = DeclaredModel.maxwell(MODULUS, 1.0, solvent_viscosity=SOLVENT, fit_modulus=True)
    model = AugmentedModel(declared, [make_effect("thixotropy")], data_scales(data.runs))
    problem = FitProblem(model, make_batch(data.runs))
    start = model.zero()
    start[model.positions("thixotropy")] = PRODUCT, 1.0
    return problem, problem.fit(start, [0, model.positions("thixotropy")[0]])


def test_the_ends_are_those_of_a_profile_by_scipy(tmp_path):
    rates = np.geomspace(0.2, 20.0, 24)
    data, stress = curve(tmp_path, rates, 0.25)
    problem, fit = fitted(data)
    parabola = intervals(problem.model, problem.batch, fit)
    found = profiled(problem, fit, parabola, [0]).bounds[0]

    weight = problem.weight[0]

    def misfit(log_modulus):
        def of(log_product):
            said = steady(rates, MODULUS * np.exp(log_modulus), np.exp(log_product))
            return float(np.sum((weight * (said - stress)) ** 2))

        found: Any = minimize_scalar(of, bounds=(-6.0, 6.0), method="bounded")
        return found.fun

    least: Any = minimize_scalar(misfit, bounds=(-2.0, 2.0), method="bounded")
    assert fit.theta[0] == pytest.approx(least.x, abs=0.02)
    # the ratio of likelihoods of Student's noise; two constants are fitted
    quantile = float(student.ppf(0.975, rates.size - 2))
    allowed = least.fun * (1.0 + quantile**2 / (rates.size - 2))
    ends = [brentq(lambda x: misfit(x) - allowed, least.x, least.x + far) for far in (-4.0, 4.0)]
    # a straight line between the last two points of a walk
    assert found[1] == pytest.approx(ends[1], rel=0.02)
    assert found[0] == pytest.approx(ends[0], rel=0.02)
    assert found[1] > 1.1 * parabola[0][1]


def test_what_is_well_told_keeps_its_interval(tmp_path):
    data, _ = curve(tmp_path, np.geomspace(0.05, 20.0, 40), 0.01)
    problem, fit = fitted(data)
    parabola = intervals(problem.model, problem.batch, fit)
    assert profiled(problem, fit, parabola, [0]).bounds[0] == parabola[0]


@pytest.mark.parametrize(
    ("interval", "is_open"),
    [((0.02, 1e3), True), ((0.02, 999.0), False), ((0.78, 1e3), True), ((20.0, 1e3), False)],
)
def test_what_goes_on_to_the_end_of_its_range_from_two_decades_below_is_left_open(
    interval, is_open
):
    assert StageParameter(50.0, interval, "").is_open_up_to(1000.0) is is_open
