"""Comparison of estimators, or on data, in memory."""

from collections.abc import Iterable, Mapping, Sequence, Sized
from typing import Any

from discover.answer import TOLERANCE
from discover.comparison.comparison import Comparison
from discover.comparison.run_comparison import compare as compare_study
from discover.dataset import Dataset
from discover.errors import InputError
from discover.laws.multimode import Fluid
from discover.learners.files import fingerprint_of
from discover.learners.run_prediction import RunPrediction
from discover.learners.settings import known_part
from discover.progress import Progress, checked, silent
from discover.study.data import StudyData
from discover.study.declared_model import StudyModel
from discover.study.in_memory import (
    HeldOut,
    data_in_memory,
    declared_fluid,
    joined,
    study_in_memory,
    with_known,
)
from discover.study.schema import Study


def compare(
    first: Sequence[RunPrediction] | Dataset, second: Dataset | Fluid | None = None, *,
    train: Dataset | None = None, held_out: HeldOut = (),
    known_effects: Mapping[str, Any] | None = None, free: Sequence[str] = (),
    tolerance: float = TOLERANCE, seed: int = 0, progress: Progress | None = None, **options: Any,
) -> Comparison:  # fmt: skip
    """Compare fitted estimators on runs that no fit saw, or fit both learners to data and compare.

    Parameters
    ----------
    first
        Fitted estimators, one of each learner at most, or a data set.
    second
        The data set that tests estimators; for a data set the known `Fluid`, by default that of its
        linear sweep, and without one a mode of Maxwell, which is fitted.
    train
        What estimators from a file were fitted to; the file holds no data.
    held_out
        Held-out runs of the data set, by name, or a data set of them.
    known_effects
        Known effects, as ``[model] effects`` in a study, such as
        ``{"stress_gain": "fit", "rate_rise_time": {"tau": 0.02}}``.
    free
        What of the base is also fitted: ``"modulus_Pa"``, ``"relaxation_time_s"`` (one factor on
        several modes), or parameters of its law.
    tolerance
        Relative discrepancy that is accepted.
    seed
        Of the learners, and of draws within intervals.
    progress
        Called with what is going on and the fraction done.
    **options
        Of ``[compare]`` in a study, such as ``quick=True``, ``learners=["tensor_sindy"]``,
        ``library={"degree": 1}``. From `held_out` on, but for the last three, for a data set only.

    Raises
    ------
    InputError
        If estimators are not fitted, or not to the same runs with the same known part, a run is
        both fitted and held out, or an option is unknown.

    Examples
    --------
    >>> import discover as dc
    >>> data = dc.synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.01)
    >>> comparison = dc.compare(data, learners=["tensor_sindy"])  # doctest: +SKIP
    >>> comparison.to_html("comparison.html")  # doctest: +SKIP
    """
    say = checked(progress) or silent
    if isinstance(first, Dataset):
        if train is not None:
            raise InputError("train is for estimators from a file; leave it out.")
        data = data_in_memory(first, held_out)
        model = with_known(declared_fluid(second, data.dataset), known_effects, free)
        study = _study(data, model, options, tolerance)
        return compare_study(study, seed, say, data=data, declared=model)
    judging = not isinstance(held_out, Sized) or len(held_out) > 0
    if options or judging or known_effects or len(free):
        given = {"held_out": judging, "known_effects": known_effects, "free": len(free)}
        unknown = next(iter(options), next((k for k, value in given.items() if value), ""))
        raise InputError(
            f"{unknown} is for a data set; the estimators are fitted already. Leave it out."
        )
    estimators = _fitted(first)
    runs = _training_runs(estimators, train)
    if not isinstance(second, Dataset) or not len(second):
        raise InputError(
            "Give the data set that tests the estimators, with one run at least: "
            "compare([sindy, network], test)."
        )
    data = StudyData(joined(second, runs), Dataset(second.name, runs), second)
    model = declared_fluid(_common_base(estimators), second)
    sparse = estimators.get("tensor_sindy")
    asked = {
        "learners": list(estimators),
        "use_normal_stresses": bool(getattr(sparse, "use_normal_stresses", False)),
    }
    made = {name: (e.result_, e.fluid_) for name, e in estimators.items()}
    library = getattr(sparse, "library_", None)
    return compare_study(
        _study(data, model, asked, tolerance), seed, say, data=data, declared=model, made=made,
        library=library,
    )  # fmt: skip


def _study(
    data: StudyData, model: StudyModel, options: Mapping[str, Any], tolerance: float
) -> Study:
    known = {"known_relaxation": bool(model.law.linear_relaxation)}
    asked = {"model": known, "compare": dict(options), "verdict": {"tolerance": tolerance}}
    return study_in_memory(data.dataset, asked, "compare()")


def _fitted(estimators: Any) -> dict[str, RunPrediction]:
    listed = list(estimators) if isinstance(estimators, Iterable) else [estimators]
    by_learner: dict[str, RunPrediction] = {}
    for one in listed:
        if not isinstance(one, RunPrediction):
            raise InputError(
                "compare takes fitted estimators and a data set, or a data set and a Fluid; got a "
                f"{type(one).__name__}."
            )
        if not hasattr(one, "result_"):
            raise InputError(f"{type(one).__name__} is not fitted; call fit(train) first.")
        if one.learner in by_learner:
            raise InputError(
                f"compare takes one {type(one).__name__} at most; got more. Compare their score() "
                "instead."
            )
        by_learner[one.learner] = one
    if not by_learner:
        raise InputError("compare needs one fitted estimator at least; got none.")
    return by_learner


def _training_runs(estimators: Mapping[str, RunPrediction], train: Any):
    wanted = {one.provenance_.fingerprint for one in estimators.values()}
    if len(wanted) > 1:
        names = " and ".join(
            f"{name}: {', '.join(one.provenance_.runs)}" for name, one in estimators.items()
        )
        raise InputError(
            f"The estimators were fitted to different runs ({names}), so they cannot be compared. "
            "Fit them to the same."
        )
    if train is None:
        kept = [one.runs_ for one in estimators.values() if hasattr(one, "runs_")]
        if not kept:
            raise InputError(
                "A file holds no data, so estimators from one are compared with the runs that they "
                "were fitted to at hand: compare([...], test, train=train)."
            )
        return kept[0]
    runs = tuple(train)
    if fingerprint_of(runs) not in wanted:
        expected = ", ".join(next(iter(estimators.values())).provenance_.runs)
        raise InputError(
            f"train does not hold the samples that the estimators were fitted to ({expected}). "
            "Give those."
        )
    return runs


def _common_base(estimators: Mapping[str, RunPrediction]) -> Fluid:
    import equinox as eqx

    fluids = [known_part(one.base) for one in estimators.values()]
    for other in fluids[1:]:
        if not eqx.tree_equal(fluids[0], other, rtol=1e-12):
            raise InputError(
                f"The estimators have different known parts ({fluids[0]!r} and {other!r}), so "
                "their terms cannot be compared. Give both the same base."
            )
    return fluids[0]
