"""Tests of residuals for noise that hold whatever its size does along a run.

Noise may be white or of one first-order correlation, and louder in some stretches: a stretch counts
by its order and not by its size.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import median_filter
from scipy.special import gammaincc, ndtr
from scipy.stats import t as student

from discover.statistics.noise.noise_model import Rows, rms
from discover.statistics.noise.smooth_misfit import LARGEST_CORRELATION, smooth_misfit_probability

_STANDS_OUT = 6.0  # robust standard deviations of the neighbourhood
_SAME_PLACE_BESIDE, _SAME_PLACE_NEIGHBOURHOOD = 5, 25


def same_place_probability(rows: Sequence[Float[np.ndarray, " _"]]) -> float:
    """Return the probability of samples that stand out so alike at one place of several runs.

    Noise has mean zero over runs at each place, within their spread [Student 1908, Biometrika 6,
    1]. First and last place, where an imperfect start or end shows, count for half of those asked.
    `rows`: residuals of each run, in a unit in which runs compare.
    """
    length = min(map(len, rows), default=0)
    if len(rows) < 2 or length < _SAME_PLACE_BESIDE:
        return 1.0
    out = [_standing_out(np.asarray(row, dtype=float)) for row in rows]
    least = 1.0
    for at in [*range(length), -1]:
        if sum(bool(loud[at]) for loud in out) < 2:
            continue
        values = np.array([row[at] for row in rows])
        error = float(np.std(values, ddof=1)) / np.sqrt(len(values))
        ratio = abs(float(np.mean(values))) / max(error, np.finfo(float).tiny)
        tried = 2 * (2 if at in (0, -1) else length)
        least = min(least, tried * 2.0 * float(student.sf(ratio, len(values) - 1)))
    return least


def _standing_out(row: Float[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Return which samples are far off the median around them, ends included."""
    apart = np.abs(row - median_filter(row, _SAME_PLACE_BESIDE, mode="reflect"))
    size = min(_SAME_PLACE_NEIGHBOURHOOD, len(row))
    spread = 1.4826 * median_filter(apart, size, mode="reflect")
    return apart > _STANDS_OUT * spread


LAGS = 12
"""Neighbours up to which noise is tested for correlation."""

FEWEST_TESTED = 2 * LAGS
"""Samples of a run from which on that is done; and of all shorter runs, to be tested together."""

FEWEST_FAST = 7
"""Samples of a run from which on its noise can be told by third differences."""

SIGNIFICANCE = 0.01
"""Noise is taken for structure this often, at most. To call a misfit noise is the graver mistake,
and of what noise leaves once in a thousand times nobody would say that it is noise."""

_SAMPLES_PER_LAG = 4
_NEAREST, _LOTS = 3, 4000
_TRIED = 10
_LARGEST = 3.0  # robust standard deviations up to which one innovation counts
_NEIGHBOURHOOD = FEWEST_TESTED + 1
_REPEATED = 0.5  # autocorrelation of a record that repeats itself
_AS_WELL = 0.9
_FEWEST_CYCLES = 2


def noise_probability(
    residual: Rows, measured: Rows | None = None, further: Sequence[float] = ()
) -> float | None:
    """Return the probability of residuals as structured as these, if they are noise.

    For every first-order correlation up to 0.9 the innovations e_t = r_t − ρ r_{t−1} are held
    against independent symmetric ones of any size, whose Σ e_t e_{t−k} has mean zero and variance Σ
    e_t² e_{t−k}² [Lobato, Nankervis & Savin 2001, Int. Econ. Rev. 42, 187]; the ρ most like noise
    counts. Tests:

    - a portmanteau over 12 lags of all runs together [after Ljung & Box 1978, Biometrika 65, 297],
      and one run by run;
    - the fast part: third differences of innovations have 20 times their variance, of a smooth
      residual less;
    - the sum over runs, sample by sample;
    - where a record repeats itself, products of innovations whole cycles apart;
    - a smooth misfit beside the noise (`smooth_misfit_probability`);
    - single samples that stand out at one place of several runs (`same_place_probability`).

    Runs of fewer than 24 samples have one test together (`separate_probability`), with the
    correlation of the longer runs, or none. The smallest probability counts as often as there are
    tests; None if all runs together are too short.

    `residual`: of each run, in any unit. `measured`: the records, by which cycles are found.
    `further`: probabilities by other tests of the longer runs.
    """
    rows, records, short = [], [], []
    for i, values in enumerate(residual):
        row = np.asarray(values)
        if len(row) >= FEWEST_TESTED and np.any(row):
            rows.append(row / _spread(row))
            records.append(None if measured is None else np.asarray(measured[i]))
        elif len(row) >= FEWEST_FAST and np.any(row):
            short.append(row)
    if sum(map(len, short)) < FEWEST_TESTED:
        short = []  # too few to say anything
    if not rows:
        return separate_probability(short) if short else None
    size = max(len(row) for row in rows)
    padded = np.array([np.append(row, np.zeros(size - len(row))) for row in rows])
    count = np.array([len(row) for row in rows])
    rho = _correlation(padded, count)
    white = _innovations(padded, count, rho)
    products, variances = _products(white)
    tests = [
        _portmanteau(np.sum(products, axis=0), np.sum(variances, axis=0)),
        _portmanteau(products, variances),
        _fast_part(np.sum(products, axis=0), np.sum(variances, axis=0)),
    ]
    if len(rows) > 1:
        tests.append(_alike(padded, count))
        tests.append(same_place_probability([row for row in residual if np.any(row)]))
    cycles = [cycle(record) if record is not None else None for record in records]
    if any(length is not None for length in cycles):
        tests.append(_repeats(white, count, cycles))
    tests += [smooth_misfit_probability(rows), *further]
    if short:
        tests.append(
            separate_probability([_differences(r[None], np.array([rho]))[0, 0] for r in short])
        )
    return float(min(1.0, len(tests) * min(tests)))


def separate_probability(rows: Sequence[Float[np.ndarray, " _"]]) -> float:
    """Return the probability of neighbours that agree so much, if each sample is separate.

    Points of a flow curve or sweep are experiments of their own, without correlated noise. Products
    of the nearest neighbours against the same numbers with signs drawn with a fixed seed [Liu 1988,
    Ann. Stat. 16, 1696]. `rows`: residuals of each series in the order of its rates.
    """
    generator = np.random.default_rng(0)
    own, drawn = 0.0, np.zeros(_LOTS)
    for values in rows:
        row = values / _spread(values)
        lots = generator.choice([-1.0, 1.0], (_LOTS, len(row))) * row
        for lag in range(1, (_NEAREST if len(row) >= FEWEST_TESTED else 1) + 1):
            own += float(row[lag:] @ row[:-lag])
            drawn += np.einsum("dt,dt->d", lots[:, lag:], lots[:, :-lag])
    return float((1 + np.count_nonzero(drawn >= own)) / (1 + _LOTS))


def cycle(record: Float[np.ndarray, " n"]) -> float | None:
    """Return the period of a record in samples; None if it does not repeat itself.

    First maximum of the autocorrelation after its sign is lost.
    """
    n = len(record)
    values = record - np.mean(record)
    power = float(values @ values)
    if power == 0.0:
        return None
    spectrum = np.abs(np.fft.rfft(values, 2 * n)) ** 2
    lags = np.arange(n // _FEWEST_CYCLES + 1)
    # of pairs, not of samples, or a slow cycle would seem to fade
    correlation = np.fft.irfft(spectrum)[lags] / power * n / (n - lags)
    lost = np.flatnonzero(correlation < 0.0)
    if not len(lost):
        return None
    after = correlation[lost[0] :]
    alike = np.flatnonzero(after >= max(_REPEATED, _AS_WELL * float(np.max(after))))
    if not len(alike):
        return None
    # several cycles repeat about as well as one: the first maximum counts
    best = lost[0] + int(alike[0])
    while best < lags[-1] and correlation[best + 1] > correlation[best]:
        best += 1
    if best == lags[-1]:
        return None
    left, top, right = correlation[best - 1 : best + 2]
    bend = left - 2.0 * top + right
    return float(best + (0.5 * (left - right) / bend if bend < 0.0 else 0.0))


def _spread(values: Float[np.ndarray, " n"]) -> float:
    """Return a standard deviation that a loud stretch hardly moves."""
    return 1.4826 * float(np.median(np.abs(values))) or rms(values) or 1.0


def _local_spread(values: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the robust standard deviation in the neighbourhood of each sample."""
    own = 1.4826 * median_filter(np.abs(values), min(_NEIGHBOURHOOD, len(values)), mode="reflect")
    return np.maximum(own, 1e-3 * _spread(values))


def _innovations(
    rows: Float[np.ndarray, "runs n"], count: Int[np.ndarray, " runs"], rho: float
) -> Float[np.ndarray, "runs n"]:
    """Return what each sample adds to noise with a correlation, limited; zero at padding."""
    white = _differences(rows, np.array([rho]))[0]
    for row, n in zip(white, count, strict=True):
        row[:n] /= _local_spread(row[:n])
        row[n:] = 0.0
    return np.clip(white, -_LARGEST, _LARGEST)


def _differences(
    rows: Float[np.ndarray, "runs n"], rho: Float[np.ndarray, " q"]
) -> Float[np.ndarray, "q runs n"]:
    """Return r_t − ρ r_{t−1} for several ρ; the first sample has the same variance."""
    white = np.repeat(rows[None], len(rho), axis=0)
    white[..., 1:] -= rho[:, None, None] * rows[:, :-1]
    white[..., 0] *= np.sqrt(1.0 - rho[:, None] ** 2)
    return white


def _products(white: Float[np.ndarray, "*q runs n"]):
    """Return Σ e_t e_{t−k} of each run at lags 1, 2, … (last axis), and their variances."""
    square = white**2
    n_lags = min(LAGS, white.shape[-1] // _SAMPLES_PER_LAG)
    products, variances = np.empty((2, *white.shape[:-1], n_lags))
    for k in range(1, n_lags + 1):
        products[..., k - 1] = np.einsum("...t,...t->...", white[..., k:], white[..., :-k])
        variances[..., k - 1] = np.einsum("...t,...t->...", square[..., k:], square[..., :-k])
    return products, np.maximum(variances, 1e-300)


def _correlation(rows: Float[np.ndarray, "runs n"], count: Int[np.ndarray, " runs"]) -> float:
    """Return the first-order correlation under which rows look most like noise."""

    def structure(rho: np.ndarray) -> np.ndarray:
        white = _differences(rows, rho)
        for i, n in enumerate(count):
            spread = 1.4826 * np.median(np.abs(white[:, i, :n]), axis=1)
            own = np.where(spread > 0.0, spread, np.sqrt(np.mean(white[:, i, :n] ** 2, axis=1)))
            white[:, i] /= np.where(own > 0.0, own, 1.0)[:, None]
            white[:, i, n:] = 0.0
        products, variances = _products(np.clip(white, -_LARGEST, _LARGEST))
        return np.sum(np.sum(products, axis=1) ** 2 / np.sum(variances, axis=1), axis=1)

    coarse = np.linspace(0.0, LARGEST_CORRELATION, _TRIED)
    best = coarse[int(np.argmin(structure(coarse)))]
    fine = best + (coarse[1] - coarse[0]) * np.linspace(-1.0, 1.0, _TRIED)
    fine = np.clip(fine, 0.0, LARGEST_CORRELATION)
    return float(fine[int(np.argmin(structure(fine)))])


def _chi_square(value: float, freedom: int | float) -> float:
    return float(gammaincc(0.5 * freedom, 0.5 * value))


def _portmanteau(products: np.ndarray, variances: np.ndarray) -> float:
    # one degree of freedom is the correlation's
    return _chi_square(float(np.sum(products**2 / variances)), products.size - 1)


def _fast_part(products: np.ndarray, variances: np.ndarray) -> float:
    """Return how probable third differences as small as these are in independent innovations."""
    missing = np.array([30.0, -12.0, 2.0])  # 20 Σ e² less the squares of third differences
    deviation = float(np.sqrt(missing**2 @ variances[:3]))
    return float(ndtr(-(missing @ products[:3]) / deviation))


def _alike(rows: Float[np.ndarray, "runs n"], count: Int[np.ndarray, " runs"]) -> float:
    """Return how probable it is that runs agree, sample by sample, as much as these do.

    Given their sizes, the sum of R symmetric numbers has a square of mean Σ e² and variance
    2 ((Σ e²)² − Σ e⁴); the sum over samples is taken for a gamma variable of that mean and
    variance. Their correlation is that of what the runs do not share.
    """
    length = int(np.min(count))
    shared = np.full(len(rows), length)
    cut = rows[:, :length]
    rho = _correlation(cut - np.mean(cut, axis=0), shared)
    white = _innovations(cut, shared, rho)
    square = np.sum(white**2, axis=0)
    told = square > 0.0
    if not np.any(told):
        return 1.0
    agreement = np.sum(white[:, told], axis=0) ** 2 / square[told]
    spread = 2.0 * (1.0 - np.sum(white[:, told] ** 4, axis=0) / square[told] ** 2)
    mean, variance = float(np.count_nonzero(told)), max(float(np.sum(spread)), 1e-12)
    scale = 0.5 * variance / mean
    return _chi_square(float(np.sum(agreement)) / scale, mean / scale)


def _repeats(
    white: Float[np.ndarray, "runs n"],
    count: Int[np.ndarray, " runs"],
    cycles: Sequence[float | None],
) -> float:
    """Return how probable innovations are that repeat after whole cycles as much as these do."""
    product, variance = 0.0, 0.0
    for row, n, length in zip(white, count, cycles, strict=True):
        if length is None or length <= LAGS:
            continue  # neighbours are tested already
        for turns in range(1, int((n - 2) / length) + 1):
            whole = round(turns * length)
            for lag in (whole - 1, whole, whole + 1):
                product += float(row[lag:n] @ row[: n - lag])
                variance += float(row[lag:n] ** 2 @ row[: n - lag] ** 2)
    return float(ndtr(-product / np.sqrt(variance))) if variance > 0.0 else 1.0
