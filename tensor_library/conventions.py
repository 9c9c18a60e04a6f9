"""Conventions that every other module relies on.

Velocity gradient
    ``L[i, j] = ∂v_i/∂x_j``; in simple shear ``v_1 = γ̇ x_2``, so ``L[0, 1] = γ̇``.
Rate of deformation
    ``γ̇ = L + Lᵀ`` (twice the symmetric part).
Stress
    Extra stress, positive in tension; ``N1 = σ11 − σ22`` and ``N2 = σ22 − σ33``.
Scaling
    Everything here is dimensionless: time by the relaxation time, stress by the modulus.
Storage
    A symmetric tensor is an array of shape ``(3, 3)``, or of shape ``(4,)`` in simple shear,
    where only the components listed in `SHEAR_COMPONENTS` live. The matching velocity
    gradient is an array of shape ``(3, 3)`` or the scalar shear rate of shape ``()``.
    Functions are written for one tensor and look at the static shape; callers ``vmap``.
"""

SHEAR_COMPONENTS = ("11", "22", "33", "12")
"""Order of the four components that live in simple shear."""
