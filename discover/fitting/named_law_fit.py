"""The result of fitting one named law."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
import pandas as pd
from jaxtyping import Float

from discover.answer import QUANTITIES, TOLERANCE, Answer, Constant, Discrepancy, HasAnswer, Mode
from discover.dataset import Dataset
from discover.equations import Equation, HasEquation, equation_to_json
from discover.errors import InputError
from discover.forward import AugmentedModel, make_batch
from discover.laws import LAWS, Fluid
from discover.loop.by_quantity import of_records
from discover.loop.fitted_range import range_of
from discover.loop.runs import RunRecord
from discover.summary_view import Estimate, PageView, SummaryView
from discover.words import percent_of


@dataclass(frozen=True, eq=False)
class NamedLawFit(SummaryView, PageView, HasEquation, HasAnswer):
    """One named law fitted to runs.

    `law`: its name, as in `discover.laws`. `constants`, `covariance`: what was fitted, and its
    covariance as fitted (moduli and times as logarithms), (p, p). `fixed`: constants of the law
    that were not fitted, by name. `effects`: values of fitted and
    declared effects, by name. `fits_to_the_noise`, `noise`: whether what the fit leaves of the runs
    is noise, and relative noise, mean over the runs. `discrepancy`: size of what the fit leaves
    besides; None where nothing is said. `records`: the runs, measured and predicted, those held out
    among them. `model`, `theta`: the forward model and its parameter vector. `written`: the law as
    an equation; None where it cannot be written out. `title`: name of the data. `tolerance`:
    relative discrepancy that is good enough. `temperature_C`: of the fitted runs; None where they
    have several or none, or are shifted.
    """

    law: str
    constants: tuple[Estimate, ...]
    covariance: Float[np.ndarray, "p p"]
    fluid: Fluid
    effects: Mapping[str, tuple[float, ...]]
    fits_to_the_noise: bool
    noise: float
    discrepancy: Discrepancy | None
    records: tuple[RunRecord, ...]
    model: AugmentedModel
    theta: Float[np.ndarray, " all"]
    written: Equation | None = None
    fixed: Mapping[str, float] = field(default_factory=dict)
    title: str = ""
    tolerance: float = TOLERANCE
    temperature_C: float | None = None
    unfitted: tuple[RunRecord, ...] = ()  # N1 and N2 that the runs recorded as well

    _page: ClassVar[str] = "discover.report.in_memory:fit_page"

    @property
    def error(self) -> float:
        """Relative error, mean over the fitted runs."""
        return float(np.mean([one.errors[0] for one in self.records if not one.held_out]))

    @property
    def held_out_error(self) -> float | None:
        """Relative error, mean over the runs held out; None without any."""
        held = [one.errors[0] for one in self.records if one.held_out]
        return float(np.mean(held)) if held else None

    def _estimates(self) -> tuple[Estimate, ...]:
        return self.constants

    @property
    def correlation(self) -> pd.DataFrame:
        """Correlation matrix of the constants; beyond ±0.95 only a combination is determined."""
        deviation = np.sqrt(np.diag(self.covariance))
        scale = np.where(deviation > 0.0, deviation, 1.0)
        matrix = self.covariance / np.outer(scale, scale)
        index = self._index_of(self._estimates())
        return pd.DataFrame(matrix, index=index, columns=index)

    def predict(self, data: Dataset) -> Float[np.ndarray, " rows"]:
        """Return stress in Pa, of creep the strain, at the samples of all runs in their order."""
        if not isinstance(data, Dataset):
            raise InputError(
                f"predict needs a data set; got a {type(data).__name__}. Load one with "
                "dc.load_dataset."
            )
        predicted = self.model.predict(self.theta, make_batch(data.runs))
        return np.concatenate(
            [row[: len(run)] for run, row in zip(data.runs, predicted, strict=True)]
        )

    def to_dataframe(self) -> pd.DataFrame:
        """Return the relative error of each run, one line a run."""
        lines = [
            {"run": one.name, "held_out": one.held_out, "error": float(one.errors[0])}
            for one in self.records
        ]
        return pd.DataFrame(lines)

    def equation(self) -> Equation:
        """Return the fitted law with its modes; raises InputError if it has no written form."""
        if self.written is None:
            raise InputError(f"{LAWS[self.law].title} cannot be written out as an equation.")
        return replace(self.written, solvent_viscosity=float(self.fluid.solvent_viscosity))

    @cached_property
    def answer(self) -> Answer:
        """The law with its constants, how well it describes the runs, and where."""
        equation = self.written and self.equation()
        law = LAWS[self.law]
        records = (*self.records, *self.unfitted)
        expected = {name: of_records(records, name, self.noise) for name in QUANTITIES}
        modes = np.asarray(self.fluid.modulus), np.asarray(self.fluid.relaxation_time)
        answer = Answer(
            law.title,
            self.law,
            (
                *(Constant(name, value) for name, value in self.fixed.items()),
                *(Constant(one.key[0], one.value, one.ci95, one.unit) for one in self.constants),
            ),
            tuple(Mode(float(modulus), float(time)) for modulus, time in zip(*modes, strict=True)),
            float(self.fluid.solvent_viscosity),
            self.error,
            self.noise,
            self.fits_to_the_noise,
            None if self.fits_to_the_noise else self.discrepancy,
            range_of(self.records, equation),
            {name: one for name, one in expected.items() if one is not None},
            failed=self._caveats(),
            tolerance=self.tolerance,
            temperature_C=self.temperature_C,
        )
        if equation is None:
            return answer
        return replace(answer, equation=replace(equation, notes=(*equation.notes, *answer.lines)))

    def _caveats(self) -> str:
        """Return what a reader of the intervals has to know."""
        said = []
        if not self.fits_to_the_noise:
            said.append("The misfit is systematic; the intervals hold the noise only.")
        bound = [one.key[0] for one in self.constants if one.notes["at_bound"]]
        if bound:
            said.append(f"At an end of its range: {', '.join(bound)}.")
        return " ".join(said)

    def to_json(self) -> dict[str, Any]:
        """Return the fit as ``fit.json`` holds it."""
        equation = self.answer.equation
        return {
            "law": self.law,
            **self.answer.to_json(),
            "answer_law": None if equation is None else equation_to_json(equation),
            "adequate_to_the_noise": self.fits_to_the_noise,
            "error": {"fit": self.error, "held_out": self.held_out_error},
            "noise": self.noise,
            "effects": {name: list(values) for name, values in self.effects.items()},
            "correlation": self.correlation.to_dict(),
            "runs": self.to_dataframe().to_dict("records"),
        }

    @cached_property
    def text(self) -> str:
        """The fit in a few sentences."""
        if self.held_out_error is None:
            return self.answer.headline
        return f"{self.answer.headline} Held-out runs: {percent_of(self.held_out_error)}."

    def __repr__(self) -> str:
        return f"<{type(self).__name__}: {self.text}>"

    def _shown(self):
        yield self.text
        yield self.summary().reset_index()
        yield self.to_dataframe()
