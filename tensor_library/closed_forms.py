"""Closed-form scalar multipliers of terms, and the registry of named things."""

import math
import re
import threading
import warnings
from collections.abc import Callable, Iterator, Mapping, MutableMapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import TYPE_CHECKING, Any, TypeVar

import jax.numpy as jnp
from jaxtyping import Array, Float

T = TypeVar("T")


class ExtensionWarning(UserWarning):
    """An installed package announces something that cannot be used; it is left out."""


class Registry(MutableMapping[str, T]):
    """Things of one kind by name, in the order in which they became known.

    `kind`: the singular, for messages. `group`: entry points that bring more, such as
    ``"discover.laws"``. `built_in`: makes those that are always there.
    """

    def __init__(self, kind: str, group: str, built_in: Callable[[], Mapping[str, T]]):
        self.kind, self.group = kind, group
        self._built_in = built_in
        self._known: dict[str, T] = {}
        self._own: frozenset[str] | None = None
        self._looked = self._complete = False
        self._lock = threading.RLock()

    @property
    def present(self) -> dict[str, T]:
        """What is built in and what was registered, without looking at installed packages."""
        with self._lock:
            if self._own is None:
                self._own = frozenset()  # should the making of them look here
                self._known.update(self._built_in())
                self._own = frozenset(self._known)
            return self._known

    @property
    def built_in(self) -> dict[str, T]:
        """Return what is always there."""
        present = self.present
        return {name: present[name] for name in present if name in (self._own or ())}

    def __getitem__(self, name: str) -> T:
        return self._all()[name]

    def __setitem__(self, name: str, value: T) -> None:
        self.present[name] = value

    def __delitem__(self, name: str) -> None:
        del self._all()[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._all())

    def __len__(self) -> int:
        return len(self._all())

    def _all(self) -> dict[str, T]:
        if self._complete:
            return self._known
        with self._lock:
            known = self.present
            if not self._looked:
                self._looked = True  # modules that are imported here may look here too
                for entry in entry_points(group=self.group):
                    self._bring(entry)
                self._complete = True
            return known

    def _bring(self, entry: EntryPoint) -> None:
        """Import the module that an entry point names; it registers what it brings."""
        if entry.name in (self._own or ()):
            self._leave_out(entry, "the name is taken by one that is built in")
            return
        try:
            entry.load()
        except (Exception, SystemExit) as error:
            kind = "" if isinstance(error, ValueError) else f"{type(error).__name__}: "
            self._leave_out(entry, kind + (str(error).splitlines() or [""])[0])
            return
        if entry.name not in self._known:
            self._leave_out(entry, f"{entry.value} registers no {self.kind} of that name")

    def _leave_out(self, entry: EntryPoint, why: str) -> None:
        whose = "an installed package"
        if entry.dist is not None:
            whose = f"{entry.dist.name} {entry.dist.version}"
        warnings.warn(
            f"The {self.kind} {entry.name!r} of {whose} is left out: {why.rstrip('.')}. Mend or "
            "remove that package; all else works.",
            ExtensionWarning,
            stacklevel=2,
        )


if TYPE_CHECKING:
    import sympy


@dataclass(frozen=True)
class ClosedForm:
    """Scalar function of tr σ with one inner parameter, zero at zero stress.

    Attributes
    ----------
    name, spelling, source
        Key in a library description, canonical text, and literature.
    inner_name, inner_default, inner_bounds
        Inner parameter, where a fit starts, and its admissible range.
    function, expression
        ``f(trace_of_stress, inner)``, dimensionless, both of shape (), in jax.numpy; and the same
        of SymPy symbols, None for a built-in form.
    complexity
        Number of operations, for model selection.

    Examples
    --------
    >>> CLOSED_FORMS["exp"].spelling
    '(exp(epsilon*tr(sigma))-1)'
    """

    name: str
    spelling: str
    inner_name: str
    inner_default: float
    inner_bounds: tuple[float, float]
    function: Callable[[Float[Array, ""], Float[Array, ""]], Float[Array, ""]]
    complexity: int
    source: str
    expression: "Callable[[Any, Any], sympy.Expr] | None" = None


def _exponential(trace_of_stress: Float[Array, ""], inner: Float[Array, ""]) -> Float[Array, ""]:
    # Beyond exp(60) a trial law is absurd in any flow; the cap keeps its integration finite, so
    # that the trial is rejected for its misfit and not for an overflow.
    return jnp.expm1(jnp.minimum(inner * trace_of_stress, 60.0))


def _saturating(trace_of_stress: Float[Array, ""], inner: Float[Array, ""]) -> Float[Array, ""]:
    return trace_of_stress / (1.0 + inner * jnp.abs(trace_of_stress))


_BUILT_IN = (
    ClosedForm("exp", "(exp(epsilon*tr(sigma))-1)", "epsilon", 0.25, (1e-4, 2.0), _exponential, 3,
               "Phan-Thien 1978, J. Rheol. 22, 259"),
    ClosedForm("saturating", "(tr(sigma)/(1+kappa*abs(tr(sigma))))", "kappa", 0.1, (1e-4, 10.0),
               _saturating, 4, "first Padé form of a coefficient that levels off"),
)  # fmt: skip

CLOSED_FORMS: Registry[ClosedForm] = Registry(
    "closed form", "discover.terms", lambda: {form.name: form for form in _BUILT_IN}
)
"""Closed forms by name; a package's own by entry points of this group."""

_TRACES = (-0.5, 0.3, 1.0, 2.0)
_SPELLING = re.compile(r"\([a-z0-9_+\-*/^().]*tr\(sigma\)[a-z0-9_+\-*/^().]*\)")


def register_closed_form(form: ClosedForm) -> ClosedForm:
    """Make a closed form of one's own known in this process; see docs/adding-a-term.md.

    Raises ValueError if a name or spelling is taken or none, the default is out of bounds, the form
    does not vanish at zero stress, or `function` and `expression` differ.

    Examples
    --------
    >>> register_closed_form(form)  # doctest: +SKIP
    """
    known = CLOSED_FORMS.present
    for what, text in (("name", form.name), ("inner_name", form.inner_name)):
        if not text.isidentifier() or text != text.lower():
            raise ValueError(
                f"The {what} of a closed form must be lower-case letters, digits and underscores; "
                f"got {text!r}."
            )
        if text in [getattr(other, what) for other in known.values()]:
            raise ValueError(f"The {what} {text!r} of a closed form is taken. Choose another.")
    if not _SPELLING.fullmatch(form.spelling) or form.spelling in [
        other.spelling for other in known.values()
    ]:
        raise ValueError(
            f"The spelling {form.spelling!r} must be new, in brackets, of lower-case letters, "
            "numbers and operators without spaces, and hold tr(sigma)."
        )
    low, high = form.inner_bounds
    if not low <= form.inner_default <= high:
        raise ValueError(
            f"The default {form.inner_default:g} of {form.inner_name} must be from {low:g} to "
            f"{high:g}."
        )
    if form.expression is None:
        raise ValueError(f"The closed form {form.name!r} needs its expression in SymPy.")
    inner = form.inner_default
    if abs(float(form.function(jnp.asarray(0.0), jnp.asarray(inner)))) > 1e-12:
        raise ValueError(f"The closed form {form.name!r} must vanish at zero stress.")
    for trace in _TRACES:
        one = float(form.function(jnp.asarray(trace), jnp.asarray(inner)))
        other = float(form.expression(trace, inner))
        if not math.isclose(one, other, rel_tol=1e-6):
            raise ValueError(
                f"function and expression of the closed form {form.name!r} must agree; at a trace "
                f"of {trace:g} they are {one:.6g} and {other:.6g}."
            )
    CLOSED_FORMS[form.name] = form
    return form
