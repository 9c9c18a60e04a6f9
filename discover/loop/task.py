"""The task of a closed loop: among which effects to search, in which runs, added to which law."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from discover.dataset import Dataset, Run
from discover.dataset.records.repeats import require_loadings
from discover.effects import (
    AbstractEffect,
    ConstitutiveEffect,
    KinematicEffect,
    KnownEffect,
    SignalEffect,
    library_effects,
    make_effect,
    named_effects,
)
from discover.errors import InputError
from discover.forward import MODULUS, RELAXATION_TIME, DeclaredModel
from discover.forward.declared import may_differ_by_mode
from discover.inference import Posterior, Problem
from discover.inference.fits import Fitter
from discover.inference.posterior import occams_window, posterior_of, refitted_to_all_runs
from discover.inference.search import Search, with_one_constant, without_by_mode
from discover.laws import LAWS
from discover.laws.registry import starting_values
from discover.loop.measured_rates import rate_reading_noise, smoothed, with_step_instants
from discover.loop.parts import LawFit
from discover.loop.path import records_of
from discover.loop.runs import MOST_SAMPLES, errors_of, require_samples, split_runs, unfitted_runs
from discover.words import unknown_name

Say = Callable[[str], None]

EXTRAPOLATION = 10.0
"""Ratio of held-out to fitted shear rates beyond which a law must stay well-posed."""

_AT_END = 1e-3  # Share of its range within which a constant stands at an end
_DIVERGES = "its stress diverges. Check its parameters, modes and units."


@dataclass(frozen=True)
class Task:
    """Among which effects to search, in which runs, added to which law.

    `declared`: the model to start from. `fitted`, `held_out`: runs to fit, and runs that only test.
    `noise`, `loading`: relative noise where it is known, and deviation of loadings, zero where
    there are none. `most`: largest number of effects. `say`: called with a line of text now and
    then. `computed`: whether runs were computed: they know no instrument, a sound one either.
    `spikes`: times of samples set aside as outliers, by run. `of_rates`: that rates were read with
    noise which the fluid did not feel; empty where not. `unfitted`: their N1 and N2 besides.
    """

    declared: DeclaredModel
    candidates: Sequence[AbstractEffect]
    fitted: Sequence[Run]
    held_out: Sequence[Run]
    noise: float | None = None
    loading: float = 0.0
    most: int = 3
    say: Say = lambda line: None
    computed: bool = False
    spikes: Mapping[str, Sequence[float]] = field(default_factory=dict)
    of_rates: str = ""
    unfitted: Sequence[Run] = ()

    @classmethod
    def of_runs(
        cls,
        dataset: Dataset,
        declared: DeclaredModel,
        fit: Sequence[str] | None = None,
        held_out: Sequence[str] = (),
        effects: Sequence[str | AbstractEffect] | str | None = None,
        max_effects: int = 3,
        strain: tuple[float, float] | None = None,
        noise: float | None = None,
        most_samples: int = MOST_SAMPLES,
        progress: Say | None = None,
        loading: float | None = None,
        computed: bool = False,
    ) -> "Task":
        """Return the task that runs, model and candidates make.

        `fit`, `held_out`: names of runs; by default all are fitted that are not held out.
        `effects`: as in `candidates_of`. `max_effects`, `strain`, `noise`, `most_samples` and
        `loading` are those of `discover.study.schema.Loop`; samples are evenly chosen, of a run
        with little noise fewer, but no fewer than 150. `computed`: see above. Raises InputError if
        runs, window or effects are not as they should be.
        """
        if max_effects < 0:
            raise InputError(f"max_effects must be 0 or more; got {max_effects}.")
        fitted, held, spikes = split_runs(dataset, fit, held_out, strain, most_samples)
        for some in (fitted, held):
            require_loadings(some, loading)
        declared, every, _ = with_step_instants(declared, [*fitted, *held], [])
        fitted, held = every[: len(fitted)], every[len(fitted) :]
        require_samples(fitted, declared)
        candidates = further_candidates(declared, effects, [*fitted, *held])
        of_rates = rate_reading_noise(declared, fitted)
        if of_rates:
            fitted, held = [*map(smoothed, fitted)], [*map(smoothed, held)]
        return cls(
            declared, candidates, fitted, held, noise, loading or 0.0, max_effects,
            progress or (lambda line: None), computed, spikes, of_rates,
            unfitted_runs(dataset, [*fitted, *held]),
        )  # fmt: skip

    def problem(
        self, declared: DeclaredModel, effects: Sequence[AbstractEffect] | None = None
    ) -> Problem:
        """Return the problem that a declared model makes of the runs.

        `effects`: those that may be there, for a fit to the fitted runs alone; else all candidates.
        """
        runs = self.held_out if effects is None else ()
        if effects is None:
            admitted = admission(self.fitted, self.held_out)
            known = {effect.name for effect in declared.effects}
            effects = [e for e in self.candidates if admitted(e) and e.name not in known]
        return Problem(
            declared, effects, self.fitted, runs, self.loading, self.noise, self.computed
        )

    def searched(self, declared: DeclaredModel, before: Search | None = None) -> Search:
        """Return the search among what a declared model lacks.

        `before`: one with other constants by mode, of which all is kept that does not depend on
        these, and what is likely is fitted anew. Raises InputError if the model cannot be
        integrated through the fitted runs.
        """
        problem = self.problem(declared)
        self.say(f"search among {len(problem.candidates)} effects")
        fitter = Fitter(problem, problem.fitted)
        # the model without any effect
        if not np.all(np.isfinite(fitter.predict([problem.zero]))):
            raise InputError(
                "The declared model cannot be integrated through the fitted runs: " + _DIVERGES
            )
        if before is None:
            return Search(fitter, self.most, self.say).run()
        search = Search(fitter, self.most, self.say, without_by_mode(before, fitter)).run()
        likely = occams_window(before)
        # what the search passes over, for many constants by mode are many to fit from nothing
        search.add(
            fitter.start(fit.names, with_one_constant(fit, before.problem, problem), fit.linear)
            for fit in likely
            if frozenset(fit.names) not in search.found
        )
        return search

    def explained(self, declared: DeclaredModel) -> Posterior:
        """Return the posterior over what a declared model lacks.

        With constants that differ from mode to mode if it is then likelier: of a model with several
        modes, those that it declares so, or else what is possible and may differ. Raises InputError
        as `searched`.
        """
        first = self.searched(declared)
        posterior = posterior_of(first)
        if len(declared.modulus) < 2 or not posterior.explanations:
            return posterior
        names, whole = (), posterior.memory["whole"][0]
        if not declared.by_mode:
            # also what is less likely with one constant for all: that may be why
            some = [*occams_window(whole), *occams_window(first)]
            found = dict.fromkeys(name for fit in some for name in fit.names)
            names = tuple(n for n in found if may_differ_by_mode(first.problem.effects[n]))
            if not names:
                return posterior
        self.say("constants that may differ from mode to mode")
        second = self.searched(replace(declared, by_mode=names), first)
        # by all runs, as the verdict is: those held out may be the ones that tell
        of_all = refitted_to_all_runs(second)
        gain = 2.0 * (log_evidence(of_all) - log_evidence(whole))
        if gain > 0.0:
            posterior = posterior_of(second, whole=of_all)
        posterior.memory["by_mode"] = abs(gain)
        return posterior

    def choose(self, laws: Sequence[str]) -> tuple[DeclaredModel, dict[str, Search]]:
        """Return the declared model with the likeliest of some laws, and the search with each.

        Raises InputError if a name is none, or no law can be integrated through the fitted runs.
        """
        unknown = [name for name in laws if name not in LAWS]
        if unknown:
            raise InputError(unknown_name("law", unknown[0], LAWS))
        found: dict[str, Search] = {}
        for name in dict.fromkeys(laws):
            self.say(f"law {len(found) + 1} of {len(laws)}: {LAWS[name].title}")
            problem = self.problem(with_law(self.declared, name))
            found[name] = Search(Fitter(problem, problem.fitted), self.most).run()
        if not found:
            return self.declared, found
        best = max(found, key=lambda name: log_evidence(found[name]))
        if not np.isfinite(log_evidence(found[best])):
            raise InputError(
                f"None of the laws {', '.join(laws)} can be integrated through the fitted runs: "
                "their stress diverges. Check modes and units."
            )
        return found[best].problem.declared, found

    def lines(self, found: Mapping[str, Search]) -> tuple[LawFit, ...]:
        """Return the laws that were tried, the likeliest first."""
        logs = {name: log_evidence(search) for name, search in found.items()}
        total, lines = float(np.logaddexp.reduce(list(logs.values()))), []
        for name in sorted(found, key=lambda name: -logs[name]):
            search = found[name]
            alive = search.ranked()
            if not alive:
                lines.append(LawFit(name, starting_values(name)))
                continue
            best, declared = alive[0], search.problem.declared
            values, ends = {}, []
            for i, parameter in enumerate(declared.free_parameters):
                value = float(np.clip(best.theta[2 + i], parameter.low, parameter.high))
                values[parameter.name] = value
                room = _AT_END * (parameter.high - parameter.low)
                if min(value - parameter.low, parameter.high - value) < room:
                    ends.append(parameter.name)
            error = errors_of(records_of(search, best), 0)
            probability = float(np.exp(logs[name] - total))
            lines.append(LawFit(name, values, tuple(ends), error, probability, best.names))
        return tuple(lines)


def log_evidence(search: Search) -> float:
    """Return the log of evidence times prior of all hypotheses of a search together."""
    alive = search.ranked()
    return float(np.logaddexp.reduce([search.rank(fit) for fit in alive])) if alive else -np.inf


def with_law(declared: DeclaredModel, name: str) -> DeclaredModel:
    """Return the declared model with another law, all of whose constants are fitted."""
    factors = {MODULUS: declared.fit_modulus, RELAXATION_TIME: declared.fit_relaxation_time}
    return DeclaredModel.named(
        name,
        starting_values(name),
        declared.modulus,
        declared.relaxation_time,
        free=[*LAWS[name].parameters, *(factor for factor, free in factors.items() if free)],
        solvent_viscosity=declared.solvent_viscosity,
        linear_error=declared.linear_error,
        modulus_covariance=declared.modulus_covariance,
        effects=declared.effects,
        step_instants=declared.step_instants,
    )


def candidates_of(effects: Sequence[str | AbstractEffect] | str | None) -> list[AbstractEffect]:
    """Return the effects that are asked for.

    `effects`: names, spellings of library terms or objects; ``"named"`` for every effect with a
    name that is no candidate on request alone; None for these and every library term up to one
    invariant.

    Raises InputError if there is none, one is given twice, or a name is unknown.
    """
    named = [effect for effect in named_effects().values() if not effect.on_request]
    if effects is None:
        return [*named, *library_effects()]
    if effects == "named":
        return named
    if isinstance(effects, str):
        raise InputError(
            f'effects must be a list of names, or "named" for every effect with a name; got '
            f"{effects!r}. Write [{effects!r}] for this one alone."
        )
    if not effects:
        raise InputError("The loop needs at least one candidate effect; got none.")
    made = [make_effect(effect) if isinstance(effect, str) else effect for effect in effects]
    names = [effect.name for effect in made]
    repeated = [name for name in names if names.count(name) > 1]
    if repeated:
        raise InputError(f"The effect {repeated[0]!r} is given twice.")
    return made


def admission(fitted: Sequence[Run], held: Sequence[Run]) -> Callable[[AbstractEffect], bool]:
    """Return which effects are candidates, given the rates.

    Terms that name the rate are none where the loop must extrapolate far in it; what shapes a
    command is none where the rate was measured; what reads a force is none where no N1 or N2 is
    fitted. Rates are set, or measured, apart from the stress, so this looks at no held-out stress.
    """
    measured = any(run.rate_is_measured for run in fitted)
    fastest = max(float(np.max(np.abs(run.rate))) for run in fitted)
    asked = max((float(np.max(np.abs(run.rate))) for run in held), default=0.0)
    far = asked > EXTRAPOLATION * fastest
    of_force = any(run.quantity in ("N1", "N2") for run in fitted)

    def admitted(effect: AbstractEffect) -> bool:
        if isinstance(effect, KinematicEffect):
            return not (measured and effect.shapes_command)
        if isinstance(effect, SignalEffect):
            return of_force or not effect.of_force
        return not (far and isinstance(effect, ConstitutiveEffect) and effect.explicit_rate)

    return admitted


def require_possible(effects: Sequence[KnownEffect], runs: Sequence[Run]) -> None:
    """Refuse a known effect that the rates of these runs contain already."""
    measured = [run.name for run in runs if run.rate_is_measured]
    for known in effects:
        if measured and isinstance(known.effect, KinematicEffect) and known.effect.shapes_command:
            raise InputError(
                f"The known effect {known.name} lies between the command and the tool, and the "
                f"rate of {measured[0]} was measured at the tool, so it contains it already. Leave "
                "the effect out."
            )


def _require_present(declared: DeclaredModel, present: set[str]) -> None:
    """Refuse an effect by mode that is neither declared nor a candidate."""
    free = {parameter.name for parameter in declared.free_parameters}
    absent = [name for name in declared.by_mode if name not in free and name not in present]
    if absent:
        raise InputError(
            f"by_mode names the effect {absent[0]}, which is neither declared nor a candidate. Add "
            "it to [model] effects or to [loop] effects, or take it out of by_mode."
        )


def further_candidates(
    declared: DeclaredModel,
    effects: Sequence[str | AbstractEffect] | str | None,
    runs: Sequence[Run],
) -> list[AbstractEffect]:
    """Return the effects that are asked for and that the declared model does not know.

    Raises InputError as `candidates_of`, or if an effect by mode is neither declared nor among
    them, or the rates of the runs, fitted or held out, contain a known effect already.
    """
    candidates = candidates_of(effects)
    known = {effect.name for effect in declared.effects}
    _require_present(declared, {*known, *(effect.name for effect in candidates)})
    require_possible(declared.effects, runs)
    return [effect for effect in candidates if effect.name not in known]
