"""Runs of a closed loop: as it fits and judges by them, cut and thinned, and as it leaves them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float

from discover.dataset import Dataset, Run
from discover.dataset.records.repeats import count_flows, require_no_copies
from discover.dataset.records.thinning import thin_run, without_held_values, without_spikes
from discover.errors import InputError
from discover.forward import DeclaredModel
from discover.loop.measured_rates import with_rate_steps
from discover.loop.parts import ErrorPair
from discover.protocols import strains
from discover.protocols.control import drawn_against
from discover.protocols.kinematics import STATES, Control, FlowKind
from discover.statistics.noise_model import independent_samples, rms
from discover.statistics.whiteness import sample_to_sample_noise
from discover.words import counted

FEWEST_SAMPLES = 5
"""Samples beyond the constants to be fitted, below which any law fits."""

MOST_SAMPLES = 400
"""Samples of a run that are used by default, at most: more of them say little more of a law."""

_FEWEST_ASKED = 10
_FEWEST_KEPT = 150
_RESOLVED = 1e-3  # Relative error that the noise of as many samples as are used may leave


def split_runs(
    dataset: Dataset,
    fit: Sequence[str] | None,
    held_out: Sequence[str],
    strain: tuple[float, float] | None,
    most: int,
) -> tuple[list[Run], list[Run], dict[str, list[float]]]:
    """Return the runs that are fitted, those that judge, and the times of spikes left out of each.

    `fit`, `held_out`: names; by default all are fitted that are not held out. `strain`: smallest
    and largest strain of the samples used. `most`: samples of a run, at most.

    Raises InputError if a run is both fitted and held out, by name or by its samples; if none is
    left to fit; or if the samples asked for are too few.
    """
    overlap = [name for name in (fit or ()) if name in held_out]
    if overlap:
        raise InputError(f"The run {overlap[0]!r} is both fitted and held out; choose one.")
    held = dataset.select(list(held_out))
    fitted = dataset.select(
        list(fit) if fit is not None else [n for n in dataset.names if n not in held_out]
    )
    if len(fitted) == 0:
        raise InputError("No run is left to fit. Take some out of held_out.")
    require_no_copies(fitted.runs, held.runs)
    if most < _FEWEST_ASKED:
        raise InputError(
            f"most_samples must be {_FEWEST_ASKED} or more; got {most}. A law cannot be told from "
            "fewer samples."
        )
    spikes: dict[str, list[float]] = {}

    def prepared(runs: Sequence[Run]) -> Iterator[Run]:
        stepped = [without_held_values(with_rate_steps(run)) for run in runs]
        for run in cut_to_strain(stepped, strain):
            left, times = without_spikes(run)
            if times:
                spikes[run.name] = times
            yield thin_run(left, _needed(left, most))

    return list(prepared(fitted.runs)), list(prepared(held.runs)), spikes


def unfitted_runs(dataset: Dataset, runs: Sequence[Run]) -> list[Run]:
    """Return N1 and N2 that runs recorded besides, without samples that no fluid can have."""
    sound = {run.name: run.time for run in dataset.quantity_by_quantity()}
    found = [run.observing(quantity) for run in runs for quantity in run.also_recorded]
    found = [one for one in found if one.name in sound.keys() - {run.name for run in runs}]
    kept = [(one, np.isin(one.time, sound[one.name])) for one in found]
    return [one.window(at) for one, at in kept if np.count_nonzero(at) >= FEWEST_SAMPLES]


def strain_of(run: Run) -> Float[np.ndarray, " n"]:
    """Return the strain of a run at its samples: recorded, or of its commanded rate.

    That of a steady state is not known, and nan.
    """
    if run.strain is not None:
        return run.strain
    if run.protocol.control == "steady":
        return np.full(len(run), np.nan)
    return strains(run.protocol, run.time)


def cut_to_strain(runs: Sequence[Run], window: tuple[float, float] | None) -> list[Run]:
    """Return the samples of every run whose strain magnitude lies in a window.

    Raises InputError if the window is no window, or a run has fewer than 3 samples in it.
    """
    if window is None:
        return list(runs)
    low, high = window
    if not 0 <= low < high:
        raise InputError(
            f"The strain window must be two increasing numbers from 0 on; got {list(window)}."
        )
    cut = []
    for run in runs:
        if run.protocol.control in STATES:
            cut.append(run)  # no course of a strain to be cut
            continue
        strain = np.abs(strain_of(run))
        keep = (strain >= low) & (strain <= high)
        if np.count_nonzero(keep) < 3:
            raise InputError(
                f"The run {run.name!r} has {counted(int(np.sum(keep)), 'sample')} at strains "
                f"from {low:g} to {high:g}; at least 3 are needed. Widen [loop] strain or leave "
                "the run out."
            )
        cut.append(run.window(keep))
    return cut


def _needed(run: Run, most: int) -> int:
    """Return how many samples of a run resolve its stress to `_RESOLVED`."""
    size = rms(run.recorded)
    noise = sample_to_sample_noise(run.recorded) / size if size > 0.0 else 0.0
    return int(min(most, max(_FEWEST_KEPT, (noise / _RESOLVED) ** 2)))


def require_samples(runs: Sequence[Run], declared: DeclaredModel) -> None:
    """Refuse what any law would fit."""
    count, constants = sum(len(run) for run in runs), declared.free_constants
    if count < FEWEST_SAMPLES + constants:
        raise InputError(
            f"The runs to fit ([data] fit) hold {count} samples in all, for {constants} constants "
            f"to be fitted; at least {FEWEST_SAMPLES + constants} are needed to tell a law from "
            "another. Sample more often, or declare the constants."
        )


def why_untested(
    constants: int, fitted: Sequence[Run], held_out: Sequence[Run]
) -> Literal["flows", "states"] | None:
    """Return why nothing that was measured could have refuted what was fitted; None if it could.

    ``flows``: no run is held out, and each flow that was measured is taken by a constant, for a
    constant takes a flow to show itself. ``states``: steady and periodic states do not tell how
    they are reached: a viscosity η₀/(1 + q γ̇) is that of a structure that flow breaks down, and as
    well one of White and Metzner.

    `constants`: fitted; those of the declared model count as one.
    """
    if not constants:
        return None
    if all(run.protocol.control in STATES for run in (*fitted, *held_out)):
        return "states"
    return "flows" if not held_out and count_flows(fitted) <= constants else None


@dataclass(frozen=True)
class RunRecord:
    """One run in the window of the loop, measured and predicted.

    `name`, `held_out`: the run, and whether it was held out. `time`, `strain`, `instrument_time`:
    in s, dimensionless, and in s on the instrument's clock, shape (n,). `rate`: commanded, in 1/s,
    shape (n,); in extension the Hencky rate. `measured`: the quantity recorded, shape (n,): σ12 in
    shear, σ11 − σ22 in extension. `predicted`: recorded stress in Pa by the declared model and
    after each stage, shape (stages + 1, n). `errors`: relative error of each of these, shape
    (stages + 1,). `temperature_C`: of the measurement, in whole °C; None where unknown. `flow`:
    which flow it is. `quantity`: what is recorded: ``sigma12``, ``tensile_stress``, ``N1``, ``N2``,
    ``storage_modulus`` or ``loss_modulus`` in Pa, or ``strain``. `band`: where 95 % of the
    measurements should lie by all explanations together, shape (2, n). `by_explanation`: what each
    explanation predicts, in the order of their probability, shape (explanations, n).
    `rate_before`: of the steady flow before it, in 1/s; 0 without one. `control`: what was imposed.
    Where it is ``steady`` or ``oscillation``, time only counts the samples; strain and rate of an
    oscillation are amplitudes.
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
    temperature_C: float | None = None
    flow: FlowKind = "shear"
    quantity: str = "sigma12"
    band: Float[np.ndarray, "2 n"] | None = None
    control: Control = "rate"
    by_explanation: Float[np.ndarray, "explanations n"] | None = None
    has_normal_stress: bool = False  # whether N1 was recorded as well
    rate_before: float = 0.0

    @property
    def fastest(self) -> float:
        """Largest rate, in 1/s."""
        return float(np.max(np.abs(self.rate)))

    @property
    def scatter(self) -> float:
        """Deviation of what changes from sample to sample, at most that about the mean."""
        return min(sample_to_sample_noise(self.measured), float(np.std(self.measured)))

    @property
    def mean_below(self) -> float:
        """Bound below which the mean of the record lies, without its sign, with 95 % (normal)."""
        off = self.measured - (mean := float(np.mean(self.measured)))
        return abs(mean) + 1.645 * float(np.std(off)) / independent_samples(off) ** 0.5

    @property
    def shift(self) -> float:
        """Time on the instrument's clock over `time`: a_T of a run that was shifted, else 1."""
        end = len(self.time) - 1
        shifted = self.time[end] != self.instrument_time[end]
        return float(self.instrument_time[end] / self.time[end]) if shifted else 1.0

    @property
    def unshifted(self) -> "RunRecord":
        """The run with times and rates as the instrument had them."""
        before, rate = (rate / self.shift for rate in (self.rate_before, self.rate))
        return replace(self, time=self.instrument_time, rate=rate, rate_before=before)

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
) -> list[RunRecord]:
    """Return each run with the predictions of several models, which are padded."""
    records = []
    for i, run in enumerate(runs):
        predicted = predictions[:, i, : len(run)]
        size = rms(run.recorded)
        misfit = np.sqrt(np.mean((predicted - run.recorded) ** 2, axis=1))
        at = run.temperature_C
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
                temperature_C=None if at is None else float(round(at)),
                flow=run.flow,
                quantity=run.quantity,
                control=run.protocol.control,
                has_normal_stress=run.first_normal_stress_difference is not None,
                rate_before=run.rate_before,
            )
        )
    return records


def errors_of(records: Sequence[RunRecord], index: int) -> ErrorPair:
    """Return the mean errors of one of the models in the records."""
    fitted = [r.errors[index] for r in records if not r.held_out]
    held = [r.errors[index] for r in records if r.held_out]
    return ErrorPair(float(np.mean(fitted)), float(np.mean(held)) if held else None)
