"""What to measure next after a comparison."""

from discover.comparison.comparison import Comparison
from discover.comparison.judging.next_measurement import NextMeasurement
from discover.comparison.judging.statements import only_states
from discover.dataset.records.rates import MORE_SAMPLES
from discover.protocols.kinematics import in_words
from discover.report.comparison.asked import coarse_rates, left_open
from discover.report.wording import (
    A_TRANSIENT,
    IF_LOADINGS,
    percent,
    sentence,
    significant,
)
from discover.words import listed


def what_to_measure_next(comparison: Comparison) -> str:
    """Return the measurement, or the command, that would tell most."""
    explanation = comparison.explanation
    if explanation.verdict == "no_signal":
        return (
            "Measure where the stress stands out of the noise: at higher rates, with a more "
            "sensitive transducer, or with a larger sample."
        )
    if coarse_rates(comparison) is not None:
        return MORE_SAMPLES
    if comparison.by_mode is not None and comparison.by_mode.explains:
        names = ", ".join(f'"{name}"' for name in comparison.by_mode.constants)
        return (
            "Have discover close-loop fit these constants too: [model] by_mode = "
            f"[{names}] gives their intervals, what else the runs show, and an export."
        )
    advised = [left.advice for left in explanation.lack_of_fit.values() if left.advice]
    if explanation.verdict == "unexplained" and advised:
        return sentence(advised[:1])
    lacking = "tensor_sindy" in comparison.outcomes and not explanation.in_library
    if lacking or explanation.verdict == "unexplained":
        return (
            "Before measuring more, find what the law lacks: discover close-loop tries effects of "
            "the instrument and of the flow on the same runs, and [compare] library and max_terms "
            f"allow more terms.{_loadings(comparison)}"
        )
    following = comparison.next_measurement
    if only_states(comparison.flows):
        return A_TRANSIENT
    if following.proposals:
        return _proposal(following)
    if not any(flow.in_shear for flow in comparison.flows_of("training")):
        return "Measure in shear: extension alone does not say what the fluid does there."
    if names := left_open(comparison):
        return f"Measure {names}: nothing else decides between laws that give the same σ12."
    rates = [flow.largest_rate for flow in comparison.flows_of("training")]
    unit = "" if comparison.noise is not None else " 1/s"
    return (
        "No rival law is known, so what tests this one hardest is a flow unlike those fitted: "
        f"a shear rate above {significant(max(rates), 3)}{unit}."
    )


def _loadings(comparison: Comparison) -> str:
    """Return that runs may be loadings of their own, where nobody said so of several."""
    runs = comparison.flows_of("training")
    several_told = comparison.loadings is None and len(runs) > 1
    if not several_told or any(run.is_truth or run.protocol.control == "stress" for run in runs):
        return ""
    return f" {IF_LOADINGS.format('compare')}"


def _proposal(following: NextMeasurement) -> str:
    best = following.proposals[0]
    n_rivals = len(following.laws) - 1
    laws = "the one rival law" if n_rivals == 1 else f"the {n_rivals} rival laws"
    leave = f"{laws} that these data leave in the library"
    if not best.falling:
        return f"None of the experiments allowed is expected to rule out {leave}."
    what = listed([in_words([name]) for name in best.observed])
    fall = len(best.falling)
    outcome = leave if fall == n_rivals else f"{fall} of {leave}"
    return (
        f"Measure {what} in {best.experiment.title}: at {percent(following.noise)} noise it is "
        f"expected to rule out {outcome}."
    )
