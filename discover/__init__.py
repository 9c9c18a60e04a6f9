"""Discovery of constitutive equations from shear rheometry.

Two learners (a frame-invariant sparse regression and a tensor-basis neural network inside
the differential equation), a comparison of what each recovered, and a closed loop from a
measured residual to the effect that explains it.

Importing this package imports nothing heavy: ``discover --help`` must answer at once.
"""

__version__ = "0.1.0"
