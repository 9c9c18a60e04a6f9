"""The search for what the runs lack, from a declared law or from one that is chosen on the way."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

from discover.closed_loop.added_mode_apart import (
    LawByMode,
    has_second_mode,
    law_by_mode_instead,
    start_from,
)
from discover.closed_loop.candidates import admission
from discover.closed_loop.explanations import FACTORS, Carried, carry_and_turn
from discover.closed_loop.judging.numerical_resolution import NumericalResolution
from discover.closed_loop.judging.tolerated_misfit import ToleratedMisfit
from discover.closed_loop.law_choice import choose_law, law_beside_effects, taken_first
from discover.closed_loop.modes_apart import modes_apart, with_other_laws
from discover.closed_loop.results.law_fit import LawFit
from discover.closed_loop.search import Search
from discover.closed_loop.search.checkpoint import SearchCheckpoint, Store
from discover.closed_loop.small_strains import find_instrument_effects
from discover.dataset import Run
from discover.effects import BY_MODE, AbstractEffect, make_effect
from discover.forward import AugmentedModel, Batch, DeclaredModel, data_scales, make_batch
from discover.forward.declared import may_differ_by_mode
from discover.inference.by_mode.constants import ConstantByMode
from discover.inference.by_mode.degrees import one_degree_more
from discover.inference.evidence import BARE_MENTION, INDISTINGUISHABLE
from discover.inference.problem import effect_of
from discover.statistics.residual import Expectation


@dataclass(frozen=True)
class SearchResult:
    """A search that has ended.

    Attributes
    ----------
    declared
        The model that it started from.
    laws
        The laws that the declared one was chosen from, the best first.
    search
        The search, with what it found.
    carried
        The sets of effects that explain the records; none of silent ones.
    by_mode
        What is known of each mode's constant, where one for all modes explains the records.
    """

    declared: DeclaredModel
    laws: tuple[LawFit, ...]
    search: Search
    carried: list[Carried]
    by_mode: Mapping[str, ConstantByMode] = field(default_factory=dict)


@dataclass(frozen=True)
class SearchTask:
    """Among which effects to search, in which runs.

    Attributes
    ----------
    fitted, held_out
        Runs to fit, and runs that only judge.
    noise
        Relative noise, where it is known.
    max_effects, width
        Largest number of effects, and of explanations that are carried.
    silent
        Whether the records hold nothing to search in.
    store, name
        Where the search is kept, and as what.
    say
        Called with a line of text now and then.
    """

    candidates: Sequence[AbstractEffect]
    fitted: Sequence[Run]
    held_out: Sequence[Run]
    noise: float | None
    max_effects: int
    width: int
    silent: bool
    store: Store | None
    name: str
    say: Callable[[str], None]

    def search(self, declared: DeclaredModel, laws: Sequence[str] = ()) -> SearchResult:
        """Search from a declared model, or from the law that the runs ask for.

        A law chosen while effects were missing may stand for a part of them. So the laws are fitted
        once more beside what was found, and another is searched beside and taken if that is
        likelier. Where what was found does not explain the runs, its constants may differ from mode
        to mode: that is searched once more too, and taken on strong evidence. Where it does, what
        it leaves open of each mode's constant is looked at beside it. Where it found the second
        mode of a fluid, laws by mode are asked in the place of what it found beside.

        Parameters
        ----------
        laws
            Named laws to choose its law from; none where it is as declared.

        Raises
        ------
        InputError
            If the declared model, or none of the laws, can be integrated through the fitted runs.
        """
        if self.silent:
            return self._begun(declared, (), self.name)
        first = self._with_law(declared, laws)
        if len(declared.modulus) > 1:
            return self._with_modes_apart(first)
        return self._with_added_mode_apart(first)

    def _with_law(self, declared: DeclaredModel, laws: Sequence[str]) -> SearchResult:
        if not laws:
            return self.carried(self._begun(declared, (), self.name))
        chosen = choose_law(declared, laws, self.fitted, self.held_out, self.say)
        first = self.carried(self._begun(*chosen, self.name))
        if not first.search.active:
            return first
        other, lines = law_beside_effects(
            first.declared, first.laws, first.search, self.fitted, self.held_out, self.say
        )
        if other is not None:
            again = self.carried(self._begun(other, lines, f"{self.name}_{other.law_name}"))
            if _is_likelier(again.search, first.search):
                return again
        # the law stays, and its constants are those beside the effects
        return replace(first, laws=taken_first(lines, first.declared.law_name))

    def _with_modes_apart(self, first: SearchResult) -> SearchResult:
        declared, search = first.declared, first.search
        names = _may_differ(search)
        if declared.by_mode or not names:
            return first
        if search.explained and (found := self._alike(search, names)) is not None:
            return replace(first, by_mode=found)
        self.say(f"constants that may differ from mode to mode: {', '.join(names)}")
        apart = replace(declared, by_mode=tuple(names))
        again = self._begun(apart, first.laws, f"{self.name}_by_mode")
        differ = any(one.degree for one in again.search.degrees.values())
        better = differ and _is_likelier(again.search, search, INDISTINGUISHABLE)
        # what else explains the runs is followed only where the search is taken
        return self.carried(again) if better else first

    def _with_added_mode_apart(self, first: SearchResult) -> SearchResult:
        search = first.search
        found = law_by_mode_instead(search, self.max_effects, data_scales(self.fitted))
        names = _may_differ(search)
        if found is None:
            told = search.explained and names and has_second_mode(search)
            by_mode = self._alike(search, names) if told else None
            return replace(first, by_mode=by_mode or {})
        self.say(f"{found.name} may differ from mode to mode, beside {', '.join(found.effects)}")
        name = f"{self.name}_by_mode"
        begun = self._begun(found.model.declared, first.laws, name, instead=(search, found))
        again = self.carried(begun)
        return first if _is_likelier(search, again.search, INDISTINGUISHABLE) else again

    def _alike(self, search: Search, names: list[str]) -> dict[str, ConstantByMode] | None:
        """Return what runs say of each mode's constants; None where these differ."""
        self.say(f"what the runs say of {', '.join(names)} in each mode")
        scales = data_scales(self.fitted)
        found = modes_apart(search, names, scales)
        if any(max(one.evidence) > INDISTINGUISHABLE for one in found.values()):
            return None
        return with_other_laws(search, found, scales)

    def one_degree_more(self, before: SearchResult) -> SearchResult | None:
        """Search once more with constants by mode of one degree more; None where there is none.

        What else explains the runs is not followed yet (`carried`).

        Parameters
        ----------
        before
            A search whose constants by mode explain the fitted runs, and no others.
        """
        least = one_degree_more(before.search.model, before.search.degrees)
        if not least:
            return None
        degrees = ", ".join(f"{name} of degree {degree}" for name, degree in least.items())
        self.say(f"constants that may differ from mode to mode once more: {degrees}")
        name = f"{self.name}_by_mode_{'_'.join(map(str, least.values()))}"
        return self._begun(before.declared, before.laws, name, least)

    @cached_property
    def _batch(self) -> Batch:
        return make_batch(self.fitted)

    @cached_property
    def _held_batch(self) -> Batch | None:
        return make_batch(self.held_out) if self.held_out else None

    def carried(self, begun: SearchResult) -> SearchResult:
        """Return a search with what else explains the runs."""
        carried = carry_and_turn(begun.search, self.max_effects, self.width, self.say)
        return replace(begun, carried=carried)

    def _begun(
        self,
        declared: DeclaredModel,
        laws: tuple[LawFit, ...],
        name: str,
        least: Mapping[str, int] | None = None,
        instead: tuple[Search, LawByMode] | None = None,
    ) -> SearchResult:
        # of one mode nothing can differ from another's
        by_mode = [BY_MODE] if len(declared.modulus) > 1 else []
        names = {e.name for e in (*self.candidates, *declared.effects)}
        # no candidates, but a bench may have a little of them
        unasked = {*FACTORS} - names
        asked = [*self.candidates, *map(make_effect, sorted(unasked)), *by_mode]
        model = AugmentedModel(declared, asked, data_scales(self.fitted), fitted=self._batch)
        admitted = admission(self.fitted, self.held_out)
        search = Search(
            model,
            self._batch,
            self._held_batch,
            len(self.candidates),
            lambda effect: effect.name not in unasked and admitted(effect),
            ToleratedMisfit(
                Expectation(self.noise, declared.linear_error),
                NumericalResolution(model, self._batch, self.fitted),
            ),
            SearchCheckpoint(self.store, name),
        )
        search.least_degrees = dict(least or {})
        if self.silent:
            self.say("the records are noise about a constant: there is nothing to search in")
            search.start()
            return SearchResult(declared, laws, search, [])
        if search.resume():
            self.say(f"going on from what was kept: {', '.join(search.active)}")
        else:
            self.say(f"declared model on {len(self.fitted)} runs")
            search.start(by_mode=instead is None)
            if instead is None:
                find_instrument_effects(search, self.fitted, self.max_effects, self.say)
            else:
                start_from(search, *instead)
        search.run(self.max_effects, self.say)
        return SearchResult(declared, laws, search, [])


def _may_differ(search: Search) -> list[str]:
    """Return the constants of a finished search that may differ from mode to mode."""
    names = [p.name for p in search.model.declared.free_parameters]
    found = (name for name in search.active if may_differ_by_mode(effect_of(search.model, name)))
    return [*names, *found]


def _is_likelier(search: Search, other: Search, by: float = BARE_MENTION) -> bool:
    """Return whether what one search found explains the runs better than what another did."""
    effective = min(one.problem.independent_samples(one.fit) for one in (search, other))
    own, theirs = (one.problem.worth(one.fit, one.active, effective) for one in (search, other))
    return own < theirs - by
