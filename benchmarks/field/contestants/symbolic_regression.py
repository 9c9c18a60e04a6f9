"""Genetic symbolic regression of the smoothed derivative of σ12, as one would with PySR or gplearn.

What linear viscoelasticity leaves of dσ12/dt is sought as a formula of σ12, γ̇ and dγ̇/dt; the
normal stresses, on which it really depends, are not among the records.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import savgol_filter

from field import Answer, Training

TITLE = "symbolic regression (gplearn) on smoothed derivatives"


def learn(training: Training) -> Answer:
    """Return the formula of the best program of twenty generations."""
    from gplearn.genetic import SymbolicRegressor

    modulus, unit = training.modulus, training.relaxation_time
    points, targets = [], []
    for record in training.records:
        time = record.flow.times
        step = time[1] - time[0]
        stress = savgol_filter(record.sigma12, 11, 3)
        slope = savgol_filter(record.sigma12, 11, 3, deriv=1, delta=step)
        points.append(_point(stress / modulus, record.flow, time, unit))
        targets.append(unit * slope / modulus + stress / modulus - points[-1][:, 1])
    model = SymbolicRegressor(
        population_size=1000,
        generations=20,
        function_set=("add", "sub", "mul", "div"),
        metric="mse",
        parsimony_coefficient=1e-4,
        p_crossover=0.7,
        max_samples=0.9,
        feature_names=["s", "g", "dg"],
        random_state=training.seed,
    )
    model.fit(np.vstack(points), np.concatenate(targets))

    def predict(flow):
        if flow.kind != "shear":
            return {}

        def change(time, state):
            point = _point(state / modulus, flow, np.atleast_1d(time), unit)
            return (modulus * (point[0, 1] + model.predict(point)) - state) / unit

        found = solve_ivp(
            change, (0.0, flow.times[-1]), [0.0], "RK45", flow.times, max_step=0.1, rtol=1e-4
        )
        if found.status != 0 or np.max(np.abs(found.y)) > 1e6 * modulus:
            raise ArithmeticError("the formula runs away")
        return {"sigma12": found.y[0]}

    return Answer(predict, words=f"dσ12/dt = γ̇ − σ12 + {model._program}")


def _point(stress, flow, time, unit) -> np.ndarray:
    rate = unit * flow.rate(time)
    turn = -(unit**2) * flow.amplitude * flow.frequency * np.sin(flow.frequency * time)
    return np.column_stack([stress, rate, turn])
