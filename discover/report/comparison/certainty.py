"""How sure a comparison is: errors on unseen flows, and what the data do not determine."""

from collections.abc import Sequence

from discover.comparison.comparison import Comparison
from discover.comparison.judging.identifiability import SEPARATED
from discover.comparison.outcomes.flows import Flow
from discover.protocols.kinematics import in_words as quantities_in_words
from discover.report.comparison.asked import coarse_rates, left_open, within_a_sentence
from discover.report.wording import (
    percent,
    sentence,
    worst,
)
from discover.words import listed


def how_sure(comparison: Comparison) -> str:
    """Return the errors on unseen flows, what is not determined, and where the noise is from."""
    if comparison.verdict == "no_signal":
        return "Nothing is determined by these data: neither a law nor N1 nor N2."
    parts = [part for name in comparison.outcomes for part in _unseen(comparison, name)]
    if not parts:
        parts.append("nothing was held out, so no prediction was put to the test")
    if comparison.loadings is not None and comparison.verdict == "explained":
        parts.append(
            "this holds if each run is a loading of its own, "
            f"{percent(comparison.loadings.deviation)}: its factor is left open, that of a run "
            "held out too, whose error is told without"
        )
    if (coarse := coarse_rates(comparison)) is not None:
        parts.append(coarse.sentence.rstrip("."))
    parts += _determined(comparison)
    for name, report in comparison.physics.items():
        failed = [c["name"] for c in (report or {}).get("checks", ()) if c["passed"] is False]
        if failed:
            parts.append(
                f"{within_a_sentence(name)}'s law fails {len(failed)} of the checks of physical "
                f"soundness ({', '.join(failed)})"
            )
    parts += _noise_from(comparison)
    return " ".join(sentence([part]) for part in parts)


def _room(comparison: Comparison) -> list[str]:
    """Return how far N1 and N2 move between laws that describe σ12 about as well."""
    open_ = [s.quantity for s in comparison.statements if s.undetermined]
    said = [
        f"{name} differs by up to {percent(size)}{' of N1' if name == 'N2' else ''}"
        for name, size in comparison.room_left.items()
        if name in open_ and size >= SEPARATED
    ]
    which = "between laws on this page that describe σ12 about as well"
    return [f"{which}, {' and '.join(said)}"] if said else []


def _noise_from(comparison: Comparison) -> list[str]:
    """Return what is taken for error of the records, and where that is known from."""
    told = comparison.explanation
    if comparison.noise is not None or told.noise_given or not told.lack_of_fit:
        return []
    changing = [one.changing for one in told.lack_of_fit.values() if one.changing is not None]
    parts = [f"{percent(min(changing))} from sample to sample"] if changing else []
    if told.sweep_error > 0.0:
        parts.append(f"{percent(told.sweep_error)} that the modes miss their own sweep by")
    if told.repeats is not None:
        parts.append(f"{percent(told.repeats.error)} that repeated runs differ by")
    return [f"nobody told the noise; taken for error is {listed(parts)}"] if parts else []


def _unseen(comparison: Comparison, name: str) -> list[str]:
    """Return what becomes of a law in flows that no fit saw, inside the fitted range and beyond."""
    predictions = comparison.outcomes[name].predictions
    inside = [flow for flow in comparison.judged if comparison.placement(flow).inside]
    beyond = [flow for flow in comparison.judged if not comparison.placement(flow).inside]
    parts, runaway = [], []
    for flows, where in ((inside, "inside the fitted range"), (beyond, "beyond the fitted range")):
        lost = [flow.title for flow in flows if predictions[flow.key] is None]
        runaway += [f"{listed(lost)}, {where}"] if lost else []
        errors = {flow.name: comparison.errors(name, flow) for flow in flows}
        recorded = quantities_in_words(flow.protocol.quantity for flow in flows)
        said = [
            f"{symbol} by up to {percent(value)}"
            f"{_without_outliers(comparison, name, flows) if quantity == 'sigma12' else ''}"
            for symbol, quantity in ((recorded, "sigma12"), ("N1", "N1"), ("N2", "N2 (of N1)"))
            if (value := worst(errors, quantity.split()[0])) is not None
        ]
        if said:
            parts.append(f"{listed(said)} {where}")
    law = within_a_sentence(name)
    told = [f"in flows that no fit saw, {law} misses {', and '.join(parts)}"]
    return (told if parts else []) + (
        [f"{law}'s stress runs away in {', and in '.join(runaway)}"] if runaway else []
    )


def _without_outliers(comparison: Comparison, name: str, flows: Sequence[Flow]) -> str:
    """Return the largest error without the samples that do not judge; empty where all do."""
    count = sum(len(comparison.outliers(name, flow)) for flow in flows)
    if not count:
        return ""
    errors = []
    for flow in flows:
        error = comparison.error_without_outliers(name, flow)
        errors.append(comparison.errors(name, flow)["sigma12"] if error is None else error)
    which = "the outlier that does" if count == 1 else f"the {count} outliers that do"
    largest = percent(max((error for error in errors if error is not None), default=None))
    whole = percent(worst({flow.name: comparison.errors(name, flow) for flow in flows}, "sigma12"))
    return "" if largest == whole else f" ({largest} without {which} not count)"


def _determined(comparison: Comparison) -> list[str]:
    """Return what is said of N1, N2 and the coefficients."""
    parts = []
    names = left_open(comparison)
    parts += _room(comparison)
    if "tensor_sindy" in comparison.outcomes and not comparison.explanation.in_library:
        by_mode = comparison.by_mode
        which = (
            "with the same constants in every mode"
            if by_mode is not None and by_mode.explains
            else "that was tried"
        )
        parts.append(
            f"since no law {which} explains the data, nothing is determined by them, "
            f"neither {names.replace(' and ', ' nor ')} nor any coefficient"
        )
        return parts
    if names:
        parts.append(
            f"not determined by these data: {names} (shown is the choice of the law that fits)"
        )
    if decided := [s.title for s in comparison.statements if not s.undetermined]:
        parts.append(
            f"{' and '.join(decided)} follow{'s' if len(decided) == 1 else ''} from σ12 only if "
            "the law is in the library"
        )
    return parts
