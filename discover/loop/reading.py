"""A residual read as a rheologist would: how it changes from run to run, and of which waves it is.

On what it depends within a run, free functions say (`inference.engine.free_functions`).
"""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize_scalar
from scipy.stats import permutation_test, rankdata

from discover.loop.runs import RunRecord
from discover.words import p_value, percent_of

HARMONICS = 5
"""Highest multiple of the frequency at which a residual is read."""
_FEWEST_CYCLES = 2.0
_REGULAR = 0.15  # relative spread of half periods, up to which a rate oscillates
_PURE = 0.97  # share of the rate that odd harmonics must explain


@dataclass(frozen=True)
class Wave:
    """What the residual of an oscillation is made of, each relative to the stress's fundamental.

    `run`: the run. `frequency`: in rad/s. `elastic`, `viscous`: fundamental in phase with the
    strain and with the shear rate; positive where the model predicts too much. `odd`, `even`:
    higher odd harmonics, and even ones; root of the sum of squares. `drift`: change from the first
    to the last sample that does not oscillate. `noise`: what noise, as large as what is left
    between the harmonics, would put into two of them.
    """

    run: str
    frequency: float
    elastic: float
    viscous: float
    odd: float
    even: float
    drift: float
    noise: float


def oscillation(record: RunRecord) -> float | None:
    """Return the frequency in rad/s at which the shear rate of a run oscillates, if it does."""
    rate, time = record.rate, record.time
    signs = np.sign(rate)
    turns = np.flatnonzero(signs[1:] * signs[:-1] < 0)
    if len(turns) < 2 * _FEWEST_CYCLES:
        return None
    share = rate[turns] / (rate[turns] - rate[turns + 1])
    crossings = time[turns] + share * (time[turns + 1] - time[turns])
    halves = np.diff(crossings)
    if np.std(halves) > _REGULAR * np.mean(halves):
        return None
    first = np.pi / float(np.mean(halves))

    def missed(frequency: float) -> float:
        basis = _harmonics(time, frequency, (1, 3, 5))
        left = rate - basis @ np.linalg.lstsq(basis, rate, rcond=None)[0]
        return float(left @ left)

    best: Any = minimize_scalar(missed, bounds=(0.95 * first, 1.05 * first), method="bounded")
    explained = 1.0 - missed(float(best.x)) / float(rate @ rate)
    return float(best.x) if explained > _PURE else None


def _harmonics(time, frequency: float, multiples) -> Float[np.ndarray, "n columns"]:
    return np.column_stack([f(m * frequency * time) for m in multiples for f in (np.cos, np.sin)])


def read_wave(record: RunRecord, model: int = -1) -> Wave | None:
    """Return what the residual of one run is made of, or nothing where it does not oscillate.

    Least squares on the harmonics of the rate's frequency, a constant and a slope, over the last
    half of the run, where what started with it has mostly died away.
    """
    frequency = oscillation(record)
    if frequency is None:
        return None
    late = record.time >= 0.5 * record.time[-1]
    if np.ptp(record.time[late]) * frequency < 2.0 * np.pi:
        late = np.ones_like(late)
    time = record.time[late]
    multiples = tuple(range(1, HARMONICS + 1))
    middle = (time - time.mean()) / max(float(np.ptp(time)), 1e-300)
    basis = np.column_stack([_harmonics(time, frequency, multiples), np.ones_like(time), middle])

    def coefficients(values):
        found = np.linalg.lstsq(basis, values[late], rcond=None)[0]
        return found[: 2 * HARMONICS : 2] - 1j * found[1 : 2 * HARMONICS : 2], float(found[-1])

    rate, _ = coefficients(record.rate)
    stress, _ = coefficients(record.measured)
    left, drift = coefficients(record.residual[model])
    rest = record.residual[model][late]
    rest = rest - basis @ np.linalg.lstsq(basis, rest, rcond=None)[0]
    free = max(len(time) - basis.shape[1], 1)
    # cosine and sine of a harmonic each have a variance of 2 s²/n, and two harmonics four of them
    noise = float(np.sqrt(8.0 * np.sum(rest**2) / free / len(time)))
    scale = abs(stress[0])
    if scale == 0.0 or rate[0] == 0.0:
        return None
    # strain lags the rate by a quarter of a cycle
    along_rate = rate[0] / abs(rate[0])
    along_strain = -1j * along_rate
    return Wave(
        run=record.name,
        frequency=frequency,
        elastic=float((left[0] * np.conj(along_strain)).real / scale),
        viscous=float((left[0] * np.conj(along_rate)).real / scale),
        odd=float(np.linalg.norm(left[2::2]) / scale),
        even=float(np.linalg.norm(left[1::2]) / scale),
        drift=drift / scale,
        noise=noise / scale,
    )


_FEWEST_RUNS = 5  # with fewer no order of runs is improbable enough
_PROBABILITY = 0.05
_PERMUTATIONS = 9999

_ABOVE_NOISE = 4.0  # in a run of its own a drift of chance reaches three


@dataclass(frozen=True)
class Trend:
    """How the residual changes from run to run.

    `quantity`: what differs between runs. `of`: ``"size"`` of the relative residual, or ``"sign"``:
    the excess of the prediction. `correlation`: rank correlation with the quantity. `probability`:
    of one as strong among as many unrelated quantities   [Bonferroni].
    """

    quantity: str
    of: str
    correlation: float
    probability: float


@dataclass(frozen=True)
class Reading:
    """A residual, read.

    `trends`: from run to run, the least probable first; only those beyond chance. `waves`: one for
    each oscillating run.
    """

    trends: tuple[Trend, ...]
    waves: tuple[Wave, ...]

    @property
    def sentences(self) -> list[str]:
        """What the reading says, each in a sentence; empty where nothing stands out."""
        return [*self._from_run_to_run(), *self._oscillating()]

    def _from_run_to_run(self) -> list[str]:
        sentences = []
        for of, what in (
            ("size", "The relative residual"),
            ("sign", "The over-prediction"),
        ):
            trends = [trend for trend in self.trends if trend.of == of]
            if not trends:
                continue
            first = trends[0]
            text = (
                f"{what} {'increases' if first.correlation > 0 else 'decreases'} with "
                f"{_plain(first.quantity)} (rank correlation {first.correlation:.2f}, "
                f"p {p_value(first.probability)})"
            )
            if len(trends) > 1:
                others = ", ".join(_plain(trend.quantity) for trend in trends[1:])
                text += f", and with {others}: these runs do not distinguish them"
            sentences.append(f"{text}.".replace("-", "−"))
        return sentences

    def _oscillating(self) -> list[str]:
        if not self.waves:
            return []
        parts = {
            "in phase with the strain (elastic)": [abs(w.elastic) for w in self.waves],
            "in phase with the rate (viscous)": [abs(w.viscous) for w in self.waves],
            "in higher odd harmonics, as of a nonlinear fluid": [w.odd for w in self.waves],
            "in even harmonics, which a fluid alone does not make": [w.even for w in self.waves],
            "in a drift": [abs(w.drift) for w in self.waves],
        }
        sizes = {name: float(np.mean(values)) for name, values in parts.items()}
        largest = max(sizes, key=lambda name: sizes[name])
        if sizes[largest] < _ABOVE_NOISE * float(np.mean([w.noise for w in self.waves])):
            return []
        return [
            f"Over the oscillating runs the residual is mostly {largest}: "
            f"{percent_of(sizes[largest])} of the fundamental of the stress."
        ]

    def to_json(self) -> dict[str, Any]:
        """Return the reading as JSON-able values."""
        return {"sentences": self.sentences, **asdict(self)}


def _plain(name: str) -> str:
    return name.replace("_", " ")


def read_residual(records: Sequence[RunRecord], model: int = -1) -> Reading:
    """Return how the residuals of some runs change from run to run, and their waves.

    `model`: which prediction: 0 is that of the declared model, −1 of the augmented one.
    """
    # strains, rates and stresses of a shear and of an extension have no scale in common, so records
    # of one kind are read together; a steady state knows neither time nor strain
    kinds = [(r.flow, r.quantity) for r in records if r.is_transient]
    if not kinds:
        return Reading((), ())
    commonest = max(kinds, key=kinds.count)
    records = [r for r in records if r.is_transient and (r.flow, r.quantity) == commonest]
    waves = tuple(w for r in records if (w := read_wave(r, model)) is not None)
    return Reading(_trends(records, model), waves)


def differences(records: Sequence[RunRecord]) -> dict[str, Float[np.ndarray, " runs"]]:
    """Return what differs from run to run, by name: of the flow, and what the source says."""
    found = {
        "the largest shear rate": [float(np.max(np.abs(r.rate))) for r in records],
        "the largest strain": [float(np.max(np.abs(r.strain))) for r in records],
        "the largest stress": [float(np.max(np.abs(r.measured))) for r in records],
        "the duration": [float(r.time[-1]) for r in records],
    }
    names = [n for n in records[0].conditions if all(n in r.conditions for r in records)]
    found |= {name: [r.conditions[name] for r in records] for name in names}
    return {
        name: np.array(values)
        for name, values in found.items()
        if np.ptp(values) > 1e-6 * np.max(np.abs(values))
    }


def _trends(records: Sequence[RunRecord], model: int) -> tuple[Trend, ...]:
    if len(records) < _FEWEST_RUNS:
        return ()
    size = np.array([r.errors[model] for r in records])
    sign = np.array([
        float(np.sum(r.residual[model] * r.measured)) / max(float(np.sum(r.measured**2)), 1e-300)
        for r in records
    ])  # fmt: skip
    tried = differences(records)
    found = []
    for name, values in tried.items():
        for of, outcome in (("size", size), ("sign", sign)):
            correlation, probability = _rank_correlation(values, outcome)
            probability *= 2 * len(tried)
            if probability < _PROBABILITY:
                found.append(Trend(name, of, correlation, probability))
    return tuple(sorted(found, key=lambda t: t.probability))


def _rank_correlation(first: np.ndarray, second: np.ndarray) -> tuple[float, float]:
    """Return Spearman's correlation, and its probability by chance from permutations.

    With a handful of runs the usual approximation by a t distribution is far off.
    """
    x, y = (rankdata(v) - 0.5 * (len(v) + 1.0) for v in (first, second))
    scale = float(np.linalg.norm(x) * np.linalg.norm(y))
    if scale == 0.0:
        return 0.0, 1.0

    def correlation(ranks, axis=-1):
        return np.sum(ranks * y, axis=axis) / scale

    # of up to seven runs every permutation is tried, of more a fixed sample
    test = permutation_test(
        (x,),
        correlation,
        permutation_type="pairings",
        vectorized=True,
        n_resamples=_PERMUTATIONS,
        rng=np.random.default_rng(0),
    )
    return float(test.statistic), float(test.pvalue)
