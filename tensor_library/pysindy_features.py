"""A term library as a pysindy feature library, for data where the full stress was measured."""

from collections.abc import Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from pysindy.feature_library.base import BaseFeatureLibrary, x_sequence_or_item
from pysindy.utils import AxesArray, comprehend_axes
from sklearn.utils.validation import check_is_fitted

from tensor_library.conventions import SHEAR_COMPONENTS
from tensor_library.kinematics import rate_of_deformation, upper_convected_production
from tensor_library.library import TermLibrary

_N_INPUTS = len(SHEAR_COMPONENTS) + 1


class TensorFeatureLibrary(BaseFeatureLibrary):
    """Components of tensor terms as features of (σ11, σ22, σ33, σ12, γ̇).

    The state is the dimensionless stress in simple shear and the control the dimensionless shear
    rate: ``SINDy(feature_library=TensorFeatureLibrary(library)).fit(stress, t, u=shear_rate)``.
    Each equation then has coefficients of its own; a law that no observer can tell apart has the
    same ones in all four, which `shared_coefficients` states as constraints.

    Parameters
    ----------
    library
        The terms.
    inner
        Inner parameters of closed forms; their defaults if None.
    include_convection
        Whether the components of L·σ + σ·Lᵀ are features too. They are not a term of any
        observer-independent law, but every convected derivative brings them.

    Attributes
    ----------
    n_features_in_, n_output_features_ : int
        5, and 4 (terms + convection).
    """

    def __init__(
        self,
        library: TermLibrary,
        inner: Sequence[float] | None = None,
        include_convection: bool = True,
    ):
        self.library = library
        self.inner = inner
        self.include_convection = include_convection

    @x_sequence_or_item
    def fit(self, x_full, y=None):
        """Check the number of inputs.

        Parameters
        ----------
        x_full
            Samples of (σ11, σ22, σ33, σ12, γ̇), shape (n, 5).
        y
            Ignored.
        """
        del y
        inputs = x_full[0].shape[x_full[0].ax_coord]
        if inputs != _N_INPUTS:
            raise ValueError(
                "A tensor feature library needs σ11, σ22, σ33, σ12 as the state and the shear rate "
                f"as the control, {_N_INPUTS} inputs; got {inputs}."
            )
        self.n_features_in_ = inputs
        self.n_output_features_ = len(self._labels()) * len(SHEAR_COMPONENTS)
        return self

    @x_sequence_or_item
    def transform(self, x_full):
        """Return the features, shape (n, n_output_features_).

        Parameters
        ----------
        x_full
            As in `fit`.
        """
        check_is_fitted(self)
        inner = self.library.inner_default if self.inner is None else self.inner
        values = []
        for x in x_full:
            samples = np.asarray(x, dtype=float).reshape(-1, _N_INPUTS)
            features = np.asarray(
                _features(
                    self.library,
                    self.include_convection,
                    jnp.asarray(samples),
                    jnp.asarray(np.asarray(inner, dtype=float)),
                )
            ).reshape(*x.shape[:-1], self.n_output_features_)
            values.append(AxesArray(features, comprehend_axes(features)))
        return values

    def get_feature_names(self, input_features=None) -> list[str]:
        """Return names such as ``(tr(sigma)*sigma)[12]``.

        Parameters
        ----------
        input_features
            Ignored: terms are spelled canonically.
        """
        del input_features
        return [f"({label})[{c}]" for label in self._labels() for c in SHEAR_COMPONENTS]

    def shared_coefficients(
        self,
    ) -> tuple[Float[np.ndarray, "constraints coefficients"], Float[np.ndarray, " constraints"]]:
        """Return constraints under which the four equations are one tensor equation.

        Returns
        -------
        Left and right-hand side of constraints on the coefficients of SINDy, flattened as (target,
        feature): no component of a term enters the equation of another component, and the four that
        remain are equal; that of convection is one.
        """
        n_components = len(SHEAR_COMPONENTS)
        labels = self._labels()
        n_features = len(labels) * n_components
        rows, right = [], []

        def at(target: int, term: int, component: int) -> int:
            return target * n_features + term * n_components + component

        for term, label in enumerate(labels):
            for target in range(n_components):
                for component in range(n_components):
                    row = np.zeros(n_components * n_features)
                    row[at(target, term, component)] = 1.0
                    value = 0.0
                    if component == target and label == "convection":
                        value = 1.0
                    elif component == target:
                        if target == 0:
                            continue
                        row[at(0, term, 0)] = -1.0
                    rows.append(row)
                    right.append(value)
        return np.array(rows), np.array(right)

    def _labels(self) -> list[str]:
        return [*self.library.names, *(["convection"] if self.include_convection else [])]


def _features(library, include_convection, samples, inner):
    def at_sample(sample):
        stress, shear_rate = sample[:4], sample[4]
        terms = library.evaluate(stress, rate_of_deformation(shear_rate), inner)
        if include_convection:
            terms = jnp.concatenate([terms, upper_convected_production(stress, shear_rate)[None]])
        return terms.reshape(-1)

    return jax.vmap(at_sample)(samples)
