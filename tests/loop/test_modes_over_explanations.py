"""The constant of each mode holds whichever of two twins is right, on records by scipy."""

import numpy as np
import pytest
from independent import Modes, PhanThienTanner, start_up

import discover as dc
from discover.closed_loop.explanations import Carried, modes_over_explanations
from discover.closed_loop.results.error_pair import ErrorPair
from discover.closed_loop.results.explanation import Explanation, Explanations
from discover.dataset import Dataset, Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel
from discover.inference.by_mode.constants import ConstantByMode, ModeConstant
from discover.inference.least_squares import Fit

MODULI, TIMES, EPSILONS, SLIP = (200.0, 100.0), (0.3, 3.0), (0.1, 0.3), 0.15
SAMPLES = np.geomspace(0.02, 15.0, 50)
TWINS = ("non_affine_motion", "tr(sigma)*gammadot")


def by_hand(share):
    """Return the constants by mode of one set of effects, beside a twin of it with this share."""
    declared = DeclaredModel.maxwell(np.array(MODULI), np.array(TIMES), by_mode=("ptt_linear",))
    model = AugmentedModel(declared, [make_effect(name) for name in ("ptt_linear", *TWINS)])
    (at,) = model.positions("ptt_linear")
    carried = []
    for name, epsilon in zip(TWINS, (0.3, 0.25), strict=True):
        theta = model.zero()
        theta[at] = epsilon
        fit = Fit(theta, (at,), np.zeros((1, 1)), np.zeros((1, 1, 1)))
        carried.append(Carried(("ptt_linear", name), fit, 0.0))
    told = [
        Explanation(one.effects, weight, ErrorPair(0.01, 0.01), {})
        for one, weight in zip(carried, (1.0 - share, share), strict=True)
    ]
    modes = tuple(ModeConstant(time, 0.3, (0.29, 0.31), False) for time in TIMES)
    own = {"ptt_linear": ConstantByMode(0.3, (0.29, 0.31), "", 1.0, 1, (0.0, 9.0), modes)}
    seen = model, carried[0].fit, carried, Explanations(tuple(told), 0.0)
    return modes_over_explanations(own, *seen)["ptt_linear"].modes


def test_the_interval_of_a_mode_reaches_to_its_value_beside_a_twin():
    for mode in by_hand(0.5):
        assert mode.ci95[0] < 0.25
        assert mode.ci95[1] == pytest.approx(0.31, abs=0.001)


def test_control_beside_what_is_unlikely_it_stays():
    for mode in by_hand(0.001):
        assert mode.ci95 == pytest.approx((0.29, 0.31), abs=0.001)


@pytest.fixture(scope="module")
def loop():
    material = Modes(
        *(
            PhanThienTanner(epsilon, slip=SLIP, modulus=modulus, relaxation_time=time)
            for epsilon, modulus, time in zip(EPSILONS, MODULI, TIMES, strict=True)
        )
    )
    lot, runs = np.random.default_rng(2), []
    for rate in (0.3, 1.0, 5.0):
        stress = material.respond(start_up(rate), SAMPLES).sigma12
        noise = 0.01 * np.sqrt(np.mean(stress**2)) * lot.standard_normal(len(SAMPLES))
        rates = np.full(len(SAMPLES), rate)
        runs.append(Run(f"{rate}", SAMPLES, dc.start_up(rate), rates, stress + noise))
    fluid = dc.Fluid(dc.make_law("ucm"), MODULI, TIMES)
    return dc.close_loop(
        Dataset("twins", tuple(runs)), fluid, effects=["ptt_linear", *TWINS],
        by_mode=["ptt_linear"], max_effects=2, held_out=["1.0"],
    )  # fmt: skip


@pytest.mark.slow
def test_a_constant_of_each_mode_holds_beside_either_twin(loop):
    # beside the term that no shear stress tells from slip, ε is smaller by 1 − ξ
    assert set(TWINS) <= set(loop.explanations.inclusion)
    found = next(stage for stage in loop.stages if stage.effect == "ptt_linear")
    (constant,) = found.parameters.values()
    for mode, truth in zip(constant.modes, EPSILONS, strict=True):
        assert mode.ci95[0] < truth < mode.ci95[1]
        assert mode.ci95[0] < (1.0 - SLIP) * truth < mode.ci95[1]
