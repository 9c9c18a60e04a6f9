"""Rolie–Poly law of a bidisperse melt: long and short chains that entangle with each other."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from discover.laws.base import AbstractConstitutiveLaw, NamedLaw, State, as_parameter
from discover.laws.textbook.rolie_poly import NAMED as MONODISPERSE
from discover.laws.textbook.rolie_poly import stretch_of
from tensor_library.algebra import Symmetric, identity_like

_EXPONENT = -0.5  # δ of Likhtman & Graham


class RoliePolyBlend(AbstractConstitutiveLaw):
    """Rolie–Double–Poly law of two components   [Boudara et al. 2019, J. Rheol. 63, 71].

    A_ij is the conformation of a chain of component i along its entanglements with component j, and
    component i has the share φ_i, the conformation A_i = Σ_j φ_j A_ij and the stretch Λ_i = √(tr
    A_i/3):

        σ = Σ_i φ_i (A_i − I),
        A_ij▽ = −½ (1/τ_i + 1/τ_j)(A_ij − I) − r_i A_ij − β r_j Λ_i^{2δ} (A_ij − I),
        r_i = (2/τ_s,i)(1 − 1/Λ_i),    δ = −1/2.

    An entanglement is lost as either chain reptates, half by each (double reptation), and as the
    other chain retracts. Of the long chains τ is λ; that of the short ones and the Rouse times τ_s
    follow from the constants. The four A_ij − I stand behind σ in the state, long before short; a
    term that is added to h beside the law relaxes in λ. All long is `RoliePoly`.

    Each A_ij is positive definite in every flow in which no chain is shorter than at rest.
    """

    long_fraction: Float[Array, ""] = eqx.field(converter=as_parameter)  # φ of the long chains
    short_time_ratio: Float[Array, ""] = eqx.field(converter=as_parameter)  # τ/λ of short ones
    stretch_time_ratio: Float[Array, ""] = eqx.field(converter=as_parameter)  # τ_s/τ, long
    short_stretch_time_ratio: Float[Array, ""] = eqx.field(converter=as_parameter)  # τ_s/τ, short
    constraint_release: Float[Array, ""] = eqx.field(converter=as_parameter)  # β
    linear_relaxation: bool = eqx.field(static=True, default=True)

    @property
    def tensors(self) -> int:
        """Four, A_ij − I of each pair of components."""
        return 4

    @property
    def variables(self) -> int:
        """Those of the four tensors."""
        return 16

    @property
    def retracts(self) -> bool:
        """Whether chains retract."""
        return True

    def _times(self) -> tuple[Float[Array, "2"], Float[Array, "2"]]:
        """Return τ_i and τ_s,i over λ."""
        own = jnp.stack([jnp.ones_like(self.short_time_ratio), self.short_time_ratio])
        ratios = jnp.stack([self.stretch_time_ratio, self.short_stretch_time_ratio])
        return own, own * ratios

    def relaxations(self) -> Float[Array, "5 2"]:
        """Return the rates beside −1 at which σ and each tensor relax at rest, and their traces.

        Written out, for the trace of a tensor follows that of its component.
        """
        times, stretching = self._times()
        lost = 0.5 * (1.0 / times[:, None] + 1.0 / times[None, :]) - 1.0
        faster = jnp.broadcast_to(1.0 / stretching[:, None], (2, 2))
        of_pairs = jnp.stack([lost.ravel(), faster.ravel()], axis=1)
        return jnp.concatenate([jnp.zeros((1, 2)), of_pairs])

    def shares(self) -> Float[Array, "4"]:
        """Return φ_i φ_j."""
        share = jnp.stack([self.long_fraction, 1.0 - self.long_fraction])
        return (share[:, None] * share[None, :]).ravel()

    def extra_term(self, stress: State, rate: Symmetric) -> State:
        """Return h of σ, and of each A_ij − I what its change is short of −(A_ij − I)."""
        del rate
        pairs = stress[4:].reshape(2, 2, 4)
        share = jnp.stack([self.long_fraction, 1.0 - self.long_fraction])
        times, stretching = self._times()
        stretch = jax.vmap(stretch_of)(jnp.tensordot(share, pairs, axes=(0, 1)))
        retraction = 2.0 / stretching * (1.0 - 1.0 / stretch)
        lost = 0.5 * (1.0 / times[:, None] + 1.0 / times[None, :])
        released = self.constraint_release * stretch[:, None] ** (2.0 * _EXPONENT) * retraction
        whole = (lost - 1.0 + retraction[:, None] + released)[..., None] * pairs
        extra = whole + retraction[:, None, None] * identity_like(stress[:4])
        total = jnp.tensordot(self.shares(), extra.reshape(4, 4), axes=1)
        return jnp.concatenate([total, extra.ravel()])


_RATIO = MONODISPERSE["rolie_poly"].parameters["stretch_time_ratio"]
_RATIO_SOURCE = MONODISPERSE["rolie_poly"].range_sources["stretch_time_ratio"]

NAMED = {
    "rolie_poly_blend": NamedLaw(
        "Rolie–Poly blend of two lengths",
        RoliePolyBlend,
        {
            "long_fraction": (0.0, 1.0),
            "short_time_ratio": (1e-4, 1.0),
            "stretch_time_ratio": _RATIO,
            "short_stretch_time_ratio": _RATIO,
            "beta": MONODISPERSE["rolie_poly"].parameters["beta"],
        },
        {
            "long_fraction": "a share of the volume",
            "short_time_ratio": "Likhtman & Graham 2003: τ_d grows as the cube of the length; a "
            "blend of lengths that differ twentyfold has 1e-4",
            "stretch_time_ratio": _RATIO_SOURCE,
            "short_stretch_time_ratio": _RATIO_SOURCE,
            "beta": MONODISPERSE["rolie_poly"].range_sources["beta"],
        },
        source="Boudara, Peterson, Leal & Read 2019, J. Rheol. 63, 71",
        is_one_mode=False,
        contains={
            "rolie_poly": {
                "long_fraction": 1.0,
                "short_time_ratio": 1.0,
                "short_stretch_time_ratio": 1.0,
            }
        },
    )
}
