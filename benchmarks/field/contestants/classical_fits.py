"""Each classical law fitted by least squares, the one with the lowest BIC taken: scipy alone."""

from functools import partial

import numpy as np
from scipy.optimize import minimize_scalar

from field import Answer, Training
from field.tensor_flow import predict

TITLE = "classical fits, lowest BIC"

LAWS = {
    "ucm": lambda c, s, d: np.zeros((3, 3)),
    "johnson_segalman": lambda c, s, d: 0.5 * c * (s @ d + d @ s),
    "giesekus": lambda c, s, d: c * s @ s,
    "ptt_linear": lambda c, s, d: c * np.trace(s) * s,
    "ptt_exponential": lambda c, s, d: np.expm1(min(c * np.trace(s), 50.0)) * s,
}
"""h of the constant, σ and γ̇   [Larson 1988, chapter 7]."""


def learn(training: Training) -> Answer:
    """Return the law of lowest BIC with its one constant, from 0 to 1."""
    found = {}
    for name, law in LAWS.items():
        misfit = partial(_misfit, law, training)
        if name == "ucm":
            best, left = 0.0, misfit(0.0)
        else:
            fit = minimize_scalar(misfit, bounds=(0.0, 1.0), method="bounded")
            best, left = float(fit.x), fit.fun
        samples = sum(len(record.sigma12) for record in training.records)
        found[name] = samples * np.log(left) + (name != "ucm") * np.log(samples), best
    name = min(found, key=lambda key: found[key][0])
    law = partial(LAWS[name], found[name][1])
    return Answer(partial(predict, law, training), name, f"constant {found[name][1]:.3g}")


def _misfit(law, training: Training, constant: float) -> float:
    squares = []
    for record in training.records:
        try:
            said = predict(partial(law, constant), training, record.flow, 1e-5)["sigma12"]
        except ArithmeticError:
            return 1e6
        squares.append((said - record.sigma12) ** 2 / np.mean(record.sigma12**2))
    return float(np.mean(squares))
