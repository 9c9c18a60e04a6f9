"""Constants that the records leave open are said to be open, however small the noise."""

import numpy as np
import pytest
from independent.folders import write_table

import discover as dc

NOISE, MODULUS, TIME = 0.01, 100.0, 1.0
BASE = dc.Fluid(dc.make_law("ucm"), 30.0, 0.5)


def constants(folder, observe):
    """Return the intervals of modulus and time from the steady states of a Maxwell fluid."""
    rates = np.geomspace(0.05, 20.0, 40)
    # upper convected Maxwell: σ12 = Gλγ̇ and N1 = 2G(λγ̇)²   [Bird, Armstrong & Hassager 1987, 4.2]
    steady = np.stack([MODULUS * TIME * rates, 2.0 * MODULUS * (TIME * rates) ** 2])
    noise = np.random.default_rng(0).standard_normal((2, 40))
    stress, first = steady * (1.0 + NOISE * noise)
    write_table(
        folder / "flow_curve.csv", {"shear_rate_1_s": rates, "stress_Pa": stress, "N1_Pa": first}
    )
    data = dc.load_dataset(folder).with_material_functions()
    if "N1" in observe:
        data = data.quantity_by_quantity()
    free = ["modulus_Pa", "relaxation_time_s"]
    loop = dc.close_loop(data, BASE, free=free, effects=["stress_offset"], explanations=1)
    assert loop.verdict == "no_effect_needed"
    return [loop.declared_parameters[name].ci95 for name in free]


@pytest.mark.slow
def test_a_flow_curve_of_constant_viscosity_leaves_modulus_and_time_open(tmp_path):
    for (low, high), truth in zip(constants(tmp_path, ["sigma12"]), (MODULUS, TIME), strict=True):
        assert low < 1e-2 * truth < 1e2 * truth < high


@pytest.mark.slow
def test_with_its_normal_stress_both_are_told(tmp_path):
    found = constants(tmp_path, ["sigma12", "N1"])
    for (low, high), truth in zip(found, (MODULUS, TIME), strict=True):
        assert low < truth < high
        # a factor of 0.5 to 2 % of each of the two records is three times that of the modulus
        assert high - low < 0.15 * truth


@pytest.mark.slow
def test_what_a_flow_curve_leaves_open_is_not_replaced_by_more_effects(tmp_path):
    """A structure in closed form: how fast it breaks no steady state knows; that it broke, all."""
    rates = np.geomspace(0.05, 20.0, 40)
    stress = 100.0 * rates / (1.0 + 0.5 * rates) + rates
    off = 1.0 + 0.01 * np.random.default_rng(0).standard_normal(40)
    write_table(tmp_path / "flow_curve.csv", {"shear_rate_1_s": rates, "stress_Pa": stress * off})
    base = dc.Fluid(dc.make_law("ucm"), 100.0, 1.0, 1.0)
    loop = dc.close_loop(dc.load_dataset(tmp_path), base)
    assert loop.verdict == "effects_added"
    assert [stage.effect for stage in loop.stages] == ["thixotropy"]
    low, high = loop.stages[0].parameters["build_up_time"].ci95
    assert high > 100.0 * max(low, 1.0)
