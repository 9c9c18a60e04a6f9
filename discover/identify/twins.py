"""Twins: laws with the same σ12, or σ12 and N1, in every simple-shear history.

By relations among terms that vanish in shear or live on σ33 (`term_relations`), and by changes of
the unmeasured normal stresses, decided in exact arithmetic on the Taylor series
(`solve_for_coefficient`). Every twin is also simulated in random histories.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any, Literal

import jax
import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.effects.registry import make_effect
from discover.forward import make_batch
from discover.forward.of_fluids import components
from discover.identify import side_by_side
from discover.identify.exact_series import DEFAULT_ORDER, solve_for_coefficient
from discover.identify.relations import feels_33, term_relations
from discover.laws import AbstractConstitutiveLaw, Fluid, UpperConvectedMaxwell
from discover.programs import compiled, on_device
from discover.summary_view import NotebookView
from discover.words import percent_of
from tensor_library import LawTerm, LawTerms, TermLibrary, parse_term
from tensor_library.law_terms import spell

Proof = Literal["relation", "series", "histories"]
_Candidate = tuple[LawTerms, Proof]

_LARGEST_DENOMINATOR = 10**5
_SHORT_DENOMINATOR = 100
INVISIBLE_SIZE = 0.05
"""Amount of a combination on σ33 that is added to show what it does; any amount would do."""


@dataclass(frozen=True)
class Twin(NotebookView):
    """Law that no shear stress distinguishes from another.

    `proof`: ``"relation"`` is exact, ``"series"`` too, at coefficients rounded to short fractions,
    ``"histories"`` to integration error.
    """

    law: LawTerms  # the twin, beyond the known part
    proof: Proof
    keeps_N1: bool  # whether N1 is the same too
    difference: side_by_side.Difference  # largest difference of σ12, N1 and N2 in random histories
    # experiments that would tell the two apart
    separated_by: tuple[side_by_side.Separation, ...] = ()

    @property
    def text(self) -> str:
        """One sentence for a reader."""
        same = "the same σ12 and the same N1" if self.keeps_N1 else "the same σ12"
        how = {
            "relation": "an identity between tensors in shear",
            "series": f"Taylor series equal to order {DEFAULT_ORDER} in exact arithmetic",
            "histories": "to integration error in random histories",
        }[self.proof]
        text = (
            f"h = {spell(self.law.coefficients)} gives {same} in every simple-shear history ({how})"
        )
        apart = []
        if not self.keeps_N1:
            apart.append(f"N1 by up to {percent_of(self.difference.N1)}")
        if self.difference.N2 > side_by_side.SAME:
            apart.append(f"N2 by up to {percent_of(self.difference.N2)} of N1")
        text += f", but differs in {' and '.join(apart)}." if apart else ", and the same N2."
        if self.separated_by:
            text += f" To distinguish, measure {' or '.join(s.text for s in self.separated_by)}."
        return text

    def line(self) -> dict[str, Any]:
        """Return the twin as one line of a table: by how much it differs, what would tell."""
        return {
            "law": spell(self.law.coefficients),
            "proof": self.proof,
            "sigma12_apart": self.difference.sigma12,
            "N1_apart": self.difference.N1,
            "N2_apart": self.difference.N2,
            "told_by": " or ".join(experiment.text for experiment in self.separated_by),
        }

    def _shown(self) -> Iterable[Any]:
        yield self.text


def find_twins(
    library: TermLibrary,
    law: LawTerms | Sequence[LawTerm],
    base: AbstractConstitutiveLaw | None = None,
) -> list[Twin]:
    """Return the twins of a law, simplest first, checked by simulation.

    Every other library term in place of each term (of a polynomial law on UCM), every exchange
    along a relation that vanishes in shear, every combination on σ33 that the law does not feel.
    `law`: beyond the known part, such as ``TensorSINDy.terms_``. `base`: by default UCM.
    """
    base = UpperConvectedMaxwell() if base is None else base
    law = law if isinstance(law, LawTerms) else LawTerms.of(law)
    library = side_by_side.joint_library(library, [law])
    found: list[_Candidate] = []
    if isinstance(base, UpperConvectedMaxwell):
        found += _by_series(library, law, base.linear_relaxation)
        found += _by_relations(library, law)
    distinct: dict[tuple, _Candidate] = {}
    for one in found:
        distinct.setdefault(_key(one[0]), one)
    distinct.pop(_key(law), None)
    unique = list(distinct.values())
    if not unique:
        return []
    laws = [law, *(one for one, _ in unique)]
    stresses = side_by_side.stresses_in_histories(library, laws, base)
    apart = side_by_side.differences(stresses)
    same = [i for i, d in enumerate(apart) if d.sigma12 <= side_by_side.SAME]
    if not same:
        return []
    kept = [(unique[i], apart[i]) for i in same]
    places = [0, *(1 + i for i in same)]
    told = side_by_side.separations(library, [laws[i] for i in places], stresses[places], base)
    return [
        Twin(twin, proof, d.N1 <= 10.0 * side_by_side.SAME, d, separated_by=by)
        for ((twin, proof), d), by in zip(kept, told, strict=True)
    ]


def _key(law: LawTerms) -> tuple:
    return tuple(sorted((n, round(v, 6)) for n, v in law.coefficients.items() if v))


def _by_series(
    library: TermLibrary, law: LawTerms, linear_relaxation: bool
) -> Iterator[_Candidate]:
    """Return twins with one term of the law exchanged for another.

    Searched at a neighbouring law with short fractions, where a rational twin is recognised, and
    solved for again at the law itself.
    """
    present = {name: value for name, value in law.coefficients.items() if value}
    if not present or any(parse_term(name).closed_form for name in present):
        return
    short = {n: _fraction(v, _SHORT_DENOMINATOR) for n, v in present.items()}
    exact = {n: _fraction(v, _LARGEST_DENOMINATOR) for n, v in present.items()}
    settings = {"order": DEFAULT_ORDER, "linear_relaxation": linear_relaxation}
    for replaced in present:
        rest = [name for name in present if name != replaced]
        for term in library.terms:
            if term.closed_form or term.name in present:
                continue
            near = {name: short[name] for name in rest}
            at_short = solve_for_coefficient(short, term.name, near, **settings)
            proved = any(value for value, is_proved in at_short if is_proved)
            if not any(value for value, _ in at_short):
                continue
            here = {name: exact[name] for name in rest}
            for value, _ in solve_for_coefficient(exact, term.name, here, **settings):
                if value:
                    found = LawTerms({**{n: present[n] for n in rest}, term.name: value})
                    yield found, "series" if proved else "histories"


def _fraction(value: float, largest_denominator: int) -> Fraction:
    """Return a short fraction near a value, but never zero for what is not."""
    return Fraction(value).limit_denominator(largest_denominator) or Fraction(value)


def _by_relations(library: TermLibrary, law: LawTerms) -> Iterator[_Candidate]:
    present = {name: value for name, value in law.coefficients.items() if value}
    hidden_33 = None
    for relation in term_relations(library):
        shared = [name for name in relation.coefficients if name in present]
        if relation.touches == "nothing":
            for name in shared:
                factor = -present[name] / relation.coefficients[name]
                yield _added(law, relation.coefficients, factor), "relation"
            continue
        if hidden_33 is None:
            names = list(present) or ["sigma"]
            hidden_33 = not feels_33(TermLibrary(tuple(parse_term(name) for name in names)))
        if hidden_33:
            # exchanging a term of the law keeps the law small; adding the whole shows the freedom
            for name in shared:
                factor = -present[name] / relation.coefficients[name]
                yield _added(law, relation.coefficients, factor), "relation"
            added = _added(law, relation.coefficients, INVISIBLE_SIZE)
            if not feels_33(TermLibrary(tuple(parse_term(n) for n in added.coefficients))):
                yield added, "relation"


def _added(law: LawTerms, relation: Mapping[str, int], factor: float) -> LawTerms:
    total = dict(law.coefficients)
    for name, value in relation.items():
        total[name] = total.get(name, 0.0) + factor * value
    # what cancels, cancels exactly: the factor was made from the same coefficient
    return LawTerms({n: v for n, v in total.items() if abs(v) > 1e-14}, law.inner)


_ZERO = 1e-10
"""Relative singular value that counts as zero; exact ones come out at rounding error."""

_NORMALS = ("σ11", "σ22", "σ33")
_DIFFERENCES = {"N1": np.array([1.0, -1.0, 0.0]), "N2": np.array([0.0, 1.0, -1.0])}


@dataclass(frozen=True)
class HiddenStresses:
    """What σ12 feels of the normal stresses in one law.

    `unfelt`: orthonormal combinations of (σ11, σ22, σ33) that never reach σ12, shape (k, 3).
    """

    unfelt: Float[np.ndarray, "k 3"]

    def leaves_no_trace(self, quantity: str) -> bool:
        """Return whether one of the two stresses that make N1 or N2 never reaches σ12 at all."""
        return any(
            np.count_nonzero(np.abs(row) > 1e-8) == 1 and abs(row @ _DIFFERENCES[quantity]) > 1e-8
            for row in self.unfelt
        )

    @property
    def text(self) -> str:
        """One sentence for a reader."""
        if not len(self.unfelt):
            return "σ12 feels all three normal stresses."
        listed = []
        for row in self.unfelt:
            parts = [
                f"{value:+.2g} {name}"
                for value, name in zip(row, _NORMALS, strict=True)
                if abs(value) > 1e-6
            ]
            listed.append(
                parts[0].split(" ")[1] if len(parts) == 1 else "(" + " ".join(parts) + ")"
            )
        return f"A change of {' or of '.join(listed)} never reaches σ12."


def hidden_stresses(law: AbstractConstitutiveLaw) -> HiddenStresses:
    """Return which normal stresses σ12 feels in a law, at its states in random histories.

    With the Jacobians A of dσ/dt at any of these, changes reach σ12 along e₁₂, e₁₂·A, e₁₂·A·A′ and
    so on: the rows of an observability matrix.
    """
    runs, fluid = side_by_side.random_histories(), Fluid.dimensionless(law)
    step, longest = side_by_side.STRAIN_STEP, side_by_side.longest_step(law)
    states = np.concatenate(components([fluid], make_batch(runs, step, longest=longest))[0])
    rates = np.concatenate([run.rate for run in runs])
    usable = np.all(np.isfinite(states), axis=1)
    jacobians = np.asarray(_jacobians(law, on_device(states[usable]), on_device(rates[usable])))
    jacobians = jacobians / np.max(np.abs(jacobians), initial=1e-300)
    felt_rows, known = np.eye(1, states.shape[1], 3), 0
    while len(felt_rows) > known:
        known = len(felt_rows)
        further = (felt_rows @ jacobians).reshape(-1, states.shape[1])
        rows = np.linalg.qr(np.concatenate([felt_rows, further]), mode="r")
        _, values, right = np.linalg.svd(rows)
        felt_rows = right[: len(values)][values > _ZERO * values[0]]
    _, values, right = np.linalg.svd(np.concatenate([felt_rows[:, :3], np.zeros((3, 3))]))
    return HiddenStresses(_readable(right[values <= _ZERO * max(values[0], 1e-300)]))


@compiled
def _jacobians(law, states, rates):
    return jax.vmap(jax.jacfwd(law.stress_rate))(states, rates)


def _readable(rows: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of the same space, along the axes where it holds them."""
    basis: list[np.ndarray] = []
    projector = rows.T @ rows
    for axis in np.eye(3):
        if np.linalg.norm(projector @ axis - axis) < 1e-8:
            basis.append(axis)
    for row in rows:
        for known in basis:
            row = row - (row @ known) * known
        if np.linalg.norm(row) > 1e-6 and len(basis) < len(rows):
            row = row / np.linalg.norm(row)
            basis.append(row * np.sign(row[np.argmax(np.abs(row))]))
    return np.array(basis).reshape(-1, 3)


def oil_twin(
    modulus: float, time: float, solvent: float, runs: Sequence[Run]
) -> dict[str, float] | None:
    """Return viscosity, rise time and inertia that record in runs what a Maxwell mode does.

    The rate behind a motor follows the commanded one, t_m dγ̇ₘ/dt + γ̇ₘ = γ̇, so that η γ̇ₘ is the
    stress of a mode with λ = t_m and G = η/t_m. An inertia I adds I dγ̇ₘ/dt = (I/t_m) (γ̇ − γ̇ₘ),
    which is that of a solvent beside a smaller mode. None where N1, extension, a step of strain
    before the record or a rate measured at the tool tells the two apart, and where no motor is that
    slow. All in units of Pa and s; `solvent`: the viscosity beside the mode.
    """
    found = {"viscosity": modulus * time + solvent, "rise_time": time, "inertia": solvent * time}
    rise, inertia = (
        make_effect(name).parameters[0] for name in ("rate_rise_time", "instrument_inertia")
    )
    told = any(
        (run.flow, run.quantity, run.protocol.control) != ("shear", "sigma12", "rate")
        or run.rate_is_measured
        or run.after_step
        for run in runs
    )
    return None if told or time > rise.high or solvent * time > inertia.high else found
