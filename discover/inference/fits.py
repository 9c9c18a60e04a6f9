"""Likeliest constants of hypotheses, by Gauss-Newton steps of many fits side by side."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.linalg import solve_triangular

from discover.inference.fit import Fit
from discover.inference.linear_errors import LinearErrors
from discover.inference.noise import Noise, NoiseModel
from discover.inference.priors import Prior, Priors
from discover.inference.problem import Problem
from discover.inference.rows import Rows

_STEP = 1e-4
"""Of the width of a prior: step of a difference."""

_MOVED = 0.1
"""Standard deviations by which moduli are moved; records at a given rate are linear in them."""

_SHIFTED_ANEW = 0.03
"""Of the records, how far predictions move before what errors of the moduli do is taken anew: these
errors are some per cent of the records themselves."""

_TRIALS = ((0.1, 0.0), (0.1, 10.0))
"""What is tried side by side: multiples of the last damping, and the least size over the usual one
by which runs may differ, for from where they do not, it takes a leap to where they do."""

_ENOUGH = 0.01
"""Gain of log posterior of a step below which a fit has ended."""

_FAR = 40.0
"""Log posterior behind the best from which on a fit does not count, and the rounds of as much gain
again that must bring it nearer."""

_ROUNDS_TO_GO = 10

LOG_2PI = float(np.log(2.0 * np.pi))


def _running_away() -> np.errstate:
    """Return what lets a trial that runs away be a rejected step, without a word."""
    return np.errstate(over="ignore", invalid="ignore")


class Fitter:
    """Fits of hypotheses of a problem to some of its rows.

    `problem`, `rows`: the problem, and what is predicted of it.
    """

    def __init__(self, problem: Problem, rows: Rows):
        self.problem, self.rows = problem, rows
        self.noise = NoiseModel(rows, None, problem.noise)
        self._without: dict[int | None, NoiseModel] = {None: self.noise}
        self._priors: dict[tuple[str, ...], tuple[Priors, np.ndarray]] = {}
        self._moduli = self._moved_moduli()
        self._no_shifts = np.zeros((len(rows), len(self._moduli)))
        self.errors = self.errors_of(rows)

    def errors_of(self, rows: Rows) -> LinearErrors:
        """Return what is linear in the records of other rows."""
        return LinearErrors(self.problem, rows, len(self._moduli))

    def noise_of(self, fit: Fit) -> NoiseModel:
        """Return the likelihood of the rows that a fit sees."""
        if fit.without not in self._without:
            self._without[fit.without] = NoiseModel(self.rows, fit.without, self.problem.noise)
        return self._without[fit.without]

    # errors of moduli -------------------------------------------------------------------------

    def _moved_moduli(self) -> Float[np.ndarray, "k c"]:
        """Return the moduli, moved by each independent error of theirs."""
        root, moduli = self.problem.modulus_root, self.problem.moduli
        if root is None:
            return np.zeros((0, len(moduli)))
        moves = np.zeros((root.shape[1], len(moduli)))
        moves[:, : len(root)] = _MOVED * root.T
        return moduli + moves

    def moduli_of(self, linear: Float[np.ndarray, "*draws q"]) -> Float[np.ndarray, "*draws c"]:
        """Return the moduli in Pa, and the solvent's viscosity, with their errors."""
        moduli = np.tile(self.problem.moduli, (*linear.shape[:-1], 1))
        if (root := self.problem.modulus_root) is not None:
            first = self.errors.of_runs.stop
            moduli[..., : len(root)] += linear[..., first : first + root.shape[1]] @ root.T
        return moduli

    def _shifts_of(
        self, moved: Float[np.ndarray, "k rows"], predicted: Float[np.ndarray, " rows"]
    ) -> Float[np.ndarray, "rows k"]:
        """Return the change of predictions with each error, of those at `_moved_moduli`."""
        with _running_away():
            return np.nan_to_num((moved - predicted).T / _MOVED)

    def _is_shifted_anew(self, fit: Fit) -> bool:
        """Return whether what errors of the moduli do is to be taken at other constants."""
        if fit.shifted is None:
            return len(self._moduli) > 0
        moved = (fit.predicted - fit.shifted) / self.rows.size
        with _running_away():
            return not np.sqrt(np.mean(moved**2)) < _SHIFTED_ANEW

    # predictions ------------------------------------------------------------------------------

    def predict(
        self,
        thetas: Sequence[np.ndarray] | Float[np.ndarray, "trials p"],
        moduli: Float[np.ndarray, "trials c"] | None = None,
    ) -> Float[np.ndarray, "trials rows"]:
        """Return the records of the model alone; not finite where the law runs away."""
        if not len(thetas):
            return np.zeros((0, len(self.rows)))
        with np.errstate(all="ignore"):
            if moduli is None:
                moduli = np.tile(self.problem.moduli, (len(thetas), 1))
            model, batch = self.problem.model, self.rows.batch
            return self.rows.flat(model.predictions(np.array(thetas), batch, moduli))

    def priors(self, names: Sequence[str]) -> Mapping[int, Prior]:
        """Return the priors of all that is free where some effects are there, by position."""
        return self.problem.priors(names)

    def start(
        self, names: Sequence[str], theta: np.ndarray, linear: np.ndarray | None = None
    ) -> Fit:
        """Return a hypothesis before its first step; what is not in it is not there."""
        key = tuple(names)
        if key not in self._priors:
            free = Priors(self.priors(key))
            self._priors[key] = free, np.setdiff1d(np.arange(len(theta)), free.positions)
        (priors, absent), theta = self._priors[key], theta.copy()
        theta[absent] = self.problem.zero[absent]
        theta[priors.positions] = np.clip(theta[priors.positions], *priors.range.T)
        linear = np.zeros(len(self.errors)) if linear is None else linear
        nothing = np.full(len(self.rows), np.nan)
        empty = Noise(np.ones(len(self.rows.runs)), 1.0, 0.0, 0.0)
        return Fit(
            tuple(sorted(names)), theta, linear, priors, nothing, -np.inf, -np.inf, empty,
            self._no_shifts,
        )  # fmt: skip

    def _set(self, fits: Sequence[Fit], predicted: Sequence[Float[np.ndarray, " rows"]]) -> None:
        """Set what predictions of the model say of hypotheses."""
        for fit, own in zip(fits, predicted, strict=True):
            fit.predicted = own
        records = np.array([self.record(fit) for fit in fits]).reshape(-1, len(self.rows))
        values, noises = self._log_likelihoods(fits, records)
        for fit, value, noise in zip(fits, values, noises, strict=True):
            fit.log_likelihood, fit.noise = float(value), noise
            fit.log_posterior = float(value + self._log_prior(fit, fit.theta, fit.linear))

    def _log_likelihoods(self, fits: Sequence[Fit], records: Float[np.ndarray, "fits rows"]):
        """Return the log likelihood of records, of the rows that each fit sees, and the noises."""
        values, noises = np.empty(len(fits)), [fit.noise for fit in fits]
        without = np.array([-1 if fit.without is None else fit.without for fit in fits])
        for one in np.unique(without):
            at = np.flatnonzero(without == one)
            model = self.noise_of(fits[at[0]])
            values[at], own = model.log_likelihoods(self.rows.recorded - records[at], records[at])
            for place, noise in zip(at, own, strict=True):
                noises[place] = noise
        return values, noises

    def _log_prior(self, fit: Fit, theta: np.ndarray, linear: np.ndarray) -> Any:
        """Return the log density of constants before the data, and of what is linear."""
        known = fit.priors.log_density(fit.priors.coordinates(theta))
        return known + self.errors.log_density(linear)

    def _steps(self, fit: Fit) -> Float[np.ndarray, " free"]:
        """Return by how much each coordinate is moved for a derivative, away from an upper end."""
        steps = _STEP * fit.priors.widths
        return np.where(fit.coordinates + steps > fit.priors.ends[:, 1], -steps, steps)

    def _moved(self, fit: Fit) -> list[np.ndarray]:
        """Return vectors whose differences from the fit are its derivatives."""
        return [*fit.priors.placed(fit.theta, fit.coordinates + np.diag(self._steps(fit)))]

    def _set_jacobian(self, fit: Fit) -> None:
        """Set the derivatives of the records, of those of the predictions."""
        assert fit.slopes is not None
        slopes = self.errors.through(fit.slopes, fit.predicted, fit.linear)
        linear = self.errors.columns(fit.predicted, fit.shifts)
        fit.jacobian = np.column_stack([slopes, linear])

    def record(self, fit: Fit) -> Float[np.ndarray, " rows"]:
        """Return the records as predicted, with what is linear."""
        return self.records(fit, fit.predicted[None], fit.linear[None])[0]

    def records(
        self,
        fit: Fit,
        predicted: Float[np.ndarray, "trials rows"],
        linear: Float[np.ndarray, "trials q"],
    ) -> Float[np.ndarray, "trials rows"]:
        """Return the records of trials of a fit, as the model predicts them and what is linear."""
        return self.errors.recorded(predicted, linear, fit.shifts)

    def misfit(self, fit: Fit) -> float:
        """Return the root mean square of what a fit leaves, over the size of each record."""
        left = (self.rows.recorded - self.record(fit)) / self.rows.size
        return float(np.sqrt(np.mean(left**2)))

    # fits ---------------------------------------------------------------------------------------

    def fit(
        self,
        starts: Sequence[Fit],
        rounds: int = 20,
        derivatives: bool = True,
        wanted: int | None = None,
        known: Iterable[Fit] = (),
        least: float = -np.inf,
    ) -> list[Fit]:
        """Return hypotheses at their likeliest constants; all take their steps side by side.

        Parameters
        ----------
        starts
            Hypotheses before their first step; one that has derivatives has predictions too.
        rounds
            Steps of each at most.
        derivatives
            Whether each ends with derivatives, covariance and evidence.
        wanted, known
            So many of the best matter, those fitted before among them: one that cannot come near is
            given up, without these.
        least
            Log posterior from which on a fit counts: one that does not reach it, were all rounds
            that are left worth the last, is given up likewise.
        """
        fits, known = list(starts), tuple(known)
        with _running_away():
            new = iter(self.predict([fit.theta for fit in fits if fit.slopes is None]))
            self._set(fits, [next(new) if fit.slopes is None else fit.predicted for fit in fits])
        active, given_up = [fit for fit in fits if np.isfinite(fit.log_posterior)], set()
        for left in reversed(range(rounds)):
            if not active:
                break
            self.linearise([fit for fit in active if fit.slopes is None])
            before = [fit.log_posterior for fit in active]
            with _running_away():
                going_on = self._stepped(active)
            gains = [fit.log_posterior - one for fit, one in zip(active, before, strict=True)]
            hopeless = {
                id(fit)
                for fit, gain in zip(active, gains, strict=True)
                if 0.0 < gain * left < least - fit.log_posterior
            }
            if wanted is not None:
                hopeless |= self.hopeless([*known, *fits], active, gains, wanted)
            given_up |= hopeless
            active = [fit for fit in going_on if id(fit) not in hopeless]
        if derivatives:
            usable = [
                fit for fit in fits if np.isfinite(fit.log_posterior) and id(fit) not in given_up
            ]
            self.linearise([fit for fit in usable if fit.slopes is None])
            for fit in usable:
                self._judge(fit)
        return fits

    @staticmethod
    def hopeless(
        fits: Sequence[Fit], active: Sequence[Fit], gains: Sequence[float], wanted: int
    ) -> set[int]:
        """Return which fits rounds of the gain of the last one do not bring near the best."""
        # the best of each set of effects: it has several starts
        best: dict[frozenset[str], float] = {}
        for fit in fits:
            key = frozenset(fit.names)
            best[key] = max(fit.log_posterior, best.get(key, -np.inf))
        near = sorted(best.values(), reverse=True)[:wanted][-1] - _FAR
        return {
            id(fit)
            for fit, gain in zip(active, gains, strict=True)
            if 0.0 < gain < (near - fit.log_posterior) / _ROUNDS_TO_GO
        }

    def linearise(self, fits: Sequence[Fit]) -> None:
        """Set the derivatives of fits, all of whose vectors are predicted side by side.

        What errors of the moduli do is taken at the constants too where these have moved far, for
        it is in proportion to the stress of each mode.
        """
        moved = [self._moved(fit) for fit in fits]
        anew = [self._is_shifted_anew(fit) for fit in fits]
        declared, thetas, moduli = self.problem.moduli, [], []
        for fit, some, is_anew in zip(fits, moved, anew, strict=True):
            shifted = self._moduli if is_anew else self._moduli[:0]
            thetas += [*some, *[fit.theta] * len(shifted)]
            moduli += [*[declared] * len(some), *shifted]
        found = self.predict(thetas, np.array(moduli).reshape(-1, len(declared)))
        place = 0
        for fit, some, is_anew in zip(fits, moved, anew, strict=True):
            own = found[place : place + len(some)]
            place += len(some)
            if is_anew:
                end = place + len(self._moduli)
                fit.shifts, place = self._shifts_of(found[place:end], fit.predicted), end
                fit.shifted = fit.predicted
            with _running_away():
                slopes = (own - fit.predicted).T / self._steps(fit)
            fit.slopes = np.where(np.all(np.isfinite(slopes), axis=0), slopes, 0.0)
            self._set_jacobian(fit)
        usable = [
            fit
            for fit, is_anew in zip(fits, anew, strict=True)
            if is_anew and np.isfinite(fit.log_posterior)
        ]
        if usable:
            self._set(usable, [fit.predicted for fit in usable])

    def _normal_equations(self, fit: Fit):
        """Return gradient and curvature of the log posterior in the coordinates."""
        assert fit.jacobian is not None
        record = self.record(fit)
        both = np.column_stack([fit.jacobian, self.rows.recorded - record])
        white = self.noise_of(fit).whitened(both, record, fit.noise)
        columns, left = white[:, :-1], white[:, -1]
        curvature, gradient = columns.T @ columns, columns.T @ left
        n, own = len(fit.priors), fit.priors.pulls(fit.coordinates)
        gradient[:n] += own[:, 0]
        curvature[np.arange(n), np.arange(n)] += own[:, 1]
        at = np.arange(n, len(gradient))
        widths = self.errors.widths(fit.linear)
        gradient[n:] -= fit.linear / widths**2
        curvature[at, at] += 1.0 / widths**2
        return gradient, curvature

    def _trials(self, fit: Fit) -> tuple[np.ndarray, np.ndarray]:
        """Return vectors to try, and what is linear in them, shapes (trials, p) and (trials, q)."""
        gradient, curvature = self._normal_equations(fit)
        ends, now, n = fit.priors.ends, fit.coordinates, len(fit.priors)
        slope = gradient[:n]
        stays = ((now <= ends[:, 0]) & (slope < 0)) | ((now >= ends[:, 1]) & (slope > 0))
        at = np.flatnonzero(np.append(~stays, np.ones(len(gradient) - n, bool)))
        multiples, least = np.array(_TRIALS).T
        widths = self.errors.widths(fit.linear, least)  # the first as they are
        known = np.zeros((len(_TRIALS), len(gradient)))
        known[:, n:] = 1.0 / widths**2 - 1.0 / widths[0] ** 2
        place = np.append(np.zeros(n), fit.linear)
        inner = np.tile(curvature[np.ix_(at, at)], (len(_TRIALS), 1, 1))
        diagonal = np.arange(len(at))
        inner[:, diagonal, diagonal] += known[:, at]
        inner[:, diagonal, diagonal] *= 1.0 + fit.damping * multiples[:, None]
        steps = np.zeros((len(_TRIALS), len(gradient)))
        steps[:, at] = np.linalg.solve(inner, (gradient - known * place)[:, at, None])[..., 0]
        return fit.at(now + steps[:, :n]), fit.linear + steps[:, n:]

    def _stepped(self, fits: Sequence[Fit]) -> list[Fit]:
        """Take the best of some trials of each fit; return fits that are to go on."""
        trials = [self._trials(fit) for fit in fits]
        thetas, linear = (np.concatenate(one) for one in zip(*trials, strict=True))
        of = [fit for fit in fits for _ in _TRIALS]
        found = self.predict(thetas)
        own = [slice(first, first + len(_TRIALS)) for first in range(0, len(of), len(_TRIALS))]
        records = [
            self.records(fit, found[at], linear[at]) for fit, at in zip(fits, own, strict=True)
        ]
        likelihoods, noises = self._log_likelihoods(of, np.concatenate(records))
        going_on = []
        for fit, at in zip(fits, own, strict=True):
            values = likelihoods[at] + self._log_prior(fit, thetas[at], linear[at])
            gains = np.where(values > fit.log_posterior, values - fit.log_posterior, 0.0)
            best = int(np.argmax(gains))
            if not gains[best]:
                fit.damping *= 30.0
                if fit.damping < 1e4:
                    going_on.append(fit)
                continue
            chosen = at.start + best
            fit.theta, fit.linear, fit.predicted = thetas[chosen], linear[chosen], found[chosen]
            fit.log_likelihood, fit.noise = float(likelihoods[chosen]), noises[chosen]
            fit.log_posterior = float(values[best])
            fit.damping = max(fit.damping * _TRIALS[best][0], 1e-7)
            if gains[best] > _ENOUGH:
                fit.slopes = None
                going_on.append(fit)
            else:  # so near that the slopes are those of the end
                self._set_jacobian(fit)
        return going_on

    def _judge(self, fit: Fit) -> None:
        """Set covariance and evidence of a fit, by Laplace's method."""
        record = self.record(fit)
        left = self.rows.recorded - record
        _, grid = self.noise_of(fit).log_likelihood(left, record)
        fit.noise = self.noise_of(fit).refined(left, record, grid)
        _, curvature = self._normal_equations(fit)
        if not np.all(np.isfinite(curvature)):
            return  # a step away the law runs away
        pulls = fit.priors.pulls(fit.coordinates)
        # over the widths of the priors no eigenvalue is less than one, however alike columns are
        scale = np.append(1.0 / np.sqrt(pulls[:, 1]), self.errors.widths(fit.linear))
        factor = np.linalg.cholesky(scale[:, None] * curvature * scale)
        root = scale[:, None] * solve_triangular(factor, np.eye(len(scale)), lower=True).T
        fit.root, fit.covariance = root, root @ root.T
        determinant = 2.0 * float(np.sum(np.log(np.diag(factor) / scale)))
        ended = []
        for name in fit.names:
            at = self.problem.model.positions(name)[0]
            prior = fit.priors[at]
            if prior.low == 0.0 and fit.theta[at] <= 1e-6 * prior.width:
                ended.append(name)
        fit.vanished = tuple(ended)
        n = len(curvature)
        fit.log_evidence = (
            -np.inf if ended else fit.log_posterior + 0.5 * n * LOG_2PI - 0.5 * determinant
        )
