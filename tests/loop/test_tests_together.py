"""Several tests of one fluid, fitted together: each is heard by what it alone can say."""

import numpy as np
import pytest
from independent import Giesekus, start_up
from independent.folders import write_table

import discover as dc

MOBILITY, MODULUS, TIME, SOLVENT = 0.3, 100.0, 1.0, 1.0
FLUID = Giesekus(MOBILITY, MODULUS, TIME)


def slow_and_steady(folder, noise: float, samples: int):
    """Write slow start-ups with a noise of their own, and a flow curve of 20 rates with 1 %."""
    rng = np.random.default_rng(5)
    times = np.linspace(0.02, 8.0, samples)
    files = []
    for rate in (0.02, 0.05, 0.1):
        stress = FLUID.respond(start_up(rate), times).sigma12 + SOLVENT * rate
        stress += noise * np.sqrt(np.mean(stress**2)) * rng.standard_normal(samples)
        columns = {"time_s": times, "shear_rate_1_s": np.full(samples, rate), "stress_Pa": stress}
        write_table(folder / f"slow_{rate:g}.csv", columns)
        files.append(f"slow_{rate:g}.csv")
    (folder / "runs.csv").write_text("\n".join(["file", *files]) + "\n")
    rates = np.geomspace(0.05, 20.0, 20)
    ends = np.array([0.0, 30.0, 60.0])
    steady = np.array([FLUID.respond(start_up(r), ends).sigma12[-1] + SOLVENT * r for r in rates])
    steady *= 1.0 + 0.01 * rng.standard_normal(20)
    write_table(folder / "flow_curve.csv", {"shear_rate_1_s": rates, "stress_Pa": steady})
    return dc.load_dataset(folder).with_material_functions()


# 10 %: nothing of the mobility is in the start-ups, so no fit without the flow curve predicts it
@pytest.mark.slow
@pytest.mark.parametrize(("noise", "samples"), [(0.1, 400), (0.01, 3000)])
def test_a_flow_curve_alone_shows_an_effect_beside_long_records_that_do_not(
    tmp_path, noise, samples
):
    loop = dc.close_loop(
        slow_and_steady(tmp_path, noise, samples),
        dc.Fluid(dc.make_law("ucm"), MODULUS, TIME, SOLVENT),
        effects=["giesekus_mobility", "ptt_linear", "stress_offset"],
        explanations=1,
    )
    assert loop.verdict == "effects_added"
    assert [stage.effect for stage in loop.stages] == ["giesekus_mobility"]
    low, high = loop.stages[0].parameters["alpha"].ci95
    assert low < MOBILITY < high
    # a 95 % interval of the flow curve alone is four deviations wide; the start-ups, which tell
    # nothing, weigh as much and widen it, and so do 0.5 to 2 % by which rates, stresses and moduli
    # may be read: 10.6 in all
    assert high - low < 12.0 * deviation()


def deviation() -> float:
    """Return the standard deviation of α from the flow curve alone, by scipy's derivative."""
    rates, ends, step = np.geomspace(0.05, 20.0, 20), np.array([0.0, 30.0, 60.0]), 0.01

    def steady(mobility):
        fluid = Giesekus(mobility, MODULUS, TIME)
        return np.array([fluid.respond(start_up(r), ends).sigma12[-1] + SOLVENT * r for r in rates])

    slope = (steady(MOBILITY + step) - steady(MOBILITY - step)) / (2.0 * step) / steady(MOBILITY)
    return 0.01 / float(np.sqrt(slope @ slope))
