"""Laws whose chains retract against the same equations on full tensors in scipy."""

import numpy as np
import pytest
from independent.authors import rolie_poly, stress, xpp
from independent.homogeneous import UNIT

from discover.dataset.run import Run
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.protocols import in_flow, start_up

RETRACTING = [
    (rolie_poly, {"stretch_time_ratio": 0.1, "beta": 0.7}),
    (xpp, {"q": 4.0, "stretch_time_ratio": 0.25, "alpha": 0.1}),
]


@pytest.mark.slow
@pytest.mark.parametrize(("law", "constants"), RETRACTING, ids=["rolie_poly", "xpp"])
@pytest.mark.parametrize(("kind", "rate"), [("shear", 2.0), ("uniaxial", 0.5)])
def test_fast_modes_of_a_retracting_law_need_no_small_steps(law, constants, kind, rate):
    """The trace of the fastest mode relaxes within 1e-5 of a step."""
    modulus, time = np.array([1000.0, 300.0, 50.0]), np.array([1e-4, 1e-2, 3.0])
    times = np.linspace(0.1, 4.0, 40)
    declared = DeclaredModel.named(law.__name__, constants, modulus, time)
    model = AugmentedModel(declared, [])
    run = Run("run", times, in_flow(start_up(rate), kind), np.full(40, rate), np.ones(40))
    found = model.predict(model.zero(), make_batch([run]))[0]
    gradient = rate * UNIT[kind]
    exact = sum(
        g * stress(law, constants, gradient, times, t) for g, t in zip(modulus, time, strict=True)
    )
    wanted = exact[:, 0, 1] if kind == "shear" else exact[:, 0, 0] - exact[:, 1, 1]
    # what the fixed steps of a fit cost, 1e-6 of other laws; a retraction is ten times as fast
    np.testing.assert_allclose(found, wanted, atol=2e-4 * np.max(np.abs(wanted)))
