"""What laws with constants by mode predict: every mode by itself, and their sum."""

from collections.abc import Mapping, Sequence

import equinox as eqx
import numpy as np
from jaxtyping import Float

from discover.comparison.outcomes.flows import DRAWN, Flow
from discover.effects import ConstitutiveEffect
from discover.equations import AugmentedLaw
from discover.identify.rivals.bands import PredictionBand, bands_of_predictions
from discover.identify.side_by_side.many_laws import predict_laws
from discover.inference.by_mode.draws import ConstantsDrawn
from discover.laws.multimode import Fluid
from discover.programs import in_threads, on_device

_AT_A_TIME = 512
"""Modes followed side by side: every length is one more program, and more take more memory."""


def bands_by_mode(
    drawn: ConstantsDrawn,
    effects: Sequence[ConstitutiveEffect],
    inner: Mapping[str, Float[np.ndarray, " _"]],
    fluid: Fluid,
    flows: Sequence[Flow],
) -> dict[str, PredictionBand]:
    """Return what the laws drawn predict in each flow, by its key.

    The band with rivals holds those of one degree more. At a given stress modes share the rate that
    is solved for, and there is none.

    Parameters
    ----------
    drawn
        The constants of each mode.
    effects
        That have them for amplitude, in the order of `drawn`.
    inner
        Further parameters of an effect, by its name.
    fluid
        The known part.
    flows
        All flows of the comparison.
    """
    shown = [f for f in flows if f.kind in DRAWN and f.protocol.control != "stress"]
    if not shown:
        return {}
    times = [flow.times for flow in shown]
    protocols = [flow.protocol for flow in shown]
    columns = _columns(drawn, effects, inner, fluid)
    total = len(columns[0])
    size = min(_AT_A_TIME, total)

    def part(start: int) -> np.ndarray:
        # the last part is filled up with what was followed already
        at = np.minimum(np.arange(start, start + size), total - 1)
        modes = _modes([column[at] for column in columns], effects, fluid)
        return predict_laws(modes, protocols, times)

    each = np.concatenate(in_threads(part, range(0, total, size)))[:total]
    predicted = each.reshape(-1, drawn.values.shape[-1], *each.shape[1:]).sum(axis=1)
    found = bands_of_predictions(predicted, drawn.sizes, times)
    return {flow.key: band for flow, band in zip(shown, found, strict=True)}


def _columns(drawn, effects, inner, fluid: Fluid) -> list[np.ndarray]:
    """Return modulus, time, solvent and the parameters of each effect, a row for every mode."""
    draws, _, modes = drawn.values.shape
    columns = [
        np.tile(np.asarray(of)[:, None], (draws, 1))
        for of in (fluid.modulus, fluid.relaxation_time)
    ]
    # it flows beside all modes, and counts once
    first = np.arange(draws * modes) % modes == 0
    columns.append(np.where(first, float(fluid.solvent_viscosity), 0.0))
    for i, effect in enumerate(effects):
        amplitude = drawn.values[:, i].reshape(-1, 1)
        rest = np.tile(inner[effect.name], (len(amplitude), 1))
        columns.append(np.concatenate([amplitude, rest], axis=1))
    return columns


def _modes(columns, effects: Sequence[ConstitutiveEffect], fluid: Fluid) -> Fluid:
    """Return fluids of one mode, a leading axis of them on every array."""

    def make(modulus, time, solvent, *values):
        law = AugmentedLaw(
            base=fluid.law,
            values=values,
            effects=tuple(effects),
            linear_relaxation=fluid.law.linear_relaxation,
        )
        return Fluid(law, modulus, time, solvent)

    return eqx.filter_vmap(make)(*(on_device(column) for column in columns))
