"""What a closed loop found, with the names of its dimensions: for xarray."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from discover.effects.registry import make_effect
from discover.errors import InputError
from discover.plain_numbers import xarray_module

if TYPE_CHECKING:
    import xarray

    from discover.loop.parts import Explanation
    from discover.loop.run_record import RunRecord

_UNEXPLAINED = "unexplained"
_DECLARED = "declared"


def labelled_loop(result: Any) -> "xarray.Dataset":
    """Return explanations, constants and predictions of a loop; see `LoopResult.to_xarray`.

    Raises InputError if xarray is not installed.
    """
    told = result.explanations
    explanations = told.likeliest_first
    found = dict(_found(result))
    probabilities = [one.probability for one in explanations]
    errors_fit = [one.error.fit for one in explanations]
    errors_held_out = [one.error.held_out for one in explanations]
    twins = ["; ".join(map(_joined, one.twins)) for one in explanations]
    each = [_constants(one) for one in explanations]
    names = list(dict.fromkeys([*found, *(name for one in each for name in one)]))
    unknown = (np.nan, np.nan)
    values = [found.get(name, (np.nan, unknown)) for name in names]
    intervals = np.array([interval or unknown for _, interval in values]).reshape(-1, 2)
    variables = {
        "probability": ("explanation", [*probabilities, told.unexplained_probability]),
        "error_fit": ("explanation", [*map(_number, errors_fit), np.nan]),
        "error_held_out": ("explanation", [*map(_number, errors_held_out), np.nan]),
        "inclusion": ("effect", [*told.inclusion.values()]),
        "constant_by_explanation": (
            ("explanation", "constant"),
            np.array([[one.get(n, np.nan) for n in names] for one in [*each, {}]]),
        ),
        "constant_found": ("constant", np.array([value for value, _ in values])),
        "constant_low95": ("constant", intervals[:, 0]),
        "constant_high95": ("constant", intervals[:, 1]),
    }
    units = _units(result, explanations)
    coordinates = {
        "explanation": [*(_joined(one.effects) for one in explanations), _UNEXPLAINED],
        "twins": ("explanation", [*twins, ""]),
        "effect": [*told.inclusion],
        "constant": np.array(names, dtype=str),
        "unit": ("constant", np.array([units.get(name, "") for name in names], dtype=str)),
    }
    variables |= _predictions(result.records, len(explanations))
    coordinates |= _samples(result.records)
    attributes = {"verdict": result.verdict, "data": result.title}
    return xarray_module().Dataset(variables, coordinates, attributes)


def _found(result: Any) -> Iterator[tuple[str, tuple[float, Any]]]:
    """Yield the name of each constant of the model that was found, its value and its interval."""
    for name, one in result.declared_parameters.items():
        yield f"{_DECLARED}.{name}", (one.value, one.ci95)
    for effect in (*result.declared_effects, *result.stages):
        for name, one in effect.parameters.items():
            yield f"{effect.effect}.{name}", (one.value, one.ci95)


def _constants(explanation: "Explanation") -> dict[str, float]:
    return {
        f"{effect}.{name}": float(value)
        for effect, values in explanation.parameters.items()
        for name, value in values.items()
    }


def _units(result: Any, explanations: Sequence["Explanation"]) -> dict[str, str]:
    """Return the unit of each constant; an effect given as an object is known by its stage alone.

    What is dimensionless has the unit 1.
    """
    units = {}
    for effect in dict.fromkeys(name for one in explanations for name in one.parameters):
        try:
            of_effect = make_effect(effect).parameters
        except InputError:
            continue
        units |= {f"{effect}.{p.name}": p.unit or "1" for p in of_effect}
    for name, one in result.declared_parameters.items():
        units[f"{_DECLARED}.{name}"] = one.unit or "1"
    for effect in (*result.declared_effects, *result.stages):
        units |= {f"{effect.effect}.{n}": one.unit or "1" for n, one in effect.parameters.items()}
    return units


def _predictions(
    records: Sequence["RunRecord"], n_explanations: int
) -> Mapping[str, tuple[Any, np.ndarray]]:
    """Return what was measured and predicted, all samples of all runs one after the other."""
    if not records:
        return {}

    def each(of_record) -> np.ndarray:
        return np.concatenate([of_record(record) for record in records], axis=-1)

    def nothing(record: "RunRecord", *shape: int) -> np.ndarray:
        return np.full((*shape, len(record.time)), np.nan)

    def by_explanation(record: "RunRecord") -> np.ndarray:
        told = record.by_explanation
        told = nothing(record, n_explanations) if told is None else told
        return np.vstack([told, nothing(record)])

    low, high = each(lambda r: nothing(r, 2) if r.band is None else r.band)
    return {
        "measured": ("sample", each(lambda r: r.measured)),
        "declared": ("sample", each(lambda r: r.predicted[0])),
        "found": ("sample", each(lambda r: r.predicted[-1])),
        "predicted": (("explanation", "sample"), each(by_explanation)),
        "low95": ("sample", low),
        "high95": ("sample", high),
    }


def _samples(records: Sequence["RunRecord"]) -> dict[str, tuple[str, np.ndarray]]:
    """Return the coordinates of the samples."""
    sizes = [len(record.time) for record in records]
    named = {
        "run": [record.name for record in records],
        "role": ["held_out" if record.held_out else "fit" for record in records],
        "quantity": [record.quantity for record in records],
    }
    columns = {"time_s": "time", "strain": "strain", "rate_1_s": "rate"}
    return {
        **{name: ("sample", np.repeat(values, sizes)) for name, values in named.items()},
        **{
            name: ("sample", np.concatenate([getattr(record, of) for record in records]))
            for name, of in columns.items()
            if records
        },
    }


def _joined(effects: Sequence[str]) -> str:
    return " + ".join(effects) or _DECLARED


def _number(value: float | None) -> float:
    return np.nan if value is None else float(value)
