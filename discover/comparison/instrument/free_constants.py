"""Constants of a declared model that are to be fitted: positions, values and units."""

from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from discover.comparison.outcomes.constant import Constant
from discover.effects import KnownEffect
from discover.forward import AugmentedModel
from discover.study.declared_model import MODE_CONSTANTS, DeclaredModel


class FreeConstants:
    """Constants of modes and instrument that a declared model leaves to be fitted.

    Parameters
    ----------
    declared
        The known part.
    model
        Its forward model, in whose vector the constants stand.
    """

    def __init__(self, declared: DeclaredModel, model: AugmentedModel):
        self.declared = declared
        self._model = model

    @cached_property
    def positions(self) -> dict[str, int]:
        """Positions of the constants in the forward model's vector, by name."""
        found = {name: i for i, name in enumerate(MODE_CONSTANTS) if name in self.declared.free}
        for known in self.declared.effects:
            at = self._model.positions(known.name)
            for parameter, position in zip(known.effect.parameters, at, strict=True):
                if parameter.name in known.free:
                    found[f"{known.name}.{parameter.name}"] = position
        return found

    @property
    def free(self) -> list[int]:
        """Positions of the constants."""
        return list(self.positions.values())

    @property
    def moves_times(self) -> bool:
        """Whether relaxation times are among them."""
        return MODE_CONSTANTS[1] in self.positions

    def raw(self, theta: Float[np.ndarray, " p"]) -> dict[str, float]:
        """Return the constants of a parameter vector, as the forward model has them."""
        return {name: float(theta[at]) for name, at in self.positions.items()}

    def vector(self, raw: Mapping[str, float]) -> Float[np.ndarray, " p"]:
        """Return a parameter vector with these constants, and all else at zero."""
        theta = self._model.zero()
        for name, value in raw.items():
            theta[self.positions[name]] = value
        return theta

    def with_longer_times(
        self, theta: Float[np.ndarray, " p"], factor: float
    ) -> Float[np.ndarray, " p"]:
        """Return a parameter vector with longer relaxation times, where these are to be fitted.

        Moduli that are to be fitted too become smaller, so that the viscosity stays: it is known
        better than either.
        """
        theta = theta.copy()
        for name, sign in zip(MODE_CONSTANTS, (-1.0, 1.0), strict=True):
            if name in self.positions:
                theta[self.positions[name]] += sign * np.log(factor)
        return theta

    def with_values(self, raw: Mapping[str, float]) -> DeclaredModel:
        """Return the declared model with numbers in the place of the constants."""
        modulus = self.declared.modulus * np.exp(raw.get(MODE_CONSTANTS[0], 0.0))
        time = self.declared.relaxation_time * np.exp(raw.get(MODE_CONSTANTS[1], 0.0))
        effects = tuple(_valued(known, raw) for known in self.declared.effects)
        return replace(
            self.declared, modulus=modulus, relaxation_time=time, effects=effects, free=()
        )

    def value_of(self, name: str, raw: float) -> float:
        """Return a constant in its unit from what the forward model has."""
        if name not in MODE_CONSTANTS:
            return raw
        modes = self.declared.modulus, self.declared.relaxation_time
        own = modes[MODE_CONSTANTS.index(name)]
        return float(np.exp(raw)) * (float(own[0]) if len(own) == 1 else 1.0)

    def labelled(
        self, raw: Mapping[str, float], bounds: Mapping[int, tuple[float, float]]
    ) -> dict[str, Constant]:
        """Return the constants with units and intervals, as a result has them.

        Parameters
        ----------
        raw
            Their values, by name, as the forward model has them.
        bounds
            Their intervals, by position; none of those that are not there.
        """
        single = len(self.declared.modulus) == 1
        found = {}
        for name, value in raw.items():
            limits = bounds.get(self.positions[name])
            if name in MODE_CONSTANTS:
                unit = ("Pa", "s")[MODE_CONSTANTS.index(name)] if single else ""
                title = name if single else f"{name.rsplit('_', 1)[0]}_factor"
                if limits is not None:
                    limits = self.value_of(name, limits[0]), self.value_of(name, limits[1])
                found[title] = Constant(name, self.value_of(name, value), unit, limits, value)
                continue
            effect, parameter = name.split(".")
            known = next(k.effect for k in self.declared.effects if k.name == effect)
            unit = next(p.unit for p in known.parameters if p.name == parameter)
            found[name] = Constant(name, value, unit, limits, value)
        return found


def _valued(known: KnownEffect, raw: Mapping[str, float]) -> KnownEffect:
    pairs = zip(known.effect.parameters, known.values, strict=True)
    values = (raw[f"{known.name}.{p.name}"] if value is None else value for p, value in pairs)
    return replace(known, values=tuple(values))
