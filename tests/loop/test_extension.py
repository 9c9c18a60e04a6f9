"""What the loop and the sparse learner say of extension, on data by scipy with full tensors."""

import numpy as np
import pytest
from independent.homogeneous import GiesekusFluid

import discover as dc
from discover.dataset.run import Run
from discover.protocols import in_flow, start_up

pytestmark = pytest.mark.usefixtures("without_curves", "verdict_alone")
MODULUS, TIME, SOLVENT = (100.0, 20.0), (0.2, 3.0), 5.0
RATES = (0.15, 0.3, 0.6, 1.2)


def extension(kind, mobility, noise=0.01):
    """Return start-ups of a two-mode Giesekus fluid with solvent, with white noise."""
    fluid = GiesekusFluid(MODULUS, TIME, mobility, SOLVENT)
    generator = np.random.default_rng(0)
    runs = []
    for rate in RATES:
        times = np.linspace(0.05, min(6.0, 3.5 / rate), 60)
        stress = fluid.recorded(kind, lambda _, r=rate: r, times)
        size = noise * np.sqrt(np.mean(stress**2))
        runs.append(
            Run(
                f"{kind}_{rate}",
                times,
                in_flow(start_up(rate), kind),
                np.full(60, rate),
                stress + size * generator.standard_normal(60),
            )
        )
    return dc.Dataset(f"{kind} extension", tuple(runs))


@pytest.fixture(scope="module")
def base():
    return dc.Fluid(dc.make_law("ucm"), MODULUS, TIME, SOLVENT)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["uniaxial", "planar"])
def test_a_mobility_is_found_in_extension_alone(base, kind):
    loop = dc.close_loop(extension(kind, 0.3), base, explanations=1)
    assert loop.verdict == "effects_added"
    assert [stage.effect for stage in loop.stages] == ["giesekus_mobility"]
    low, high = loop.stages[0].parameters["alpha"].ci95
    assert low <= 0.3 <= high
    # the noise alone is left
    assert loop.error_after.fit == pytest.approx(0.01, rel=0.2)


@pytest.mark.slow
def test_nothing_is_found_where_the_declared_law_made_the_extension(base):
    loop = dc.close_loop(extension("uniaxial", 0.0), base, explanations=1)
    assert loop.verdict == "no_effect_needed"
    assert not loop.stages


@pytest.mark.slow
def test_the_sparse_learner_finds_the_law_in_extension_alone(base):
    data = extension("uniaxial", 0.3)
    law = dc.TensorSINDy(dc.build_library(), base=base).fit(data)
    (term,) = law.result_.terms
    assert term.term == "sigma.sigma"
    assert term.coefficient == pytest.approx(0.3, rel=0.02)
    # and predicts a flow that it did not see, in another geometry
    planar = extension("planar", 0.3, noise=0.0)
    assert law.score(planar) > 0.99


def test_effects_of_a_rotational_rheometer_leave_an_extension_as_it_is(base):
    flawed = dc.close_loop(
        extension("uniaxial", 0.0), base, effects=["stress_gain", "wall_slip", "transducer_lag"]
    )
    assert flawed.verdict == "no_effect_needed"
    lost = [candidate for ranking in flawed.rankings for candidate in ranking]
    assert all(candidate.score < 1e-3 for candidate in lost)


@pytest.mark.parametrize(
    ("effect", "verdict"), [("giesekus_mobility", "effects_added"), ("stress_gain", "unexplained")]
)
def test_a_band_in_a_flow_of_another_kind_holds_what_is_measured_there(base, effect, verdict):
    fluid, generator, runs = (
        GiesekusFluid(MODULUS, TIME, 0.3, SOLVENT),
        np.random.default_rng(0),
        [],
    )
    for kind, rate in [("shear", 0.3), ("shear", 0.6), ("shear", 1.2), ("uniaxial", 0.3)]:
        times = np.linspace(0.05, 6.0, 60)
        stress = fluid.recorded(kind, lambda _, r=rate: r, times)
        noise = 0.01 * np.sqrt(np.mean(stress**2)) * generator.standard_normal(60)
        protocol = start_up(rate) if kind == "shear" else in_flow(start_up(rate), kind)
        runs.append(Run(f"{kind}_{rate}", times, protocol, np.full(60, rate), stress + noise))
    loop = dc.close_loop(
        dc.Dataset("both", tuple(runs)), base, held_out=["uniaxial_0.3"], effects=[effect]
    )
    assert loop.verdict == verdict
    assert all(record.band is not None for record in loop.records)
    # shear alone, unexplained: a gain that follows it says little of extension
    assert loop.held_in_band > 0.9
