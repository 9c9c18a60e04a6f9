"""What is no number, flow, name or table is refused by the Python door in one kind of error."""

import numpy as np
import pandas as pd
import pytest

import discover as dc

pytestmark = pytest.mark.usefixtures("as_users_run_it")

NO_NUMBERS = ["1", b"1", True, None, 1j, {}, object(), [[1.0]], ["1"], "half \ud800"]
# integers too large for a double, and what is no finite number
NO_FINITE_NUMBERS = [*NO_NUMBERS, float("nan"), float("inf"), 10**400]


@pytest.fixture
def flow():
    return dc.start_up(1.0)


@pytest.mark.parametrize("value", NO_FINITE_NUMBERS, ids=lambda value: type(value).__name__)
def test_a_flow_takes_no_text_truth_value_or_complex_number_for_a_number(value, flow):
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
    ):
        with pytest.raises(dc.InputError):
            make()


@pytest.mark.parametrize(
    "value", [*NO_FINITE_NUMBERS, -1.0, 0.0], ids=lambda value: type(value).__name__
)
def test_a_fluid_takes_no_text_truth_value_or_complex_number_for_a_number(value):
    law = dc.make_law("ucm")
    for make in (lambda: dc.Fluid(law, value, 1.0), lambda: dc.Fluid(law, 1.0, value)):
        with pytest.raises(dc.InputError):
            make()


@pytest.mark.parametrize("value", NO_FINITE_NUMBERS, ids=lambda value: type(value).__name__)
def test_a_solvent_and_a_constant_take_none_either(value):
    with pytest.raises(dc.InputError):
        dc.Fluid(dc.make_law("ucm"), 1.0, 1.0, value)
    with pytest.raises(dc.InputError):
        dc.make_law("giesekus", {"alpha": value})


def test_numbers_of_any_plain_kind_are_taken():
    law = dc.make_law("giesekus", {"alpha": np.float64(0.25)})
    for modulus in (2, 2.0, np.float32(2.0), [2], (2.0,), np.array([2]), pd.Series([2.0])):
        fluid = dc.Fluid(law, modulus, 1, np.int64(3))
        assert float(fluid.modulus[0]) == 2.0
        assert float(fluid.solvent_viscosity) == 3.0
    dc.after_alternation(dc.measured_rate([0, 1, 2, 3], [0, 1, 0, -1]), 4, [0, 1, 2, 3])


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
def test_other_names_are_kept(name):
    assert list(dc.from_dataframe(samples(name)).names) == [name]


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


@pytest.mark.parametrize("tables", ["lve", 3, [1]], ids=lambda value: type(value).__name__)
def test_tables_are_a_mapping(tables):
    with pytest.raises(dc.InputError, match="mapping"):
        dc.from_dataframe(samples("a"), tables=tables)
