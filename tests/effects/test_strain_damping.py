"""Damping by strain, against the K-BKZ integral by quadrature."""

import numpy as np
import pytest
from independent import KBKZ, Giesekus, start_up, steps
from noisy_runs import run_at
from vectors import vector_of

import discover as dc
from discover.dataset import Run
from discover.effects import make_effect
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.protocols import shear_rates, step_rates

MODULUS, TIME, DAMPING, NOISE = 100.0, 1.0, 0.25, 0.02
SCALE = {"modulus": MODULUS, "relaxation_time": TIME}
INTEGRAL = KBKZ(DAMPING, **SCALE)
TIMES = np.linspace(0.1, 7.0, 60)


@pytest.mark.parametrize(
    ("protocol", "flow"),
    [
        (step_rates([0.0], [3.0]), start_up(3.0)),
        (step_rates([0.0, 3.0], [4.0, 0.0]), steps([0.0, 3.0], [4.0, 0.0])),
        (step_rates([0.0, 3.0], [0.5, 4.0]), steps([0.0, 3.0], [0.5, 4.0])),
    ],
    ids=["start-up", "cessation", "step of the rate"],
)
def test_where_no_flow_turns_damping_by_strain_is_wagners_law(protocol, flow):
    declared = DeclaredModel.named("ucm", {}, MODULUS, TIME)
    model = AugmentedModel(declared, [make_effect("strain_damping")])
    theta = vector_of(model, strain_damping=DAMPING)
    stress = INTEGRAL.respond(flow, TIMES).sigma12
    run = Run("run", TIMES, protocol, shear_rates(protocol, TIMES), stress)
    ours = model.predict(theta, make_batch([run], strain_step=0.02))[0]
    # both are of second order or better in steps of 0.02
    np.testing.assert_allclose(ours, stress, atol=2e-4 * np.max(stress))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("material", "name"),
    [(INTEGRAL, "strain_damping"), (Giesekus(0.3, **SCALE), "giesekus_mobility")],
    ids=["K-BKZ", "Giesekus"],
)
def test_a_loop_names_damping_by_strain_where_it_is_and_not_elsewhere(material, name):
    lot, runs = np.random.default_rng(3), []
    for rate in (0.5, 2.0, 4.0):
        stress = material.respond(start_up(rate), TIMES).sigma12
        stress = stress + NOISE * np.max(stress) * lot.standard_normal(len(TIMES))
        runs.append(run_at(rate, TIMES, stress, f"at {rate:g}"))
    loop = dc.close_loop(
        dc.Dataset("start-ups", tuple(runs)), dc.Fluid(dc.make_law("ucm"), MODULUS, TIME),
        effects=["strain_damping", "giesekus_mobility", "thixotropy"], max_effects=1,
        explanations=1,
    )  # fmt: skip
    (stage,) = loop.stages
    assert stage.effect == name
    assert loop.verdict == "effects_added"
    (found,) = stage.parameters.values()
    low, high = found.ci95
    assert low < {"strain_damping": DAMPING, "giesekus_mobility": 0.3}[name] < high
