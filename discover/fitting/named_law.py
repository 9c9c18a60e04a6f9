"""Fit of one named law, within bounds, from several starts."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float

from discover.answer import TOLERANCE
from discover.dataset import Dataset, Run
from discover.dataset.run_table import temperature_of
from discover.errors import InputError
from discover.fitting.named_law_fit import NamedLawFit
from discover.forward import AugmentedModel
from discover.inference.fit import Fit
from discover.inference.fits import Fitter
from discover.inference.posterior import posterior_of
from discover.inference.problem import Problem
from discover.inference.search import Search
from discover.laws import LAWS, Fluid, make_law
from discover.laws.registry import starting_values
from discover.loop.final_model import augmented_fluid, declared_law
from discover.loop.from_posterior import FinishedSearch
from discover.loop.loop import without_fluid
from discover.loop.runs import MOST_SAMPLES, require_samples, split_runs, unfitted_runs
from discover.plain_numbers import as_number, as_whole_number
from discover.processor import in_one_thread
from discover.study.declared_model import MODE_CONSTANTS, StudyModel, forward_model, linear_start
from discover.study.in_memory import HeldOut, data_in_memory, declared_fluid, with_known
from discover.study.schema import Verdict
from discover.summary_view import Estimate
from discover.validation import validated
from discover.words import did_you_mean, unknown_name

_TRIED, _STARTS = 64, 6
"""A fit starts at the likeliest of some vectors spread evenly over the ranges   [Sobol 1967]; the
best end counts."""

_REACHES = 1.0, 0.2
"""Parts of the ranges over which they are spread, first whole and then about the best end: a law
with a yield stress has walls, where some run begins to flow, that no slope leads through."""

_DECADES = 2.5
"""To either side of the estimate, over which starts of a modulus or a time are spread."""

_AT_END = 1e-6  # share of its range within which a constant lies at an end of it

Bounds = Mapping[str, tuple[float, float]]
Theta = Float[np.ndarray, " p"]


@in_one_thread
def fit(
    law: str, data: Dataset, *, base: Fluid | None = None, bounds: Bounds | None = None,
    start: Mapping[str, float] | None = None, fixed: Mapping[str, float] | None = None,
    effects: Mapping[str, Any] | None = None, held_out: HeldOut = (), noise: float | None = None,
    most_samples: int = MOST_SAMPLES, tolerance: float = TOLERANCE,
) -> NamedLawFit:  # fmt: skip
    """Fit one named law to runs.

    Modes come from `base`, else from the linear sweep of the data, else one mode is fitted.

    Parameters
    ----------
    law
        Name of the law; `discover.laws` lists them.
    data
        The runs to fit: transients, creep, flow curves, sweeps, in shear or extension.
    base
        Fluid whose modes and solvent are taken, without its law.
    bounds
        Range (low, high) of constants by name: parameters of the law, ``modulus_Pa``,
        ``relaxation_time_s``. Naming one of the last two fits it, for several modes as one factor.
    start
        Further starting values, by name.
    fixed
        Constants that are not fitted, by name.
    effects
        Known effects, as ``[model] effects``, such as ``{"solvent_viscosity": "fit"}``.
    held_out
        Names of runs of `data` that only test the fit, or a data set of such runs.
    noise
        Relative noise of the runs, where known.
    most_samples
        Most samples used of a run.
    tolerance
        Relative discrepancy that is good enough.

    Returns
    -------
    The fit: ``summary()``, ``conf_int()``, ``correlation``, ``predict()``, ``plot()``, ``use``.

    Raises
    ------
    InputError
        If a name, a value or a range is none, or the law cannot be integrated through the runs.

    Examples
    --------
    >>> import discover as dc
    >>> data = dc.synthetic_dataset("giesekus", {"alpha": 0.2}, noise=0.01)
    >>> dc.fit("giesekus", data).summary()  # doctest: +SKIP
    """
    if not isinstance(law, str) or law not in LAWS:
        raise InputError(unknown_name("law", law, LAWS))
    if held_out == "each":
        raise InputError("fit has no held_out='each'. Name runs, or use close_loop.")
    tolerance = validated(Verdict, {"tolerance": tolerance}, "fit()").tolerance
    bounds, start, fixed = (
        _numbers(name, given, count)
        for name, given, count in (("bounds", bounds, 2), ("start", start, 1), ("fixed", fixed, 1))
    )
    both = sorted(fixed.keys() & (bounds.keys() | start.keys()))
    if both:
        raise InputError(f"{both[0]!r} is fixed, and has a range or a start. Choose one.")
    if noise is not None and not 0.0 <= (noise := as_number("noise", noise)) <= 10.0:
        raise InputError(f"noise must be a fraction from 0 to 10; got {noise:g}. 0.01 means 1 %.")
    most_samples = as_whole_number("most_samples", most_samples, 10)
    divided = data_in_memory(data, held_out)
    whole = divided.dataset
    fitted, held, _ = split_runs(
        whole, divided.fit.names, divided.held_out.names, None, most_samples
    )
    declared = _declared(law, data, base, fitted, (bounds, start, fixed), effects)
    forward = forward_model(declared)
    require_samples(fitted, forward)
    problem = Problem(forward, (), fitted, held, noise=noise, computed=True)
    model = problem.model
    names, ranges = _names_and_ranges(model, declared, bounds)
    problem.narrow(ranges)
    fitter = Fitter(problem, problem.fitted)
    search = Search(fitter)
    first = _first(model, names, start, declared)
    (best,) = search.add([fitter.start((), first)])
    for reach in _REACHES if model.free_positions else ():
        spread = _spread(model, model.free_positions, first, best.theta, reach)
        tried = fitter.fit([fitter.start((), one) for one in spread], 0, derivatives=False)
        tried.sort(key=lambda one: -one.log_posterior)
        search.add(tried[:_STARTS])
        best = search.found[frozenset()]
    if not np.isfinite(best.log_evidence):
        raise InputError(
            f"{LAWS[law].title} cannot be integrated through these runs with any of {_TRIED} "
            "starts. Narrow the ranges with bounds, or give a start."
        )
    posterior = posterior_of(search)
    ended = FinishedSearch(posterior, without_fluid(posterior), most=1)
    active = [known.name for known in forward.effects]
    left, n = ended.discrepancy, len(best.free)
    assert best.covariance is not None
    return NamedLawFit(
        law, _constants(model, best, names, declared), best.covariance[:n, :n],
        augmented_fluid(model, best.theta, active),
        {name: tuple(map(float, best.theta[model.positions(name)])) for name in active},
        ended.verdict == "no_effect_needed", ended.noise,
        left, tuple(ended.records),
        model, best.theta, declared_law(forward, best.theta, {}),
        {name: value for name, value in fixed.items() if name in LAWS[law].parameters},
        data.name, tolerance,
        temperature_of(fitted),
        tuple(ended.records_of_unfitted(unfitted_runs(whole, [*fitted, *held]))),
    )  # fmt: skip


def _numbers(name: str, given: Any, count: int) -> dict[str, Any]:
    """Return constants by name with one number each, or two increasing ones."""
    if given is None:
        return {}
    if not isinstance(given, Mapping):
        raise InputError(f"{name} must be a mapping from names to numbers; got {given!r}.")
    found = {}
    for key, value in given.items():
        try:
            numbers = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            numbers = np.full(1, np.nan)
        wanted = "a finite number" if count == 1 else "two increasing numbers (low, high)"
        plain = not isinstance(value, str | bytes | bool) and numbers.size == count
        if not plain or not np.all(np.isfinite(numbers)) or np.any(np.diff(numbers.ravel()) <= 0):
            raise InputError(f"{name}[{key!r}] must be {wanted}; got {value!r}.")
        found[key] = float(numbers.ravel()[0]) if count == 1 else tuple(map(float, numbers))
    return found


def _declared(
    law: str, data: Dataset, base: Fluid | None, runs: Sequence[Run],
    given: tuple[dict, dict, dict], effects: Mapping[str, Any] | None,
) -> StudyModel:  # fmt: skip
    """Return the law with its modes, and what of them is free."""
    bounds, start, fixed = given
    own = LAWS[law].parameters
    possible = [*own, *MODE_CONSTANTS]
    for name in (*bounds, *start, *fixed):
        if name not in possible:
            raise InputError(
                f"{LAWS[law].title} has no constant {name!r}.{did_you_mean(name, possible)} "
                f"Constants: {', '.join(possible)}."
            )
    values = {key: min(max(value, own[key][0]), own[key][1])
              for key, value in starting_values(law).items()}  # fmt: skip
    values |= {key: value for key, value in (start | fixed).items() if key in own}
    built = make_law(law, values)
    free = [name for name in own if name not in fixed]
    one_mode = base is None and (data.linear_sweep is None or not LAWS[law].is_one_mode)
    if base is not None:
        if not isinstance(base, Fluid):
            raise InputError(f"base must be a Fluid; got a {type(base).__name__}.")
        fluid = Fluid(built, base.modulus, base.relaxation_time, base.solvent_viscosity)
    elif one_mode:
        estimate = dict(zip(MODE_CONSTANTS, linear_start(runs), strict=True))
        fluid = Fluid(built, *((estimate | start | fixed)[name] for name in MODE_CONSTANTS))
    else:
        fluid = Fluid.from_sweep(data.linear_sweep, built)
    if (effects or {}).get("solvent_viscosity") == "fit":
        # the effect is added to the fluid's own, and what is fitted is the whole
        errors = fluid.modulus_covariance
        own = None if errors is None else errors[: fluid.n_modes, : fluid.n_modes]
        fluid = replace(fluid, solvent_viscosity=0.0, modulus_covariance=own)
    asked = [name for name in MODE_CONSTANTS if one_mode or name in bounds or name in start]
    if not one_mode and fixed.keys() & set(MODE_CONSTANTS):
        raise InputError("Modes come from base or the linear sweep; they cannot be fixed here.")
    free += [name for name in asked if name not in fixed]
    return with_known(declared_fluid(fluid, data), effects, free)


def _names_and_ranges(
    model: AugmentedModel, declared: StudyModel, bounds: Bounds
) -> tuple[dict[int, str], dict[int, tuple[float, float]]]:
    """Return the names of the free constants, and the ranges that bounds narrow, by position."""
    names, ranges = {}, {}
    free = [p.name for p in model.declared.free_parameters]
    for position in model.declared.free_positions:
        name = MODE_CONSTANTS[position] if position < 2 else free[position - 2]
        names[position] = name
        if name not in bounds:
            continue
        low, high = bounds[name]
        if position < 2:
            if low <= 0.0:
                raise InputError(f"bounds[{name!r}] must be positive; got {bounds[name]}.")
            unit = _size(declared, position)
            low, high = np.log(low / unit), np.log(high / unit)
        first, last = float(model.low[position]), float(model.high[position])
        if low >= last or high <= first:
            raise InputError(
                f"bounds[{name!r}] = {bounds[name]} lies outside the range of the law, "
                f"{first:g} to {last:g}."
            )
        ranges[position] = max(low, first), min(high, last)
    for known in model.declared.effects:
        for position, parameter in zip(
            model.positions(known.name), known.effect.parameters, strict=True
        ):
            if position in model.free_positions:
                names[position] = f"{known.name}.{parameter.name}"
    return names, ranges


def _size(declared: StudyModel, position: int) -> float:
    """Return the modulus or time of one mode; 1 where one factor on several is fitted."""
    values = (declared.modulus, declared.relaxation_time)[position]
    return float(values[0]) if len(values) == 1 else 1.0


def _first(
    model: AugmentedModel,
    names: Mapping[int, str],
    start: Mapping[str, float],
    declared: StudyModel,
) -> Theta:
    """Return the first start of the fit: as declared."""
    first = np.clip(model.zero(), model.low, model.high)
    for position, name in names.items():
        if name in start:
            value = start[name]
            if position < 2:
                value = float(np.log(value / _size(declared, position)))
            if not model.low[position] <= value <= model.high[position]:
                raise InputError(f"start[{name!r}] = {start[name]:g} lies outside its range.")
            first[position] = value
    return first


def _spread(
    model: AugmentedModel, free: Sequence[int], first: Theta, centre: Theta, reach: float
) -> list[Theta]:
    """Return vectors spread over a part of the ranges: all of them, or about a centre."""
    from scipy.stats import qmc  # takes a while to load, and nothing else needs it

    spread = np.tile(first, (_TRIED, 1))
    shares = qmc.Sobol(len(free), scramble=False).random(_TRIED).T - 0.5
    for share, position in zip(shares, free, strict=True):
        low, high = float(model.low[position]), float(model.high[position])
        at, is_amplitude = float(centre[position]), position >= 2 and low >= 0.0
        if position < 2:
            half = _DECADES * np.log(10.0)
            low, high = max(low, first[position] - half), min(high, first[position] + half)
        elif is_amplitude:
            # amplitudes are small where laws are mild: even in the logarithm
            top = min(high, 1e3 * max(float(model.first_trial[position]), low))
            low, high = np.log(max(low, 1e-3 * top)), np.log(top)
            at = float(np.log(max(at, np.exp(low))))
        at = 0.5 * (low + high) if reach == 1.0 else at
        values = at + reach * (high - low) * share
        spread[:, position] = np.exp(values) if is_amplitude else values
    return list(np.clip(spread, model.low, model.high))


def _constants(
    model: AugmentedModel, fit: Fit, names: Mapping[int, str], declared: StudyModel
) -> tuple[Estimate, ...]:
    """Return the fitted constants in their units; of several modes the factor on them."""
    units = {
        f"{known.name}.{parameter.name}": parameter.unit or "1"
        for known in model.declared.effects
        for parameter in known.effect.parameters
    }
    constants = []
    for position in fit.free:
        name, low, high = names[position], float(model.low[position]), float(model.high[position])
        value, *ends = float(fit.theta[position]), *fit.interval(position)
        margin = _AT_END * (high - low if np.isfinite(high - low) else 1.0)
        at_bound = min(value - low, high - value) <= margin
        unit = units.get(name, "1")
        if position < 2:  # as the logarithm of a factor
            size = _size(declared, position)
            value, *ends = (size * float(np.exp(one)) for one in (value, *ends))
            if len(declared.modulus) > 1:
                name = ("modulus_factor", "relaxation_time_factor")[position]
            else:
                unit = ("Pa", "s")[position]
        notes = {"at_bound": bool(at_bound)}
        constants.append(Estimate((name,), value, (ends[0], ends[1]), unit, notes=notes))
    return tuple(constants)
