"""Laws whose chains retract are predicted side by side, as exactly as others."""

import numpy as np
from independent import RoliePoly
from independent import start_up as flow_at

from discover.dataset import Run
from discover.forward import AugmentedModel, make_batch
from discover.forward.declared import DeclaredModel
from discover.laws import make_law
from discover.protocols import start_up
from discover.protocols.protocol import in_flow

MODULI, TIMES, RATE = np.array([60.0, 20.0]), np.array([0.2, 2.0]), 3.0
RATIO, BETA = 0.05, 0.5
WHEN = np.geomspace(0.02, 4.0, 40)


def test_rolie_poly_follows_its_equation_in_shear_and_extension():
    rate, record = np.full(len(WHEN), RATE), np.full(len(WHEN), 50.0)
    runs = [
        Run("shear", WHEN, start_up(RATE), rate, record),
        Run("extension", 0.3 * WHEN, in_flow(start_up(RATE), "uniaxial"), rate, record),
    ]
    law = make_law("rolie_poly", {"stretch_time_ratio": RATIO, "beta": BETA})
    model = AugmentedModel(DeclaredModel(law, MODULI, TIMES, fit_modulus=True), [])
    thetas = np.tile(model.zero(), (9, 1))
    thetas[:, 0] = np.linspace(0.0, 0.8, 9)
    found = model.predictions(thetas, make_batch(runs))
    modes = [
        RoliePoly(BETA, RATIO * time, modulus=modulus, relaxation_time=time)
        for modulus, time in zip(MODULI, TIMES, strict=True)
    ]
    sheared = sum(mode.respond(flow_at(RATE), WHEN).sigma12 for mode in modes)
    drawn = sum(mode.pull(RATE, 0.3 * WHEN) for mode in modes)
    # the error of the steps that a loop takes, largest where chains stretch
    np.testing.assert_allclose(found[0] / np.stack([sheared, drawn]), 1.0, atol=2e-4)
    np.testing.assert_allclose(found, found[0] * np.exp(np.linspace(0, 0.8, 9))[:, None, None])
