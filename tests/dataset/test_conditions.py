"""Material and temperature in words, where runs.csv names them."""

import numpy as np
import pytest

from discover.dataset import Run
from discover.dataset.run_table import material_and_temperature
from discover.protocols import start_up


def run(**metadata):
    pair = np.array([0.0, 1.0])
    return Run("r", pair, start_up(1.0), np.ones(2), np.ones(2), metadata=metadata)


@pytest.mark.parametrize(
    ("rows", "words"),
    [
        ([{}], ""),
        ([{"temperature_C": 160.0}, {"temperature_C": 160.0}], "160 °C"),
        ([{"sample": "LDPE", "temperature_C": 160.0}], "LDPE, 160 °C"),
        (
            [{"temperature_C_measured": -10.005}, {"temperature_C_measured": -23.01}],
            "−23 and −10 °C",
        ),
        ([{"temperature_C": t} for t in (20.0, 40.0, 60.0)], "20 to 60 °C"),
        ([{"material": "gel"}, {"material": "gel"}, {"material": "melt"}], "gel, melt"),
    ],
)
def test_titles_name_what_the_table_names_and_nothing_else(rows, words):
    assert material_and_temperature([run(**row) for row in rows]) == words
