"""Slip that is a free function of the stress: a hypothesis without a name, in the flow itself."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from discover.effects import EffectParameter, SeriesElement


class SlipCurve(SeriesElement):
    """Slip s(σ), straight lines between some stresses; at stress zero there is none.

    It stands for any law of slip that is not in proportion to the stress: that of melts goes with
    its second or third power [Hatzikiriakos 2012, Prog. Polym. Sci. 37, 624].
    """

    bends: ClassVar[tuple[float, ...]] = (0.0, 0.8, 1.6)
    """Where the slope changes, over the typical stress."""

    def basis(
        self, stress: Float[np.ndarray, " n"], typical: float
    ) -> Float[np.ndarray, "n bends"]:
        """Return what slip takes at stresses in Pa, of one of each change of slope."""
        size = np.abs(stress)[:, None] / typical
        return stress[:, None] * np.maximum(size - np.array(self.bends), 0.0)

    def slip_and_compliance(self, values):
        """Return 0 and 0: all of it depends on the stress."""
        return jnp.zeros_like(values[0]), jnp.zeros_like(values[0])

    def slip_at(self, values, stress):
        """Return s at a stress in Pa."""
        size = jnp.abs(stress) / values[-1]
        changes = zip(values[:-1], self.bends, strict=True)
        return sum(change * jnp.maximum(size - at, 0.0) for change, at in changes)


def _slope(number: int) -> EffectParameter:
    return EffectParameter(
        f"slope_{number}", f"s_{number}", "1/(Pa s)", scale="fluidity", first_trial=0.0,
        range_source="a change of slope may have either sign",
    )  # fmt: skip


SLIP_CURVE = SlipCurve(
    name="slip_curve",
    parameters=(
        *map(_slope, range(1, len(SlipCurve.bends) + 1)),
        EffectParameter(
            "typical_stress", r"\sigma_0", "Pa", low=0.0, scale="stress", first_trial=1.0,
            range_source="the size of the records",
        ),
    ),
    equation=r"\dot\gamma_\mathrm{felt} = \dot\gamma - s(\sigma)\,\sigma",
    source="Yoshimura & Prud'homme 1988, J. Rheol. 32, 53",
    check="Repeat with another gap H: slip goes as 1/H; roughen the plates.",
)  # fmt: skip
