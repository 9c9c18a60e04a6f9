"""What the door does not take is refused in one clear sentence."""

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
        (lambda: run(time=TIMES[::-1]), "increase strictly"),
        (lambda: run(time=TIMES - 1.0), "at or after 0"),
        (lambda: run(rate=RATES[:2]), r"must have shape \(31,\) like its time; got \(2,\)"),
        (lambda: run(clock_factor=0.0), "clock factor"),
        (lambda: dc.Dataset("melt", (run(), run())), "holds the run 'a' twice"),
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
        (lambda: dc.Fluid(UCM, 1.0, -1.0), "relaxation_time of a fluid must be positive"),
        (lambda: dc.Fluid(UCM, [1.0, 2.0], [1.0]), "one value for each mode"),
        (lambda: dc.Fluid(UCM, "much", 1.0), "must be numbers"),
        (lambda: dc.Fluid.from_sweep(DATA), "data.linear_sweep; got a Dataset"),
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
def test_settings_tables_and_calls_of_the_wrong_kind_are_refused_before_anything_is_fitted(learner):
    for settings, message in (
        ({"base": "ucm"}, "base must be a Fluid"),
        ({"base": UCM}, r"base must be a Fluid.*Fluid\(law"),
        ({"random_state": -1}, "whole number, at least 0"),
        ({"random_state": 1.5}, "whole number, at least 0"),
        ({"progress": "loud"}, "progress must be a function"),
    ):
        with pytest.raises(dc.InputError, match=message):
            learner(**settings).fit(DATA)
    for call in (learner().predict, learner().score, lambda _: learner().equation_):
        with pytest.raises(NotFittedError):
            call(DATA)
    for table in (SAMPLES, SAMPLES[["time_s", "stress_Pa"]].to_numpy()):
        with pytest.raises(dc.InputError, match=f"{type(table).__name__} .*from_dataframe"):
            learner().fit(table)
    for runs, message in (
        (run(), r"fit\(\[run\]\)"),
        *((wrong, "sequence of Run") for wrong in (None, "melt", 3.0)),
    ):
        with pytest.raises(dc.InputError, match=message):
            learner().fit(runs)


def test_errors_call_data_in_memory_by_its_name_and_half_a_character_is_one_of_them():
    with pytest.raises(dc.InputError, match="ud800"):
        dc.from_dataframe(samples("slow", stress_Pa="\ud800"))
    wrong = pd.concat([samples(name, stress_Pa="x") for name in ("slow", "fast")])
    for name, called in (({}, "data in memory"), ({"name": "melt"}, "melt")):
        with pytest.raises(dc.InputError, match=rf"^{called}: 2 problems\."):
            dc.from_dataframe(wrong, **name)


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
    tables = {"lve": data.linear_sweep.to_dataframe().set_index("omega_rad_s")}
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
        ((None, None, "lve"), "mapping"),
        ((None, None, [1]), "mapping"),
    ],
)
def test_a_table_that_is_no_data_set_is_refused(arguments, message):
    with pytest.raises(dc.InputError, match=message):
        dc.from_dataframe(*arguments)


NO_NUMBERS = ["1", b"1", True, None, 1j, {}, object(), [[1.0]], ["1"], "half \ud800"]
# integers too large for a double, and what is no finite number
NO_FINITE_NUMBERS = [*NO_NUMBERS, float("nan"), float("inf"), 10**400]


@pytest.fixture
def flow():
    return dc.start_up(1.0)


@pytest.mark.parametrize("value", NO_FINITE_NUMBERS, ids=lambda value: type(value).__name__)
def test_no_text_truth_value_or_complex_number_is_taken_for_a_number(value, flow):
    for make in (
        lambda: dc.start_up(value),
        lambda: dc.step_rates([0.0, 1.0], value),
        lambda: dc.measured_rate(value, [1.0, 2.0]),
        lambda: dc.oscillatory_shear(1.0, value),
        lambda: dc.after_steady_flow(flow, value, 1.0),
        lambda: dc.after_step_strain(flow, 1.0, value),
        lambda: dc.after_alternation(flow, value, np.array([0.0, 1.0])),
        lambda: dc.synthetic_dataset("ucm", noise=value),
        lambda: dc.synthetic_dataset("ucm", duration=value),
        lambda: dc.synthetic_dataset("ucm", seed=value),
        lambda: dc.synthetic_dataset("ucm", n_samples=value),
        lambda: dc.Fluid(UCM, value, 1.0),
        lambda: dc.Fluid(UCM, 1.0, value),
        lambda: dc.Fluid(UCM, 1.0, 1.0, value),
        lambda: dc.make_law("giesekus", {"alpha": value}),
    ):
        with pytest.raises(dc.InputError):
            make()


def test_numbers_of_any_plain_kind_are_taken():
    law = dc.make_law("giesekus", {"alpha": np.float64(0.25)})
    for modulus in (2, 2.0, np.float32(2.0), [2], (2.0,), np.array([2]), pd.Series([2.0])):
        fluid = dc.Fluid(law, modulus, 1, np.int64(3))
        assert float(fluid.modulus[0]) == 2.0
        assert float(fluid.solvent_viscosity) == 3.0
    dc.after_alternation(dc.measured_rate([0, 1, 2, 3], [0, 1, 0, -1]), 4, [0, 1, 2, 3])
    made = dc.synthetic_dataset("ucm", noise=np.float64(0.01), n_samples=np.int64(20), duration=2)
    assert (made.noise, len(made[0])) == (0.01, 20)


@pytest.mark.parametrize(
    "other", ["shear", 1.0, None, np.ones(3)], ids=lambda value: type(value).__name__
)
def test_what_is_no_flow_is_refused_as_one(other):
    for make in (
        lambda: dc.in_flow(other, "uniaxial"),
        lambda: dc.after_steady_flow(other, 1.0, 1.0),
        lambda: dc.after_step_strain(other, 1.0, 1.0),
        lambda: dc.after_alternation(other, 1.0, [0.0, 1.0]),
    ):
        with pytest.raises(dc.InputError, match="takes a flow"):
            make()


def samples(name, **columns):
    return pd.DataFrame(
        {"time_s": [0.1, 0.2, 0.3], "shear_rate_1_s": 1.0, "stress_Pa": [1.0, 2.0, 3.0]} | columns
    ).assign(run=name)


@pytest.mark.parametrize(
    "name",
    ["a/b", "a\\b", "..", ".", " ", "", "x" * 300, "nul\0", "half \ud800", 3, None, "lve.csv",
     "line\nbreak"],
    ids=lambda value: type(value).__name__,
)  # fmt: skip
def test_a_name_that_no_file_can_have_is_none_of_a_run(name):
    with pytest.raises(dc.InputError, match="names of runs"):
        dc.from_dataframe(samples("x").assign(run=name))


@pytest.mark.parametrize("name", ["slow.csv", "Übung 3", "1 1/s".replace("/", "per")])
def test_other_names_are_kept_and_one_sample_and_one_run_are_counted_in_the_singular(name):
    data = dc.from_dataframe(samples(name).iloc[:1])
    assert list(data.names) == [name]
    assert repr(data) == "<Dataset 'data in memory': 1 run, 1 sample>"
    assert "1 sample," in repr(data[0])


@pytest.mark.parametrize(
    "table",
    [
        samples("a").set_axis(pd.MultiIndex.from_product([["x"], list("abcd")]), axis=1),
        samples("a").rename(columns={"stress_Pa": 3}),
        pd.concat([samples("a"), samples("a")[["stress_Pa"]]], axis=1),
        samples("a").iloc[:0],
        samples("a", stress_Pa=["a", "b", "c"]),
        samples("a", stress_Pa=[[1.0], [2.0], [3.0]]),
    ],
    ids=["two levels", "number for a name", "twice", "empty", "text", "lists"],
)
def test_a_table_that_is_none_of_samples_is_refused(table):
    with pytest.raises(dc.InputError):
        dc.from_dataframe(table)


SAMPLES = pd.DataFrame(
    {"run": "a", "time_s": TIMES, "shear_rate_1_s": RATES, "stress_Pa": STRESS}
)  # fmt: skip


def test_a_run_that_ends_where_it_begins_can_be_shown_but_not_followed():
    # of two runs one has lost all samples but the first
    rest = SAMPLES.head(1).assign(run="b", stress_Pa=0.2)
    data = dc.from_dataframe(pd.concat([SAMPLES, rest]))
    assert data.table().loc[1, "samples"] == 1
    said = "'b' has one sample, at time 0"
    for call in (dc.TensorSINDy().fit, dc.close_loop, lambda one: dc.fit("ucm", one)):
        with pytest.raises(dc.InputError, match=said):
            call(data)


def test_levels_of_an_index_that_have_names_are_columns():
    plain = dc.from_dataframe(SAMPLES)
    for levels in (["run"], ["run", "time_s"]):
        found = dc.from_dataframe(SAMPLES.set_index(levels))
        assert found.names == plain.names
        np.testing.assert_array_equal(found[0].time, plain[0].time)
    # an index that repeats a column says nothing more
    assert dc.from_dataframe(SAMPLES.set_index("run", drop=False)).names == plain.names


FLUID = dc.Fluid(UCM, [100.0], [1.0])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((UCM, dc.start_up(1.0), TIMES), r"takes a Fluid.*Fluid\(law"),
        ((FLUID, 1.0, TIMES), r"takes a flow, such as start_up\(0\.5\)"),
        # backwards, the last time is that of rest: the stress was zero throughout
        ((FLUID, dc.start_up(1.0), TIMES[::-1]), "increase strictly"),
        ((FLUID, dc.start_up(1.0), [0.0, 1.0, 1.0]), "increase strictly"),
        ((FLUID, dc.start_up(1.0), TIMES - 1.0), "at or after 0"),
        ((FLUID, dc.start_up(1.0), []), "at or after 0"),
        ((FLUID, dc.start_up(1.0), 2.0), "times of simulate must be a list"),
        ((FLUID, dc.start_up(1.0), [0.0, np.nan]), "sample 1 holds nan"),
    ],
)
def test_simulate_refuses_what_is_no_fluid_flow_or_time(arguments, said):
    with pytest.raises(dc.InputError, match=said):
        dc.simulate(*arguments)
