import jax.numpy as jnp
import numpy as np
import pytest
from sklearn.base import clone

from tensor_library import (
    SHEAR_COMPONENTS,
    build_library,
    rate_of_deformation,
    upper_convected_production,
)
from tensor_library.pysindy_features import TensorFeatureLibrary

LIBRARY = build_library(tensors=("sigma", "sigma.sigma"), degree=1, closed_forms=("exp",))
SAMPLES = np.random.default_rng(0).normal(size=(7, 5))


def test_features_are_the_components_of_the_terms_in_the_order_of_their_names():
    features = TensorFeatureLibrary(LIBRARY)
    values = np.asarray(features.fit_transform(SAMPLES))
    names = features.get_feature_names()
    assert values.shape == (7, len(names)) == (7, features.n_output_features_)
    stress, rate = jnp.asarray(SAMPLES[2, :4]), jnp.asarray(SAMPLES[2, 4])
    for j, term in enumerate(LIBRARY.terms):
        expected = term.evaluate(stress, rate_of_deformation(rate))
        for i, component in enumerate(SHEAR_COMPONENTS):
            column = names.index(f"({term.name})[{component}]")
            assert column == 4 * j + i
            assert values[2, column] == pytest.approx(float(expected[i]), rel=1e-10, abs=1e-12)
    np.testing.assert_allclose(values[2, -4:], upper_convected_production(stress, rate))


def test_convection_can_be_left_out():
    features = TensorFeatureLibrary(LIBRARY, include_convection=False).fit(SAMPLES)
    assert features.n_output_features_ == 4 * len(LIBRARY)
    assert not any("convection" in name for name in features.get_feature_names())


def test_inner_parameters_reach_the_closed_forms():
    default = np.asarray(TensorFeatureLibrary(LIBRARY).fit_transform(SAMPLES))
    other = np.asarray(TensorFeatureLibrary(LIBRARY, inner=[0.9]).fit_transform(SAMPLES))
    closed = np.arange(4 * (len(LIBRARY) - 1), 4 * len(LIBRARY))
    assert np.all(default[:, closed] != other[:, closed])
    rest = np.setdiff1d(np.arange(default.shape[1]), closed)
    np.testing.assert_array_equal(default[:, rest], other[:, rest])


def test_constraints_hold_for_a_tensor_equation_and_only_for_one():
    features = TensorFeatureLibrary(build_library(tensors=("sigma", "sigma.sigma"))).fit(SAMPLES)
    left, right = features.shared_coefficients()
    coefficients = np.zeros((4, 3, 4))  # target, term (σ, σ², convection), component
    for component in range(4):
        coefficients[component, :, component] = -1.0, -0.2, 1.0
    np.testing.assert_array_equal(left @ coefficients.ravel(), right)
    coefficients[1, 1, 1] = -0.3  # 22 has its own coefficient: no longer a tensor equation
    assert np.any(left @ coefficients.ravel() != right)


def test_it_clones_and_refuses_a_wrong_number_of_inputs():
    features = TensorFeatureLibrary(LIBRARY)
    assert clone(features).get_params() == features.get_params()
    with pytest.raises(ValueError, match="5 inputs; got 3"):
        features.fit(SAMPLES[:, :3])
