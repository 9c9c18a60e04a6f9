"""The result of a closed loop on a yield stress, a viscous fluid or a solid."""

from collections.abc import Sequence

import numpy as np

from discover.answer.simple_material import SimpleMaterial, material_of
from discover.dataset import Run
from discover.forward import make_batch
from discover.inference.posterior import Posterior
from discover.inference.problem import Problem
from discover.inference.simple_materials import simple_material
from discover.loop.loop_result import LoopResult
from discover.loop.parts import Explanation, Explanations, Stage, StageParameter
from discover.loop.runs import RunRecord, errors_of, record_runs, why_untested
from discover.loop.task import Task
from discover.statistics.noise_model import rms
from discover.statistics.whiteness import sample_to_sample_noise
from discover.words import significant

# Effect that is all that such a material has; another law stands for itself
_EFFECT = {"herschel_bulkley": "yield_stress", "newtonian": "solvent_viscosity"}
_AS_WELL = 1.1
_FELT = 0.1  # Of the shear stress: thrust is tared to some per cent of the torque's range


def simple_material_result(task: Task, posterior: Posterior) -> LoopResult | None:
    """Return the result for runs of a simple material; None where a law that relaxes is needed.

    None as well where the declared law has this viscosity, or a normal stress that was recorded
    besides shows elasticity.
    """
    if any(map(_is_elastic, task.unfitted)):
        return None
    found = simple_material(posterior)
    if found is None:
        return None
    material = material_of(found)
    probability = 1.0 / (1.0 + float(np.exp(-found.log_odds)))
    if any(material.predict(run) is None for run in task.held_out):
        return None
    records: list[RunRecord] = []
    for runs, held in ((task.fitted, False), (task.held_out, True)):
        if runs:
            records += record_runs(runs, _predicted(posterior.problem, material, runs), held)
    before, after = errors_of(records, 0), errors_of(records, 1)
    knows_times = 1 not in task.declared.free_positions
    if material.kind == "viscous" and knows_times and before.fit <= _AS_WELL * after.fit:
        return None  # the declared law has this viscosity, and may have more
    explained = probability >= 0.5
    left = [record.relative_residual[1] for record in records if not record.held_out]
    # where it is all there is, what it leaves is the noise
    fast = [sample_to_sample_noise(one) for one in left if len(one) > 2]
    noise = material.error if explained or not fast else float(np.mean(fast))
    parameters = {
        one.name: StageParameter(one.value, one.ci95 or (one.value, one.value), one.unit)
        for one in material.constants
    }
    effect = _EFFECT.get(material.law, material.law)
    stage = Stage(
        effect, "constitutive", parameters, (), after, 0.0, material.latex,
        "evidence, compared with laws that relax", check_of(material),
    )  # fmt: skip
    values = {one.name: one.value for one in material.constants}
    explanation = Explanation((effect,), probability, after, {effect: values})
    verdict = "effects_added" if explained else "unexplained"
    return LoopResult(
        verdict, before, after, noise, (stage,),
        {
            "structured": not explained, "error": after.fit, "noise_floor": noise,
            "outliers": sum(map(len, task.spikes.values())), "outlier_times_s": task.spikes,
            "untested": why_untested(len(values), task.fitted, task.held_out),
            "description": f"A {material.title} is likelier than all laws that relax.",
        },
        records=tuple(records),
        explanations=Explanations(
            (explanation,), 1.0 - probability, {effect: probability}, {"constitutive": probability}
        ),
        material=material,
    )  # fmt: skip


def _is_elastic(run: Run) -> bool:
    """Return whether a normal stress is more than its scatter, and than errors of its zero."""
    size = rms(run.recorded)
    return size > _FELT * rms(run.stress) and sample_to_sample_noise(run.recorded) < 0.5 * size


def _predicted(problem: Problem, material: SimpleMaterial, runs: Sequence[Run]) -> np.ndarray:
    batch = make_batch(runs)
    with np.errstate(all="ignore"):
        # of the model with all candidates, whose code is made
        first = problem.model.predictions([problem.zero], batch)[0]
    second = np.zeros_like(first)
    for i, run in enumerate(runs):
        found = material.predict(run)
        assert found is not None
        second[i, : len(run)] = found
    return np.stack([first, second])


def check_of(material: SimpleMaterial) -> str:
    """Return what to measure next of a material."""
    if material.kind != "yield_stress":
        return _CHECKS[material.kind]
    first, consistency, index = material.constants
    low, high = first.ci95 or (first.value, first.value)
    below, above = (float(f"{one:.2g}") for one in (_BELOW * low, high / _BELOW))
    rate = ((above - first.value) / consistency.value) ** (1.0 / index.value)
    slow, fast, flows = (significant(one, 2) for one in (below, above, rate))
    return f"Creep at {slow} and {fast} Pa until steady: this law gives 0 and {flows} 1/s."


_BELOW = 0.9  # Stress of a creep over the yield stress, far enough from it to be told in an hour
_CHECKS = {
    "viscous": "N1, or the first moments of a start-up: a constant viscosity shows no elasticity.",
    "solid": "Creep or relaxation over a longer time: it shows whether the material flows.",
}
