"""One run as a closed loop leaves it: measured, and predicted by every model on the way."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Float

from discover.dataset import Run
from discover.dataset.run import TEMPERATURE
from discover.loop.parts import ErrorPair
from discover.loop.runs import strain_of
from discover.protocols.control import drawn_against
from discover.protocols.kinematics import STATES, Control, FlowKind
from discover.statistics.noise.noise_model import rms


@dataclass(frozen=True)
class RunRecord:
    """One run in the window of the loop, measured and predicted.

    `name`, `held_out`: the run, and whether it was held out. `time`, `strain`, `instrument_time`:
    in s, dimensionless, and in s on the instrument's clock, shape (n,). `rate`: commanded, in 1/s,
    shape (n,); in extension the Hencky rate. `measured`: the quantity recorded, shape (n,): σ12 in
    shear, σ11 − σ22 in extension. `predicted`: recorded stress in Pa by the declared model and
    after each stage, shape (stages + 1, n). `errors`: relative error of each of these, shape
    (stages + 1,). `conditions`: numbers that the source gives of the run, such as its temperature,
    and its place in the order of the runs. `flow`: which flow it is. `quantity`: what is recorded:
    ``sigma12``, ``tensile_stress``, ``N1``, ``N2``, ``storage_modulus`` or ``loss_modulus`` in Pa,
    or ``strain``. `band`: where 95 % of the measurements should lie by all explanations together,
    shape (2, n). `by_explanation`: what each explanation predicts, in the order of their
    probability, shape (explanations, n). `control`: what was imposed. Where it is ``steady`` or
    ``oscillation``, time only counts the samples; strain and rate of an oscillation are amplitudes.
    """

    name: str
    held_out: bool
    time: Float[np.ndarray, " n"]
    strain: Float[np.ndarray, " n"]
    instrument_time: Float[np.ndarray, " n"]
    rate: Float[np.ndarray, " n"]
    measured: Float[np.ndarray, " n"]
    predicted: Float[np.ndarray, "stages n"]
    errors: Float[np.ndarray, " stages"]
    conditions: dict[str, float] = field(default_factory=dict)
    flow: FlowKind = "shear"
    quantity: str = "sigma12"
    band: Float[np.ndarray, "2 n"] | None = None
    control: Control = "rate"
    by_explanation: Float[np.ndarray, "explanations n"] | None = None

    @property
    def fastest(self) -> float:
        """Largest rate, in 1/s."""
        return float(np.max(np.abs(self.rate)))

    @property
    def temperature_C(self) -> float | None:
        """Temperature of the measurement, in whole °C; None where unknown."""
        told = (self.conditions.get(key) for key in TEMPERATURE)
        at = next((one for one in told if one is not None), None)
        return None if at is None else float(round(at))

    @property
    def shift(self) -> float:
        """Time on the instrument's clock over `time`: a_T of a run that was shifted, else 1."""
        end = len(self.time) - 1
        shifted = self.time[end] != self.instrument_time[end]
        return float(self.instrument_time[end] / self.time[end]) if shifted else 1.0

    @property
    def unshifted(self) -> "RunRecord":
        """The run with times and rates as the instrument had them."""
        return replace(self, time=self.instrument_time, rate=self.rate / self.shift)

    @property
    def is_transient(self) -> bool:
        """Whether it goes on in time, and is no steady or periodic state."""
        return self.control not in STATES

    @property
    def along(self) -> tuple[str, Float[np.ndarray, " n"]]:
        """What it is drawn against, and its values: time, shear rate, frequency or amplitude."""
        return drawn_against(self.control, self.time, self.rate, self.strain)

    @property
    def residual(self) -> Float[np.ndarray, "stages n"]:
        """Prediction minus measurement in Pa, for each model."""
        return self.predicted - self.measured

    @property
    def relative_residual(self) -> Float[np.ndarray, "stages n"]:
        """The residual over the root-mean-square stress."""
        return self.residual / (rms(self.measured) or 1.0)


def record_runs(
    runs: Sequence[Run],
    predictions: Float[np.ndarray, "stages runs n"],
    held_out: bool,
    order: Sequence[str] = (),
) -> list[RunRecord]:
    """Return each run with the predictions of several models, which are padded.

    `order`: names of the runs of the data set, in its order.
    """
    records = []
    for i, run in enumerate(runs):
        predicted = predictions[:, i, : len(run)]
        size = rms(run.recorded)
        misfit = np.sqrt(np.mean((predicted - run.recorded) ** 2, axis=1))
        records.append(
            RunRecord(
                name=run.name,
                held_out=held_out,
                time=run.time,
                strain=strain_of(run),
                instrument_time=run.time / run.clock_factor,
                rate=run.rate,
                measured=run.recorded,
                predicted=predicted,
                errors=misfit / (size if size > 0 else 1.0),
                conditions=_conditions(run, order),
                flow=run.flow,
                quantity=run.quantity,
                control=run.protocol.control,
            )
        )
    return records


def errors_of(records: Sequence[RunRecord], index: int) -> ErrorPair:
    """Return the mean errors of one of the models in the records."""
    fitted = [r.errors[index] for r in records if not r.held_out]
    held = [r.errors[index] for r in records if r.held_out]
    return ErrorPair(float(np.mean(fitted)), float(np.mean(held)) if held else None)


def _conditions(run: Run, order: Sequence[str]) -> dict[str, float]:
    numbers = {k: float(v) for k, v in run.metadata.items() if not isinstance(v, str)}
    numbers.pop("n_points", None)  # of the file, not of the experiment
    if run.name in order:
        numbers["the order of the runs"] = float(list(order).index(run.name))
    return numbers
