"""A data set is a sequence of runs, and estimators keep the rules of scikit-learn."""

import warnings

import numpy as np
import pytest
from independent_folder import MODULUS, RATES, TIME, write_folder
from sklearn.base import clone
from sklearn.model_selection import KFold
from sklearn.utils import estimator_checks, indexable

import discover as dc


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    return dc.load_dataset(write_folder(tmp_path_factory.mktemp("door") / "melt"))


def test_a_run_is_chosen_by_number_or_name_several_are_a_data_set_and_none_an_error(data):
    assert len(data) == 3
    assert data[0] is data["slow.csv"] is data[np.int64(-3)]
    assert [run.name for run in data] == list(RATES)
    for chosen in (data[1:], data[[1, 2]], data[np.array([1, 2])], data[["medium.csv", "fast.csv"]],
                   data[np.array([False, True, True])]):  # fmt: skip
        assert isinstance(chosen, dc.Dataset)
        assert chosen.names == ("medium.csv", "fast.csv")
        assert chosen.linear_sweep is data.linear_sweep
    assert len(data[[]]) == 0
    with pytest.raises(IndexError, match="3 runs; there is no number 3"):
        data[3]
    with pytest.raises(dc.InputError, match=r"no run 'gone\.csv'"):
        data["gone.csv"]
    for wrong in (1.5, [True, False], [[0]], None):
        with pytest.raises(dc.InputError, match="by its name or number"):
            data[wrong]


def test_scikit_learn_divides_a_data_set_and_a_split_does_by_name_and_keeps_the_sweep(data):
    (same,) = indexable(data)
    assert same is data
    folds = [data[test].names for _, test in KFold(3).split(data)]
    assert folds == [(name,) for name in RATES]
    train, test = data.split(held_out=["fast.csv"])
    assert train.names == ("slow.csv", "medium.csv")
    assert test.names == ("fast.csv",)
    assert test.linear_sweep is data.linear_sweep
    assert data.split(["fast.csv"], fit=["slow.csv"])[0].names == ("slow.csv",)


@pytest.mark.parametrize(
    ("held_out", "fit", "message"),
    [
        ("fast.csv", None, r"Write \['fast.csv'\]"),
        (["gone.csv"], None, "no run 'gone.csv'"),
        (list(RATES), None, "No run is left to fit"),
        ([], None, "No run is left to hold out"),
        (["fast.csv"], ["fast.csv"], "both in fit and in held_out"),
    ],
)
def test_a_split_that_divides_nothing_is_an_error(data, held_out, fit, message):
    with pytest.raises(dc.InputError, match=message):
        data.split(held_out, fit)


def test_representations_are_short_and_tables_long(data):
    for thing in (data, data[0], data.linear_sweep):
        assert len(repr(thing)) < 120
        assert "\n" not in repr(thing)
    table = data.to_dataframe()
    assert list(table.columns) == ["run", "time_s", "shear_rate_1_s", "stress_Pa"]
    assert len(table) == 120
    np.testing.assert_array_equal(
        table[table["run"] == "fast.csv"]["stress_Pa"], data["fast.csv"].stress
    )
    assert list(data.linear_sweep.to_dataframe()) == ["omega_rad_s", "Gp_Pa", "Gpp_Pa"]


def test_modes_come_from_the_sweep_and_synthetic_data_know_their_linear_response(data):
    fluid = dc.Fluid.from_sweep(data.linear_sweep)
    assert fluid.n_modes == 1
    np.testing.assert_allclose(fluid.modulus, [MODULUS], rtol=1e-6)
    np.testing.assert_allclose(fluid.relaxation_time, [TIME], rtol=1e-6)
    law = dc.make_law("giesekus", {"alpha": 0.3})
    assert dc.Fluid.from_sweep(data.linear_sweep, law, modes=2).law is law
    with pytest.raises(dc.InputError, match=r"no lve\.csv"):
        dc.Fluid.from_sweep(None)
    data = dc.synthetic_dataset("fene_p", {"L2": 10.0}, n_samples=11)
    omega = data.linear_sweep.angular_frequency
    moduli = data.linear_sweep.storage_modulus, data.linear_sweep.loss_modulus
    for found, wanted in zip(moduli, (omega**2, omega), strict=True):
        np.testing.assert_allclose(found, wanted / (1 + omega**2), rtol=1e-10)


LEARNERS = (dc.TensorSINDy, dc.TBNNUDE)
CHECKS = (
    "check_parameters_default_constructible", "check_no_attributes_set_in_init",
    "check_get_params_invariance", "check_set_params", "check_mixin_order", "check_estimator_repr",
    "check_estimator_cloneable", "check_valid_tag_types",
)  # fmt: skip


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


@pytest.mark.parametrize("learner", LEARNERS)
def test_a_clone_has_the_base_and_no_fit(learner):
    base = dc.Fluid(dc.make_law("giesekus", {"alpha": 0.3}), [10.0, 1.0], [0.1, 1.0])
    made = clone(learner(base=base, random_state=3))
    assert made.random_state == 3
    assert made.base.law == base.law
    assert repr(made.base) == "<Fluid: Giesekus, 2 modes from 0.1 to 1 s>"
    assert len(repr(made)) < 200
