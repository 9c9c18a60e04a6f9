"""Which of the normal stresses the shear stress feels.

σ12 is measured, σ11, σ22 and σ33 are not. Along a trajectory, a small change of the hidden stresses
at the start travels as dδ/dt = J(t) δ with J the Jacobian of the law; what never reaches σ12 in any
history is unobservable   [Hermann & Krener 1977, IEEE TAC 22, 728]. A law may say anything it likes
about such a combination: σ12 cannot object.
"""

from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.forward.fluids import dynamics_of_fluid
from discover.forward.integrators.at_given_rate import follow
from discover.identify.side_by_side.histories import histories_for
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.multimode import Fluid
from discover.programs import compiled

_ZERO = 1e-10
"""Relative singular value that counts as zero; exact ones come out at rounding error."""

_NORMALS = ("σ11", "σ22", "σ33")
_DIFFERENCES = {"N1": np.array([1.0, -1.0, 0.0]), "N2": np.array([0.0, 1.0, -1.0])}


@dataclass(frozen=True)
class HiddenStresses:
    """What σ12 feels of the normal stresses in one law.

    `unfelt`: orthonormal combinations of (σ11, σ22, σ33) that never reach σ12, shape (k, 3).
    `felt`: for N1 and N2, whether the difference is free of every unfelt combination.
    """

    unfelt: Float[np.ndarray, "k 3"]
    felt: dict[str, bool]

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

    def to_json(self) -> dict[str, Any]:
        """Return the combinations as JSON-able values."""
        return {"unfelt": self.unfelt.tolist(), "felt": dict(self.felt), "text": self.text}


def hidden_stresses(law: AbstractConstitutiveLaw) -> HiddenStresses:
    """Return which normal stresses σ12 feels in a law, over random shear histories.

    `law`: any dimensionless law. Histories in which it runs away are left out.
    """
    flows = histories_for(law)
    arrived = np.asarray(_arrivals(law, flows.protocols, flows.grids))
    usable = np.all(np.isfinite(arrived), axis=(1, 2))
    rows = arrived[usable].reshape(-1, 3)
    triangular = np.linalg.qr(rows, mode="r") if len(rows) else np.zeros((3, 3))
    _, values, right = np.linalg.svd(triangular)
    unfelt = _readable(right[values <= _ZERO * max(values[0], 1e-300)])
    felt = {
        name: bool(np.all(np.abs(unfelt @ difference) < 1e-8))
        for name, difference in _DIFFERENCES.items()
    }
    return HiddenStresses(unfelt, felt)


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


@compiled
def _arrivals(law, protocols, grids):
    """Return ∂σ12(t)/∂(σ11, σ22, σ33)(0) at the samples, (runs, n, 3)."""

    def one(protocol, grid):
        alone = dynamics_of_fluid(Fluid.dimensionless(law), protocol)

        def slope(state, rate):
            stress, changes = state[:, 0], state[:, 1:]
            value, push = jax.linearize(lambda s: alone.slope(s, rate), stress)
            along = jax.vmap(push, in_axes=1, out_axes=1)(changes)
            return jnp.concatenate([value[:, None], along], axis=1)

        beside = alone._replace(slope=slope, columns=3)
        start = beside.rest()[0].at[:3, 1:, 0].set(jnp.eye(3))
        return follow(beside, alone, protocol, grid, lambda state, _: state[3, 1:, 0], start)

    return jax.vmap(one)(protocols, grids)
