"""Kinematics of the homogeneous flows that a rheometer makes, and what it records in each.

All of them share their principal third axis, so that the stress has four components, 11, 22, 33 and
12, and the velocity gradient the same four. A rate times a fixed gradient is the whole flow.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from discover.errors import InputError
from discover.programs import on_device
from discover.words import listed, unknown_name
from tensor_library.algebra import contracted

FlowKind = Literal["shear", "uniaxial", "planar", "biaxial"]

RecordedQuantity = Literal[
    "sigma12", "tensile_stress", "N1", "N2", "strain", "storage_modulus", "loss_modulus"
]

MODULI: tuple[RecordedQuantity, RecordedQuantity] = ("storage_modulus", "loss_modulus")
"""What is recorded of an oscillation by its first harmonic."""

Control = Literal["rate", "stress", "steady", "oscillation"]
"""What a protocol imposes: a rate, a stress, rates each held until the flow is steady, or
oscillations each gone on until they are periodic."""

FOLLOWED: tuple[Control, ...] = ("rate", "steady")
"""Controls of which the rate is known beforehand; of the others it is solved for."""

STATES: tuple[Control, ...] = ("steady", "oscillation")
"""Controls of which each sample is a state of its own, and time only counts them."""

LINEAR_STRAIN = 0.4
"""Up to this strain a Maxwell-type law is linear in start-up to a few per cent of the stress, so
what is found there owes nothing to any law, and speaks for none."""

ONLY_STATES = (
    "Only steady or periodic states were measured, which do not tell how they are reached: another "
    "law, or a structure that flow breaks down, can give the same states and another transient."
)
"""Said of a law that was fitted to nothing else."""

KINDS: tuple[FlowKind, ...] = ("shear", "uniaxial", "planar", "biaxial")
"""Flows by name; the first is the default everywhere."""

# L11, L22, L33, L12 of a flow at unit rate. Biaxial: the rate is that of each of the two equal
# directions   [Bird, Armstrong & Hassager 1987, vol. 1, section 3.1; Meissner et al. 1982]
_GRADIENT = {
    "shear": (0.0, 0.0, 0.0, 1.0),
    "uniaxial": (1.0, -0.5, -0.5, 0.0),
    "planar": (1.0, -1.0, 0.0, 0.0),
    "biaxial": (1.0, -2.0, 1.0, 0.0),
}
# weights of σ11, σ22, σ33, σ12
_RECORDED: dict[RecordedQuantity, tuple[float, ...]] = {
    "sigma12": (0.0, 0.0, 0.0, 1.0),
    "tensile_stress": (1.0, -1.0, 0.0, 0.0),
    "N1": (1.0, -1.0, 0.0, 0.0),
    "N2": (0.0, 1.0, -1.0, 0.0),
}


_IN_WORDS = {
    "sigma12": "σ12", "N1": "N1", "N2": "N2", "tensile_stress": "tensile stress",
    "strain": "strain", "storage_modulus": "G′", "loss_modulus": "G″",
}  # fmt: skip


class Kinematics(eqx.Module):
    """A homogeneous flow at unit rate, and the stress that is recorded in it.

    `recorded`: weights of σ11, σ22, σ33, σ12 in the recorded stress.
    `intensity`: √(γ̇:γ̇/2) at unit rate: 1 in shear, √3 in uniaxial extension.
    `viscous`: recorded stress of a Newtonian fluid of unit viscosity at unit rate: 1 in shear, 3, 4
        and 6 in uniaxial, planar and biaxial extension   [Trouton 1906, Proc. R. Soc. A 77, 426].
    """

    gradient: Float[Array, "*batch 4"]  # L11, L22, L33, L12 at unit rate
    recorded: Float[Array, "*batch 4"]
    intensity: Float[Array, "*batch"]
    viscous: Float[Array, "*batch"]

    def stress(self, components: Float[Array, "4 ..."]) -> Float[Array, " ..."]:
        """Return the recorded stress of σ11, σ22, σ33, σ12."""
        return contracted(self.recorded, components)

    @property
    def is_shear(self) -> Bool[Array | np.ndarray, "*batch"]:
        """Whether it is simple shear, made by a rotational rheometer."""
        return self.gradient[..., 3] == 1.0

    @property
    def records_torque(self) -> Bool[Array | np.ndarray, "*batch"]:
        """Whether the torque is what is recorded: σ12 in shear."""
        return self.recorded[..., 3] == 1.0

    @property
    def driven(self) -> "Kinematics":
        """The same flow, of which the stress that drives it is the viscous one: σ12 in shear."""
        return replace(self, viscous=jnp.where(self.is_shear, 1.0, self.viscous))

    def equivalent_shear_stress(self, components: Float[Array, "4 ..."]) -> Float[Array, " ..."]:
        """Return the stress whose work at the shear rate of equal intensity is that of the flow."""
        return contracted(self.gradient, components) / self.intensity


def kind_of(kinematics: Kinematics | None) -> FlowKind:
    """Return the name of a flow; None is simple shear."""
    if kinematics is None:
        return "shear"
    gradient = np.asarray(kinematics.gradient)
    return next(kind for kind in KINDS if np.array_equal(_GRADIENT[kind], gradient))


def kinematics_of(kind: str, quantity: RecordedQuantity | None = None) -> Kinematics:
    """Return the kinematics of a flow by its name.

    `quantity`: what is recorded; by default σ12 in shear and the tensile stress in extension.
    """
    if not isinstance(kind, str) or kind not in _GRADIENT:
        raise InputError(unknown_name("flow", kind, KINDS))
    gradient = np.array(_GRADIENT[kind])
    rate = _rate(gradient)
    usual: RecordedQuantity = "sigma12" if kind == "shear" else "tensile_stress"
    recorded = np.array(_RECORDED[quantity or usual])
    intensity = np.sqrt(0.5 * rate @ (rate * np.array([1.0, 1.0, 1.0, 2.0])))
    return Kinematics(
        *(on_device(part) for part in (gradient, recorded, intensity, recorded @ rate))
    )


def quantity_of(kinematics: Kinematics | None) -> RecordedQuantity:
    """Return what is recorded, as studies and results spell it."""
    if kinematics is None:
        return "sigma12"
    if kind_of(kinematics) != "shear":
        return "tensile_stress"
    recorded = np.asarray(kinematics.recorded)
    names: tuple[RecordedQuantity, ...] = ("sigma12", "N1", "N2")
    return next(name for name in names if np.array_equal(_RECORDED[name], recorded))


def normal_stress_differences(
    kinematics: Kinematics | None,
    recorded: Float[np.ndarray, "trials runs n"],
    of_modes: Float[np.ndarray, "trials runs n 4"],
) -> Float[np.ndarray, "trials runs n 2"]:
    """Return N1 and N2 of runs, of the recorded stress and σ11, σ22, σ33, σ12 of the modes."""
    weights = np.array([_RECORDED["N1"], _RECORDED["N2"]])
    found = of_modes @ weights.T
    if kinematics is None:
        return found
    gradient, own, viscous = (
        np.asarray(of) for of in (kinematics.gradient, kinematics.recorded, kinematics.viscous)
    )
    beside = recorded - np.sum(of_modes * own[:, None], axis=-1)
    none = (viscous == 0.0)[:, None]
    share = np.where(none, 0.0, _rate(gradient) @ weights.T / (viscous[:, None] + none))
    return found + share[:, None] * beside[..., None]


def _rate(gradient: Float[np.ndarray, "*runs 4"]) -> Float[np.ndarray, "*runs 4"]:
    """Return the components of γ̇ = L + Lᵀ."""
    return gradient * np.array([2.0, 2.0, 2.0, 1.0])


def of_one_kind(each: Sequence[Kinematics | None]) -> list[Kinematics] | list[None]:
    """Return kinematics that stack: all None where all are simple shear, none of them otherwise."""
    if all(one is None for one in each):
        return [None] * len(each)
    shear = kinematics_of("shear")
    return [one or shear for one in each]


def stack_kinematics(each: Sequence[Kinematics | None]) -> Kinematics | None:
    """Return kinematics with a leading batch axis; None where all are simple shear."""
    return jax.tree.map(lambda *leaves: on_device(np.stack(leaves)), *of_one_kind(each))


def in_words(quantities: Iterable[str]) -> str:
    """Return in words what is recorded, of several quantities."""
    found = set(quantities)
    return listed([words for quantity, words in _IN_WORDS.items() if quantity in found])
