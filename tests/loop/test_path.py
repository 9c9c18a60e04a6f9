"""Which effects of a hypothesis are reported, from hypotheses that are made up."""

from types import SimpleNamespace

import pytest

from discover.loop.path import Path

pytestmark = pytest.mark.usefixtures("as_users_run_it")  # stand-ins are no posteriors

LAW, BENCH, TWIN = "a law", "a bench", "its twin"
SIZES = {LAW: 1, BENCH: 1, TWIN: 2}  # constants of each effect


def path_of(verdict, likelihoods, chosen, at_an_end=()):
    """Return the path to a hypothesis, by the log likelihood of each set of effects."""
    found = {
        frozenset(names): SimpleNamespace(
            names=tuple(sorted(names)),
            log_likelihood=value,
            at_an_end=at_an_end * (names == chosen),
        )
        for names, value in likelihoods.items()
    }
    told = [SimpleNamespace(members=[chosen])]
    return Path(
        SimpleNamespace(
            explanations=told,
            by_left_out=[(found[frozenset(chosen)], 1.0)],
            verdict=verdict,
            has_function=lambda fit: False,
            search=SimpleNamespace(found=found),
            problem=SimpleNamespace(
                effects={n: SimpleNamespace(parameters=range(k)) for n, k in SIZES.items()}
            ),
        ),
        False, (), 1,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("likelihoods", "kept"),
    [
        # runs left out in turn hold two hypotheses alike that differ by an effect of no size
        ({(LAW, BENCH): -90.0, (LAW,): -90.0, (BENCH,): -400.0, (): -400.0}, (LAW,)),
        # an effect that describes the runs better stays, though the law is not all there is
        ({(LAW, BENCH): -90.0, (LAW,): -95.0, (BENCH,): -400.0, (): -400.0}, (BENCH, LAW)),
        # nothing describes them any better than the declared model does
        ({(LAW, BENCH): -90.0, (LAW,): -90.2, (BENCH,): -90.1, (): -90.3}, ()),
    ],
)
def test_what_is_unexplained_is_not_put_to_an_effect_that_the_fitted_runs_do_not_show(
    likelihoods, kept
):
    assert path_of("unexplained", likelihoods, (LAW, BENCH)).fit.names == kept


def test_of_two_effects_that_do_the_same_one_stays():
    # either is idle beside the other, and the runs ask for one: that with fewer constants
    likelihoods = {(BENCH, TWIN): -90.0, (BENCH,): -90.5, (TWIN,): -90.2, (): -200.0}
    assert path_of("unexplained", likelihoods, (BENCH, TWIN)).fit.names == (BENCH,)


def test_what_evidence_chose_is_left_alone():
    likelihoods = {(LAW, BENCH): -90.0, (LAW,): -90.4, (BENCH,): -400.0, (): -400.0}
    assert path_of("effects_added", likelihoods, (LAW, BENCH)).fit.names == (BENCH, LAW)
