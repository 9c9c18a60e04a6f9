"""Named laws, as study files spell them: ``NAMED`` of the files in `textbook`, and a user's own."""

import inspect
import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jax.typing import ArrayLike
from jaxtyping import Array, Float

from discover.errors import InputError, Problems
from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, State, as_parameter
from discover.laws.each_mode import law_of_mode
from discover.laws.textbook import classical, pom_pom, rolie_poly
from discover.plain_numbers import as_number, short
from discover.validation import require_new_name
from discover.words import nearest, unknown_name
from tensor_library.algebra import Symmetric
from tensor_library.closed_forms import Registry
from tensor_library.isotropic_function import IsotropicFunction


class LawOfFunction(AbstractConstitutiveLaw):
    """Law with h(σ, γ̇) as a function of stress, rate and the parameters by name."""

    values: tuple[Float[Array, ""], ...]  # of the parameters, in the order of `names`
    function: Callable[..., Symmetric] = eqx.field(static=True)
    names: tuple[str, ...] = eqx.field(static=True)  # names of the parameters
    linear_relaxation: bool = eqx.field(static=True, default=True)

    def extra_term(self, stress: State, rate: Symmetric) -> Any:  # a user's, checked by its shape
        """Return h of the function."""
        return self.function(stress, rate, **dict(zip(self.names, self.values, strict=True)))


def law_of_function(
    name: str, function: Callable[..., Symmetric], names: tuple[str, ...]
) -> Callable[..., LawOfFunction]:
    """Return what makes the law from its parameters; InputError if the function takes others."""
    wanted = f"def {name}(stress, rate{''.join(f', {one}' for one in names)})"
    if not callable(function):
        raise InputError(f"extra_term must be a function, {wanted}; got {function!r}.")
    try:
        inspect.signature(function).bind(None, None, **dict.fromkeys(names))
    except TypeError as error:
        raise InputError(
            f"extra_term of the law {name!r} must be a function {wanted}: {error}. Give the range "
            "of each of its parameters in parameters."
        ) from None

    def build(*values: ArrayLike) -> LawOfFunction:
        return LawOfFunction(
            values=tuple(map(as_parameter, values)), function=function, names=names
        )

    return build


if TYPE_CHECKING:
    import pandas as pd


def _named_laws() -> dict[str, NamedLaw]:
    return {**classical.NAMED, **pom_pom.NAMED, **rolie_poly.NAMED}


LAWS: Registry[NamedLaw] = Registry("law", "discover.laws", _named_laws)
"""Named laws by the name in study files; a package's own by entry points of this group."""

ANY = "any"
"""What a study file writes to choose from all laws."""

RESERVED = ("learned", ANY)
"""What a study file may write in place of the name of a law."""


def laws_table() -> "pd.DataFrame":
    """Return the laws known by name, one line a parameter; all are dimensionless.

    Examples
    --------
    >>> import discover as dc
    >>> "giesekus" in dc.laws().index
    True
    """
    import pandas as pd

    lines = [
        {"law": name, "title": law.title, "parameter": parameter, "unit": unit, "low": low,
         "high": high, "source": law.source}
        for name, law in LAWS.items()
        for parameter, unit, (low, high) in (
            [(key, "1", ends) for key, ends in law.parameters.items()]
            or [("", "", (math.nan, math.nan))]
        )
    ]  # fmt: skip
    return pd.DataFrame(lines).set_index("law")


def name_of(law: AbstractConstitutiveLaw) -> tuple[str, dict[str, float]] | None:
    """Return name and parameters of a law, with or without −σ; None if no named law makes it."""
    values = [float(leaf) for leaf in jax.tree.leaves(law) if jnp.ndim(leaf) == 0]
    for name, entry in LAWS.items():
        if isinstance(entry.build, type) and entry.build is not type(law):
            continue
        if len(values) != len(entry.parameters):
            continue
        made = entry.build(*values)  # pyright: ignore[reportArgumentType]
        if _same_law(made, law):
            return name, dict(zip(entry.parameters, values, strict=True))
    return None


def _same_law(made: AbstractConstitutiveLaw, law: AbstractConstitutiveLaw) -> bool:
    if type(made) is not type(law):
        return False
    if made.linear_relaxation != law.linear_relaxation:
        made = replace(made, linear_relaxation=law.linear_relaxation)  # pyright: ignore
    return bool(eqx.tree_equal(made, law))


def register_law(
    name: str, build: Callable[..., AbstractConstitutiveLaw] | None = None,
    parameters: Mapping[str, tuple[float, float]] | None = None, title: str = "", source: str = "",
    written: Callable[[], IsotropicFunction] | None = None, *,
    extra_term: Callable[..., Symmetric] | None = None,
) -> NamedLaw:  # fmt: skip
    """Make a law of one's own known to studies, loops and exports in this process.

    An installed package does so in every process: see docs/adding-a-law.md. Raises InputError if
    the name is taken or none, a range is none, `build` makes no law, `extra_term` takes other
    parameters or returns no tensor, or both or neither are given.

    Parameters
    ----------
    name, title, source
        As studies spell it: lower-case letters, digits and underscores; for readers; literature.
    build, extra_term
        Class of the law, or a function of its parameters; or h as a function of stress and rate,
        dimensionless (3, 3), and of the parameters by name: λ dσ/dt = γ̇ + L·σ + σ·Lᵀ − σ − h.
    parameters
        Name and admissible range (low, high) of each parameter, dimensionless.
    written
        Returns h written out, for a law that is no sum of terms.

    Examples
    --------
    >>> import discover as dc
    >>> from tensor_library import trace
    >>> def softening(stress, rate, k):
    ...     return k * trace(stress) ** 2 * stress
    >>> law = dc.register_law("softening", extra_term=softening, parameters={"k": (0.0, 10.0)})
    >>> dc.make_law("softening", {"k": 1.0}).linear_relaxation
    True
    >>> del dc.laws.LAWS["softening"]
    """
    require_new_name(name, [*LAWS.present, *RESERVED], "law")
    if (build is None) == (extra_term is None):
        raise InputError(
            f"The law {name!r} needs either build, a class or function that makes the law, or "
            "extra_term, a function h(stress, rate, parameters); give one of them."
        )
    ranges = {}
    for key, ends in (parameters or {}).items():
        try:
            low, high = map(float, ends)
        except (TypeError, ValueError):
            low, high = math.nan, math.nan
        if not low < high:
            raise InputError(
                f"The range of {key!r} must be two numbers (low, high), low < high; got {ends!r}."
            )
        ranges[str(key)] = (low, high)
    if extra_term is not None:
        build = law_of_function(name, extra_term, tuple(ranges))
    assert build is not None
    _require_law(name, build, ranges)
    shown = title or name.replace("_", " ")
    entry = NamedLaw(shown, build, ranges, source=source, written=written)
    LAWS[name] = entry
    return entry


def _require_law(name: str, build, ranges: Mapping[str, tuple[float, float]]) -> None:
    values = [min(max(0.1, low), high) for low, high in ranges.values()]
    try:
        law = build(*values)
    except TypeError as error:
        raise InputError(
            f"The law {name!r} cannot be made from its parameters {', '.join(ranges) or '(none)'}: "
            f"{error}. Give the range of each, in the order in which {build!r} takes them."
        ) from None
    if not isinstance(law, AbstractConstitutiveLaw):
        raise InputError(
            f"The law {name!r} must be an AbstractConstitutiveLaw; {build!r} makes a "
            f"{type(law).__name__}. See docs/adding-a-law.md."
        )
    for shape in ((3, 3), (4,)) if not law.variables else (law.rest().shape,):
        rate = jnp.zeros(4 if law.variables else shape)
        extra = law.extra_term(jnp.zeros(shape), rate)
        if jnp.shape(extra) != shape:
            raise InputError(
                f"The extra term of the law {name!r} must have the shape {shape} of the stress; "
                f"got {jnp.shape(extra)}. Write it with tensor_library.algebra."
            )


def starting_value(law: str, parameter: str) -> float:
    """Return a value from which a fit of a law's parameter may start, also of an unknown law."""
    if law not in LAWS or parameter not in LAWS[law].parameters:
        return 0.1
    low, high = LAWS[law].parameters[parameter]
    if high > 1e3:
        return 100.0
    # a range that leaves out zero spans orders of magnitude
    return math.sqrt(low * high) if low > 0.0 else min(0.1, high)


def starting_values(law: str) -> dict[str, float]:
    """Return a starting value of each parameter of a law."""
    return {parameter: starting_value(law, parameter) for parameter in LAWS[law].parameters}


def make_law(name: str, parameters: Mapping[str, float] | None = None) -> AbstractConstitutiveLaw:
    """Return the named law; InputError if it or a parameter is unknown, missing or out of range.

    Examples
    --------
    >>> import discover as dc
    >>> [one.coefficient for one in dc.make_law("giesekus", {"alpha": 0.3}).as_terms()]
    [0.3]
    """
    if not (parameters is None or isinstance(parameters, Mapping)):
        raise InputError(
            f"The parameters of a law are given by name, such as {{'alpha': 0.3}}; got "
            f"{parameters!r}."
        )
    parameters = dict(parameters or {})
    if not isinstance(name, str) or name not in LAWS:
        raise InputError(unknown_name("law", name, LAWS))
    entry, problems, values = LAWS[name], Problems(), []
    for key in parameters:
        if key not in entry.parameters:
            problems.add(unknown_name("parameter", key, entry.parameters, f"The law {name!r}"))
    meant = {nearest(key, entry.parameters) for key in parameters if key not in entry.parameters}
    for key, (low, high) in entry.parameters.items():
        if key not in parameters:
            if key not in meant:
                problems.add(
                    f"The law {name!r} needs its parameter {key!r}. Give it, from {low:g} to "
                    f"{high:g}."
                )
            continue
        try:
            value = as_number(key, parameters[key])
        except InputError:
            value = math.nan
        if not low <= value <= high:
            problems.add(
                f"The parameter {key!r} of the law {name!r} must be a number from {low:g} to "
                f"{high:g}; got {short(parameters[key])}."
            )
        values.append(value)
    problems.require_none()
    return entry.build(*values)


def check_law(law: AbstractConstitutiveLaw) -> None:
    """Raise InputError unless a law's rate has as many components as its stress."""
    law = law_of_mode(law, 0)
    name = type(law).__name__
    stress, rate = law.rest(), jnp.zeros(())
    try:
        made = [jax.eval_shape(law.stress_rate, stress, rate)]
        if type(law).stress_rate is AbstractConstitutiveLaw.stress_rate:
            made.append(jax.eval_shape(law.extra_term, stress, stress[:4]))
    except Exception as error:  # whatever a user's own code raises
        text = str(error).partition("\n")[0] or "no reason given"
        raise InputError(
            f"The law {name} cannot be computed: {type(error).__name__}, {text} Its extra_term "
            "takes σ and γ̇ with four components each and returns h with four, in jax.numpy."
        ) from error
    for part in made:
        shape = getattr(part, "shape", None)
        if shape != stress.shape:
            raise InputError(
                f"The law {name} must return the four components 11, 22, 33, 12; got "
                f"{'no array' if shape is None else f'the shape {shape}'}."
            )
