"""The sparse learner in correlated noise, and records that are zero."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from shared_flows import LIBRARY

import discover as dc
from discover.dataset import Run
from discover.errors import InputError
from discover.learners.tensor_sindy import TensorSINDy
from discover.protocols import start_up

TIMES = np.linspace(0.02, 6.0, 150)
RATES = (0.5, 1.0, 2.0, 4.0)
NOISE = 0.03


def runs(correlation, seed):
    """Return start-ups of an upper-convected Maxwell fluid, whose σ12 is γ̇ (1 − e^−t)."""
    generator = np.random.default_rng([7, seed])
    made = []
    for rate in RATES:
        exact = -rate * np.expm1(-TIMES)
        innovation = generator.standard_normal(len(TIMES) + 100)
        noise = lfilter([np.sqrt(1.0 - correlation**2)], [1.0, -correlation], innovation)[100:]
        stress = exact + NOISE * np.sqrt(np.mean(exact**2)) * noise
        made.append(Run(f"{rate}", TIMES, start_up(rate), np.full_like(TIMES, rate), stress))
    return made


def fitted(correlation, seed):
    return TensorSINDy(LIBRARY).fit(runs(correlation, seed))


def worth(model):
    return model.result_.details["noise"]["effective_samples"]


@pytest.mark.slow
def test_correlated_noise_seldom_brings_in_a_term():
    # counting every sample, all four have terms, three to five of them
    models = [fitted(0.9, seed) for seed in range(4)]
    assert sum(model.terms_ != () for model in models) <= 1
    # (1 − 0.9)/(1 + 0.9) of 600 samples are 32; the correlation is told in steps of 0.07
    assert all(15 < worth(model) < 80 for model in models if not model.terms_)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_every_sample_counts_in_white_noise(seed):
    model = fitted(0.0, seed)
    assert worth(model) == len(RATES) * len(TIMES)
    assert model.terms_ == ()


TIMES_ZERO = np.linspace(0.1, 4.0, 40)
PLAIN = dc.Run("a.csv", TIMES_ZERO, dc.start_up(1.0), np.ones(40), 1.0 - np.exp(-TIMES_ZERO))


@pytest.mark.parametrize("learner", [dc.TensorSINDy(), dc.TBNNUDE()])
def test_a_record_that_is_zero_throughout_is_refused(learner):
    with pytest.raises(InputError, match=r"b\.csv.*zero throughout"):
        learner.fit([PLAIN, replace(PLAIN, name="b.csv", stress=np.zeros(40))])
