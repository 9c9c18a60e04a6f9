"""What the loop says of creep, flow curves and N1, on data by scipy and closed forms."""

from functools import cache

import numpy as np
import pytest
from independent import Giesekus
from independent.folders import write_table
from independent.sweeps import strain_at

import discover as dc

pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")
MODULUS, TIME, SOLVENT, NOISE = 100.0, 1.0, 1.0, 0.01
EFFECTS = ["giesekus_mobility", "ptt_linear", "stress_offset"]
CREEP_TIMES = np.geomspace(0.02, 10.0, 60)
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)


@cache
def creep(stress, mobility):
    """Return the strain of a Giesekus fluid with solvent at `CREEP_TIMES`, by scipy."""
    law = Giesekus(mobility, MODULUS, TIME)
    return strain_at(law, [(0.0, stress)], SOLVENT, CREEP_TIMES)


def creep_folder(folder, mobility, draw=0):
    generator = np.random.default_rng(draw)
    folder.mkdir(exist_ok=True)
    lines = ["file,control"]
    for stress in (20.0, 40.0, 60.0):
        strain = creep(stress, mobility)
        noise = NOISE * np.sqrt(np.mean(strain**2)) * generator.standard_normal(60)
        columns = {
            "time_s": CREEP_TIMES,
            "stress_Pa": np.full(60, stress),
            "strain": strain + noise,
        }
        write_table(folder / f"creep_{stress:g}.csv", columns)
        lines.append(f"creep_{stress:g}.csv,stress")
    (folder / "runs.csv").write_text("\n".join(lines) + "\n")
    return dc.load_dataset(folder)


def curve_folder(folder, mobility):
    generator, rates = np.random.default_rng(0), np.geomspace(0.05, 20.0, 40)
    if mobility:
        steady = [Giesekus(mobility, MODULUS, TIME).steady_shear(rate)[:2] for rate in rates]
    else:
        steady = np.stack([MODULUS * TIME * rates, 2.0 * MODULUS * (TIME * rates) ** 2], axis=1)
    values = np.array(steady) * (1.0 + NOISE * generator.standard_normal((40, 2)))
    columns = {"shear_rate_1_s": rates, "stress_Pa": values[:, 0], "N1_Pa": values[:, 1]}
    write_table(folder / "flow_curve.csv", columns)
    return dc.load_dataset(folder).with_material_functions()


def mobility_of(loop):
    assert loop.verdict == "effects_added"
    assert [stage.effect for stage in loop.stages] == ["giesekus_mobility"]
    return loop.stages[0].parameters["alpha"].ci95


def test_a_mobility_is_found_in_creep_alone(tmp_path):
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME, SOLVENT)
    named = []
    for draw in range(4):
        data = creep_folder(tmp_path / str(draw), 0.3, draw)
        loop = dc.close_loop(data, base, effects=EFFECTS, explanations=1)
        assert [stage.effect for stage in loop.stages] == ["giesekus_mobility"]
        low, high = loop.stages[0].parameters["alpha"].ci95
        assert low <= 0.3 <= high
        assert {record.quantity for record in loop.records} == {"strain"}
        # the noise alone is left
        assert loop.error_after.fit == pytest.approx(NOISE, rel=0.2)
        named.append(loop.verdict == "effects_added")
    # a third of the prior is with what has no name: one draw in ten is withheld
    assert sum(named) >= 3


def test_nothing_is_found_in_the_creep_of_the_declared_fluid(tmp_path):
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME, SOLVENT)
    loop = dc.close_loop(creep_folder(tmp_path, 0.0), base, effects=EFFECTS, explanations=1)
    assert loop.verdict == "no_effect_needed"


@pytest.mark.slow
def test_a_mobility_is_found_in_a_flow_curve_and_its_n1(tmp_path):
    data = curve_folder(tmp_path, 0.3).quantity_by_quantity()
    loop = dc.close_loop(data, BASE, effects=EFFECTS, explanations=1)
    low, high = mobility_of(loop)
    assert low <= 0.3 <= high
    assert [record.name for record in loop.records] == ["flow_curve.csv", "flow_curve.csv (N1)"]


@pytest.mark.slow
def test_nothing_is_found_in_the_flow_curve_of_the_declared_fluid(tmp_path):
    loop = dc.close_loop(curve_folder(tmp_path, 0.0), BASE, effects=EFFECTS, explanations=1)
    assert loop.verdict == "no_effect_needed"


@pytest.mark.slow
def test_n1_that_was_not_fitted_judges_a_law_found_in_the_stress_alone(tmp_path):
    data = curve_folder(tmp_path, 0.3).quantity_by_quantity()
    loop = dc.close_loop(
        data, BASE, effects=EFFECTS, explanations=1, held_out=["flow_curve.csv (N1)"]
    )
    assert mobility_of(loop)
    # N1 lies over three decades: its root mean square is that of the fastest rates, where one per
    # cent of noise and the mobility's own uncertainty are what is missed
    assert loop.error_after.held_out < 0.03
    assert loop.error_before.held_out > 1.0


@pytest.mark.slow
def test_the_page_of_a_flow_curve_has_the_rate_below_it_and_not_time(tmp_path):
    options = {"effects": EFFECTS, "max_effects": 1, "explanations": 1}
    loop = dc.close_loop(curve_folder(tmp_path, 0.3), BASE, **options)
    page = loop.to_html(tmp_path / "page.html").read_text(encoding="utf-8")
    assert "shear rate (1/s)" in page
    assert "time (s)" not in page


# the points are separate experiments: what is smooth in what is left of them is no noise
def test_a_flow_curve_that_no_law_has_is_not_explained_by_the_nearest(tmp_path):
    generator, rates = np.random.default_rng(1), np.geomspace(0.05, 10.0, 25)
    # thins as none of the candidates does   [Carreau 1972]
    stress = MODULUS * TIME * rates * (1.0 + (TIME * rates) ** 2) ** -0.3
    noisy = stress * (1.0 + NOISE * generator.standard_normal(25))
    write_table(tmp_path / "flow_curve.csv", {"shear_rate_1_s": rates, "stress_Pa": noisy})
    data = dc.load_dataset(tmp_path).with_material_functions()
    loop = dc.close_loop(data, BASE, effects=EFFECTS, explanations=1, max_effects=1)
    assert loop.verdict == "unexplained"
