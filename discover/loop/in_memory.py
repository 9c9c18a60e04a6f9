"""A closed loop on data that a program holds."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from discover.answer import TOLERANCE
from discover.dataset import Dataset
from discover.errors import InputError
from discover.laws.multimode import Fluid
from discover.loop.loop import run_study
from discover.loop.loop_result import LoopResult
from discover.progress import Progress, checked
from discover.study import in_memory
from discover.words import unknown_name

_OPTIONS = {
    "effects", "max_effects", "strain", "noise", "most_samples", "explanations", "laws", "loading",
}  # fmt: skip


def close_loop(
    data: Dataset,
    base: Fluid | None = None,
    *,
    held_out: in_memory.HeldOut = (),
    free: Sequence[str] = (),
    by_mode: Sequence[str] = (),
    known_effects: Mapping[str, Any] | None = None,
    tolerance: float = TOLERANCE,
    progress: Progress | None = None,
    **options: Any,
) -> LoopResult:
    """Find what a fluid lacks on these data, add it, and test the result on held-out runs.

    Parameters
    ----------
    data
        The runs to fit.
    base
        The declared fluid; by default that of the data's linear sweep, and without a sweep one
        mode of Maxwell, which is fitted.
    held_out
        Runs that only test: a data set of their own, names of runs of `data`, or ``"each"`` to
        hold each run out in turn.
    free
        What of the base is also fitted: parameters of its law, which must be one with a name, and
        ``"modulus_Pa"``, ``"relaxation_time_s"``, with several modes one factor on all.
    by_mode
        What may differ from mode to mode, as a smooth function of the relaxation time: parameters
        of the law, of those in `free`, and effects by the size of their term. How smooth is for the
        data to say.
    known_effects
        Known effects, as ``[model] effects`` in a study, such as
        ``{"stress_gain": "fit", "rate_rise_time": {"tau": 0.02}}``. They are part of the declared
        model and not proposed again.
    tolerance
        Relative discrepancy that is accepted.
    progress
        Called now and then with a line of text and about what fraction is done.
    **options
        `effects`, `max_effects`, `strain`, `noise`, `most_samples`, `explanations` and `loading` as
        in ``[loop]`` of a study; `laws`: names of laws to choose the base's from.

    Returns
    -------
    The result, with ``to_html``, ``to_dataframe`` and ``equation``.

    Raises
    ------
    InputError
        If data, base or an option is not as it should be.

    Examples
    --------
    >>> import discover as dc
    >>> data = dc.synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.01)
    >>> loop = dc.close_loop(data, held_out=["laos_2_1"], max_effects=1)  # doctest: +SKIP
    >>> loop.verdict, loop.to_dataframe()  # doctest: +SKIP
    """
    unknown = sorted(set(options) - _OPTIONS)
    if unknown:
        raise InputError(unknown_name("option", unknown[0], sorted(_OPTIONS), "close_loop"))
    laws, effects, strain = (options.pop(key, None) for key in ("laws", "effects", "strain"))
    if isinstance(laws, str):
        raise InputError(f"laws must be a list of names; got {laws!r}. Write [{laws!r}].")
    if not (effects is None or isinstance(effects, str | Iterable)):
        raise InputError(f"effects must be 'named' or a list of effects; got {effects!r}.")
    if strain is not None:
        options["strain"] = strain.tolist() if isinstance(strain, np.ndarray) else strain
    if effects is not None:
        named = isinstance(effects, str)
        effects = effects if named else list(effects)
        options["effects"] = effects if named else [getattr(e, "name", e) for e in effects]
    divided = in_memory.data_in_memory(data, held_out)
    declared = in_memory.with_known(
        in_memory.declared_fluid(base, divided.dataset), known_effects, free, by_mode
    )
    asked = {"loop": options, "verdict": {"tolerance": tolerance}}
    study = in_memory.study_in_memory(data, asked, "close_loop()")
    declared = replace(declared, choice=tuple(laws or ()))
    return run_study(study, divided, declared, checked(progress), effects)
