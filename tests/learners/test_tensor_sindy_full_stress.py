import numpy as np
import pysindy
import pytest
from shared_flows import small_dataset

from discover.errors import InputError
from discover.learners.tensor_sindy.full_stress import derivative_problem, regress_full_stress
from discover.learners.tensor_sindy.optimisers import OPTIMISERS
from tensor_library import build_library
from tensor_library.pysindy_features import TensorFeatureLibrary


@pytest.fixture(scope="module")
def measured():
    dataset = small_dataset("giesekus", {"alpha": 0.2}, n_samples=801)
    return (
        [run.time for run in dataset],
        [dataset.exact[run.name].components for run in dataset],
        [run.shear_rate for run in dataset],
    )


@pytest.mark.parametrize("optimizer", OPTIMISERS)
def test_with_the_whole_stress_measured_derivative_regression_finds_giesekus(measured, optimizer):
    library = build_library()
    solutions = {s.support: s for s in regress_full_stress(*measured, library, optimizer)}
    index = library.names.index("sigma.sigma")
    # fourth-order differences at a step of 0.01
    assert solutions[(index,)].coefficients[index] == pytest.approx(0.2, abs=1e-6)


def test_it_is_ordinary_sindy(measured):
    # pysindy's own SINDy, with an equation for each component, finds the same coefficient in each
    times, stresses, rates = measured
    library = build_library(tensors=("sigma", "gammadot", "sigma.sigma"))
    model = pysindy.SINDy(
        optimizer=pysindy.STLSQ(threshold=0.05, alpha=1e-8),
        feature_library=TensorFeatureLibrary(library),
        differentiation_method=pysindy.FiniteDifference(order=4),
    )
    with pytest.warns(UserWarning, match="eliminated all"):  # σ33 stays zero
        model.fit(stresses, t=times, u=[r[:, None] for r in rates])
    names = model.get_feature_names()
    each = [
        model.coefficients()[target, names.index(f"(sigma.sigma)[{component}]")]
        for target, component in ((0, "11"), (1, "22"), (3, "12"))
    ]
    design, target = derivative_problem(times, stresses, rates, library)
    ours = np.linalg.lstsq(design, target, rcond=None)[0]
    np.testing.assert_allclose(each, -ours[2], atol=1e-5)
    np.testing.assert_allclose(ours, [0.0, 0.0, 0.2], atol=1e-6)


def test_shapes_that_disagree_are_refused(measured):
    times, stresses, rates = measured
    with pytest.raises(InputError, match="shape"):
        derivative_problem(times[:1], [stresses[0][:, :3]], rates[:1], build_library())
