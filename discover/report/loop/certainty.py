"""How sure a closed loop is: errors before and after, and what these data do not decide."""

from collections.abc import Iterator

from discover.loop.asked import (
    EXPLAINED,
    MOST_NAMES,
    doubted,
    untested_by,
)
from discover.loop.loop_result import LoopResult
from discover.protocols.kinematics import ONLY_STATES
from discover.report.wording import percent, sentence
from discover.words import listed

_SLOW = 0.5  # correlation from which noise and a slow effect look alike for some samples on end


def how_sure(result: LoopResult) -> str:
    """Return by how much the error fell, and after it what these data do not decide."""
    sentences = [_errors(result)]
    if untested_by(result) == "states":
        sentences.append(ONLY_STATES)
    if (deviation := result.remaining.get("loading_deviation")) and result.verdict in EXPLAINED:
        sentences.append(
            f"Each run has a loading factor, fitted jointly ({percent(deviation)} scatter); "
            "that of a held-out run is unknown."
        )
    if steps := result.remaining.get("step_instants"):
        runs = listed([*steps]) if len(steps) <= MOST_NAMES else f"{len(steps)} runs"
        sentences.append(
            f"The rate of {runs} steps between two samples: the instants are fitted jointly, "
            "those of a held-out run to that run."
        )
    doubts = [*_what_tests_it(result), *_samples_that_count(result)]
    return " ".join([*sentences, *(sentence([doubt]) for doubt in doubts)])


def _errors(result: LoopResult) -> str:
    """Return the errors before and after, on runs that no fit saw and on those fitted."""
    before, after = result.error_before, result.error_after
    parts, said = [], ""
    if before.held_out is not None and after.held_out is not None:
        unseen = "held-out runs:"
        if result.folds:
            unseen = "runs left out in turn:"
        said, sizes = _change(result, before.held_out, after.held_out)
        parts.append(f"{unseen} the error {said} {sizes}")
        if result.held_in_band is not None:
            share = percent(result.held_in_band)
            parts.append(f"{share} of their samples lie inside the 95 % band")
    verb, sizes = _change(result, before.fit, after.fit)
    # a verb is said again only where it is another one
    told = sizes if verb == said else f"the error {verb} {sizes}"
    return sentence([*parts, f"fitted runs: {told} ({_share_of_noise(result)})"])


def _share_of_noise(result: LoopResult) -> str:
    """Return how much of the error of the fitted runs is noise, as far as that is known."""
    floor = percent(result.noise_floor)
    linear = result.remaining.get("linear_error") or 0.0
    if linear > result.noise_floor:
        misfit = f"misfit of the spectrum {percent(linear)}"
        return f"noise {floor}, {misfit}"
    return f"noise {floor}"


def _what_tests_it(result: LoopResult) -> Iterator[str]:
    """Tell what no run tests, and how probable it is that something else is right."""
    together = result.remaining.get("autocorrelation") or 0.0
    if result.verdict in EXPLAINED and together > _SLOW:
        yield (
            f"the residual is smooth (lag-1 correlation {together:.2g}); it is taken for noise, "
            "but a slowly varying effect would look the same"
        )
    untested = untested_by(result)
    if untested == "flows":
        yield ("no run was held out, and there are as few flows as fitted constants")
    elif result.error_before.held_out is None:
        yield "no run was held out"
    if doubted(result) is not None:
        none = percent(result.explanations.unexplained_probability)
        yield f"probability that no candidate is right: {none}"


def _samples_that_count(result: LoopResult) -> Iterator[str]:
    """Tell how many samples did not count."""
    if count := result.remaining.get("outliers", 0):
        yield f"{count} {'outliers were' if count > 1 else 'outlier was'} excluded"


def _change(result: LoopResult, before: float, after: float) -> tuple[str, str]:
    """Return what an error did, as a verb, and from where to where, as far as digits show it."""
    if percent(before) == percent(after):
        return "stays at" if result.stages or result.folds else "is", percent(after)
    return "falls" if after < before else "rises", f"from {percent(before)} to {percent(after)}"
