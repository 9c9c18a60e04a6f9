"""Runs and data sets as the rest of the software sees them: SI units, checked."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, overload

import numpy as np
import pandas as pd
from jaxtyping import Float

from discover.errors import InputError
from discover.notebook_view import NotebookView
from discover.protocols.history import after_steady_flow
from discover.protocols.kinematics import FlowKind
from discover.protocols.shear import ShearProtocol

if TYPE_CHECKING:
    from discover.dataset.linear_viscoelasticity import RelaxationSpectrum

SLOWEST_RATE = 1e-12
"""In 1/s; slower is rest, for any instrument and any experimenter."""


@dataclass(frozen=True)
class ShearRun:
    """One experiment in shear or in extension.

    In extension the rate is the Hencky rate, the stress the tensile stress σ11 − σ22, and the
    strain the Hencky strain; biaxial rate and stress are those of one of the two equal directions.

    Attributes
    ----------
    name
        File name, or name of the protocol.
    time
        Sampling times in s, shape (n,), increasing, from the start of the flow at 0.
    protocol
        The rate as a function of time, commanded or measured, which flow has it, and what came
        before t = 0.
    shear_rate
        Rate at the sampling times, in 1/s, shape (n,).
    shear_stress
        The stress recorded, in Pa, shape (n,): σ12 in shear.
    first_normal_stress_difference, second_normal_stress_difference
        N1 and N2 in Pa, shape (n,), where measured.
    strain
        Strain at the sampling times, where recorded; computed from the rate otherwise.
    clock_factor
        Time on the instrument's clock is ``time / clock_factor``; differs from one for data that
        were shifted to another temperature.
    rate_is_measured
        Whether the shear rate was measured, or derived from measured strain, and not commanded.
    rate_before
        Rate in 1/s of the steady flow before t = 0, which becomes part of the protocol; zero where
        there was none.
    strain_before
        Strain, added up without regard to its sign, that the same sample had seen in earlier runs.
    metadata
        What else the source says of the run.
    """

    name: str
    time: Float[np.ndarray, " _"]
    protocol: ShearProtocol
    shear_rate: Float[np.ndarray, " _"]
    shear_stress: Float[np.ndarray, " _"]
    first_normal_stress_difference: Float[np.ndarray, " _"] | None = None
    second_normal_stress_difference: Float[np.ndarray, " _"] | None = None
    strain: Float[np.ndarray, " _"] | None = None
    clock_factor: float = 1.0
    rate_is_measured: bool = False
    rate_before: float = 0.0
    strain_before: float = 0.0
    metadata: Mapping[str, float | str] = field(default_factory=dict)

    def __post_init__(self):
        # shapes are checked here, not by annotation: users build runs by hand
        n = self.time.shape[0] if self.time.ndim == 1 else 0
        if n == 0:
            raise InputError(f"The run {self.name!r} has no samples; give at least one.")
        for label, values in (
            ("time", self.time),
            ("shear_rate", self.shear_rate),
            ("shear_stress", self.shear_stress),
            ("first_normal_stress_difference", self.first_normal_stress_difference),
            ("second_normal_stress_difference", self.second_normal_stress_difference),
            ("strain", self.strain),
        ):
            if values is None:
                continue
            if values.shape != (n,):
                raise InputError(
                    f"{label} of the run {self.name!r} must have shape ({n},) like its time; got "
                    f"{values.shape}."
                )
            if not np.all(np.isfinite(values)):
                row = int(np.argmin(np.isfinite(values)))
                raise InputError(
                    f"{label} of the run {self.name!r} must be finite; sample {row} holds "
                    f"{values[row]}. Remove that sample."
                )
        if self.time[0] < 0 or np.any(np.diff(self.time) <= 0):
            raise InputError(
                f"time of the run {self.name!r} must start at or after 0 and increase strictly. "
                "Sort the samples and remove repeated times."
            )
        if not self.clock_factor > 0:
            raise InputError(
                f"The clock factor of the run {self.name!r} must be positive; got "
                f"{self.clock_factor}."
            )
        if not np.isfinite(self.rate_before):
            raise InputError(
                f"The shear rate before the run {self.name!r} must be finite; got "
                f"{self.rate_before}. Give 0 for a run from rest."
            )
        if self.rate_before != 0.0 and self.from_rest and self.time[-1] > 0.0:
            begun = after_steady_flow(self.protocol, self.rate_before, float(self.time[-1]))
            object.__setattr__(self, "protocol", begun)

    def __len__(self) -> int:
        return self.time.shape[0]

    def __repr__(self) -> str:
        kinds = [name for name, values in self._recorded().items() if values is not None]
        span = f"{self.time[0]:.4g} to {self.time[-1]:.4g} s"
        return f"<ShearRun {self.name!r}: {len(self)} samples, {span}, {', '.join(kinds)}>"

    def _recorded(self) -> dict[str, np.ndarray | None]:
        in_shear = self.flow == "shear"
        return {
            "time_s": self.time,
            "shear_rate_1_s" if in_shear else "hencky_rate_1_s": self.shear_rate,
            "stress_Pa" if in_shear else "tensile_stress_Pa": self.shear_stress,
            "N1_Pa": self.first_normal_stress_difference,
            "N2_Pa": self.second_normal_stress_difference,
            "strain" if in_shear else "hencky_strain": self.strain,
        }

    def to_dataframe(self) -> pd.DataFrame:
        """Return the samples, one line each, in the columns of a data folder's files."""
        columns = {name: values for name, values in self._recorded().items() if values is not None}
        return pd.DataFrame(columns)

    @property
    def flow(self) -> FlowKind:
        """Which flow it is: ``shear``, ``uniaxial``, ``planar`` or ``biaxial``."""
        return self.protocol.flow

    @property
    def from_rest(self) -> bool:
        """Whether the fluid is taken to be at rest until t = 0."""
        return float(self.protocol.begins) == 0.0

    @property
    def flows(self) -> bool:
        """Whether anything flows in the run, or did just before it."""
        return not self.from_rest or bool(np.max(np.abs(self.shear_rate)) > SLOWEST_RATE)

    def window(self, keep: np.ndarray) -> "ShearRun":
        """Return the run with only the samples where the boolean array `keep` holds.

        The flow's history is unchanged: it is the protocol's, from t = 0.
        """

        def cut(values):
            return None if values is None else values[keep]

        return replace(
            self,
            time=self.time[keep],
            shear_rate=self.shear_rate[keep],
            shear_stress=self.shear_stress[keep],
            first_normal_stress_difference=cut(self.first_normal_stress_difference),
            second_normal_stress_difference=cut(self.second_normal_stress_difference),
            strain=cut(self.strain),
        )


def same_samples(one: ShearRun, other: ShearRun) -> bool:
    """Return whether two runs hold the same times and stresses, under whatever names."""
    return np.array_equal(one.time, other.time) and np.array_equal(
        one.shear_stress, other.shear_stress
    )


def require_signal(runs: Sequence[ShearRun]) -> None:
    """Refuse runs of which none can teach a law.

    Raises
    ------
    InputError
        If nothing flows in any of them, or no stress is anything but zero.
    """
    names = ", ".join(run.name for run in runs[:3]) + (" …" if len(runs) > 3 else "")
    if runs and not any(run.flows for run in runs):
        raise InputError(
            f"The shear rate is zero in every run ({names}), so there is nothing to learn a law "
            "from. Add runs with flow, or check the unit of the column."
        )
    if runs and not any(np.any(run.shear_stress) for run in runs):
        raise InputError(
            f"The stress is zero throughout in every run ({names}), so there is nothing to learn a "
            "law from. Check the column."
        )


@dataclass(frozen=True)
class LinearSweep:
    """Small-amplitude oscillatory shear: G′ and G″ against frequency.

    Attributes
    ----------
    angular_frequency
        In rad/s, shape (n,), increasing.
    storage_modulus, loss_modulus
        In Pa, shape (n,).
    thinned
        How it was thinned when it was read, in words; empty if it was not.
    """

    angular_frequency: Float[np.ndarray, " n"]
    storage_modulus: Float[np.ndarray, " n"]
    loss_modulus: Float[np.ndarray, " n"]
    thinned: str = ""

    def __len__(self) -> int:
        return self.angular_frequency.shape[0]

    def __repr__(self) -> str:
        omega = self.angular_frequency
        span = f", {omega[0]:.4g} to {omega[-1]:.4g} rad/s" if len(self) else ""
        return f"<LinearSweep: {len(self)} frequencies{span}>"

    def relaxation_spectrum(self, **options: Any) -> "RelaxationSpectrum":
        """Return the modes of this sweep.

        Parameters
        ----------
        **options
            `most_modes` and `tolerance` of `discover.dataset.relaxation_spectrum`.
        """
        from discover.dataset.linear_viscoelasticity import relaxation_spectrum

        return relaxation_spectrum(self, **options)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the sweep, one line for each frequency, in the columns of ``lve.csv``."""
        return pd.DataFrame(
            {
                "omega_rad_s": self.angular_frequency,
                "Gp_Pa": self.storage_modulus,
                "Gpp_Pa": self.loss_modulus,
            }
        )


@dataclass(frozen=True)
class ShearDataset(NotebookView):
    """Runs on one fluid: a sequence of runs, for Python and for scikit-learn.

    ``data["a.csv"]`` and ``data[0]`` are a run; ``data[:3]``, ``data[[0, 2]]`` and
    ``data[["a.csv", "b.csv"]]`` are data sets, and so is what a boolean array chooses.

    Attributes
    ----------
    name
        Name of the folder, or of the synthetic study.
    runs
        The runs.
    linear_sweep
        Small-amplitude data on the same fluid, where there are any.
    provenance
        Where the data come from, in words.
    set_aside
        Runs of the folder that cannot be fitted, by name, with the reason.
    """

    name: str
    runs: tuple[ShearRun, ...]
    linear_sweep: LinearSweep | None = None
    provenance: str = ""
    set_aside: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self):
        names = [run.name for run in self.runs]
        repeated = {name for name in names if names.count(name) > 1}
        if repeated:
            raise InputError(
                f"The data set {self.name!r} holds the run {sorted(repeated)[0]!r} twice."
            )

    def __len__(self) -> int:
        return len(self.runs)

    def __iter__(self) -> Iterator[ShearRun]:
        return iter(self.runs)

    def __repr__(self) -> str:
        sweep = "" if self.linear_sweep is None else ", linear sweep"
        samples = sum(len(run) for run in self.runs)
        kind = type(self).__name__
        return f"<{kind} {self.name!r}: {len(self)} runs, {samples} samples{sweep}>"

    @overload
    def __getitem__(self, which: str | int | np.integer) -> ShearRun: ...

    @overload
    def __getitem__(self, which: slice | Sequence[Any] | np.ndarray) -> "ShearDataset": ...

    def __getitem__(self, which: Any) -> "ShearRun | ShearDataset":
        if isinstance(which, str):
            return self._named(which)
        if isinstance(which, slice):
            return replace(self, runs=self.runs[which])
        chosen = np.asarray(which)
        if chosen.ndim == 0 and np.issubdtype(chosen.dtype, np.integer):
            return self._numbered(int(chosen))
        if chosen.ndim == 1 and (chosen.size == 0 or chosen.dtype.kind in "iu"):
            return replace(self, runs=tuple(self._numbered(int(i)) for i in chosen))
        if chosen.ndim == 1 and chosen.dtype.kind == "U":
            return self.select([str(name) for name in chosen])
        if chosen.dtype == bool and chosen.shape == (len(self),):
            return replace(self, runs=tuple(self.runs[i] for i in np.flatnonzero(chosen)))
        raise InputError(
            f"A run of the data set {self.name!r} is chosen by its name or number, several by a "
            f"slice, by names, by numbers, or by {len(self)} booleans; got {which!r}."
        )

    def _named(self, name: str) -> ShearRun:
        for run in self.runs:
            if run.name == name:
                return run
        if name in self.set_aside:
            raise InputError(
                f"The run {name!r} of {self.name!r} cannot be used: {self.set_aside[name]}. Name "
                "another."
            )
        raise InputError(
            f"The data set {self.name!r} has no run {name!r}; it has {', '.join(self.names)}."
        )

    def _numbered(self, number: int) -> ShearRun:
        if not -len(self) <= number < len(self):
            # an IndexError: it ends a loop over the numbers of a sequence
            raise IndexError(
                f"The data set {self.name!r} has {len(self)} runs; there is no number {number}."
            )
        return self.runs[number]

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the runs."""
        return tuple(run.name for run in self.runs)

    @property
    def thinned(self) -> str:
        """What was thinned when it was read, in sentences; empty if nothing was."""
        said = [
            (run.name, run.metadata["thinned"]) for run in self.runs if "thinned" in run.metadata
        ]
        if self.linear_sweep is not None and self.linear_sweep.thinned:
            said.append(("the linear sweep", self.linear_sweep.thinned))
        return " ".join(f"{name}: {text}." for name, text in said)

    @property
    def left_out(self) -> str:
        """Which runs were set aside and why, in sentences, one for each reason."""
        reasons: dict[str, list[str]] = {}
        for name, reason in self.set_aside.items():
            reasons.setdefault(reason, []).append(name)
        return " ".join(
            f"{names[0]} is set aside: {reason}."
            if len(names) == 1
            else f"{names[0]} and {len(names) - 1} more runs like it are set aside: {reason}."
            for reason, names in reasons.items()
        )

    def table(self) -> pd.DataFrame:
        """Return the runs as a table, one line each; units are in the names of the columns."""
        from discover.dataset.run_table import run_line

        return pd.DataFrame([run_line(run) for run in self.runs])

    def _shown(self) -> Iterable[Any]:
        sweep = self.linear_sweep
        points = 0 if sweep is None else len(sweep.angular_frequency)
        linear = f"a linear sweep of {points} points" if points else "no linear sweep"
        first = next(iter(self.provenance.splitlines()), "")
        yield f"{self.name}: {len(self)} runs, {linear}. {first}".strip()
        table = self.table()
        for name in ("N1", "N2") if len(self) else ():
            table[name] = ["measured" if there else None for there in table[name]]
        yield table
        yield self.thinned
        yield self.left_out

    def select(self, names: Sequence[str]) -> "ShearDataset":
        """Return the data set of the named runs, in the order given.

        Raises
        ------
        InputError
            If a run does not exist.
        """
        return replace(self, runs=tuple(self._named(name) for name in names))

    def split(
        self, held_out: Sequence[str], fit: Sequence[str] | None = None
    ) -> "tuple[ShearDataset, ShearDataset]":
        """Return the runs to fit and those that only judge, as two data sets.

        Parameters
        ----------
        held_out
            Names of the runs that no fit may see.
        fit
            Names of the runs to fit; by default all others.

        Raises
        ------
        InputError
            If a run does not exist or is in both, or one of the two would be empty.
        """
        for label, names in (("held_out", held_out), ("fit", fit)):
            if isinstance(names, str):
                raise InputError(
                    f"{label} must be a list of names; got {names!r}. Write [{names!r}]."
                )
        test = self.select(list(held_out))
        train = self.select([n for n in self.names if n not in held_out] if fit is None else fit)
        both = set(train.names) & set(test.names)
        if both:
            raise InputError(f"The run {sorted(both)[0]!r} is both in fit and in held_out.")
        if not len(train) or not len(test):
            empty = "fit" if not len(train) else "hold out"
            raise InputError(
                f"No run is left to {empty}; the data set {self.name!r} has "
                f"{', '.join(self.names)}. Divide them."
            )
        return train, test

    def to_dataframe(self) -> pd.DataFrame:
        """Return all samples, one line each: the column ``run``, then those of its file."""
        table = pd.concat(
            [run.to_dataframe().assign(run=run.name) for run in self.runs], ignore_index=True
        )
        table.insert(0, "run", table.pop("run"))
        return table
