"""What of scikit-learn's own checks does not need a table of numbers as data."""

import warnings

import pytest
from sklearn.base import BaseEstimator, clone
from sklearn.utils import estimator_checks

import discover as dc

LEARNERS = (dc.TensorSINDy, dc.TBNNUDE)
CHECKS = (
    "check_parameters_default_constructible",
    "check_no_attributes_set_in_init",
    "check_get_params_invariance",
    "check_set_params",
    "check_mixin_order",
    "check_estimator_repr",
    "check_estimator_cloneable",
    "check_valid_tag_types",
)


class ChangesItsParameters(BaseEstimator):
    """Breaks the first rule: `__init__` only stores."""

    def __init__(self, limit=1.0):
        self.limit = 2.0 * limit


@pytest.mark.usefixtures("as_users_run_it")
@pytest.mark.parametrize("learner", LEARNERS)
@pytest.mark.parametrize("check", CHECKS)
def test_estimators_keep_the_rules_of_scikit_learn(learner, check):
    function = getattr(estimator_checks, check, None)
    if function is None:
        pytest.skip(f"this scikit-learn has no {check}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # values of other types are tried on purpose
        function(learner.__name__, learner())


def test_an_estimator_that_breaks_a_rule_is_found():
    # control of the test above
    with pytest.raises((AssertionError, RuntimeError)):
        estimator_checks.check_parameters_default_constructible(
            "ChangesItsParameters", ChangesItsParameters()
        )


@pytest.mark.parametrize("learner", LEARNERS)
def test_a_clone_has_the_base_and_no_fit(learner):
    base = dc.Fluid(dc.make_law("giesekus", {"alpha": 0.3}), [10.0, 1.0], [0.1, 1.0])
    made = clone(learner(base=base, random_state=3))
    assert made.random_state == 3
    assert made.base.law == base.law
    assert repr(made.base) == "<Fluid: Giesekus, 2 modes from 0.1 to 1 s>"
    assert len(repr(made)) < 200
