"""What a closed loop found, with the names of its dimensions: for xarray."""

from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from discover.effects.registry import make_effect
from discover.errors import InputError
from discover.plain_numbers import xarray_module

if TYPE_CHECKING:
    import xarray

    from discover.loop.run_record import RunRecord

_UNEXPLAINED = "unexplained"
_DECLARED = "declared"
_NAMED = ("run", "role", "quantity")
_NUMBERS = ("time_s", "strain", "rate_1_s")
_VALUES = ("measured", "declared", "found", "low95", "high95")


def labelled_loop(result: Any) -> "xarray.Dataset":
    """Return explanations, constants and predictions of a loop; see `LoopResult.to_xarray`.

    Raises InputError if xarray is not installed.
    """
    told, explanations = result.explanations, result.explanations.likeliest_first
    effects = [(e.effect, e.parameters) for e in (*result.declared_effects, *result.stages)]
    found = _by_name([(_DECLARED, result.declared_parameters), *effects])
    each = [_by_name(one.parameters.items()) for one in explanations]
    names = list(dict.fromkeys([*found, *(name for one in each for name in one)]))
    known = [found.get(name) for name in names]
    intervals = [(np.nan, np.nan) if one is None else one.ci95 or (np.nan, np.nan) for one in known]
    low, high = np.array(intervals).reshape(-1, 2).T
    # an effect given as an object is known by its stage alone; what is dimensionless has the unit 1
    units = {}
    for effect in dict.fromkeys(name for one in explanations for name in one.parameters):
        with suppress(InputError):
            units |= {f"{effect}.{p.name}": p.unit or "1" for p in make_effect(effect).parameters}
    units |= {name: one.unit or "1" for name, one in found.items()}
    errors = [one.error for one in explanations]
    variables = {
        "probability": [*(one.probability for one in explanations), told.unexplained_probability],
        "error_fit": np.array([*(one.fit for one in errors), np.nan], dtype=float),
        "error_held_out": np.array([*(one.held_out for one in errors), np.nan], dtype=float),
    }
    variables = {name: ("explanation", values) for name, values in variables.items()} | {
        "inclusion": ("effect", [*told.inclusion.values()]),
        "constant_by_explanation": (
            ("explanation", "constant"),
            np.array([[one.get(n, np.nan) for n in names] for one in [*each, {}]], dtype=float),
        ),
        "constant_found": (
            "constant",
            np.array([np.nan if one is None else one.value for one in known], dtype=float),
        ),
        "constant_low95": ("constant", low),
        "constant_high95": ("constant", high),
    }
    twins = ("; ".join(map(_joined, one.twins)) for one in explanations)
    coordinates = {
        "explanation": [*(_joined(one.effects) for one in explanations), _UNEXPLAINED],
        "twins": ("explanation", [*twins, ""]),
        "effect": [*told.inclusion],
        "constant": np.array(names, dtype=str),
        "unit": ("constant", np.array([units.get(name, "") for name in names], dtype=str)),
    }
    if result.records:
        table = pd.concat([_samples(record) for record in result.records])
        predicted = [_by_explanation(record, len(explanations)) for record in result.records]
        variables |= {name: ("sample", table[name].to_numpy()) for name in _VALUES}
        variables["predicted"] = ("explanation", "sample"), np.concatenate(predicted, axis=1)
        coordinates |= {name: ("sample", table[name].to_numpy(dtype=str)) for name in _NAMED}
        coordinates |= {name: ("sample", table[name].to_numpy()) for name in _NUMBERS}
    attributes = {"verdict": result.verdict, "data": result.title}
    return xarray_module().Dataset(variables, coordinates, attributes)


def _by_name(owners: Iterable[tuple[str, Mapping[str, Any]]]) -> dict[str, Any]:
    """Return what is said of each constant, by its owner and its name."""
    return {f"{owner}.{name}": one for owner, own in owners for name, one in own.items()}


def _samples(record: "RunRecord") -> pd.DataFrame:
    """Return what was measured and predicted of a run, one line a sample."""
    low, high = (np.nan, np.nan) if record.band is None else record.band
    return pd.DataFrame({
        "run": record.name, "role": "held_out" if record.held_out else "fit",
        "quantity": record.quantity, "time_s": record.time, "strain": record.strain,
        "rate_1_s": record.rate, "measured": record.measured, "declared": record.predicted[0],
        "found": record.predicted[-1], "low95": low, "high95": high,
    })  # fmt: skip


def _by_explanation(record: "RunRecord", explanations: int) -> np.ndarray:
    """Return what each explanation predicts of a run, and nothing for none of them."""
    told = np.full((explanations + 1, len(record.time)), np.nan)
    if record.by_explanation is not None:
        told[:-1] = record.by_explanation
    return told


def _joined(effects: Sequence[str]) -> str:
    return " + ".join(effects) or _DECLARED
