"""Base of the estimators: what they are fitted to, prediction, score, law, file."""

import html
from abc import abstractmethod
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

import numpy as np
from jaxtyping import Float
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.utils.validation import check_is_fitted

from discover.dataset.records.thinning import without_spikes
from discover.dataset.run import Run
from discover.forward import make_batch
from discover.forward.of_fluids import followed, observed, pieces_in_time
from discover.learners.files import Provenance, provenance_of, write_estimator
from discover.learners.lack_of_fit import LackOfFit, lack_of_fit
from discover.learners.results import estimates_of
from discover.learners.settings import (
    as_runs,
    check_settings,
    known_part,
    require_known_rate,
    require_signal,
)
from discover.processor import in_one_thread
from discover.summary_view import Estimate, SummaryView
from tensor_library.law_terms import spell

if TYPE_CHECKING:
    from discover.equations import Equation
    from discover.laws.multimode import Fluid
    from discover.learners.results import LearnerResult

_Learner = TypeVar(
    "_Learner", bound="RunPrediction"
)  # not Self, which the tests' hook cannot check


_STRAIN_STEP = 0.2
"""Largest strain of a step."""


class RunPrediction(SummaryView, RegressorMixin, BaseEstimator):
    """What is common to estimators: what they are fitted to, prediction, score, law, file."""

    base: "Fluid | None"
    fluid_: "Fluid"
    result_: "LearnerResult"
    runs_: tuple[Run, ...]
    provenance_: Provenance

    learner: ClassVar[str]
    """Name of the learner, in files and tables."""

    _saved: ClassVar[tuple[str, ...]] = (
        "n_features_in_", "law_", "fluid_", "terms_", "result_", "provenance_",
    )  # fmt: skip
    """Attributes of the fit that a file holds."""

    _index = ("term",)

    @in_one_thread
    def fit(self: _Learner, X: Iterable[Run], y=None) -> _Learner:
        """Find the law of runs `X`, or of a data set, without outliers; `y` is ignored.

        Raises InputError if a parameter or a run is unusable.
        """
        del y
        check_settings(self.get_params(deep=False))
        self._check_parameters()
        known = known_part(self.base)
        # once, for it may be read only once
        whole = as_runs(X, known.relaxation_time, known.law.linear_relaxation)
        runs = [without_spikes(run)[0] for run in whole]
        require_signal(runs)
        require_known_rate(known, runs)
        self._left = None
        self._learn(runs, known)
        self.n_features_in_ = 1
        self.runs_ = tuple(runs)
        self.provenance_ = provenance_of(X, runs)
        return self

    @property
    def equation_(self) -> "Equation":
        """Law with its modes as an equation; of a network its projection on the library."""
        check_is_fitted(self, "result_")
        return replace(
            self.result_.equation(),
            modulus=tuple(map(float, self.fluid_.modulus)),
            relaxation_time=tuple(map(float, self.fluid_.relaxation_time)),
            solvent_viscosity=float(self.fluid_.solvent_viscosity),
        )

    @property
    def lack_of_fit_(self) -> LackOfFit | None:
        """Lack of fit to the fitted runs; None of a file that does not say."""
        check_is_fitted(self, "fluid_")
        if getattr(self, "_left", None) is None and hasattr(self, "runs_"):
            errors = known_part(self.base).modulus_covariance
            self._left = lack_of_fit(replace(self.fluid_, modulus_covariance=errors), self.runs_)
        return self._left

    @property
    def text(self) -> str:
        """Law, how well it describes the fitted runs, and which terms are determined."""
        terms = self.result_.terms
        law = spell({term.term: term.coefficient for term in terms}) if terms else "no term"
        said = [f"h = {law}."]
        if self.base is None:
            said.append("No base was given: upper-convected Maxwell, G = 1 Pa, λ = 1 s is assumed.")
        left = self.lack_of_fit_
        if left is not None:
            said.append(left.described)
        if terms and left is not None and left.verdict != "explained":
            said.append(f"{self._empirical} No term is determined.")
        elif terms and self._tells_terms:
            sure = [
                one.key[0] for one in self._estimates() if one.notes["determined"].startswith("yes")
            ]
            said.append(f"Determined, if the law is in the library: {', '.join(sure) or 'none'}.")
        return " ".join(said)

    _empirical: ClassVar[str] = "The terms are an empirical fit, not an identified law."

    @property
    def _tells_terms(self) -> bool:
        return any(term.ci95 is not None for term in self.result_.terms)

    def _estimates(self) -> list[Estimate]:
        check_is_fitted(self, "result_")
        rivals = [row["support"] for row in self.result_.details.get("rivals", ())]
        return estimates_of(self.result_.terms, self.lack_of_fit_, rivals)

    def __repr__(self, N_CHAR_MAX: int = 700) -> str:
        if not hasattr(self, "result_"):
            return super().__repr__(N_CHAR_MAX)
        return f"<{type(self).__name__}: {self.text}>"

    def _shown(self) -> Iterable[Any]:
        yield self.text
        yield self.equation_
        yield self.summary().reset_index()

    def _repr_html_(self) -> str:
        if not hasattr(self, "result_"):
            return f"<pre>{html.escape(repr(self))}</pre>"
        return super()._repr_html_()

    def _repr_mimebundle_(self, **options: Any) -> dict[str, str]:
        # what scikit-learn shows of an estimator is its parameters
        del options
        return {"text/plain": repr(self), "text/html": self._repr_html_()}

    def save(self, path: str | Path) -> Path:
        """Write the fitted estimator to one file, without pickle; `discover.load` reads it.

        It holds parameters (but `progress`), modes, law, terms and provenance, no data.

        Parameters
        ----------
        path
            The file, such as ``law.discover``; replaced whole or not at all.

        Raises
        ------
        InputError
            If a parameter or a law cannot be written without pickle.
        """
        check_is_fitted(self, "result_")
        parameters: Mapping[str, Any] = self.get_params(deep=False)
        return write_estimator(
            path,
            self.learner,
            {name: value for name, value in parameters.items() if name != "progress"},
            {name: getattr(self, name) for name in (*self._saved, "lack_of_fit_")},
        )

    def _with_fit(self: _Learner, fitted: Mapping[str, Any]) -> _Learner:
        """Return the estimator with attributes of a fit that a file held."""
        for name in self._saved:
            setattr(self, name, fitted[name])
        self._left = fitted.get("lack_of_fit_")
        return self

    def predict(self, X: Iterable[Run]) -> Float[np.ndarray, " rows"]:
        """Return what is recorded at the samples of all runs, one run after the other.

        σ12 in Pa, in extension the tensile stress; of creep the strain, of a sweep G′ and then G″.

        Parameters
        ----------
        X
            Runs or a data set; of their records only an imposed stress is used.

        Raises
        ------
        NotFittedError
            If nothing was fitted yet.
        InputError
            If a run is unusable.
        """
        check_is_fitted(self, "fluid_")
        return np.concatenate(self._predict_runs(self._runs(X)))

    def score(self, X: Iterable[Run], y=None, sample_weight=None) -> float:
        """Return one minus the relative error of what is recorded, averaged over runs.

        The error of a run is rms of prediction minus measurement over rms of the measurement: 1 is
        perfect, 0 predicts nothing, and a law that diverges scores minus infinity. Unlike R² it
        does not depend on the mean of an oscillating signal.

        Parameters
        ----------
        X
            Runs or a data set, such as one that no fit saw.
        y, sample_weight
            Ignored; scikit-learn passes them.
        """
        del y, sample_weight
        check_is_fitted(self, "fluid_")
        runs = self._runs(X)
        errors = [
            np.sqrt(np.mean((p - run.recorded) ** 2) / np.mean(run.recorded**2))
            for p, run in zip(self._predict_runs(runs), runs, strict=True)
        ]
        error = float(np.mean(errors))
        return 1.0 - error if np.isfinite(error) else -np.inf

    def _runs(self, X: Iterable[Run]) -> list[Run]:
        fluid = self.fluid_
        return as_runs(X, fluid.relaxation_time, fluid.law.linear_relaxation)

    def _check_parameters(self) -> None:
        """Refuse parameters that only this learner has."""

    @abstractmethod
    def _learn(self, runs: list[Run], known: "Fluid") -> None:
        """Find the law: set the attributes of the fit but those that tell of the runs."""

    def _predict_runs(self, runs: list[Run]) -> list[Float[np.ndarray, " n"]]:
        """Return what is recorded of each run."""
        fluid = self.fluid_
        runs = [followed(fluid, run) for run in runs]
        pieces = pieces_in_time(fluid, runs, _STRAIN_STEP)
        found = observed([fluid], make_batch(runs, _STRAIN_STEP, pieces=pieces))[0]
        return [rows[: len(run), 0] for run, rows in zip(runs, found, strict=True)]
