"""Runs and data sets as the rest of the software sees them: SI units, checked."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from jaxtyping import Float

from discover.dataset.tables.table import as_column
from discover.errors import InputError
from discover.protocols.between_samples import RateStep
from discover.protocols.control import paced_by
from discover.protocols.history import after_steady_flow, steady_rate_before
from discover.protocols.kinematics import MODULI, STATES, FlowKind, RecordedQuantity
from discover.protocols.protocol import FlowProtocol, recording
from discover.statistics.noise_model import rms
from discover.summary_view import NotebookView
from discover.words import counted

# Relative error of one run above which two do not differ by their loading: fillings and trimmings
# of one sample differ by some per cent, and what differs by more, as a run told in minutes does,
# may not excuse what a law leaves of all others
LARGEST = 0.1
SLOWEST_RATE = 1e-12  # in 1/s; slower is rest, for any instrument and any experimenter
# Of the largest value of a flow curve or sweep: below it the noise is no longer in proportion
_LEAST_STEADY = 1e-4
TEMPERATURE = ("temperature_C", "temperature_C_measured")
"""Columns of runs.csv that give the temperature of a run, in °C."""

_NEEDED = ("time", "rate", "stress")
_COLUMNS = (
    *_NEEDED, "first_normal_stress_difference", "second_normal_stress_difference", "strain",
    "storage_modulus", "loss_modulus",
)  # fmt: skip
# of quantities that are no column's name
COLUMN_OF = {
    "sigma12": "stress", "tensile_stress": "stress", "N1": "first_normal_stress_difference",
    "N2": "second_normal_stress_difference",
}  # fmt: skip


@dataclass(frozen=True)
class Run(NotebookView):
    """One experiment in shear or in extension.

    In extension rate and strain are Hencky's, and the stress is σ11 − σ22; biaxial ones are of one
    of the two equal directions.

    Attributes
    ----------
    name, metadata
        File name, or name of the protocol; what else the source says of the run.
    time, rate, stress
        In s, increasing, from the start of the flow at 0; in 1/s; and σ12 in Pa; shape (n,).
    protocol
        The rate as a function of time, which flow has it, and what came before t = 0.
    first_normal_stress_difference, second_normal_stress_difference
        N1 and N2 in Pa, shape (n,), where measured.
    strain, storage_modulus, loss_modulus
        Shape (n,), where recorded. Of oscillations strain, rate and stress are amplitudes of the
        first harmonic, beside G′ and G″ in Pa.
    rate_steps
        Steps of the rate between two samples whose instants are fitted, or were.
    clock_factor, rate_is_measured
        Instrument time is ``time / clock_factor``; whether the rate was measured, not commanded.
    rate_before, strain_before
        Rate in 1/s of the steady flow before t = 0; strain, without its sign, of earlier runs.

    Examples
    --------
    >>> import discover as dc
    >>> import numpy as np
    >>> times = np.linspace(0.0, 5.0, 51)
    >>> stress = 50.0 * (1 - np.exp(-times))
    >>> dc.Run("slow.csv", times, dc.start_up(0.5), np.full(51, 0.5), stress).stress.shape
    (51,)
    """

    name: str
    time: Float[np.ndarray, " _"]
    protocol: FlowProtocol
    rate: Float[np.ndarray, " _"]
    stress: Float[np.ndarray, " _"]
    first_normal_stress_difference: Float[np.ndarray, " _"] | None = None
    second_normal_stress_difference: Float[np.ndarray, " _"] | None = None
    strain: Float[np.ndarray, " _"] | None = None
    clock_factor: float = 1.0
    rate_is_measured: bool = False
    rate_before: float = 0.0
    strain_before: float = 0.0
    metadata: Mapping[str, float | str] = field(default_factory=dict)
    storage_modulus: Float[np.ndarray, " _"] | None = None
    loss_modulus: Float[np.ndarray, " _"] | None = None
    rate_steps: tuple[RateStep, ...] = ()

    def __post_init__(self):
        # kinds and shapes are checked here, not by annotation: users build runs by hand
        if not isinstance(self.name, str):
            raise InputError(f"The name of a run must be text; got {self.name!r}.")
        its = f"of the run {self.name!r}"
        if not isinstance(self.protocol, FlowProtocol):
            raise InputError(
                f"protocol {its} must be a flow, such as start_up(0.5) or "
                f"measured_rate(times, rates); got a {type(self.protocol).__name__}."
            )
        for label in _COLUMNS:
            values = getattr(self, label)
            if values is None and label not in _NEEDED:
                continue
            column = as_column(values, f"{label} {its}")
            object.__setattr__(self, label, column)
            if not len(self.time):
                raise InputError(f"The run {self.name!r} has no samples; give at least one.")
            if column.shape != self.time.shape:
                raise InputError(
                    f"{label} {its} must have shape {self.time.shape} like its time; got "
                    f"{column.shape}."
                )
        for label in ("clock_factor", "rate_before", "strain_before"):
            value = getattr(self, label)
            if isinstance(value, bool) or not isinstance(value, Real):
                raise InputError(f"{label} {its} must be a number; got {value!r}.")
        if self.time[0] < 0 or np.any(np.diff(self.time) <= 0):
            raise InputError(
                f"time {its} must start at or after 0 and increase strictly. Sort the samples and "
                "remove repeated times."
            )
        if not 0 < self.clock_factor < math.inf:
            raise InputError(f"The clock factor {its} must be positive; got {self.clock_factor}.")
        if not np.isfinite(self.rate_before):
            raise InputError(
                f"The shear rate before the run {self.name!r} must be finite; got "
                f"{self.rate_before}. Give 0 for a run from rest."
            )
        if self.rate_before != 0.0 and self.from_rest and self.time[-1] > 0.0:
            begun = after_steady_flow(self.protocol, self.rate_before, float(self.time[-1]))
            object.__setattr__(self, "protocol", begun)
        elif rate := steady_rate_before(self.protocol, float(self.time[-1])):
            object.__setattr__(self, "rate_before", rate)
        unpaced = self.protocol.control == "stress" and self.protocol.table_strains is None
        if unpaced and self.strain is not None:
            paced = paced_by(self.protocol, self.time, self.strain)
            object.__setattr__(self, "protocol", paced)

    def __len__(self) -> int:
        return self.time.shape[0]

    def __repr__(self) -> str:
        kinds = [name for name, values in self._recorded().items() if values is not None]
        span = f"{self.time[0]:.4g} to {self.time[-1]:.4g} s"
        return f"<Run {self.name!r}: {counted(len(self), 'sample')}, {span}, {', '.join(kinds)}>"

    def _shown(self) -> Iterator[Any]:
        yield repr(self).strip("<>")
        if self.metadata:
            yield pd.DataFrame([self.metadata])
        yield self.to_dataframe().describe().loc[["min", "mean", "max"]].rename_axis("column")

    def _recorded(self) -> dict[str, np.ndarray | None]:
        if self.protocol.control == "oscillation":
            return {
                "strain": self.strain,
                "omega_rad_s": self.angular_frequency,
                "Gp_Pa": self.storage_modulus,
                "Gpp_Pa": self.loss_modulus,
            }
        in_shear = self.flow == "shear"
        return {
            "time_s": self.time,
            "shear_rate_1_s" if in_shear else "hencky_rate_1_s": self.rate,
            "stress_Pa" if in_shear else "tensile_stress_Pa": self.stress,
            "N1_Pa": self.first_normal_stress_difference,
            "N2_Pa": self.second_normal_stress_difference,
            "strain" if in_shear else "hencky_strain": self.strain,
        }

    def to_dataframe(self) -> pd.DataFrame:
        """Return the samples, one line each, in the columns of a data folder's files."""
        columns = {name: values for name, values in self._recorded().items() if values is not None}
        return pd.DataFrame(columns)

    @property
    def quantity(self) -> RecordedQuantity:
        """What is fitted or tested, as studies and results spell it."""
        return self.protocol.quantity

    @property
    def recorded(self) -> Float[np.ndarray, " n"]:
        """The values of that quantity, in Pa or dimensionless, shape (n,); InputError if none."""
        values = getattr(self, COLUMN_OF.get(self.quantity, self.quantity))
        if values is None:
            raise InputError(f"The run {self.name!r} has no {self.quantity}; it was not recorded.")
        return values

    def sizes(self, values: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
        """Units of a misfit: root mean square of a record; of states, the value itself."""
        size = np.full(len(values), rms(values))
        if self.protocol.control in STATES:
            largest = float(np.max(np.abs(values), initial=0.0))
            size = np.maximum(np.abs(values), _LEAST_STEADY * largest)
        return np.where(size > 0, size, 1.0)

    def observing(self, quantity: RecordedQuantity) -> "Run":
        """Return the same run with another quantity fitted or tested, under a name of its own.

        `quantity`: N1 or N2 in shear, or a modulus of oscillations; InputError without a record.
        """
        seen = replace(
            self, name=f"{self.name} ({quantity})", protocol=recording(self.protocol, quantity)
        )
        _ = seen.recorded  # says what is missing
        return seen

    @property
    def also_recorded(self) -> tuple[RecordedQuantity, ...]:
        """What was recorded next to σ12: N1, N2, both or neither."""
        both: tuple[RecordedQuantity, ...] = ("N1", "N2") if self.quantity == "sigma12" else ()
        return tuple(one for one in both if getattr(self, COLUMN_OF[one]) is not None)

    @property
    def records(self) -> "tuple[Run, ...]":
        """What of the run is fitted or tested by default: itself, or the moduli of oscillations."""
        if self.protocol.control != "oscillation" or self.name != self.source:
            return (self,)
        return tuple(replace(self, name=self.source).observing(modulus) for modulus in MODULI)

    @property
    def angular_frequency(self) -> Float[np.ndarray, " n"]:
        """ω in rad/s of oscillations, shape (n,): rate over strain; InputError without a strain."""
        if self.strain is None:
            raise InputError(f"The run {self.name!r} has no strain, so no frequency is known.")
        return self.rate / self.strain

    @property
    def temperature_C(self) -> float | None:
        """Temperature at which it was measured, in °C, before any shift; None where not told."""
        told = (self.metadata.get(key) for key in TEMPERATURE)
        return next((float(one) for one in told if isinstance(one, int | float)), None)

    @property
    def source(self) -> str:
        """Name of the run whose record it is."""
        return self.name.removesuffix(f" ({self.quantity})")

    @property
    def flow(self) -> FlowKind:
        """Which flow it is: ``shear``, ``uniaxial``, ``planar`` or ``biaxial``."""
        return self.protocol.flow

    @property
    def from_rest(self) -> bool:
        """Whether the fluid is taken to be at rest until t = 0."""
        return float(self.protocol.begins) == 0.0

    @property
    def after_step(self) -> bool:
        """Whether a step of strain came before the record."""
        return not (self.from_rest or self.rate_before or np.any(self.protocol.cycle))

    @property
    def flows(self) -> bool:
        """Whether anything flows in the run, or did just before it."""
        return not self.from_rest or bool(np.max(np.abs(self.rate)) > SLOWEST_RATE)

    def window(self, keep: np.ndarray) -> "Run":
        """Keep samples where `keep` holds; the flow's history is the protocol's, from t = 0."""
        recorded = {name: getattr(self, name) for name in _COLUMNS}
        kept = {name: values[keep] for name, values in recorded.items() if values is not None}
        return replace(self, **kept)


def require_later_samples(runs: Iterable[Run]) -> None:
    """Refuse a run at a given rate that ends where it begins."""
    for run in runs:
        if run.protocol.control == "rate" and not run.time[-1] > 0.0:
            raise InputError(
                f"The run {run.name!r} has one sample, at time 0, before anything has flowed. "
                "Give later ones, or leave the run out."
            )


def require_signal(runs: Sequence[Run]) -> None:
    """Refuse runs of which none can teach a law, and one that nobody can follow."""
    require_later_samples(runs)
    names = ", ".join(run.name for run in runs[:3]) + (" …" if len(runs) > 3 else "")
    flows, stressed = (any(run.flows for run in runs), any(np.any(run.stress) for run in runs))
    if not runs or (flows and stressed):
        return
    what = "stress is zero throughout" if flows else "shear rate is zero"
    remedy = (
        "Check the column." if flows else "Add runs with flow, or check the unit of the column."
    )
    raise InputError(
        f"The {what} in every run ({names}), so there is nothing to learn a law from. {remedy}"
    )
