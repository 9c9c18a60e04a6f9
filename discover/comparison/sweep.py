"""The same comparison again over laws and values of one parameter, as computed data."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from discover.comparison.comparison import SweepPoint
from discover.comparison.flows import comparison_flows
from discover.comparison.known_part import Frame
from discover.comparison.learning import Learning
from discover.comparison.prepared import thinned_to
from discover.errors import InputError
from discover.laws.registry import LAWS, make_law
from discover.progress import Progress
from discover.study.data import load_study_data
from discover.study.declared_model import DeclaredModel
from discover.study.schema import Study
from discover.words import unknown_name

Asked = tuple[str, float, Study]
"""A law, the value of its parameter, and the study of that point."""


def sweep_studies(study: Study) -> list[Asked]:
    """Return the law, the value and the study of each point of a sweep."""
    sweep, synthetic = study.compare.sweep, study.data.synthetic
    if sweep is None:
        return []
    if synthetic is None:
        raise InputError(
            "compare.sweep makes synthetic data, so [data] must say synthetic = {...} too."
        )
    studies = []
    for law in sweep.laws:
        if sweep.parameter not in LAWS[law].parameters:
            its = LAWS[law].parameters
            said = unknown_name("parameter", sweep.parameter, its, f"the law {law!r}")
            raise InputError(f"compare.sweep: {said}")
        for value in sweep.values:
            make_law(law, {sweep.parameter: value})  # refuses now what would fail after hours
            made = synthetic.model_copy(update={"law": law, "parameters": {sweep.parameter: value}})
            data = study.data.model_copy(update={"synthetic": made})
            studies.append((law, value, study.model_copy(update={"data": data})))
    return studies


def sweep_points(
    asked: Sequence[Asked],
    learning: Learning,
    model: DeclaredModel,
    seed: int | None,
    step: Callable[[int, str], Progress],
) -> list[SweepPoint]:
    """Return what each learner of a study finds at each point of its sweep.

    `asked`: the points, as `sweep_studies` returns them. `learning`: where learners are trained, of
    the study whose sweep it is. `model`: the known part. `seed`: overrides the study's seed of the
    noise. `step`: returns what is called with what is going on, of the number of learners that are
    done and a title.
    """
    options, points = learning.study.compare, []
    for i, (law, value, other) in enumerate(asked):
        data = thinned_to(load_study_data(other, seed), options.most_samples)
        flow = comparison_flows(data, ())[len(data.fit)]
        alone = Frame(model, data, [flow], [flow])
        elsewhere, found = replace(learning, study=other, made=None), {}
        for j, learner in enumerate(options.learners):
            part = f"sweep_{law}_{value:g}_{learner}"
            say = step(i * len(options.learners) + j, part)
            found[learner] = elsewhere.outcome(learner, alone, say, part)
        assert options.sweep is not None
        points.append(SweepPoint(law, options.sweep.parameter, value, flow, found))
    return points
