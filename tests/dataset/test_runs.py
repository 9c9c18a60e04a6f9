import numpy as np
import pytest

from discover.dataset import Dataset, Run
from discover.errors import InputError
from discover.protocols import start_up


def make_run(**changes):
    time = np.array([0.0, 1.0, 2.0])
    fields = {
        "name": "a.csv",
        "time": time,
        "protocol": start_up(1.0),
        "rate": np.ones(3),
        "stress": time,
    } | changes
    return Run(**fields)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"time": np.array([0.0, 2.0, 1.0])}, "increase strictly"),
        ({"time": np.array([-1.0, 0.0, 1.0])}, "at or after 0"),
        ({"stress": np.array([0.0, np.nan, 1.0])}, "sample 1 holds nan"),
        ({"rate": np.ones(2)}, r"shape \(3,\)"),
        ({"time": np.zeros(0)}, "no samples"),
        ({"clock_factor": 0.0}, "clock factor"),
    ],
)
def test_a_bad_run_is_refused_with_what_is_wrong(changes, message):
    with pytest.raises(InputError, match=message):
        make_run(**changes)


def test_a_window_cuts_samples_and_keeps_the_flow():
    run = make_run(first_normal_stress_difference=np.array([0.0, 2.0, 4.0]))
    cut = run.window(run.time > 0.5)
    assert len(cut) == 2
    assert cut.protocol is run.protocol
    assert cut.first_normal_stress_difference is not None
    np.testing.assert_array_equal(cut.first_normal_stress_difference, [2.0, 4.0])


def test_selecting_an_unknown_run_names_those_there_are():
    data = Dataset("set", (make_run(),))
    with pytest.raises(InputError, match=r"no run 'b\.csv'\. Write a\.csv"):
        data.select(["b.csv"])


def test_a_repeated_name_is_refused():
    with pytest.raises(InputError, match="twice"):
        Dataset("set", (make_run(), make_run()))
