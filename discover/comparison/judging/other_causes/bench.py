"""Laws fitted to runs of a bench that is a little off in all of them alike.

A gap or the angle of a cone, a calibration, the zero of a clock and the temperature of the bath are
the same for every run of a session. Each is known to a per cent or two, and here each is a constant
that is normal with that width.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from discover.comparison.judging.moved_law import MovedLaw
from discover.comparison.judging.other_causes.bench_faults import Faults, OnBench
from discover.comparison.judging.other_causes.bench_flows import faster, yielding
from discover.comparison.outcomes.flows import QUANTITIES, Flow, predict
from discover.errors import InputError
from discover.statistics import root_of
from discover.statistics.noise.independent_samples import independent_samples
from discover.statistics.noise.outliers import stray
from discover.statistics.projection import rms
from discover.statistics.reading.small_faults import HALF_BAND, WIDTHS
from discover.study.declared_model import MODE_CONSTANTS
from tensor_library.law_terms import LawTerms

WIDTH = max(WIDTHS)
"""Standard deviation of factors that all runs share: of rates, times and stresses."""

_LATE = 0.5
"""Standard deviation of the zero of the clock, in the shortest time from it to a sample."""

_STEP = 1e-3
_EVALUATIONS = 20
_ENOUGH = 0.05  # of the objective, below which no step is worth its time
_RUNAWAY = 1e3
"""What a law that runs away leaves of each sample, in its noise: more than any trial may."""


@dataclass(frozen=True)
class Bench:
    """The fitted runs, and a law with the terms of all laws that are asked.

    Attributes
    ----------
    law
        Of all terms; modulus and time can be moved too.
    fitted
        Constants that were fitted along, which may be anything.
    flows, records, weights
        The runs, their values, and what makes their noise one; zero of outliers.
    widths
        Standard deviations of what changes the records in proportion to it: the zero of the clock
        in s, where a run tells it, and the compliance of the tool, times the modulus.
    worth
        Share of the samples that are independent.
    """

    law: MovedLaw
    fitted: tuple[str, ...]
    flows: Sequence[Flow]
    records: Sequence[Float[np.ndarray, " _"]]
    weights: Sequence[Float[np.ndarray, " _"]]
    widths: tuple[float, ...]
    worth: float

    @classmethod
    def of(cls, found: MovedLaw, terms: Sequence[str], flows: Sequence[Flow]) -> "Bench | None":
        """Return it; None where the runs say nothing of a bench, or the law does not follow them.

        Parameters
        ----------
        found
            A law that explains the runs: what it leaves of each is its noise.
        terms
            Of the laws that are asked, by their spelling.
        flows
            The fitted runs.
        """
        if found.terms.inner or not flows or not all(map(_tells, flows)):
            return None
        names = tuple(dict.fromkeys([*MODE_CONSTANTS, *found.names]))
        every = dict.fromkeys([*found.terms.coefficients, *terms], 0.0)
        law = MovedLaw(found.declared, LawTerms({**every, **found.terms.coefficients}), names)
        try:
            predicted = _predicted(law, law.start, flows, 0.0)
        except _RunsAway:
            return None
        records, weights, left = [], [], []
        for flow, values in zip(flows, predicted, strict=True):
            record = np.asarray(flow.measured, dtype=float)
            even = flow.even(record)
            residual = even * (values - record)
            kept = ~stray(residual, even * record)
            noise = rms(residual[kept])
            if noise == 0.0:
                return None
            records.append(record)
            weights.append(even * kept / noise)
            left.append(residual[kept] / noise)
        together = np.concatenate(left)
        worth = independent_samples(together) / len(together)
        times = [flow.times[flow.times > 0.0][0] for flow in flows if not flow.is_of_states]
        widths = (_LATE * float(min(times)), WIDTH) if times else ()
        return cls(law, found.names, flows, records, weights, widths, worth)

    @property
    def samples(self) -> float:
        """Number of independent samples of all runs."""
        return self.worth * sum(int(np.count_nonzero(one)) for one in self.weights)

    def fit(self, start: Mapping[str, float]) -> OnBench | None:
        """Return a law with the likeliest faults; None where it runs away.

        The evidence is Laplace's in the faults   [MacKay 1992, Neural Comput. 4, 415], and a
        coefficient costs what it does in the Bayesian criterion.

        Parameters
        ----------
        start
            Its coefficients, by the spelling of its terms.
        """
        names, terms = self.law.names, tuple(self.law.terms.coefficients)
        places = [len(names) + i for i, term in enumerate(terms) if term in start]
        columns = [*places, *range(len(names))]
        free = [np.inf if name in self.fitted else WIDTH for name in names]
        widths = np.array([*[np.inf] * len(places), *free, WIDTH, *self.widths])
        values = self.law.start
        values[len(names) :] = [start.get(term, 0.0) for term in terms]
        begin = _Place(values, 0.0, np.zeros(len(self.widths)))
        try:
            return self._found(self._likeliest(begin, columns, widths), columns, places, widths)
        except _RunsAway:
            return None

    def _likeliest(self, begin: "_Place", columns: Sequence[int], widths) -> "_Place":
        """Return the place of largest probability, of residuals that are one at the noise.

        What the clock and the tool change is linear about the beginning.
        """
        root = float(np.sqrt(self.worth))
        linear = self._derivatives(begin, columns)[1][len(columns) + 1 :]

        def left(sizes):
            try:
                residual = self._residual(begin.at(columns, sizes), linear)
            except _RunsAway:
                residual = np.full(linear.shape[1], _RUNAWAY)
            return np.concatenate([root * residual, sizes / widths])

        def slopes(sizes):
            told = self._derivatives(begin.at(columns, sizes), columns)[1]
            told[len(columns) + 1 :] = linear
            return np.vstack([root * told.T, np.diag(1.0 / widths)])

        found = least_squares(
            left,
            begin.sizes(columns),
            slopes,  # pyright: ignore[reportArgumentType]  (annotated as a string in SciPy)
            x_scale="jac",
            ftol=_ENOUGH / self.samples,
            max_nfev=_EVALUATIONS,
        )
        return begin.at(columns, found.x)

    def _found(self, place: "_Place", columns, places, widths) -> OnBench:
        """Return a law where its fit has ended."""
        residual, slopes = self._derivatives(place, columns)
        off = place.sizes(columns) / widths
        now = 0.5 * self.worth * float(residual @ residual) + 0.5 * float(np.sum(off**2))
        square = self.worth * slopes @ slopes.T + np.diag(1.0 / widths**2)
        covariance = _inverse(square)
        half = HALF_BAND * np.sqrt(np.maximum(np.diag(covariance), 0.0))
        names, terms = self.law.names, tuple(self.law.terms.coefficients)
        coefficients = {
            terms[at - len(names)]: (
                float(place.values[at]),
                float(place.values[at] - one),
                float(place.values[at] + one),
            )
            for at, one in zip(places, half, strict=False)
        }
        own = dict(zip(names, place.values, strict=False))
        stress, time = (float(np.expm1(own[name])) for name in MODE_CONSTANTS)
        late, compliance = map(float, place.linear) if len(place.linear) else (0.0, 0.0)
        cost = now + _occam(square, widths) + 0.5 * len(places) * float(np.log(self.samples))
        count = len(columns) + 1
        return OnBench(
            coefficients,
            Faults(place.rate, time, stress, compliance, late),
            cost,
            place.values,
            columns,
            root_of(covariance[:count, :count]).T,
        )

    def limits(
        self, found: OnBench, flows: Sequence[Flow]
    ) -> dict[str, tuple[Float[np.ndarray, "n 3"], Float[np.ndarray, "n 3"]]]:
        """Return between what σ12, N1 and N2 lie in flows on this bench, by their keys.

        To first order in all that was fitted, whether moduli are off or the gain of the transducer;
        a flow in which the law runs away is left out.
        """
        told = {}
        for flow in flows:
            rows = [_of_law(self.law, found.values, flow, found.faults.rate)]
            for column in found.columns:
                other = found.values.copy()
                other[column] += _STEP
                rows.append(_of_law(self.law, other, flow, found.faults.rate))
            rows.append(_of_law(self.law, found.values, flow, found.faults.rate + _STEP))
            known = [row for row in rows if row is not None]
            if len(known) < len(rows):
                continue
            slopes = (np.array(known[1:]) - known[0]) / _STEP
            moduli = self._within(found, known[0], slopes)
            gain = self._within(found, *self._of_gain(found, known[0], slopes))
            told[flow.key] = np.minimum(moduli[0], gain[0]), np.maximum(moduli[1], gain[1])
        return told

    def _of_gain(self, found: OnBench, values: np.ndarray, slopes: np.ndarray):
        """Return σ12 as it is shown, and N1 and N2 where a gain is off and no modulus."""
        place = self.law.names.index(MODE_CONSTANTS[0])
        if MODE_CONSTANTS[0] in self.fitted:
            return values, slopes
        shown = np.array([1.0, *2 * [float(np.exp(-found.values[place]))]])
        moved = slopes * shown
        moved[list(found.columns).index(place), :, 1:] -= (values * shown)[:, 1:]
        return values * shown, moved

    @staticmethod
    def _within(found: OnBench, values: np.ndarray, slopes: np.ndarray):
        """Return the ends of 95 % intervals of what has these slopes in all that was fitted."""
        moved = np.einsum("rp,pnc->rnc", found.root, slopes)
        half = HALF_BAND * np.sqrt(np.sum(moved**2, axis=0))
        return values - half, values + half

    def _residual(self, place: "_Place", linear) -> Float[np.ndarray, " m"]:
        """Return what is left of the runs; `linear` is what the linear faults change."""
        here = _predicted(self.law, place.values, self.flows, place.rate)
        residual = self._weighed([a - b for a, b in zip(here, self.records, strict=True)])
        return residual + place.linear @ linear if len(place.linear) else residual

    def _derivatives(self, place: "_Place", columns: Sequence[int]):
        """Return residuals and their derivatives: coefficients, constants, rate, clock, tool."""
        here = _predicted(self.law, place.values, self.flows, place.rate)
        moved = []
        for column in columns:
            other = place.values.copy()
            other[column] += _STEP
            moved.append(_predicted(self.law, other, self.flows, place.rate))
        moved.append(_predicted(self.law, place.values, self.flows, place.rate + _STEP))
        slopes = [
            self._weighed([(b - a) / _STEP for a, b in zip(here, rows, strict=True)])
            for rows in moved
        ]
        if self.widths:
            later = _STEP * self.widths[0]
            ahead = _predicted(self.law, place.values, self.flows, place.rate, later)
            fluid = self.law.fluid(place.values)
            felt = [yielding(fluid, faster(one, place.rate)) for one in self.flows]
            slopes.append(
                self._weighed([(a - b) / later for a, b in zip(here, ahead, strict=True)])
            )
            slopes.append(self._weighed([_followed(one) for one in felt]))
        return self._residual(place, np.array(slopes[len(columns) + 1 :])), np.array(slopes)

    def _weighed(self, rows: Sequence[np.ndarray]) -> Float[np.ndarray, " m"]:
        return np.concatenate([w * row for w, row in zip(self.weights, rows, strict=True)])


@dataclass(frozen=True)
class _Place:
    """Constants and coefficients of a law, what is off of the rate, and the linear faults."""

    values: Float[np.ndarray, " q"]
    rate: float
    linear: Float[np.ndarray, " k"]

    def sizes(self, columns: Sequence[int]) -> Float[np.ndarray, " p"]:
        """Return all that is fitted."""
        return np.array([*self.values[list(columns)], self.rate, *self.linear])

    def at(self, columns: Sequence[int], sizes: Float[np.ndarray, " p"]) -> "_Place":
        """Return another place, by all that is fitted."""
        values = self.values.copy()
        values[list(columns)] = sizes[: len(columns)]
        return _Place(values, float(sizes[len(columns)]), sizes[len(columns) + 1 :])


class _RunsAway(Exception):
    """A law cannot be followed through the runs."""


def _followed(values: np.ndarray | None) -> np.ndarray:
    if values is None:
        raise _RunsAway
    return values


def _tells(flow: Flow) -> bool:
    """Return whether a run tells of a bench: σ12 was recorded at a given rate."""
    at_rate = flow.protocol.control in ("rate", "steady")
    return at_rate and flow.in_shear and flow.records_shear_stress and flow.measured is not None


def _inverse(square: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """Return the inverse of normal equations whose columns differ in size."""
    scale = np.sqrt(np.maximum(np.diag(square), 1e-300))
    return np.linalg.pinv(square / np.outer(scale, scale), rcond=1e-12) / np.outer(scale, scale)


def _occam(square: Float[np.ndarray, "p p"], widths: Float[np.ndarray, " p"]) -> float:
    """Return the log of how much more is known of the faults after the data than before.

    Beside all that may be anything.
    """
    normal = np.isfinite(widths)
    scale = np.where(normal, widths, 1.0 / np.sqrt(np.maximum(np.diag(square), 1e-300)))
    scaled = square * np.outer(scale, scale)
    whole, free = np.linalg.slogdet(scaled), np.linalg.slogdet(scaled[np.ix_(~normal, ~normal)])
    return 0.5 * float(whole[1] - free[1])


def _predicted(
    law: MovedLaw, values, flows: Sequence[Flow], rate: float, later: float = 0.0
) -> list[Float[np.ndarray, " _"]]:
    """Return σ12 of the runs, some time after their samples."""
    return [_followed(_of_law(law, values, flow, rate, later))[:, 0] for flow in flows]


def _of_law(
    law: MovedLaw, values, flow: Flow, rate: float, later: float = 0.0
) -> Float[np.ndarray, "n 3"] | None:
    """Return σ12, N1 and N2 in a flow; None where a law runs away, or there is none."""
    try:
        fluid = law.fluid(values)
    except InputError:  # a constant of the declared law beyond its range
        return None
    told = predict(fluid, faster(flow, rate, 0.0 if flow.is_of_states else later))
    if told is None:
        return None
    rows = np.stack([np.asarray(told[q], dtype=float) for q in QUANTITIES], axis=-1)
    return rows if np.all(np.isfinite(rows[:, 0])) else None
