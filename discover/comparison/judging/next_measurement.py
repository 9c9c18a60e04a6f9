"""After a comparison: bands on the test flows, and what to measure next."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify.design.experiments import OBSERVED, candidate_experiments
from discover.identify.design.next_experiment import Proposal, propose_experiments, rank
from discover.identify.rivals.bands import PredictionBand, prediction_bands
from discover.identify.side_by_side.many_laws import Contender, fluid_of, predict_laws
from discover.identify.soundness.physics_flows import time_scale
from discover.laws.multimode import Fluid
from discover.learners.trajectories.modulus_errors import ModulusErrors
from discover.protocols import another_between_samples
from discover.study.compare_section import NextExperiment
from tensor_library.law_terms import LawTerms

LEAST_NOISE = 0.01
"""Relative noise assumed of the next experiment where the data at hand show less."""

_MOST_RIVALS = 6
_MOST_DRAWS = 40
_SHOWN = 5
_GUESSED = 2.0  # a curve through samples is a guess, which falls short at the crests


@dataclass(frozen=True)
class IdentifiabilityCell:
    """What one oscillation would tell of the rivals.

    Attributes
    ----------
    weissenberg, deborah
        Its place on the Pipkin diagram.
    observed
        What would be measured.
    difference
        Root-mean-square difference of each quantity between the chosen law and the rival furthest
        from it, relative to the chosen law's; N2's is relative to N1. None where a rival runs
        away.
    decides
        Whether it is expected to rule out every rival, readjusted within its intervals.
    """

    weissenberg: float
    deborah: float
    observed: tuple[str, ...]
    difference: Mapping[str, float | None]
    decides: bool

    @classmethod
    def of(cls, proposal: Proposal) -> "IdentifiabilityCell":
        """Return the cell of an oscillation."""
        if proposal.experiment.pipkin is None:
            raise ValueError(f"{proposal.experiment.title} is no oscillation.")
        chosen, rivals = proposal.curves[0], proposal.curves[1:]
        size = np.sqrt(np.mean(chosen**2, axis=0))
        size[2] = size[1]
        with np.errstate(over="ignore", invalid="ignore"):  # a rival may run away
            apart = np.sqrt(np.mean((rivals - chosen) ** 2, axis=1))
        furthest = np.max(apart, axis=0, initial=0.0)
        share = furthest / np.maximum(size, 1e-300)
        difference = {
            name: float(value) if np.isfinite(value) else None
            for name, value in zip(OBSERVED, share, strict=True)
        }
        decides = len(proposal.falling) == len(proposal.evidence)
        return cls(*proposal.experiment.pipkin, proposal.observed, difference, decides)


@dataclass(frozen=True)
class NextMeasurement:
    """What the laws that remain leave open, and what would close it.

    Attributes
    ----------
    laws
        Names of the laws, the chosen one first.
    proposals
        The best experiments, best first; empty where no rival is known.
    bands
        By the key of the flow.
    noise
        Relative noise that the evidence assumes.
    oscillations
        What every oscillation of the candidates would decide, in any order.
    """

    laws: tuple[str, ...] = ()
    proposals: Sequence[Proposal] = ()
    bands: Mapping[str, PredictionBand] = field(default_factory=dict)
    noise: float = LEAST_NOISE
    oscillations: Sequence[Proposal] = ()

    def to_json(self) -> dict[str, Any]:
        """Return everything but the curves."""
        return {
            "laws": self.laws,
            "noise": self.noise,
            "proposals": self.proposals,
            "bands": self.bands,
            "pipkin": [
                {
                    "Wi": cell.weissenberg,
                    "De": cell.deborah,
                    "observed": cell.observed,
                    "difference": cell.difference,
                    "decides": cell.decides,
                }
                for cell in self.identifiability()
            ],
        }

    def identifiability(self) -> list["IdentifiabilityCell"]:
        """Return what each oscillation would tell of the rivals, over the Pipkin diagram."""
        return [IdentifiabilityCell.of(proposal) for proposal in self.oscillations]


def bands_of_law(
    outcome: LearnerOutcome,
    rivals: Iterable[LawTerms],
    declared: Fluid,
    flows: Sequence[Flow],
    seed: int = 0,
) -> dict[str, PredictionBand]:
    """Return the bands of the law that sparse regression chose, by the key of the flow.

    Parameters
    ----------
    rivals
        Laws, closest first.
    declared
        The known part.
    flows
        Flows to draw bands for.
    seed
        Of the draws from the parameters' uncertainty.
    """
    if not flows:
        return {}
    chosen, others = contenders(outcome, rivals)
    found = prediction_bands(
        chosen,
        others,
        declared,
        [flow.protocol for flow in flows],
        [flow.times for flow in flows],
        n_draws=_MOST_DRAWS,
        seed=seed,
    )
    found = _with_sampled_rates(found, chosen, declared, flows)
    return {flow.key: band for flow, band in zip(flows, found, strict=True)}


def next_measurement(
    outcome: LearnerOutcome,
    rivals: Iterable[LawTerms],
    declared: Fluid,
    options: NextExperiment,
    seed: int = 0,
    misfit: float | None = None,
) -> NextMeasurement:
    """Return proposals for the law that sparse regression chose; its bands are none yet.

    Parameters
    ----------
    outcome, rivals, declared, seed
        As in `bands_of_law`.
    options
        What the user could run.
    misfit
        Relative error of the law without outliers, where there are any.
    """
    chosen, others = contenders(outcome, rivals)
    misfit = float(outcome.details.get("misfit") or 0.0) if misfit is None else misfit
    noise = options.noise or max(misfit, LEAST_NOISE)
    proposals = []
    if others:
        experiments = candidate_experiments(
            time_scale(declared),
            options.flows,
            options.weissenberg_numbers,
            options.deborah_numbers,
            float(np.sum(declared.modulus)),
        )
        quick = [one for one in experiments if one.in_transient_shear or not one.in_shear]
        slow = [one for one in experiments if one not in quick]
        for some in (quick, slow):
            found = propose_experiments(
                chosen, others, declared, some, noise, options.observe, seed=seed
            )
            proposals = sorted([*proposals, *found], key=rank)
            # states and creep, which are solved for, are asked where nothing else decides
            if proposals and len(proposals[0].falling) == len(others):
                break
    names = (chosen.name, *(law.name for law in others))
    oscillations = [p for p in proposals if p.experiment.pipkin is not None]
    return NextMeasurement(names, proposals[:_SHOWN], noise=noise, oscillations=oscillations)


def _with_sampled_rates(
    bands: Sequence[PredictionBand], chosen: Contender, declared: Fluid, flows: Sequence[Flow]
) -> list[PredictionBand]:
    """Return bands that hold for rates that are known at the samples only, too.

    Each limit gives way by twice the most that changes along the run where the rate is another
    curve through its samples: at which sample nobody knows.
    """
    made = ((i, another_between_samples(flow.protocol, flow.times)) for i, flow in enumerate(flows))
    smooth = {i: protocol for i, protocol in made if protocol is not None}
    found = list(bands)
    if not smooth:
        return found
    times = [flows[i].times for i in smooth]
    other = predict_laws(fluid_of([chosen], declared), list(smooth.values()), times)[0]
    for i, predicted in zip(smooth, other, strict=True):
        band = bands[i]
        change = np.max(np.abs(predicted[: len(band.times)] - band.chosen), axis=0)
        change *= _GUESSED
        found[i] = replace(
            band,
            low=band.low - change,
            high=band.high + change,
            rivals_low=band.rivals_low - change,
            rivals_high=band.rivals_high + change,
        )
    return found


def contenders(
    outcome: LearnerOutcome, rivals: Iterable[LawTerms]
) -> tuple[Contender, list[Contender]]:
    """Return the chosen law and its rivals, with the covariances that the search knows."""
    details = outcome.details
    known = [(LawTerms.from_json(row), row) for row in details.get("rivals", ())]
    others = []
    for rival in list(rivals)[:_MOST_RIVALS]:
        same = (one for one in known if one[0].coefficients == rival.coefficients)
        others.append(_contender(*next(same, (rival, {}))))
    return _contender(LawTerms.of(outcome.terms), details), others


def _contender(law: LawTerms, row: Mapping[str, Any]) -> Contender:
    return Contender(law_name(law), law, **_uncertainty(row, len(law.values)))


def law_name(law: LawTerms) -> str:
    """Return a law as the sum of its terms, for tables."""
    text = " ".join(f"{value:+.3g} {name}" for name, value in law.coefficients.items())
    return text.removeprefix("+") or "no term"


def _uncertainty(row: Mapping[str, Any], size: int) -> dict[str, Any]:
    """Return what is known of a law's parameters, as `Contender` takes it."""
    found = row.get("draws") or {"method": "linear"}
    drawn = np.asarray(found.get("values", ()), dtype=float)
    weighed = found["method"] == "weighed" and drawn.ndim == 2 and drawn.shape[1] == size
    errors = row.get("modulus_errors")
    return {
        "modulus_errors": None
        if errors is None
        else ModulusErrors(**{name: np.asarray(v, dtype=float) for name, v in errors.items()}),
        "covariance": _covariance(row, size),
        "drawn": drawn if weighed else None,
        "without_band": str(found.get("reason", "")) if found["method"] == "none" else "",
    }


def _covariance(row: Mapping[str, Any], size: int) -> np.ndarray | None:
    matrix = row.get("covariance")
    if matrix is None:
        return None
    values = np.asarray(matrix, dtype=float)
    usable = values.shape == (size, size) and np.all(np.isfinite(values))
    return values if usable else None
