"""Moduli of the first harmonic, against scipy and closed forms."""

import numpy as np

from discover.dataset.linear_viscoelasticity import LinearSweep
from discover.dataset.material_functions import linear_sweep_as_run
from discover.dataset.run import Run
from discover.effects import named_effects
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.protocols import oscillations

MODULUS, TIME, MOBILITY = 100.0, 1.0, 0.3
STRAINS, FREQUENCIES = np.array([0.1, 1.0, 10.0, 2.0]), np.array([1.0, 1.0, 0.3, 30.0])
MAXWELL = DeclaredModel.named("giesekus", {"alpha": 0.0}, MODULUS, TIME)
GIESEKUS = DeclaredModel.named("giesekus", {"alpha": MOBILITY}, MODULUS, TIME)


def sweep(strain=STRAINS, frequency=FREQUENCIES):
    n = len(strain)
    return Run(
        "sweep", np.arange(1.0, n + 1.0), oscillations(strain, frequency), strain * frequency,
        np.ones(n), strain=strain, storage_modulus=np.ones(n), loss_modulus=np.ones(n),
    )  # fmt: skip


INSTRUMENT = (
    "transducer_lag", "time_delay", "instrument_inertia", "stress_gain", "stress_offset",
    "edge_fracture", "rate_rise_time", "bearing_friction", "tool_compliance", "wall_slip",
)  # fmt: skip


def predicted(declared, run, **values):
    """Return the moduli with some effects, in a model that has all: one program serves."""
    model = AugmentedModel(declared, [named_effects()[name] for name in INSTRUMENT])
    theta = model.zero()
    for name, value in values.items():
        theta[model.positions(name)[0]] = value
    storage, loss = model.predict(theta, make_batch(run.records))
    return storage + 1j * loss


def test_moduli_of_modes_over_thirteen_decades_are_their_closed_form():
    moduli, times = np.geomspace(1e5, 1.0, 7), np.geomspace(1e-8, 1e5, 7)
    omega = np.geomspace(1e-3, 1e3, 9)
    run = linear_sweep_as_run(LinearSweep(omega, np.ones(9), np.ones(9)))
    x = omega[:, None] * times
    exact = ((x**2 + 1j * x) / (1.0 + x**2)) @ moduli
    # the limit of small strain of a law that is not linear: terms of the square of 0.01
    giesekus = DeclaredModel.named("giesekus", {"alpha": 0.3}, moduli, times)
    np.testing.assert_allclose(predicted(giesekus, run), exact, rtol=1e-4)


def test_lag_delay_inertia_and_gain_change_a_modulus_by_their_closed_forms():
    iw, plain = 1j * FREQUENCIES, predicted(GIESEKUS, sweep())
    for name, value, expected in (
        ("transducer_lag", 0.02, plain / (1.0 + 0.02 * iw)),
        ("time_delay", 0.02, plain * np.exp(-0.02 * iw)),
        ("instrument_inertia", 0.5, plain + 0.5 * iw**2),
        ("stress_gain", 0.1, 1.1 * plain),
        ("stress_offset", 5.0, plain),
        ("edge_fracture", 0.5, plain),
        ("rate_rise_time", 0.5, plain),
    ):
        found = predicted(GIESEKUS, sweep(), **{name: value})
        np.testing.assert_allclose(found, expected, rtol=1e-9, err_msg=name)


def test_coulomb_friction_adds_to_the_loss_modulus_alone():
    added = predicted(MAXWELL, sweep(), bearing_friction=2.0) - predicted(MAXWELL, sweep())
    # 4/π of a square wave; the trapezoidal rule meets its kink
    np.testing.assert_allclose(added, 4j * 2.0 / np.pi / STRAINS, rtol=1e-3, atol=1e-5)
