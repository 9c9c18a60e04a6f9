"""The dense library's bands, on data from simulators that share nothing with the package."""

from dataclasses import replace

import numpy as np
import pytest
from discover.learners.tensor_dense import TensorDense
from independent import KBKZ, Giesekus, RoliePoly, UpperConvectedMaxwell
from independent import oscillation as imposed
from independent.noise import white

import discover as dc
from discover.dataset import Run
from discover.errors import InputError
from discover.protocols import oscillatory_shear
from discover.protocols.protocol import shear_rates
from tensor_library import build_library

TIMES = np.linspace(0.0, 12.0, 61)
FLOWS = ((1.0, 0.5), (2.0, 1.0))
UNSEEN = (2.0, 0.5)
LIBRARY = build_library(degree=1, invariants=("tr(sigma.gammadot)",))
QUANTITIES = ("sigma12", "N1", "N2")


def run_of(flow, stress):
    protocol = oscillatory_shear(*flow)
    return Run("laos", TIMES, protocol, shear_rates(protocol, TIMES), stress)


def fitted(law, seed=0):
    rng = np.random.default_rng(seed)
    runs = [run_of(f, white(law.respond(imposed(*f), TIMES).sigma12, 0.01, rng)) for f in FLOWS]
    return TensorDense(library=LIBRARY).fit(runs)


def inside_and_width(estimator, law):
    """Return the share of samples inside the band, and half its width over N1 or σ12."""
    truth = law.respond(imposed(*UNSEEN), TIMES)
    (band,) = estimator.predict_band([run_of(UNSEEN, np.ones_like(TIMES))])
    inside, width = {}, {}
    for quantity in QUANTITIES:
        low, _, high = band[quantity][:, 1:]
        true = getattr(truth, quantity)[1:]
        size = np.sqrt(np.mean((truth.sigma12 if quantity == "sigma12" else truth.N1) ** 2))
        inside[quantity] = np.mean((true >= low - 1e-3 * size) & (true <= high + 1e-3 * size))
        width[quantity] = 0.5 * np.sqrt(np.mean((high - low) ** 2)) / size
    return inside, width


@pytest.fixture(scope="module")
def maxwell():
    return fitted(UpperConvectedMaxwell())


@pytest.mark.slow
@pytest.mark.parametrize("law", [Giesekus(0.6), RoliePoly(1.0, 0.1)], ids=["inside", "outside"])
def test_bands_hold_an_unseen_flow_of_a_law_inside_the_library_and_of_one_outside(law):
    inside, width = inside_and_width(fitted(law), law)
    for quantity in ("sigma12", "N1"):  # sixteen terms and two flows hold N2 less well
        assert inside[quantity] >= 0.9  # of a 95 % band
        assert width[quantity] < 0.5  # and half as wide as what it is about


def test_a_maxwell_fluid_has_narrow_bands_about_maxwell(maxwell):
    inside, width = inside_and_width(maxwell, UpperConvectedMaxwell())
    assert min(inside.values()) >= 0.9
    # the noise is 1 %, the records are 122; terms that σ12 does not see have a narrow prior
    assert max(width.values()) < 0.06


def test_where_a_named_law_fits_the_band_is_of_the_laws_at_hand_alone(maxwell):
    assert maxwell.draws_.optima is None


@pytest.mark.slow
def test_where_no_named_law_fits_the_band_allows_for_one_more_also_from_a_file(tmp_path):
    # K-BKZ of scipy, to which none of the five named laws is fitted to the noise
    law = KBKZ(0.3, -0.15)
    dense = fitted(law)
    assert len(np.unique(dense.draws_.optima)) > 1
    unseen = [run_of(UNSEEN, np.ones_like(TIMES))]
    (band,) = dense.predict_band(unseen)
    dense_again = dc.load(dense.save(tmp_path / "law.discover"))
    (again,) = dense_again.predict_band(unseen)
    assert np.array_equal(band["N1"], again["N1"])
    dense.draws_ = replace(dense.draws_, optima=None)
    (at_hand,) = dense.predict_band(unseen)
    assert np.all(band["N1"][0] <= at_hand["N1"][0])
    assert np.all(band["N1"][2] >= at_hand["N1"][2])
    inside, _ = inside_and_width(dense_again, law)
    assert inside["N1"] >= 0.9


def test_an_estimator_from_a_file_has_the_same_bands(maxwell, tmp_path):
    unseen = [run_of(UNSEEN, np.ones_like(TIMES))]
    again = dc.load(maxwell.save(tmp_path / "law.discover"))
    (before,), (after,) = maxwell.predict_band(unseen), again.predict_band(unseen)
    for quantity in QUANTITIES:
        assert np.array_equal(before[quantity], after[quantity])
    assert again.score(maxwell.runs_) == maxwell.score(maxwell.runs_)


def test_the_law_that_is_written_out_predicts_what_the_estimator_does(maxwell):
    runs = maxwell.runs_
    stress = maxwell.predict(runs)
    measured = np.concatenate([run.stress for run in runs])
    # its misfit is the noise
    assert np.linalg.norm(stress - measured) / np.linalg.norm(measured) == pytest.approx(
        0.01, rel=0.3
    )
    assert len(maxwell.terms_) == len(maxwell.library_)
    assert sum(maxwell.draws_.weights) == pytest.approx(1.0)


def test_draws_have_the_weights_of_the_laws_that_fit(maxwell):
    pytest.importorskip("xarray")
    draws = maxwell.to_xarray()
    assert dict(draws.sizes) == {"chain": 1, "draw": 1000, "term": len(maxwell.library)}
    found, held = draws["coefficient"].mean(("chain", "draw")).values, maxwell.draws_
    spread = held.coefficients.std(axis=0)
    # the mean of 1,000 draws scatters by 3 % of their spread
    np.testing.assert_array_less(np.abs(found - held.weights @ held.coefficients),
                                 0.2 * spread + 1e-12)  # fmt: skip


def test_a_closed_form_is_refused_in_words():
    library = build_library(closed_forms=("exp",))
    with pytest.raises(InputError, match=r"without closed forms.*epsilon"):
        TensorDense(library=library).fit([run_of(FLOWS[0], np.ones_like(TIMES))])
