"""Bands, proposed experiments, and what happens when they are run."""

import numpy as np
import pytest

from discover.errors import InputError
from discover.identify.design.experiment_outcome import judge_laws
from discover.identify.design.experiments import candidate_experiments
from discover.identify.design.next_experiment import (
    DECISIVE,
    MOST_EVIDENCE,
    propose_experiments,
    squared_distance,
)
from discover.identify.rivals.bands import bands_of_predictions, prediction_bands
from discover.identify.side_by_side.many_laws import (
    Contender,
    fluid_of,
    predict_laws,
    sigma_points,
)
from discover.laws import Fluid, UpperConvectedMaxwell, make_law
from discover.protocols.kinematics import FLOW_CLASSES
from discover.simulate import simulate
from discover.study.compare_section import NextExperiment
from tensor_library.law_terms import LawTerms

MAXWELL = Fluid.dimensionless(UpperConvectedMaxwell())
SMALL = np.array([[1e-3**2]])
JOHNSON_SEGALMAN = Contender(
    "slip", LawTerms({"sigma.gammadot+gammadot.sigma": 0.2}), covariance=SMALL
)
TWIN = Contender("twin", LawTerms({"tr(sigma)*gammadot": 0.32}), covariance=SMALL)
GIESEKUS = Contender("mobility", LawTerms({"sigma.sigma": 0.2}), covariance=SMALL)
LINEAR_PTT = Contender("network", LawTerms({"tr(sigma)*sigma": 0.1}), covariance=SMALL)
EXPERIMENTS = candidate_experiments(1.0, ("laos", "start_up"), (1.0, 2.0), (0.5, 1.0))
NOISE = 0.02


@pytest.fixture(scope="module")
def about_the_twin():
    return propose_experiments(JOHNSON_SEGALMAN, [TWIN], MAXWELL, EXPERIMENTS, NOISE, n_draws=8)


@pytest.fixture(scope="module")
def about_giesekus():
    return propose_experiments(GIESEKUS, [LINEAR_PTT], MAXWELL, EXPERIMENTS, NOISE, n_draws=8)


def test_laws_in_one_library_are_simulated_as_each_alone():
    experiment = EXPERIMENTS[-1]
    together = predict_laws(
        fluid_of([GIESEKUS, LINEAR_PTT], MAXWELL), [experiment.protocol], [experiment.times]
    )
    for i, (name, value) in enumerate(
        (("giesekus", {"alpha": 0.2}), ("ptt_linear", {"epsilon": 0.1}))
    ):
        alone = simulate(
            Fluid.dimensionless(make_law(name, value)), experiment.protocol, experiment.times
        )
        # accuracy of the fixed grid's default steps
        np.testing.assert_allclose(together[i, 0, :, 0], alone.shear_stress, atol=2e-6)
        np.testing.assert_allclose(
            together[i, 0, :, 1], alone.first_normal_stress_difference, atol=2e-6
        )


@pytest.mark.slow
def test_extension_separates_the_slip_twin_before_a_second_normal_stress_difference():
    some = candidate_experiments(1.0, ("start_up", "uniaxial"), (1.0,))
    best, *_ = propose_experiments(JOHNSON_SEGALMAN, [TWIN], MAXWELL, some, NOISE, n_draws=8)
    assert best.observed == ("tensile_stress",)
    assert best.falling == ("twin",)
    assert best.experiment.title == "uniaxial extension at Wi = 1"


def test_experiments_put_on_what_their_names_say():
    """At λ = 0.5 s and G = 3 Pa; what a fluid then does is asked in the slow test below."""
    classes = ("step_strain", "flow_curve", "creep")
    found = candidate_experiments(0.5, classes, (1.0, 2.0), modulus=3.0)
    kinds = [e.kind for e in found]
    assert kinds == ["step_strain"] * 2 + ["flow_curve"] + ["creep"] * 2
    assert [e.protocol.quantity for e in found] == ["sigma12"] * 3 + ["strain"] * 2
    tables = [
        (np.asarray(e.protocol.table_times), np.asarray(e.protocol.table_rates)) for e in found
    ]
    for strain, (times, rates) in zip((1.0, 2.0), tables, strict=False):
        # put on before the clock starts, at Wi = 2 and no faster, and held from there on
        assert np.sum(np.diff(times) * 0.5 * (rates[1:] + rates[:-1])) == pytest.approx(strain)
        assert np.max(rates) == pytest.approx(2.0 / 0.5)
        assert rates[-1] == 0.0 == times[-1]
    np.testing.assert_allclose(tables[2][1], np.geomspace(0.1, 2.0, 10) / 0.5)
    for level, (times, stress) in zip((1.0, 2.0), tables[3:], strict=True):
        # a stress in units of the modulus, reached as an elastic solid would at Wi = 2
        assert stress[-1] == pytest.approx(3.0 * level)
        assert np.max(np.diff(stress) / np.diff(times)) == pytest.approx(3.0 * 2.0 / 0.5)


@pytest.mark.slow
def test_a_maxwell_fluid_relaxes_flows_and_creeps_in_the_experiments_as_on_paper():
    some = candidate_experiments(0.5, ("step_strain", "flow_curve", "creep"), (2.0,), modulus=3.0)
    fluids = fluid_of([Contender("none", LawTerms({}))], Fluid(UpperConvectedMaxwell(), 3.0, 0.5))
    told = predict_laws(fluids, [e.protocol for e in some], [e.times for e in some])
    step, curve, creep = (told[0, i, : len(e.times), 0] for i, e in enumerate(some))
    # put on within one relaxation time, at Wi = 2
    begun = 3.0 * 2.0 * -np.expm1(-1.0)
    np.testing.assert_allclose(step, begun * np.exp(-some[0].times / 0.5), rtol=2e-3)
    np.testing.assert_allclose(curve, 1.5 * np.geomspace(0.2, 2.0, 10) / 0.5, rtol=1e-6)
    # of σ = 6 Pa that is reached within one relaxation time: σ/G and ∫ σ dt / η
    late = some[2].times > 0.6
    strain = 2.0 * (1.0 + (some[2].times - 0.25) / 0.5)
    np.testing.assert_allclose(creep[late], strain[late], rtol=2e-3)
    assert [e.protocol.quantity for e in some] == ["sigma12", "sigma12", "strain"]


def test_a_study_may_name_every_class_of_experiment():
    assert NextExperiment(flows=FLOW_CLASSES).flows == FLOW_CLASSES
    assert {e.kind for e in candidate_experiments(1.0)} == set(FLOW_CLASSES)


def test_only_a_second_normal_stress_difference_separates_the_slip_twin(about_the_twin):
    assert about_the_twin[0].observed == ("sigma12", "N2")
    assert about_the_twin[0].falling == ("twin",)
    others = [p for p in about_the_twin if "N2" not in p.observed]
    # the two agree exactly: what is left is the integration error over the noise
    assert max(p.evidence["twin"] for p in others) < 1e-6


@pytest.mark.slow
def test_shear_stress_suffices_where_it_separates(about_giesekus):
    assert about_giesekus[0].observed == ("sigma12",)
    assert about_giesekus[0].evidence["network"] > DECISIVE


@pytest.mark.slow
def test_evidence_falls_with_noise_squared_and_with_parameters_that_can_be_readjusted():
    def evidence(noise, covariance):
        laws = [Contender("a", LawTerms({"sigma.sigma": 0.2}), covariance=covariance)]
        laws += [Contender("b", LawTerms({"sigma.sigma": 0.21}), covariance=covariance)]
        found = propose_experiments(
            laws[0], laws[1:], MAXWELL, EXPERIMENTS[-1:], noise, ["sigma12"]
        )
        return found[0].evidence["b"]

    assert evidence(0.01, None) == pytest.approx(4.0 * evidence(0.02, None), rel=1e-9)
    # a mobility known to 0.1 only is no evidence for one value against another 0.01 away
    assert evidence(0.01, np.array([[0.1**2]])) < 0.1 < evidence(0.01, None)


def test_the_squared_distance_is_that_of_the_dense_matrix():
    rng = np.random.default_rng(0)
    factor, difference = rng.normal(size=(3, 20)), rng.normal(size=20)
    dense = difference @ np.linalg.solve(np.eye(20) + factor.T @ factor, difference)
    assert squared_distance(difference, factor) == pytest.approx(dense, rel=1e-10)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("truth", "laws", "quantities"),
    [
        (("giesekus", {"alpha": 0.2}), (GIESEKUS, LINEAR_PTT), ("sigma12",)),
        (("johnson_segalman", {"xi": 0.4}), (JOHNSON_SEGALMAN, TWIN), ("sigma12", "N2")),
    ],
)
def test_the_rival_falls_when_the_proposed_experiment_is_run(truth, laws, quantities):
    best = propose_experiments(laws[0], laws[1:], MAXWELL, EXPERIMENTS, NOISE, n_draws=8)[0]
    assert best.observed == quantities
    stress = simulate(
        Fluid.dimensionless(make_law(*truth)), best.experiment.protocol, best.experiment.times
    )
    exact = {
        "sigma12": stress.shear_stress,
        "N1": stress.first_normal_stress_difference,
        "N2": stress.second_normal_stress_difference,
    }
    size = {q: np.sqrt(np.mean(exact["N1" if q == "N2" else q] ** 2)) for q in quantities}
    noise = {q: NOISE * size[q] for q in quantities}
    rng = np.random.default_rng(1)
    measured = {q: exact[q] + noise[q] * rng.normal(size=exact[q].size) for q in quantities}
    right, wrong = judge_laws(laws, MAXWELL, best.experiment, measured, noise)
    assert not right.refuted
    assert wrong.refuted
    # the negative control: without what was asked for, the twin stands
    if quantities[-1] == "N2":
        del measured["N2"]
        assert not judge_laws(laws, MAXWELL, best.experiment, measured, noise)[1].refuted


def test_a_band_holds_the_law_and_widens_with_its_uncertainty_and_its_rivals():
    flows = EXPERIMENTS[-1:]
    protocols, times = [e.protocol for e in flows], [e.times for e in flows]
    narrow = prediction_bands(GIESEKUS, [LINEAR_PTT], MAXWELL, protocols, times)[0]
    assert np.all(narrow.low <= narrow.chosen + 1e-12)
    assert np.all(narrow.chosen <= narrow.high + 1e-12)
    loose = Contender("mobility", GIESEKUS.law, covariance=4.0 * SMALL)
    wide = prediction_bands(loose, [LINEAR_PTT], MAXWELL, protocols, times)[0]
    # same draws, twice as far; linear to a few per cent at this size
    ratio = wide.widths(False)["N1"] / narrow.widths(False)["N1"]
    assert ratio == pytest.approx(2.0, rel=0.05)
    assert narrow.widths()["N2"] > 10 * narrow.widths(False)["N2"]
    assert narrow.runaways == 0.0


def test_where_many_draws_run_away_there_is_no_band_and_it_is_said():
    times = [np.linspace(0.0, 1.0, 5)]
    predicted = np.ones((3, 1, 5, 3))
    predicted[2] = np.nan
    band = bands_of_predictions(predicted, [3], times)[0]
    assert band.runaways == pytest.approx(1 / 3)
    assert not np.any(np.isfinite(band.low))
    assert "run away" in band.reason


def test_one_draw_of_fifty_that_runs_away_is_counted_and_left_out():
    times = [np.linspace(0.0, 1.0, 5)]
    predicted = np.ones((50, 1, 5, 3))
    predicted[49] = np.nan
    band = bands_of_predictions(predicted, [50], times)[0]
    assert band.runaways == pytest.approx(1 / 50)
    assert np.all(np.isfinite(band.low))


def test_a_rival_that_runs_away_though_its_draws_do_not_falls_in_any_experiment():
    drawn = np.array([[0.1], [0.11]])
    rival = Contender("away", LawTerms({"tr(sigma)*sigma": -1.0}), covariance=SMALL, drawn=drawn)
    fast = EXPERIMENTS[-1:]
    proposals = propose_experiments(GIESEKUS, [rival], MAXWELL, fast, NOISE, n_draws=8)
    assert all(proposal.evidence["away"] == MOST_EVIDENCE for proposal in proposals)
    stays = Contender("stays", LawTerms({"tr(sigma)*sigma": 0.1}), covariance=SMALL, drawn=drawn)
    proposals = propose_experiments(GIESEKUS, [stays], MAXWELL, fast, NOISE, n_draws=8)
    assert all(proposal.evidence["stays"] < MOST_EVIDENCE for proposal in proposals)


def test_an_unknown_class_of_experiment_is_an_input_error():
    with pytest.raises(InputError, match="squeeze"):
        candidate_experiments(1.0, ["squeeze"])
    with pytest.raises(InputError, match="Wi"):
        candidate_experiments(1.0, weissenberg_numbers=[-1.0])


def test_sigma_points_have_the_covariance_that_they_stand_for():
    covariance = np.array([[4.0, 1.0], [1.0, 2.0]]) * 1e-4
    law = Contender(
        "both", LawTerms({"sigma.sigma": 0.2, "tr(sigma)*sigma": 0.1}), covariance=covariance
    )
    first, *others = sigma_points(law, 32, np.random.default_rng(0))
    assert first is law
    assert len(others) == 4  # two for each parameter
    moved = np.array([one.law.values for one in others]) - first.law.values
    np.testing.assert_allclose(moved.T @ moved / len(moved), covariance, rtol=1e-12)
    np.testing.assert_allclose(moved.sum(axis=0), 0.0, atol=1e-15)


def test_laws_that_are_known_exactly_or_only_by_draws_have_no_sigma_points():
    rng, terms = np.random.default_rng(0), LawTerms({"sigma.sigma": 0.2})
    exact = Contender("exact", terms)

    def mobility(contender):
        return contender.law.coefficients["sigma.sigma"]

    assert sigma_points(exact, 32, rng) == (exact,)
    drawn = Contender("drawn", terms, covariance=SMALL, drawn=np.full((50, 1), 0.3))
    assert [*map(mobility, sigma_points(drawn, 8, rng))] == [0.2, *[0.3] * 8]
