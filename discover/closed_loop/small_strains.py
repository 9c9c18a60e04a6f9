"""What small strains say of the instrument, where the fluid is linear."""

from collections.abc import Callable, Sequence

import numpy as np

from discover.closed_loop.judging.before_after import strain_of
from discover.closed_loop.runs import FEWEST_LINEAR_SAMPLES
from discover.closed_loop.search import Search
from discover.dataset import Run
from discover.protocols.kinematics import LINEAR_STRAIN


def find_instrument_effects(
    search: Search, runs: Sequence[Run], max_effects: int, say: Callable[[str], None]
) -> None:
    """Find instrument effects where the strain is small and no law differs from another.

    That holds for fluids that are linear there. Where instrument effects alone do not explain the
    small strains, the fluid may not be, and nothing is settled.

    Parameters
    ----------
    search
        The search, before it adds anything; what is found is in it afterwards.
    max_effects
        Largest number of effects found.
    say
        Called with a line of text now and then.
    """
    small = []
    for run in runs:
        if run.flow != "shear" or not run.from_rest or run.protocol.control != "rate":
            continue  # a fluid that flowed before is not at small strain
        reached = np.maximum.accumulate(np.abs(strain_of(run)))
        keep = reached <= LINEAR_STRAIN
        if np.count_nonzero(keep) >= FEWEST_LINEAR_SAMPLES:
            small.append(run.window(keep))
    if len(small) < 2 or max_effects == 0:
        return
    linear = search.restricted(
        small, lambda effect: effect.kind != "constitutive", "at_small_strain"
    )
    if not linear.resume():
        linear.start(by_mode=False)
    linear.run(max_effects, lambda line: say(f"at small strain, {line}"), whole=False)
    if linear.active and linear.explained:
        search.adopt(linear)
        search.checkpoint.save(search)
