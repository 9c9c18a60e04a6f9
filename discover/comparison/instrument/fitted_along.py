"""Constants that are fitted along with each learner: a gain, a rise time, a factor on moduli.

A learner is given the constants, then the constants are fitted given what it found, in turn, until
they settle. Both learners, and the classical laws, start from the same constants.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

from discover.comparison.instrument.before_learning import CLASSICAL_EFFECTS, BeforeLearning
from discover.comparison.instrument.corrected import InRecord, corrected
from discover.comparison.instrument.free_constants import FreeConstants
from discover.comparison.instrument.given_law import ConstantsGivenLaw
from discover.comparison.instrument.twins import twins_of_constants
from discover.comparison.outcomes.constant import Constant
from discover.effects import library_term, make_effect
from discover.errors import InputError
from discover.forward import AugmentedModel, data_scales
from discover.laws.multimode import Fluid
from discover.laws.textbook.maxwell import UpperConvectedMaxwell
from discover.learners.results.result import LearnerResult
from discover.study.data import StudyData
from discover.study.declared_model import DeclaredModel, forward_model
from tensor_library.library import TermLibrary

_ROUNDS = 3

Train = Callable[[DeclaredModel, StudyData, TermLibrary], tuple[LearnerResult, Fluid]]
"""From a known part without free constants, corrected data and candidate terms."""


@dataclass(frozen=True)
class Learned:
    """What a learner found together with constants.

    Attributes
    ----------
    result, fluid
        What it found.
    constants
        By name.
    rounds
        How often it learned.
    settled
        Whether the constants had settled by then.
    """

    result: LearnerResult
    fluid: Fluid
    constants: Mapping[str, Constant]
    rounds: int
    settled: bool


class FittedAlong:
    """The constants of a declared model that are fitted along with each learner.

    Parameters
    ----------
    declared
        The known part; what is to be fitted are constants of the modes and of the instrument.
    data
        As recorded.
    library
        The study's candidate terms.

    Raises
    ------
    InputError
        If these runs cannot tell two of the constants apart.
    """

    def __init__(self, declared: DeclaredModel, data: StudyData, library: TermLibrary):
        self.data, self.library = data, library
        if not declared.law.linear_relaxation:
            raise InputError(
                "known_relaxation = false leaves the linear law to the learners, so no constant "
                f"({', '.join(declared.free_constants)}) can be fitted along with it. Write "
                "numbers."
            )
        forward = forward_model(declared)
        if not isinstance(declared.law, UpperConvectedMaxwell):
            # one law of terms, whatever its name: no parameter of it is free any more
            forward = replace(forward, law_name="", parameters=(), free_parameters=())
        classical = [make_effect(name) for name in CLASSICAL_EFFECTS.values()]
        names = {effect.name for effect in classical}
        self._terms = [library_term(t) for t in library.terms if t.closed_form is None]
        terms = [term for term in self._terms if term.name not in names]
        self.runs = list(data.fit)
        self.model = AugmentedModel(forward, [*classical, *terms], data_scales(self.runs))
        self.constants = FreeConstants(declared, self.model)
        self.before = BeforeLearning(self.constants, self.model, self.runs)

    def corrected(
        self, raw: Mapping[str, float]
    ) -> tuple[DeclaredModel, StudyData, Mapping[str, InRecord]]:
        """Return known part, data, and what the instrument makes of them, with these constants."""
        model = self.constants.with_values(raw)
        data, made = corrected(self.data, model.effects)
        return replace(model, effects=()), data, made

    @cached_property
    def twins(self) -> tuple[str, ...]:
        """Terms of the library that do to these records what the constants do."""
        theta = self.constants.vector(self.before.start)
        return twins_of_constants(self.constants, self._terms, self.model, self.before.batch, theta)

    @property
    def searched(self) -> TermLibrary:
        """The library without the terms that the constants stand for."""
        if not self.twins:
            return self.library
        kept = [i for i, name in enumerate(self.library.names) if name not in self.twins]
        if not kept:
            raise InputError(
                "Every term of the library does to these records what the constants to be fitted "
                f"({', '.join(self.constants.positions)}) do. Write numbers for them, or allow "
                "more terms."
            )
        return self.library.subset(kept)

    def learn(self, train: Train) -> Learned:
        """Return what a learner finds with the constants fitted along."""
        raw, rounds, settled = dict(self.before.start), 0, False
        library = self.searched
        given_law = ConstantsGivenLaw(
            self.constants, self.model, self.before.batch, self.runs, self._terms
        )
        while True:
            rounds += 1
            model, data, _ = self.corrected(raw)
            result, _ = train(model, data, library)
            given = given_law.fitted(result, raw)
            if given is None:
                break
            settled, raw = given.settled(raw), given.raw
            if settled or rounds == _ROUNDS:
                break
        if given is not None and given.joint is not None:
            result = given_law.law_with(result, given.joint)
        known = self.constants.with_values(raw)
        fluid = Fluid(
            result.law, known.modulus, known.relaxation_time, float(known.solvent_viscosity)
        )
        bounds = {} if given is None else given.bounds
        return Learned(result, fluid, self.constants.labelled(raw, bounds), rounds, settled)
