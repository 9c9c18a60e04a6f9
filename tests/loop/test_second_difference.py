"""N2 of a law that stands for kernels which differ in it: K-BKZ by quadrature, N2 = −0.15 N1."""

import numpy as np
import pandas as pd
import pytest
from independent.chains import KBKZ
from independent.flow import start_up

import discover as dc
from discover.inference.engine.bands import SIMPLE_FLUIDS

FLUID, TIMES = KBKZ(0.2, modulus=60.0, relaxation_time=1.3), np.linspace(0.05, 6.0, 60)
RATES = {"a": 0.7, "b": 1.5, "c": 3.0, "d": 4.5}


@pytest.fixture(scope="module")
def loop():
    lot, tables = np.random.default_rng(3), []
    for name, rate in RATES.items():
        stress = FLUID.respond(start_up(rate), TIMES).sigma12
        noise = 0.01 * np.sqrt(np.mean(stress**2)) * lot.standard_normal(len(TIMES))
        columns = {"time_s": TIMES, "shear_rate_1_s": rate, "stress_Pa": stress + noise}
        tables.append(pd.DataFrame(columns).assign(run=name))
    base = dc.Fluid(dc.make_law("ucm"), FLUID.modulus, FLUID.relaxation_time)
    effects = ["strain_damping", "giesekus_mobility", "stress_gain"]
    return dc.close_loop(
        dc.from_dataframe(pd.concat(tables)), base, held_out=["d"], effects=effects
    )


def test_damping_by_strain_is_named_and_its_n2_is_not_determined(loop):
    assert loop.explanations.likeliest_first[0].members[0] == ("strain_damping",)
    assert loop.answer.expected("N2").missing == "not determined"


def test_n2_of_such_a_law_is_anything_that_a_simple_fluid_may_have(loop):
    # deviation of what is as likely anywhere between the least ratio and zero
    assert loop.spread_of_laws["N2"].inside == pytest.approx(-SIMPLE_FLUIDS / np.sqrt(12.0))
    assert loop.spread_of_laws["N1"].inside < 0.05  # control: σ12 tells N1
