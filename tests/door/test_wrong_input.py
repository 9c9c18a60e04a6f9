"""What a program hands over by mistake gives one error that says what was wanted."""

import numpy as np
import pandas as pd
import pytest
from independent_folder import write_folder
from sklearn.exceptions import NotFittedError

import discover as dc

TIMES, RATES = np.linspace(0.0, 5.0, 31), np.full(31, 0.5)
STRESS = 50.0 * (1.0 - np.exp(-TIMES))
LEARNERS = (dc.TensorSINDy, dc.TBNNUDE)


pytestmark = pytest.mark.usefixtures("as_users_run_it")


def run(**changes):
    parts = {"name": "a", "time": TIMES, "protocol": dc.start_up(0.5), "rate": RATES}
    return dc.Run(**(parts | {"stress": STRESS} | changes))


DATA = dc.Dataset("melt", (run(),))
UCM = dc.make_law("ucm")


class Spread(dc.AbstractConstitutiveLaw):
    """Returns one component, which an addition would spread over all four."""

    linear_relaxation: bool = True

    def extra_term(self, stress, rate):
        return stress[0]


class Broken(Spread):
    """Returns no array at all."""

    def extra_term(self, stress, rate):
        return "h"


class WithUnit:
    magnitude = STRESS


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: run(stress=["a"] * 31), "stress of the run 'a' must be a list or an array of num"),
        (lambda: run(stress=STRESS + 1j), "of complex128"),
        (lambda: run(stress=None), "stress of the run 'a' must be a list"),
        (lambda: run(stress=WithUnit()), "carries a unit"),
        (lambda: run(stress=np.where(TIMES > 4, np.nan, STRESS)), "sample 25 holds nan"),
        (lambda: run(rate=0.5), "rate of the run 'a' must be a list or an array of numbers"),
        (lambda: run(time=TIMES[:, None]), "an array of shape"),
        (lambda: run(time=[], rate=[], stress=[]), "has no samples"),
        (lambda: run(protocol=0.5), r"must be a flow, such as start_up\(0\.5\)"),
        (lambda: run(name=None), "must be text"),
        (lambda: run(clock_factor="2"), "clock_factor of the run 'a' must be a number"),
        (lambda: dc.Dataset("melt", run()), "Put a single run in a list"),
        (lambda: dc.Dataset("melt", (STRESS,)), "from_dataframe"),
        (lambda: dc.Dataset("melt", (run(),), linear_sweep="lve.csv"), "must be a LinearSweep"),
        (lambda: DATA.split(held_out=3), "must be a list of names"),
        (lambda: DATA.split(held_out=[run()]), "must be a list of names"),
        (lambda: dc.LinearSweep([1.0, 2.0], [1.0], [1.0, 2.0]), "must have shape"),
        (lambda: dc.LinearSweep([-1.0], [1.0], [1.0]), "must be positive"),
        (lambda: dc.load_dataset(None), "named by its path"),
        (lambda: dc.load(None), "takes the path of a file"),
        (lambda: dc.make_law("giesekus", [0.3]), "given by name"),
        (lambda: dc.synthetic_dataset("ucm", n_samples=2.5), "whole number"),
        (lambda: dc.Fluid("ucm", 1.0, 1.0), "make_law"),
        (lambda: dc.Fluid(UCM, -1.0, 1.0), "modulus of a fluid must be positive"),
        (lambda: dc.Fluid(UCM, 1.0, np.nan), "relaxation_time of a fluid must be positive"),
        (lambda: dc.Fluid(UCM, [1.0, 2.0], [1.0]), "one value for each mode"),
        (lambda: dc.Fluid(UCM, "much", 1.0), "must be numbers"),
        (lambda: dc.Fluid.from_sweep(DATA), "data.linear_sweep; got a Dataset"),
        (lambda: dc.start_up("fast"), "must be finite numbers"),
        (lambda: dc.in_flow(0.3, "uniaxial"), "takes a flow"),
        (lambda: dc.build_library(degree="two"), "degree must be 0 to 4"),
        (lambda: dc.compare(DATA, held_out=3), "held_out must be a data set"),
        (lambda: dc.compare(DATA, progress="loud"), "progress must be a function"),
        (lambda: dc.close_loop(DATA, progress="loud"), "progress must be a function"),
        (lambda: dc.close_loop(DATA, effects=3), "'named' or a list"),
        (lambda: dc.close_loop(DATA, max_effects=1.5), "max_effects"),
        (lambda: dc.close_loop(DATA, strain=3.0), "strain"),
        (lambda: dc.close_loop(DATA, laws="giesekus"), r"Write \['giesekus'\]"),
        (lambda: dc.close_loop(DATA, dc.Fluid(Spread(), 1.0, 1.0)), r"got the shape \(\)"),
        (lambda: dc.close_loop(DATA, dc.Fluid(Broken(), 1.0, 1.0)), "cannot be computed"),
        (lambda: dc.TensorSINDy(base=dc.Fluid(Broken(), 1.0, 1.0)).fit(DATA), "cannot be computed"),
    ],
)  # fmt: skip
def test_a_mistake_is_one_error_that_says_what_was_wanted(call, message):
    with pytest.raises(ValueError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("learner", LEARNERS)
def test_settings_of_the_wrong_kind_are_refused_before_anything_is_fitted(learner):
    for settings, message in (
        ({"modulus": "1"}, "modulus must be positive and finite"),
        ({"relaxation_time": [1.0, 2.0]}, "one value for each mode"),
        ({"solvent_viscosity": -1.0}, "not negative"),
        ({"base_law": "ucm"}, "must be a law"),
        ({"random_state": -1}, "whole number, at least 0"),
        ({"random_state": 1.5}, "whole number, at least 0"),
        ({"progress": "loud"}, "progress must be a function"),
    ):
        with pytest.raises(dc.InputError, match=message):
            learner(**settings).fit(DATA)


@pytest.mark.parametrize("learner", LEARNERS)
def test_what_needs_a_fit_says_so(learner):
    for call in (learner().predict, learner().score, lambda _: learner().equation_):
        with pytest.raises(NotFittedError):
            call(DATA)


def test_lists_and_series_are_columns_too():
    # control: what is refused above is not refused for being no array
    made = run(time=list(TIMES), rate=pd.Series(RATES), stress=STRESS.astype(object))
    assert made.time.dtype == made.rate.dtype == made.stress.dtype == np.float64
    np.testing.assert_array_equal(made.stress, STRESS)
    assert dc.Dataset("melt", [made]).runs == (made,)
    assert dc.Dataset("melt", ()).to_dataframe().empty


def test_a_table_is_the_data_set_that_its_files_would_be(tmp_path):
    data = dc.load_dataset(write_folder(tmp_path / "melt"))
    samples = data.to_dataframe()
    tables = {"lve": data.linear_sweep.to_dataframe()}
    same = dc.from_dataframe(samples, tables=tables, name="melt")
    assert repr(same) == repr(data)
    for one, other in zip(same, data, strict=True):
        # numbers are written with all their digits
        np.testing.assert_array_equal(one.stress, other.stress)
        np.testing.assert_array_equal(one.time, other.time)
        assert one.metadata == other.metadata
    kilo = samples.assign(stress_kPa=samples.pop("stress_Pa") / 1000.0)
    np.testing.assert_allclose(dc.from_dataframe(kilo)[0].stress, data[0].stress, rtol=1e-14)
    stretched = samples.rename(columns={"shear_rate_1_s": "hencky_rate_1_s"})
    stretched = stretched.assign(tensile_stress_Pa=data.to_dataframe()["stress_Pa"])
    index = pd.DataFrame({"run": list(data.names), "flow": "uniaxial"})
    assert dc.from_dataframe(stretched, index)[0].flow == "uniaxial"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((), "no sample and no table"),
        (([1.0],), "must be a pandas DataFrame"),
        ((pd.DataFrame({"a": [1.0]}),), "no column time_s"),
        ((DATA.to_dataframe().assign(run=3),), "names of runs"),
        ((DATA.to_dataframe().assign(run="../a"),), "names of runs"),
        ((DATA.to_dataframe(), pd.DataFrame({"run": ["b"]})), "of which there is no sample"),
        ((DATA.to_dataframe(), pd.DataFrame({"flow": ["shear"]})), "no column 'file'"),
        ((None, None, {"sweep": DATA.to_dataframe()}), "Unknown table 'sweep'. Write one of"),
    ],
)
def test_a_table_that_is_no_data_set_is_refused(arguments, message):
    with pytest.raises(dc.InputError, match=message):
        dc.from_dataframe(*arguments)
