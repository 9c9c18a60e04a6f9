"""Laws to be spelled in every format, with the value of h at random states as the term itself says.

One equation for each monomial of the invariants, with all eight tensors in it, and with
coefficients of both signs; `flipped` has all of them reversed, so that every term is spelled with
either sign. The values come from `TermLibrary.evaluate`, which spells nothing.
"""

from dataclasses import dataclass, replace

import jax
import jax.numpy as jnp
import numpy as np

from discover.effects import ConstitutiveEffect, library_term, named_effects
from discover.equations import Equation, effect_terms, law_terms
from discover.laws import make_law
from tensor_library import INVARIANT_NAMES, TENSOR_NAMES, LawTerm, build_library, parse_term

INNER = {"epsilon": 0.31, "kappa": 0.27}
LIBRARY = build_library(
    degree=2,
    closed_forms=("exp", "saturating"),
    invariants=INVARIANT_NAMES,
    closed_form_tensors=TENSOR_NAMES,
)
LAWS = {
    "ucm": {}, "johnson_segalman": {"xi": 0.4}, "giesekus": {"alpha": 0.3},
    "ptt_linear": {"epsilon": 0.2}, "ptt_exponential": {"epsilon": 0.2}, "fene_p": {"L2": 12.0},
}  # fmt: skip
EFFECTS = [
    effect
    for effect in [
        *named_effects().values(),
        library_term(parse_term("tr(sigma)*(sigma.gammadot+gammadot.sigma)")),
    ]
    if isinstance(effect, ConstitutiveEffect) and effect.adds_term
]


@dataclass(frozen=True)
class Spelled:
    """An equation and what h is at every one of `STATES`, shape (states, 3, 3)."""

    equation: Equation
    extra: np.ndarray

    @property
    def flipped(self):
        """The same with every coefficient reversed."""
        terms = tuple(replace(t, coefficient=-t.coefficient) for t in self.equation.terms)
        return Spelled(replace(self.equation, terms=terms), -self.extra)


def _symmetric(generator):
    a = generator.normal(size=(3, 3))
    return 0.5 * (a + a.T)


def _states():
    generator = np.random.default_rng(15)
    states = []
    for sign in (1.0, -1.0):
        stress, rate = _symmetric(generator), _symmetric(generator)
        rate -= np.trace(rate) / 3.0 * np.eye(3)
        # one state under tension, one under pressure: a closed form may take the size of the trace
        stress += (sign * 0.8 - np.trace(stress)) / 3.0 * np.eye(3)
        states.append((stress, rate))
    return states


STATES = _states()
_INNER_VALUES = np.array([INNER[name] for name in LIBRARY.inner_names])


def at_states(function):
    """Return what a function of stress and rate of deformation says of all states.

    As one program: step by step each operation would be compiled by itself, in every worker that
    collects these tests.
    """
    stresses, rates = map(np.array, zip(*STATES, strict=True))
    return jax.tree.map(np.asarray, jax.jit(jax.vmap(function))(stresses, rates))


_VALUES = at_states(lambda stress, rate: LIBRARY.evaluate(stress, rate, jnp.array(_INNER_VALUES)))


def sum_of(indices, coefficients):
    terms = tuple(
        LawTerm(LIBRARY.names[i], c, {n: INNER[n] for n in LIBRARY.terms[i].inner_names})
        for i, c in zip(indices, coefficients, strict=True)
    )
    return Spelled(Equation(terms), np.einsum("n,snij->sij", coefficients, _VALUES[:, indices]))


def _library_laws():
    generator = np.random.default_rng(3)
    groups: dict[tuple, list[int]] = {}
    for index, term in enumerate(LIBRARY.terms):
        groups.setdefault((term.powers, term.closed_form), []).append(index)
    laws = {}
    for indices in groups.values():
        # three digits, which every format writes in full; some small enough for a power of ten,
        # none so small that `agree` would pass over a term that is wrong
        sizes = 10.0 ** generator.uniform(-5.0, 1.0, len(indices))
        numbers = [float(f"{size:.3g}") * (-1) ** k for k, size in enumerate(sizes)]
        laws[LIBRARY.names[indices[0]]] = sum_of(indices, numbers)
    return laws


def _named_laws():
    laws = {name: make_law(name, parameters) for name, parameters in LAWS.items()}
    effects = [(effect, np.array([0.17, 0.4][: len(effect.parameters)])) for effect in EFFECTS]
    effects = [(e, values) for e, values in effects if e.as_terms(values.tolist()) is not None]

    def extra(stress, rate):
        of_laws = {name: law.extra_term(stress, rate) for name, law in laws.items()}
        return of_laws | {e.name: e.extra_term(jnp.array(v), stress, rate) for e, v in effects}

    extras = at_states(extra)
    equations = {name: Equation(law_terms(law)) for name, law in laws.items()}
    equations |= {e.name: Equation(effect_terms(e, values)) for e, values in effects}
    return {name: Spelled(equation, extras[name]) for name, equation in equations.items()}


LIBRARY_LAWS = _library_laws()
NAMED_LAWS = _named_laws()


BOTH_SIGNS = {
    f"{name} {sign}": spelled if sign == "+" else spelled.flipped
    for name, spelled in (LIBRARY_LAWS | NAMED_LAWS).items()
    for sign in "+-"
}


def agree(found, wanted, tolerance=1e-10):
    return np.max(np.abs(np.asarray(found, float) - wanted), initial=0.0) <= tolerance * max(
        np.max(np.abs(wanted)), 1e-300
    )
