"""What a closed loop found, before it is put into an answer."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

from discover.answer import TOLERANCE, Discrepancy
from discover.answer.simple_material import SimpleMaterial
from discover.effects.registry import spelled_on_a_page
from discover.equations import Equation, StatePart, Tested, law_parts_by_mode
from discover.equations.equation import box_of, flow_numbers, mean_relaxation_time
from discover.equations.parts import LawParts
from discover.errors import InputError
from discover.inference.design import NextTests
from discover.inference.free_form import FreeForm
from discover.laws import Fluid
from discover.loop import parts
from discover.loop.runs import RunRecord


@dataclass(frozen=True)
class LoopFindings:
    """What a closed loop found.

    `verdict`: what is to be believed. `error_before`, `error_after`: of the declared and of the
    augmented model. `noise_floor`: relative noise, mean over the fitted runs. `stages`: effects
    added, in order. `remaining`: the residual, and whether it is systematic. `rankings`: candidates
    at each stage, and those that earned nothing at the last. `records`: every run with its
    predictions. `unfitted`: what else they recorded. `corrections`: by how much each effect of the
    instrument changes a run at most. `declared_parameters`: of the declared law: modulus in Pa and
    relaxation time in s, or for several modes a common factor on each, and parameters of the law;
    those that may differ from mode to mode are a `ConstantByMode`. `declared_effects`: effects that
    were part of the declared model, and so are no finding. `declared_law`: the declared law with
    its modes as finally fitted, without effects; None where it cannot be written out. `fluid`: the
    augmented fluid, without instrument effects; None where an effect gives it a state that no law
    of stress and rate can carry, or where its constants differ from mode to mode. `fluid_at_mean`:
    the same with constants that differ from mode to mode at the mean relaxation time, and without
    states; None where `fluid` is there, or a state cannot be written out. `states`: structure
    variables of the whole fluid. `explanations`: what explains the fitted runs about as well as
    what was found, and how probable each is. `next_tests`: the tests that were weighed by how well
    they would distinguish these. `laws`: the laws that the declared one was chosen from, the best
    first; none where one was declared. `free_form`: free functions of one variable that explain
    what named effects leave, the likeliest first. `discrepancy`: size of what no hypothesis holds,
    as the contract writes it; None where nothing is said. `spread_of_laws`: by how much laws that
    describe the runs as well differ in σ12, N1, N2, uniaxial stress. `left_out`:
    relative error besides noise of each fitted run while it is left out of the fit, by name.
    `nearest_law`: where the law has no name of the field: the best that has one. `material`: the
    simple material that the runs show, recognised before any search; None where none is.
    `tolerance`: relative discrepancy that is accepted. `temperature_C`: of the moduli and times;
    None where unknown. `folds`: the loops that left each run out in
    turn, where they were asked for; the held-out errors are then their means. `seconds`: time
    taken. `title`, `described`: name of the data, and data and declared model in words, for the
    page.
    """

    verdict: parts.Verdict
    error_before: parts.ErrorPair
    error_after: parts.ErrorPair
    noise_floor: float
    stages: tuple[parts.Stage, ...]
    remaining: dict[str, Any]
    rankings: tuple[tuple[parts.CandidateScore, ...], ...] = field(repr=False, default=())
    records: tuple[RunRecord, ...] = field(repr=False, default=())
    unfitted: tuple[RunRecord, ...] = field(repr=False, default=())
    declared_parameters: dict[str, parts.StageParameter] = field(default_factory=dict)
    declared_effects: tuple[parts.DeclaredEffect, ...] = ()
    declared_law: Equation | None = field(repr=False, default=None)
    fluid: Fluid | None = field(repr=False, default=None)
    fluid_at_mean: Fluid | None = field(repr=False, default=None)
    states: tuple[StatePart, ...] = field(repr=False, default=())
    explanations: parts.Explanations = field(default_factory=parts.Explanations)
    next_tests: NextTests = field(repr=False, default_factory=NextTests)
    laws: tuple[parts.LawFit, ...] = ()
    free_form: tuple[FreeForm, ...] = ()
    discrepancy: Discrepancy | None = None
    spread_of_laws: Mapping[str, parts.Spread] = field(default_factory=dict)
    left_out: Mapping[str, float] = field(default_factory=dict)
    corrections: Mapping[str, float] = field(default_factory=dict)
    nearest_law: parts.NearestLaw | None = None
    material: SimpleMaterial | None = None
    tolerance: float = TOLERANCE
    temperature_C: float | None = None
    folds: tuple[parts.Fold, ...] = ()
    seconds: float = 0.0
    title: str = field(repr=False, default="")
    described: str = field(repr=False, default="")

    @property
    def by_mode(self) -> dict[str, parts.ConstantByMode]:
        """Constants that might differ from mode to mode: by their name, or by their effect's."""
        of_law = self.declared_parameters.items()
        found = {name: one for name, one in of_law if isinstance(one, parts.ConstantByMode)}
        for effect in (*self.declared_effects, *self.stages):
            for one in effect.parameters.values():
                if isinstance(one, parts.ConstantByMode):
                    found[effect.effect] = one
        return found

    @property
    def differing_by_mode(self) -> tuple[str, ...]:
        """Names of those of them that do."""
        return tuple(name for name, one in self.by_mode.items() if one.degree)

    @cached_property
    def letters(self) -> dict[str, dict[str, str]]:
        """Letters of the parameters in LaTeX by effect that was added, no two alike."""
        spelled = spelled_on_a_page(stage.effect for stage in self.stages)
        return {name: one.symbols for name, one in spelled.items()}

    def without_answer(self) -> Equation:
        """Return the augmented fluid as an equation, with the box in which it was tested.

        Raises InputError as `equation`.
        """
        fluid = self.fluid_at_mean if self.fluid is None else self.fluid
        if self.material is not None:
            raise InputError(
                f"A {self.material.title} is not a viscoelastic law. Take its constants from "
                "`use`, or its text from `answer.written`."
            )
        if fluid is None:
            states = [s.effect for s in self.stages if s.kind == "constitutive"]
            raise InputError(
                f"The loop added {', '.join(states) or 'an effect'}, which gives the fluid a "
                "state without a written form. Give the effect's class the method `written`."
            )
        time = mean_relaxation_time(fluid.modulus, fluid.relaxation_time)
        learned_in = box_of(_numbers(r, time) for r in self.records if not r.held_out)
        judged_in = box_of(_numbers(r, time) for r in self.records if r.held_out)
        notes = [f"Verdict of the loop: {self.verdict}."]
        outside = [s.effect for s in self.stages if s.kind != "constitutive"]
        added = len(outside) < len(self.stages)
        if outside:
            notes.append(
                f"The runs also show {', '.join(outside)}, which is not part of the fluid and is "
                "not in this equation."
            )
        held_out = self.error_after.held_out
        errors = {} if held_out is None else {"sigma12 (mean over runs)": held_out}
        return Equation.of_fluid(
            fluid,
            self._parts(fluid),
            title=f"Declared law{' with the constitutive effects' * added} of a closed loop.",
            notes=tuple(notes),
            tested=None if learned_in is None else Tested(learned_in, judged_in, errors),
            states=self.states,
        )

    def _parts(self, fluid: Fluid) -> LawParts:
        """Return the law of the fluid with a name, if it needs one, and its terms."""
        differing = {n: self.by_mode[n].values for n in self.differing_by_mode}
        return law_parts_by_mode(fluid.law, differing, fluid.n_modes)


def _numbers(record: RunRecord, time: float) -> tuple[float, float]:
    return flow_numbers(record.time, record.rate, time)
