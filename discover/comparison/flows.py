"""Flows in which learned laws are compared, with what is known of the truth in each."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.integrate import cumulative_simpson

from discover import protocols
from discover.dataset import Dataset
from discover.dataset.material_functions import as_compared
from discover.dataset.records.thinning import thin_run, without_held_values, without_spikes
from discover.dataset.run import Run
from discover.equations import law_terms
from discover.errors import InputError
from discover.forward.of_fluids import recorded_and_normal
from discover.laws import Fluid, make_law
from discover.learners.files import kept_in_files
from discover.protocols.control import drawn_against
from discover.protocols.kinematics import STATES
from discover.protocols.protocol import TEST_DURATION, TRAINING_DURATION, strains_in_table
from discover.simulate.solve import observe
from discover.simulate.synthetic import SyntheticDataset
from discover.study.data import StudyData
from discover.study.declared_model import StudyModel
from tensor_library.law_terms import LawTerm

QUANTITIES = ("sigma12", "N1", "N2")
"""What is compared, as spelled in JSON."""

Stresses = Mapping[str, Float[np.ndarray, " _"]]
"""Some of `QUANTITIES`, each of shape (n,)."""

HIGH_DEBORAH_AMPLITUDE = 3.0
"""Wi of the paper's curves that become elliptical."""


FlowKind = Literal["training", "held_out", "test", "high_deborah", "pipkin"]

MEASURED: tuple[FlowKind, ...] = ("training", "held_out")
"""Kinds that are runs, fitted or kept from the fit."""

DRAWN: tuple[FlowKind, ...] = ("training", "held_out", "test")
"""Kinds whose curves are drawn with bands; of the others errors alone are told."""


@dataclass(frozen=True)
class Flow:
    """Flow, its samples, and what is known of the stresses.

    `times`, `shear_rate`: in s and 1/s, shape (n,). `reference`: the truth where the law is known,
    else the measurement; not every quantity. `measured`: σ12 of training flows, noise included.
    """

    name: str  # name of the run or of the protocol
    kind: FlowKind  # what it is for. Only ``training`` was seen by the learners
    protocol: protocols.FlowProtocol  # the shear rate
    times: Float[np.ndarray, " n"]
    rate: Float[np.ndarray, " n"]
    reference: Stresses
    measured: Float[np.ndarray, " n"] | None = None
    is_truth: bool = False  # whether `reference` is exact and not a measurement

    @property
    def key(self) -> str:
        """Unique name: a test may repeat a training flow past its last time."""
        return self.name if self.kind == "test" else f"{self.kind}/{self.name}"

    @property
    def is_record(self) -> bool:
        """Whether it is a run that was measured."""
        return self.kind in MEASURED and not (self.kind == "held_out" and self.is_truth)

    @property
    def records_shear_stress(self) -> bool:
        """Whether σ12 in shear is recorded, beside which N1 and N2 are told."""
        return self.protocol.quantity == "sigma12"

    @property
    def in_shear(self) -> bool:
        """Whether it is a shear flow, and no extension."""
        return self.protocol.flow == "shear"

    @property
    def is_of_states(self) -> bool:
        """Whether each sample is a steady or periodic state, and time only counts them."""
        return self.protocol.control in STATES

    @property
    def records_strain(self) -> bool:
        """Whether the stress is imposed, as in creep, and the strain is recorded."""
        return self.protocol.quantity == "strain"

    @property
    def training_end(self) -> float | None:
        """Last time of the training series in s; None where there is none."""
        if self.kind == "test":
            return TRAINING_DURATION
        in_time = self.kind == "training" and not self.is_of_states
        return float(self.times[-1]) if in_time else None

    @property
    def oscillatory(self) -> bool:
        """Whether Lissajous curves make sense."""
        if self.protocol.control != "rate":  # the slope of a noisy strain changes its sign
            return False
        changes = np.count_nonzero(np.diff(np.sign(self.rate[np.abs(self.rate) > 0])))
        return bool(np.any(np.asarray(self.protocol.amplitudes)) or changes >= 3)

    @property
    def drawn(self) -> tuple[str, Float[np.ndarray, " n"]]:
        """What the record is drawn against, in words, and its values."""
        return drawn_against(self.protocol.control, self.times, self.rate, self.strain)

    @property
    def along(self) -> Float[np.ndarray, " n"]:
        """What the record is drawn against: time in s, the rate in 1/s, frequency or amplitude."""
        return self.drawn[1]

    @property
    def frequency(self) -> float | None:
        """Largest angular frequency of the protocol in rad/s; None where it does not oscillate."""
        if self.protocol.control == "oscillation":
            return float(np.max(self.rate / self.strain))
        amplitudes = np.asarray(self.protocol.amplitudes)
        frequencies = np.abs(np.asarray(self.protocol.frequencies)[amplitudes != 0.0])
        return float(np.max(frequencies)) if frequencies.size else None

    @property
    def amplitude(self) -> float:
        """Largest amplitude of the oscillating part of the rate in 1/s."""
        return float(np.max(np.abs(np.asarray(self.protocol.amplitudes)), initial=0.0))

    @property
    def strain(self) -> Float[np.ndarray, " n"]:
        """Strain, shape (n,): recorded in creep, amplitude of oscillations, else since the start.

        nan of steady states.
        """
        if self.protocol.control == "steady":
            return np.full(self.times.shape, np.nan)
        if self.records_strain:
            return np.asarray(self.reference["sigma12"])
        if self.is_of_states:
            return strains_in_table(self.protocol, self.times)
        return cumulative_simpson(self.rate, x=self.times, initial=0.0)

    @property
    def largest_rate(self) -> float:
        """Largest rate without its sign, in 1/s.

        At a given stress the mean over the second half of the samples: slopes between samples are
        noise.
        """
        if self.records_strain and len(self.times) > 2:
            middle = len(self.times) // 2
            moved = abs(self.strain[-1] - self.strain[middle])
            return float(moved / (self.times[-1] - self.times[middle]))
        return float(np.max(np.abs(self.rate)))

    @property
    def title(self) -> str:
        """The flow in the field's notation."""
        amplitudes = np.asarray(self.protocol.amplitudes)
        frequencies = np.asarray(self.protocol.frequencies)
        rates = np.asarray(self.protocol.table_rates)
        if self.oscillatory and np.count_nonzero(amplitudes) == 1:
            i = int(np.flatnonzero(amplitudes)[0])
            size = "" if amplitudes[i] == 1 else f"{amplitudes[i]:g} "
            return f"γ̇ = {size}cos({'' if frequencies[i] == 1 else f'{frequencies[i]:g} '}t)"
        if not np.any(amplitudes) and rates.size == 1 and self.protocol.control == "rate":
            if self.protocol.flow != "shear":
                return f"{self.protocol.flow} extension at ε̇ = {rates[0]:g}"
            return f"start-up at γ̇ = {rates[0]:g}"
        return self.name


@kept_in_files
@dataclass(frozen=True)
class FlowBand:
    """σ12 (or what is recorded), N1 and N2 of one flow with their limits, in Pa.

    Of a posterior its 95 % band, of an ensemble the lowest and highest member. By quantity, shape
    (n,); not finite where no claim can be made.
    """

    middle: Mapping[str, Float[np.ndarray, " n"]]
    low: Mapping[str, Float[np.ndarray, " n"]]
    high: Mapping[str, Float[np.ndarray, " n"]]

    def half_widths(self) -> dict[str, float]:
        """Return the root-mean-square half-width of each over that of its middle, N2's of N1's."""
        found = {}
        for quantity in self.middle:
            size = np.linalg.norm(self.middle["N1" if quantity == "N2" else quantity])
            width = np.linalg.norm(self.high[quantity] - self.low[quantity])
            found[quantity] = float(0.5 * width / size) if size > 0.0 else np.nan
        return found

    def limited_to(self, quantities: Sequence[str]) -> "FlowBand":
        """Return the band with limits for some quantities alone."""

        def of(limits: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
            return {
                name: values if name in quantities else np.full_like(values, np.nan)
                for name, values in limits.items()
            }

        return replace(self, low=of(self.low), high=of(self.high))


def comparison_flows(
    data: StudyData, high_deborah: tuple[float, ...], pipkin: Sequence[tuple[float, float]] = ()
) -> list[Flow]:
    """Return the flows of a comparison: training, held out, and, with a known law, tests.

    `high_deborah`: De of the flows γ̇ = 3 cos(De t). `pipkin`: Wi and De of oscillations over which
    errors are mapped. N1 and N2 that are fitted or tested as σ12 of their run is are in its flow.
    """
    sound = {run.name: run for run in data.dataset.quantity_by_quantity()}
    flows = []
    kinds: tuple[tuple[FlowKind, Dataset, Dataset], ...] = (
        ("training", data.fit, data.held_out), ("held_out", data.held_out, data.fit)
    )  # fmt: skip
    for kind, part, other in kinds:
        known = {name: run for name, run in sound.items() if name not in other.names}
        there = {f"{run.name} ({one})" for run in part for one in run.also_recorded}
        flows += [run_flow(run, kind, data, known) for run in part if run.name not in there]
    truth = data.truth
    if truth is None:
        return flows
    times = np.linspace(0.0, TEST_DURATION, 401)
    for name, protocol in protocols.paper_test_protocols().items():
        flows.append(_truth_flow(name, "test", protocol, times, truth))
    for deborah in high_deborah:
        protocol = protocols.oscillatory_shear(HIGH_DEBORAH_AMPLITUDE, deborah)
        name, times = f"high_deborah_{deborah:g}", _late_cycle(deborah)
        flows.append(_truth_flow(name, "high_deborah", protocol, times, truth))
    for weissenberg, deborah in pipkin:
        protocol = protocols.oscillatory_shear(weissenberg, deborah)
        name, times = f"pipkin_{weissenberg:g}_{deborah:g}", _late_cycle(deborah, samples=61)
        flows.append(_truth_flow(name, "pipkin", protocol, times, truth))
    return flows


def _late_cycle(deborah: float, samples: int = 121) -> Float[np.ndarray, " n"]:
    """Return rest, and one cycle after twelve relaxation times for the transient to die out."""
    period = 2.0 * np.pi / deborah
    start = np.ceil(12.0 / period) * period
    return np.concatenate([[0.0], start + np.linspace(0.0, period, samples)])


def run_flow(run: Run, kind: FlowKind, data: StudyData, sound: Mapping[str, Run]) -> Flow:
    """Return the flow of a run of the data set.

    `sound`: records by name; what of N1 and N2 is not among them is not compared, and nan.
    """
    dataset = data.dataset
    exact = dataset.exact if isinstance(dataset, SyntheticDataset) else None
    if exact is not None:
        reference = columns_of(recorded_and_normal(run.protocol, exact[run.name].components))
    else:
        reference: dict[str, np.ndarray] = {"sigma12": run.recorded}  # in creep the strain
        for own in map(run.observing, run.also_recorded):
            if own.name in sound:
                there = np.isin(own.time, sound[own.name].time)
                reference[own.quantity] = np.where(there, own.recorded, np.nan)
    measured = run.recorded if kind == "training" else None
    return Flow(
        run.name, kind, run.protocol, run.time, run.rate, reference, measured, exact is not None
    )


def _truth_flow(name, kind, protocol, times, truth: Fluid) -> Flow:
    rates, reference = protocols.shear_rates(protocol, times), observe(truth, protocol, times)
    return Flow(name, kind, protocol, times, rates, columns_of(reference), is_truth=True)


def columns_of(observed: Float[np.ndarray, "n 3"]) -> dict[str, np.ndarray]:
    """Return the compared quantities by name."""
    return dict(zip(QUANTITIES, observed.T, strict=True))


def relative_errors(prediction: Stresses | None, reference: Stresses) -> dict[str, float | None]:
    """Return the relative L2 error of each quantity; None where it cannot be said.

    N2's is relative to N1's norm, since N2 may vanish.
    """
    errors: dict[str, float | None] = dict.fromkeys(QUANTITIES)
    if prediction is None:
        return errors
    for quantity in QUANTITIES:
        scale = reference.get("N1" if quantity == "N2" else quantity)
        if quantity not in reference or scale is None:
            continue
        told = np.isfinite(scale) & np.isfinite(reference[quantity])
        norm = float(np.linalg.norm(scale[told]))
        if norm > 0:
            difference = np.linalg.norm((prediction[quantity] - reference[quantity])[told])
            errors[quantity] = float(difference / norm)
    return errors


def of_recorded(errors: Mapping[str, float | None], flow: Flow) -> dict[str, float | None]:
    """Return errors under the names of what is recorded: the tensile stress in extension."""
    if flow.records_shear_stress:
        return dict(errors)
    return {flow.protocol.quantity: errors["sigma12"]}


def prepared(data: StudyData) -> StudyData:
    """Return data whose runs are as learners take them."""
    if data.each:
        raise InputError(
            'held_out = "each" is for close-loop; a comparison needs the names of held-out runs, '
            'such as held_out = ["fast.csv"].'
        )
    return with_runs(data, as_compared)


def thinned_to(data: StudyData, most: int) -> StudyData:
    """Return data with each value once, and at most so many of each run, evenly in their order."""
    return with_each_run(data, lambda run: thin_run(without_held_values(run), most))


def without_spikes_in_fit(data: StudyData) -> tuple[StudyData, str]:
    """Return data whose fitted runs lack outliers, and words on them; held-out runs keep theirs."""
    parts = [without_spikes(run) for run in data.fit.runs]
    told = [f"{len(times)} of {run.name}" for run, times in parts if times]
    if not told:
        return data, ""
    cleaned = {run.name: run for run, _ in parts}
    dataset, fit = (
        replace(part, runs=tuple(cleaned.get(run.name, run) for run in part.runs))
        for part in (data.dataset, data.fit)
    )
    return replace(data, dataset=dataset, fit=fit), (f"Outliers excluded: {', '.join(told)}")


def with_each_run(data: StudyData, change: Callable[[Run], Run]) -> StudyData:
    """Return data with each run changed, in every part of it."""
    return with_runs(data, lambda runs: map(change, runs))


def with_runs(data: StudyData, change: Callable[[Iterable[Run]], Iterable[Run]]) -> StudyData:
    """Return data with the runs changed together, in every part of it."""
    parts = {
        name: replace(part, runs=tuple(change(part.runs)))
        for name in ("dataset", "fit", "held_out")
        for part in [getattr(data, name)]
    }
    return replace(data, **parts)


def require_one_known_law(declared: StudyModel) -> None:
    """Refuse a known part that only a closed loop can have."""
    if declared.choice:
        raise InputError(
            "[model] law names several laws to choose from, which is for close-loop: a comparison "
            "learns what one known law lacks. Name one law, or ucm."
        )
    if declared.by_mode:
        raise InputError(
            f"[model] by_mode lets {', '.join(declared.by_mode)} differ from mode to mode, which "
            "only close-loop fits. Run discover close-loop on this study, and start from what "
            'it finds: [model] from = "its folder". Or leave by_mode out.'
        )


def true_terms(
    law: str, parameters: Mapping[str, float], known_relaxation: bool
) -> tuple[LawTerm, ...] | None:
    """Return what is missing from UCM in a named law; None if it is no sum of library terms.

    `known_relaxation`: whether −σ is known, else it is missing too. Raises InputError if there is
    no such law, or a parameter is missing or out of range.
    """
    known = make_law(law, parameters)
    try:
        found = law_terms(known)
    except InputError:
        return None
    return found if known_relaxation else (LawTerm("sigma", 1.0), *found)
