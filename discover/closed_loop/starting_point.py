"""What a loop starts from: the model, the runs that are fitted and those that judge, candidates."""

from collections.abc import Sequence
from dataclasses import dataclass

from discover.closed_loop.candidates import candidates_of, require_possible, require_present
from discover.closed_loop.runs import require_samples, split_runs
from discover.dataset import Dataset, Run
from discover.dataset.records.own_loadings import with_loadings
from discover.effects import AbstractEffect
from discover.forward import DeclaredModel
from discover.inference.scattered_rates import smoothed, unfelt_scatter
from discover.inference.step_instants import with_places


@dataclass(frozen=True)
class StartingPoint:
    """What a loop starts from.

    Attributes
    ----------
    declared
        The model, with a place for each instant that is fitted along.
    candidates
        Effects that it does not know.
    fitted, held_out
        The runs that are fitted, and those that only judge.
    spikes
        Times of samples set aside as outliers, by run.
    of_rates
        That rates were read with noise which the fluid did not feel, in words; empty where not.
    """

    declared: DeclaredModel
    candidates: Sequence[AbstractEffect]
    fitted: Sequence[Run]
    held_out: Sequence[Run]
    spikes: dict[str, list[float]]
    of_rates: str


def starting_point(
    dataset: Dataset,
    declared: DeclaredModel,
    names: tuple[Sequence[str] | None, Sequence[str]],
    effects: Sequence[str | AbstractEffect] | str | None,
    strain: tuple[float, float] | None,
    most_samples: int,
    loading: float | None,
    noise: float | None,
) -> StartingPoint:
    """Return what a loop starts from; see `run_loop`, whose parameters these are.

    Parameters
    ----------
    names
        Of the runs to fit, and of those that only judge.

    Raises
    ------
    InputError
        If runs, window or effects are not as they should be.
    """
    fitted, held_out, spikes = split_runs(dataset, *names, strain, most_samples)
    fitted, held_out = (with_loadings(some, loading, noise) for some in (fitted, held_out))
    candidates = candidates_of(effects)
    declared, fitted, held_out = with_places(declared, fitted, held_out)
    require_samples(fitted, declared)
    known = {effect.name for effect in declared.effects}
    require_present(declared, {*known, *(effect.name for effect in candidates)})
    require_possible(declared, [*fitted, *held_out])
    of_rates = unfelt_scatter(declared, fitted)
    if of_rates:
        fitted, held_out = [*map(smoothed, fitted)], [*map(smoothed, held_out)]
    new = [effect for effect in candidates if effect.name not in known]
    return StartingPoint(declared, new, fitted, held_out, spikes, of_rates)
