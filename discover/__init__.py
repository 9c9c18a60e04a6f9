"""Discovery of constitutive equations from shear rheometry.

Two learners (a frame-invariant sparse regression and a tensor-basis neural network inside
the differential equation), a comparison of what each recovered, and a closed loop from a
measured residual to the effect that explains it.

Importing this package imports nothing heavy: what is named here is loaded when it is first used,
and with it double precision and the cache of compiled programs are set up.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

from discover._version import __version__ as __version__

if TYPE_CHECKING:  # what editors and type checkers see; `_PLACES` is what runs
    from discover.comparison.in_memory import compare as compare
    from discover.dataset import Dataset as Dataset
    from discover.dataset import LinearSweep as LinearSweep
    from discover.dataset import Run as Run
    from discover.dataset import check_folder as check_folder
    from discover.dataset import from_dataframe as from_dataframe
    from discover.dataset import load_dataset as load_dataset
    from discover.dataset.importing import register_importer as register_importer
    from discover.effects.registry import effects_table as effects
    from discover.effects.registry import register_effect as register_effect
    from discover.errors import InputError as InputError
    from discover.fitting import fit as fit
    from discover.laws import AbstractConstitutiveLaw as AbstractConstitutiveLaw
    from discover.laws import Fluid as Fluid
    from discover.laws import make_law as make_law
    from discover.laws.registry import laws_table as laws
    from discover.laws.registry import register_law as register_law
    from discover.learners import register_learner as register_learner
    from discover.learners.load import load as load
    from discover.learners.tbnn_ude import TBNNUDE as TBNNUDE
    from discover.learners.tensor_sindy import TensorSINDy as TensorSINDy
    from discover.loop.in_memory import close_loop as close_loop
    from discover.protocols import after_alternation as after_alternation
    from discover.protocols import after_steady_flow as after_steady_flow
    from discover.protocols import after_step_strain as after_step_strain
    from discover.protocols import in_flow as in_flow
    from discover.protocols import measured_rate as measured_rate
    from discover.protocols import oscillatory_shear as oscillatory_shear
    from discover.protocols import sampled_rate as sampled_rate
    from discover.protocols import start_up as start_up
    from discover.protocols import step_rates as step_rates
    from discover.simulate import synthetic_dataset as synthetic_dataset
    from discover.simulate.solve import simulate as simulate
    from tensor_library import ClosedForm as ClosedForm
    from tensor_library import build_library as build_library
    from tensor_library import register_closed_form as register_closed_form

_PLACES = {
    "discover.loop.in_memory": ("close_loop",),
    "discover.comparison.in_memory": ("compare",),
    "discover.dataset": (
        "LinearSweep", "Dataset", "Run", "check_folder", "from_dataframe", "load_dataset",
    ),
    "discover.dataset.importing": ("register_importer",),
    "discover.effects.registry": ("register_effect",),
    "discover.errors": ("InputError",),
    "discover.fitting": ("fit",),
    "discover.laws": ("AbstractConstitutiveLaw", "Fluid", "make_law"),
    "discover.laws.registry": ("register_law",),
    "discover.learners": ("register_learner",),
    "discover.learners.load": ("load",),
    "discover.learners.tbnn_ude": ("TBNNUDE",),
    "discover.learners.tensor_sindy": ("TensorSINDy",),
    "discover.protocols": (
        "after_alternation", "after_steady_flow", "after_step_strain", "in_flow", "measured_rate",
        "oscillatory_shear", "sampled_rate", "start_up", "step_rates",
    ),
    "discover.simulate": ("synthetic_dataset",),
    "tensor_library": ("ClosedForm", "build_library", "register_closed_form"),
}  # fmt: skip
_PLACE = {name: place for place, names in _PLACES.items() for name in names}

# the last are packages that answer a call
__all__ = [*_PLACE, "effects", "laws", "simulate"]  # pyright: ignore[reportUnsupportedDunderAll]

_PACKAGES = (
    "batch", "loop", "comparison", "dataset", "effects", "equations", "identify", "laws",
    "learners", "protocols", "simulate", "statistics", "study",
)  # fmt: skip
"""Packages that need no import of their own, and are not listed: the door is `__all__`."""


def __getattr__(name: str) -> Any:
    if name in _PACKAGES:
        return import_module(f"discover.{name}")
    if name not in _PLACE:
        raise AttributeError(f"module 'discover' has no attribute {name!r}")
    value = getattr(import_module(_PLACE[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*__all__, "__version__"]
