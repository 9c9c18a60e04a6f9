"""What a loop that has ended says of its explanations: their probabilities, errors and band."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from discover.closed_loop.explanations.bands.mixture import mixed_bands
from discover.closed_loop.explanations.beam import Carried
from discover.closed_loop.explanations.limits import names_of_limits
from discover.closed_loop.explanations.nameless_terms import share_of_names
from discover.closed_loop.explanations.other_shapes import most_believed
from discover.closed_loop.explanations.probabilities import explanations_of
from discover.closed_loop.explanations.untested import share_believed
from discover.closed_loop.judging.before_after import errors_of, record_runs
from discover.closed_loop.judging.judgement import Judgement
from discover.closed_loop.results.explanation import Explanations
from discover.closed_loop.results.run_record import RunRecord
from discover.closed_loop.search import Search
from discover.dataset import Run
from discover.forward import AugmentedModel, Batch


def explain(
    search: Search,
    carried: Sequence[Carried],
    runs: tuple[Sequence[Run], Sequence[Run]],
    held_batch: Batch | None,
    judgement: Judgement,
    unlisted: float = np.inf,
) -> Explanations:
    """Return the explanations that were carried, with their probabilities and errors.

    Parameters
    ----------
    search, carried
        The search that has ended, and the explanations.
    runs
        The runs that were fitted, and those held out; or that other searches leave out in turn.
    held_batch
        These, as the model has them, if there are any.
    judgement
        Of what the search chose. Where it is no signal, nothing is explained.
    unlisted
        Criterion of what explains the records and is no set of effects, if anything does.
    """
    if judgement.verdict == "no_signal":
        return Explanations()
    model, batch = search.model, search.batch
    thetas = [one.fit.theta for one in carried]
    records = record_runs(model, batch, runs[0], thetas, held_out=False)
    if held_batch is not None:
        records += record_runs(model, held_batch, runs[1], thetas, held_out=True)
    errors = [errors_of(records, i) for i in range(len(thetas))]
    effective = search.problem.independent_samples(search.fit)

    def limits_of(one: Carried) -> dict[str, str]:
        return names_of_limits(model, batch, runs[0], one.fit, one.effects)

    def believed(one: Carried) -> float:
        tested = share_believed(model, one.fit, one.effects, runs)
        return tested * share_of_names(model, one.effects)

    most = () if judgement.structured else most_believed(search, carried)
    return explanations_of(
        model, carried, errors, judgement, effective, unlisted, limits_of, believed, most
    )


def with_band(
    model: AugmentedModel,
    batch: Batch,
    carried: Sequence[Carried],
    explanations: Explanations,
    parts: Sequence[tuple[Batch | None, Sequence[RunRecord]]],
    judgement: Judgement,
    candidates: Sequence[str],
) -> list[RunRecord]:
    """Return the records of runs with what the explanations predict, each and together.

    Where none of them explains the fitted runs, a run held out in a flow of another kind (`flow`)
    has no band: laws that follow shear alike differ in extension by many times what they leave of
    shear, and candidates near them say nothing of laws that are not.

    Parameters
    ----------
    model, batch, carried, explanations
        As in `explain`.
    parts
        The runs as the model has them, and their records in the same order: fitted and held out.
    judgement
        Of what the search chose.
    candidates
        Effects that were tried.
    """
    of = {one.effects: one.probability for one in explanations.likeliest_first}
    mixed = [one for one in carried if one.effects in of]
    if not mixed:
        return [record for _, records in parts for record in records]
    told = [(held, records) for held, records in parts if held is not None]
    every = [record for _, records in told for record in records]
    alike = len({(one.control, one.flow, one.quantity) for one in every}) == 1
    # of one kind of test alone does the rate say how fast it is
    timed = alike and every[0].control == "rate"
    rates = [np.array([np.max(np.abs(r.rate)) for r in records]) for _, records in told]
    bands = mixed_bands(
        model, batch, mixed, [of[one.effects] for one in mixed], [held for held, _ in told],
        judgement.left.noise, judgement.structured, candidates,
        [rates[0], *rates] if timed else (),
    )  # fmt: skip
    flows = {record.flow for record in told[0][1]}
    thetas = [one.fit.theta for one in sorted(mixed, key=lambda one: [*of].index(one.effects))]
    each = [model.predictions(thetas, held) for held, _ in told]
    return [
        replace(
            record,
            band=band[:, i, : len(record.time)]
            if record.flow in flows or not judgement.structured
            else None,
            by_explanation=predicted[:, i, : len(record.time)],
        )
        for (_, records), band, predicted in zip(told, bands, each, strict=True)
        for i, record in enumerate(records)
    ]
