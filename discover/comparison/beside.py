"""What is looked at beside the laws found: rivals, structure, and the classical laws."""

from collections.abc import Callable, Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

from discover.comparison.at_once import at_once
from discover.comparison.fitting.classical import CLASSICAL, ClassicalFit, fit_classical_laws
from discover.comparison.fitting.further_laws import fit_further_laws
from discover.comparison.instrument import Frame, classical_along
from discover.comparison.instrument.known import Known
from discover.comparison.judging.identifiability import Rival, find_rivals, structure_of
from discover.comparison.outcomes.outcome import LearnerOutcome
from discover.identify import Structure
from discover.progress import Progress
from discover.study.schema import Study
from tensor_library.library import TermLibrary


class Beside(NamedTuple):
    """What is looked at beside the laws found, for the fields of `Judgement` of the same names.

    Attributes
    ----------
    further
        What the caller had computed at the same time, by name.
    """

    rivals: Sequence[Rival]
    structure: Structure | None
    classical: Sequence[ClassicalFit]
    further: Mapping[str, Any] = MappingProxyType({})


def look_beside(
    study: Study,
    known: Known,
    library: TermLibrary,
    chosen: LearnerOutcome | None,
    frame: Frame,
    say: Callable[[str], None],
    further: Mapping[str, Callable[[], Any]],
) -> Beside:
    """Return rivals, structure and classical laws, which need nothing of one another.

    Parameters
    ----------
    study, known, library, chosen, frame
        As in `judge`: what sparse regression found, and the frame in which it did.
    say
        Called with what is going on.
    further
        What else is to be computed side by side with these, by name.
    """

    def classical(tell: Progress) -> Sequence[ClassicalFit]:
        tell("fitted to the same runs", 0.0)
        # the criterion of the sparse law counts these, and both stand in one column
        return _classical(study, known, chosen and chosen.details.get("n_independent"))

    def rivals(tell: Progress) -> Sequence[Rival]:
        assert chosen is not None
        tell("simulating laws that the data do not rule out", 0.0)
        met, model = chosen.details.get("rivals", ()), frame.model
        return find_rivals(chosen.terms, met, model, frame.flows, library, chosen.predictions)

    def structure(tell: Progress) -> Structure:
        assert chosen is not None
        tell("what the runs can tell of it", 0.0)
        runs, normal = frame.data.fit.runs, study.compare.use_normal_stresses
        return structure_of(chosen.terms, runs, library, frame.model, normal)

    parts: dict[str, Callable[[Progress], Any]] = {"the classical laws": classical}
    if chosen is not None:
        parts |= {"rivals": rivals, "the library": structure}
    parts |= {name: _told(part) for name, part in further.items()}
    found = at_once(parts, lambda text, _: say(text))
    more = {name: found[name] for name in further}
    return Beside(
        found.get("rivals", ()), found.get("the library"), found["the classical laws"], more
    )


def _told(part: Callable[[], Any]) -> Callable[[Progress], Any]:
    def run(tell: Progress) -> Any:
        tell("fitting", 0.0)
        return part()

    return run


def _classical(study: Study, known: Known, independent: float | None) -> Sequence[ClassicalFit]:
    """Return the classical laws, with the same constants fitted along as the learners have.

    Behind them those that the study names, with the constants that the known part alone has.
    """
    before = known.before
    further = [name for name in study.compare.laws if name not in CLASSICAL]
    fits = fit_further_laws(
        further, before.model, before.data.fit.runs, before.flows, before.recorded, independent
    )
    if known.along is None:
        relaxes = study.model.known_relaxation
        return [*fit_classical_laws(before.model, known.flows, relaxes, independent), *fits]
    each = [
        known.frame_of(known.along.constants.raw(known.along.before.classical[law].theta))
        for law in CLASSICAL
    ]
    return [*classical_along(known.along, each, known.flows, independent), *fits]
