"""What trials of a loop cost: given up where they are of no use, and with weights computed once.

All candidates are scored against a melt (`loop_speed.py` says which) and the upper convected
Maxwell law: as the loop does it, with each trial followed to its end, and with the weights of the
steps computed in each trial. Prints seconds of processor and ratios; the scores are the same.

    python benchmarks/trials.py
"""

import time
from collections.abc import Callable

import numpy as np
from loop_speed import with_all_candidates

ROUNDS = 5


def main() -> None:
    """Print seconds and ratios."""
    from discover.compilation_cache import enable_compilation_cache
    from discover.precision import enable_x64

    enable_x64()
    enable_compilation_cache()
    from discover.closed_loop.search.scoring.attribution import attribute
    from discover.inference.problem import FitProblem

    model, batch = with_all_candidates()
    fit = FitProblem(model, batch).at(model.zero(), [])
    residuals, weights = model.residuals, model._program.weights

    def score() -> dict[str, float]:
        found = attribute(model, batch, fit, (), 3)
        return {one.effect: one.reduction for one in (*found.leading, *found.rest)}

    def as_it_is() -> None:
        model.residuals, model._program.weights = residuals, weights

    def to_the_end() -> None:
        as_it_is()
        model.residuals = lambda thetas, batch, limits=None: residuals(thetas, batch)

    def weights_in_each_trial() -> None:
        as_it_is()
        model._program.weights = lambda *_: None

    ways: dict[str, Callable[[], None]] = {
        "as it is": as_it_is,
        "each trial to its end": to_the_end,
        "weights in each trial": weights_in_each_trial,
    }
    seconds: dict[str, list[float]] = {name: [] for name in ways}
    scores = {}
    for prepare in ways.values():  # nothing is compiled in what is timed
        prepare()
        model._last_weights = None
        score()
    for _ in range(ROUNDS):
        for name, prepare in ways.items():
            prepare()
            model._last_weights = None
            begun = time.process_time()
            scores[name] = score()
            seconds[name].append(time.process_time() - begun)
    modes, effects = len(model.declared.modulus), len(model.effects)
    print(f"{modes} modes, {len(batch.recorded)} runs, {effects} effects")
    least = min(seconds["as it is"])
    for name, each in seconds.items():
        difference = max(abs(scores[name][e] - scores["as it is"][e]) for e in scores[name])
        print(
            f"{name}: {min(each):.2f} s, {min(each) / least:.2f} times; "
            f"scores differ by {difference:.1e} of {np.max([*scores[name].values()]):.2f}"
        )


if __name__ == "__main__":
    main()
