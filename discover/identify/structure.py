"""What an experiment can determine of a library, from its protocols alone, before any fit.

Null space of the exact sensitivities of σ12 to the coefficients at a nominal law, and its image in
N1 and N2. First order; where the law is a polynomial, exact arithmetic decides on finite sizes.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, replace
from fractions import Fraction
from functools import partial
from typing import Any, Literal

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Array, Float, Int

from discover.dataset.records.thinning import thin_run
from discover.dataset.run import Run
from discover.forward.flow_batch import FlowBatch, lay_out
from discover.forward.fluids import (
    dynamics_of_fluid,
    observed_of_stress,
    samples_of_dynamics,
    with_cheap_tangents,
)
from discover.forward.of_fluids import pieces_in_time
from discover.forward.stepping import follow
from discover.identify.exact_series import same_shear_stress
from discover.identify.relations import Direction, spell_briefly, unseen_directions
from discover.identify.side_by_side import joint_library
from discover.identify.twins import hidden_stresses
from discover.laws import Fluid, LibraryExpansion, UpperConvectedMaxwell
from discover.laws.each_mode import differs_by_mode, law_of_mode, over_modes
from discover.laws.expansion import expansion_of, law_of_terms
from discover.learners.settings import as_runs
from discover.programs import compiled
from discover.summary_view import NotebookView, table_of
from discover.words import counted
from tensor_library import LawTerm, LawTerms, TermLibrary, parse_term
from tensor_library.algebra import contracted, rate_of_deformation


@partial(compiled, runs_long=True)
def with_sensitivities(
    law: LibraryExpansion, known: Fluid, flows: FlowBatch
) -> tuple[Float[Array, "runs n 3"], Float[Array, "runs n 3 terms"]]:
    """Return what is recorded, N1 and N2 in Pa, and their derivatives by the coefficients."""
    fluid = replace(known, law=law)

    def stress_rate(made, coefficients, *flow):
        return replace(made, coefficients=coefficients).stress_rate(*flow)

    def at_given_rate(protocol, grid):
        """Follow σ with its derivatives beside it, which is traced sooner than through a step."""

        def of_mode(made, state, gradient):
            def change(stress, coefficients):
                return stress_rate(made, coefficients, stress, gradient)

            value, pull = jax.vjp(change, state[:, 0], law.coefficients)
            by_state, by_coefficient = jax.vmap(pull)(jnp.eye(len(state)))
            beside = by_state @ state[:, 1:] + by_coefficient
            return jnp.concatenate([value[:, None], beside], axis=1)

        def observe(state, gradient):
            stress = contracted(state[:4], known.modulus)
            return stress.at[:, 0].add(known.solvent_viscosity * rate_of_deformation(gradient))

        alone = dynamics_of_fluid(fluid, protocol)
        of_modes = jax.jit(over_modes(of_mode, law, -1))  # traced once for all stages of a step
        beside = alone._replace(slope=of_modes, columns=len(law.coefficients))
        found = observed_of_stress(follow(beside, alone, protocol, grid, observe), protocol)
        return found[..., 0], found[..., 1:]

    def one(protocol, grid):
        if protocol.control == "rate":
            return at_given_rate(protocol, grid)

        def dynamics(coefficients):
            def of_mode(made, *flow):
                return with_cheap_tangents(stress_rate, made)(coefficients, *flow)

            return dynamics_of_fluid(fluid, protocol)._replace(slope=over_modes(of_mode, law, -1))

        def observed(coefficients):
            found = samples_of_dynamics(dynamics, coefficients, known, protocol, grid).observed
            return found, found

        columns, value = jax.jacfwd(observed, has_aux=True)(law.coefficients)
        return value, columns

    return flows.over(one)


Verdict = Literal["measured", "determined", "assumed", "undetermined"]

_CHANGED = 1e-6
"""Relative change of a quantity per unit of a direction that counts as a change."""

_ROWS = 400
"""Samples of each quantity that enter a null space; more say nothing new of it."""

_STRAIN_STEP = 0.2
"""Largest strain of a step."""

_FINITE_STEP = Fraction(1, 10)
_FINITE_ORDER = 8
_NORMAL_STRESSES = ("N1", "N2")


@dataclass(frozen=True)
class QuantityVerdict:
    """Whether the observed stresses determine a normal stress difference.

    `verdict`: ``"measured"``; ``"undetermined"``: the library holds a change of the law that the
    experiment cannot see and that changes the quantity; ``"assumed"``: it holds none, but one of
    the two normal stresses leaves no trace in σ12; ``"determined"`` within the library otherwise.
    """

    quantity: str  # ``"N1"`` or ``"N2"``
    verdict: Verdict
    text: str  # the verdict for a reader

    @property
    def open(self) -> bool:
        """Whether the observed stresses leave the quantity open."""
        return self.verdict in ("undetermined", "assumed")

    def line(self) -> dict[str, Any]:
        """Return the verdict as one line of a table."""
        return {"quantity": self.quantity, "verdict": self.verdict, "why": self.text}


@dataclass(frozen=True)
class Structure(NotebookView):
    """What an experiment can determine of a library around one law."""

    law: LawTerms  # its terms beyond the known part
    n_terms: int  # size of the library
    unseen: tuple[Direction, ...]  # changes of the law that no datum sees
    quantities: tuple[QuantityVerdict, ...]  # verdicts on N1 and N2 from what is observed

    @property
    def text(self) -> str:
        """How much the flows leave unseen, and the verdicts, for a reader."""
        count = counted(len(self.unseen), "combination")
        return (
            f"These flows leave {count} of the {self.n_terms} coefficients of the library unseen, "
            f"however small the noise. {' '.join(one.text for one in self.quantities)}"
        )

    def table(self) -> pd.DataFrame:
        """Return the verdicts on N1 and N2, one line each."""
        return table_of(self.quantities)

    def _shown(self) -> Iterable[Any]:
        yield self.text.partition(". ")[0] + "."
        yield self.table()

    def to_json(self) -> dict[str, Any]:
        """Return the structure as ``comparison.json`` holds it."""
        return {
            "terms": dict(self.law.coefficients),
            "n_terms": self.n_terms,
            "unseen_directions": [asdict(one) for one in self.unseen],
            "quantities": [asdict(one) for one in self.quantities],
            "text": self.text,
        }


def analyse_structure(
    runs: Sequence[Run],
    library: TermLibrary,
    law: LawTerms | Sequence[LawTerm] = (),
    known: Fluid | None = None,
    use_normal_stresses: bool = False,
) -> Structure | None:
    """Return what shear flows can determine of a library around a law; None where it diverges.

    `runs`: their protocols and times; with `use_normal_stresses`, N1 and N2 that they hold count as
    measured. `law`: beyond the known part, such as ``TensorSINDy.terms_``. `known`: known part; by
    default UCM with G = 1 Pa and λ = 1 s.
    """
    known = Fluid() if known is None else known
    law = law if isinstance(law, LawTerms) else LawTerms.of(law)
    library, base = joint_library(library, [law]), known.law
    runs = as_runs(runs, np.asarray(known.relaxation_time), base.linear_relaxation)
    runs = [thin_run(run, _ROWS) for run in runs]
    flows = lay_out(
        [run.protocol for run in runs],
        [run.time for run in runs],
        strain_step=_STRAIN_STEP,
        relaxation_time=known.settling_time,
        pieces=pieces_in_time(known, runs, _STRAIN_STEP),
    )
    normal = {"N1": "first_normal_stress_difference", "N2": "second_normal_stress_difference"}
    observed = ["sigma12"] + [
        quantity
        for quantity, column in normal.items()
        if use_normal_stresses and any(getattr(run, column) is not None for run in runs)
    ]
    whole = expansion_of(law, library, base.linear_relaxation, base)
    blocks = _sensitivities(whole, known, flows, np.array([[len(run)] for run in runs]))
    if blocks is None:
        return None
    unseen = _unseen(library, blocks, observed)
    exact = tuple(_finite(direction, law, base) for direction in unseen)
    numbers = range(known.n_modes) if differs_by_mode(base) else [0]
    # without terms that are zero: what a program differentiates it takes long to compile
    alone = law_of_terms(law, base.linear_relaxation, base)
    of_modes = [hidden_stresses(law_of_mode(alone, number)) for number in numbers]
    hidden = max(of_modes, key=lambda one: len(one.unfelt))
    verdicts = [_verdict(q, observed, exact, hidden, len(library)) for q in _NORMAL_STRESSES]
    if verdicts[1].verdict == "undetermined" and _changing(
        _unseen(library, blocks, list(dict.fromkeys([*observed, "N1"]))), "N2"
    ):
        text = verdicts[1].text + " Measuring N1 as well would not change this."
        verdicts[1] = replace(verdicts[1], text=text)
    return Structure(law, len(library), exact, tuple(verdicts))


def _sensitivities(
    law: LibraryExpansion, known: Fluid, flows: FlowBatch, lengths: Int[np.ndarray, "runs 1"]
) -> dict[str, Float[np.ndarray, "rows n"]] | None:
    """Return relative derivatives of each quantity by the coefficients; None if the law diverges.

    Over the root-mean-square of each run, N2 over that of N1.
    """
    value, columns = with_sensitivities(law, known, flows)
    samples = np.arange(np.max(lengths)) < lengths
    shape = samples[..., None]
    stresses = np.where(shape, np.asarray(value)[:, : samples.shape[1]], 0.0)
    sensitivity = np.where(shape[..., None], np.asarray(columns)[:, : samples.shape[1]], 0.0)
    if not (np.all(np.isfinite(stresses)) and np.all(np.isfinite(sensitivity))):
        return None
    scale = np.sqrt(np.sum(stresses**2, axis=1) / samples.sum(axis=1)[:, None])
    scale[:, 2] = scale[:, 1]
    blocks = {}
    for kind, quantity in enumerate(("sigma12", *_NORMAL_STRESSES)):
        sizes = np.where(scale[:, kind] > 0, scale[:, kind], 1.0)[:, None, None]
        block = sensitivity[:, :, kind] / sizes
        rows = block[samples][:: max(1, samples.sum() // _ROWS)]
        blocks[quantity] = rows / np.sqrt(len(rows))
    return blocks


def _unseen(library, blocks, observed) -> list[Direction]:
    stacked = np.concatenate([blocks[q] for q in observed])
    # rows beyond the number of unknowns say nothing more to a null space
    reduced = np.asarray(np.linalg.qr(stacked, mode="r"))
    return unseen_directions(library.names, reduced, blocks)


def _changing(directions: Sequence[Direction], quantity: str) -> list[Direction]:
    changing = [d for d in directions if d.changes[quantity] > _CHANGED]
    return sorted(changing, key=lambda d: (not d.at_any_size, len(d.coefficients)))


def _finite(direction: Direction, law: LawTerms, base) -> Direction:
    """Say whether a finite step along a direction is invisible too, where that can be decided."""
    names = [*law.coefficients, *direction.coefficients]
    polynomial = all(parse_term(name).closed_form is None for name in names)
    if not polynomial or not isinstance(base, UpperConvectedMaxwell):
        return direction
    here = {n: Fraction(v).limit_denominator(10**5) for n, v in law.coefficients.items()}
    there = dict(here)
    for name, value in direction.coefficients.items():
        step = _FINITE_STEP * Fraction(value).limit_denominator(1000)
        there[name] = there.get(name, Fraction(0)) + step
    same = same_shear_stress(here, there, _FINITE_ORDER, base.linear_relaxation)
    return replace(direction, at_any_size=same)


def _verdict(quantity, observed, exact, hidden, n_terms) -> QuantityVerdict:
    if quantity in observed:
        return QuantityVerdict(quantity, "measured", f"{quantity} is measured.")
    what = " and ".join("σ12" if q == "sigma12" else q for q in observed)
    examples = _changing(exact, quantity)
    unfelt = ""
    if observed == ["sigma12"] and hidden.leaves_no_trace(quantity):
        unfelt = (
            f" {hidden.text} So {quantity} follows from the convected derivative and the form of "
            "the law that were assumed, not from the data."
        )
    if examples:
        size = "" if examples[0].at_any_size else ", to first order"
        text = (
            f"{quantity} is not determined by {what}: {len(examples[0].coefficients)} terms more, "
            f"h = {spell_briefly(examples[0].coefficients)} in any amount, change {quantity} and "
            f"leave {what} as it is{size}.{unfelt}"
        )
        return QuantityVerdict(quantity, "undetermined", text)
    if unfelt:
        text = (
            f"No combination of the {n_terms} terms changes {quantity} and leaves {what} as it "
            f"is. But{unfelt[:2].lower()}{unfelt[2:]}"
        )
        return QuantityVerdict(quantity, "assumed", text)
    text = (
        f"If the law is in this library of {n_terms} terms, with the convected derivative that was "
        f"assumed, {what} determines {quantity}."
    )
    return QuantityVerdict(quantity, "determined", text)
