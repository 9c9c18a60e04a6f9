"""Whether linear tests predict one another, as one spectrum has to."""

from dataclasses import dataclass

import numpy as np

from discover.dataset.linear.linear_spectra import predicted, spectrum_of
from discover.dataset.linear.linear_tests import SWEEP, LinearTest, Tests
from discover.errors import InputError
from discover.statistics.projection import rms

AGREES = 0.1
"""Root-mean-square relative error up to which two linear tests agree: two loadings and two kinds of
test rarely differ by less than some per cent."""

_FEWEST = 4


@dataclass(frozen=True)
class Agreement:
    """How well the modes of one linear test predict another.

    `source`: the test that the modes come from: ``lve``, ``relaxation`` or ``creep``.
    `test`: the one predicted.
    `celsius`: temperature of both.
    `error`: root-mean-square relative error of the prediction over the times that the source
        reaches.
    `bias`: mean relative error over them: a gain of one of the two shows here.
    `times`: first and last of those times in s, 1/ω for a sweep.
    """

    source: str
    test: str
    celsius: float
    error: float
    bias: float
    times: tuple[float, float]

    @property
    def left(self) -> float:
        """What would be left of the error, were the prediction divided by one factor."""
        return float(np.sqrt(max(self.error**2 - self.bias**2, 0.0)) / (1.0 + self.bias))

    @property
    def agrees(self) -> bool:
        """Whether the error is up to `AGREES`."""
        return self.error <= AGREES


def linear_agreements(tests: Tests) -> list[Agreement]:
    """Return how well each test predicts each other one at its temperature.

    Times that both reach are compared, 1/ω of a frequency: the modes of a test say nothing of
    others.

    `tests`: by kind and temperature in °C, as measured or as moved to one.
    """
    spectra = {}
    found = []
    for source, test in ((a, b) for a in tests for b in tests if a != b):
        for celsius in sorted(set(tests[source]) & set(tests[test])):
            one, other = tests[source][celsius], tests[test][celsius]
            inside = _shared(one, other)
            if np.sum(inside) < _FEWEST:
                continue
            if (source, celsius) not in spectra:
                spectra[source, celsius] = _modes(one)
            spectrum = spectra[source, celsius]
            if spectrum is None:
                continue
            argument = other.argument[inside]
            error = predicted(spectrum, test, argument) / other.values[:, inside] - 1.0
            size, bias = rms(error), float(np.mean(error))
            seen = _times(other)[inside]
            ends = float(seen.min()), float(seen.max())
            found.append(Agreement(source, test, celsius, size, bias, ends))
    return found


def _modes(test: LinearTest):
    try:
        return spectrum_of(test)
    except InputError:  # too few samples, or moduli that no modes have
        return None


def _times(test: LinearTest) -> np.ndarray:
    return 1.0 / test.argument if test.kind == SWEEP else test.argument


def _shared(one: LinearTest, other: LinearTest) -> np.ndarray:
    reached, times = _times(one), _times(other)
    slack = 1.0 + 1e-9  # of 1/ω
    return (times >= reached.min() / slack) & (times <= reached.max() * slack)
