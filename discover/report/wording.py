"""Numbers and conclusions in words."""

import re
from collections.abc import Mapping, Sequence

from discover.comparison.comparison import Comparison
from discover.comparison.next_measurement import NextMeasurement
from discover.comparison.outcome import LearnerOutcome

SYMBOLS = {"sigma12": "σ12", "N1": "N1", "N2": "N2"}
LEARNERS = {"tensor_sindy": "Sparse regression", "tbnn_ude": "The neural network"}


def percent(value: float | None) -> str:
    """Return a fraction as a percentage with two digits; a dash where there is none."""
    if value is None:
        return "–"
    if value != 0 and abs(value) < 1e-5:
        return "< 0.001 %"
    return f"{100.0 * value:.2g} %" if abs(value) < 0.995 else f"{100.0 * value:.0f} %"


def significant(value: float | None, digits: int = 4) -> str:
    """Return a number with so many digits; a dash where there is none."""
    if value is None:
        return "–"
    return "0" if abs(value) < 1e-12 else f"{value:.{digits}g}".replace("-", "−")


_LETTERS = (
    ("gammadot", "γ̇"),
    ("sigma", "σ"),
    ("epsilon", "ε"),
    ("kappa", "κ"),
    ("*", " "),
)


def spoken(term: str) -> str:
    """Return a term in canonical spelling, or words with such terms, with the field's letters."""
    # a full stop between tensors is a product; elsewhere it ends a sentence or is a decimal point
    text = re.sub(r"(?<=sigma|madot)\.(?=sigma|gammadot)", "·", term)
    for spelled, letter in _LETTERS:
        text = text.replace(spelled, letter)
    return text


def interval(bounds: Sequence[float] | None) -> str:
    """Return an interval, with as many digits as tell its ends apart."""
    if bounds is None:
        return "–"
    low, high = bounds
    width = abs(high - low)
    digits = 4
    while digits < 10 and width > 0 and f"{low:.{digits}g}" == f"{high:.{digits}g}":
        digits += 1
    return f"{low:.{digits}g} to {high:.{digits}g}".replace("-", "−")


def worst(errors: Mapping[str, Mapping[str, float | None]], quantity: str) -> float | None:
    """Return the largest error of a quantity over flows."""
    values = [row[quantity] for row in errors.values() if row[quantity] is not None]
    return max(values, default=None)  # pyright: ignore[reportArgumentType]


def terms_text(outcome: LearnerOutcome) -> str:
    """Return the law's terms as plain text."""
    if not outcome.terms:
        return "no term at all"
    parts = []
    for term in outcome.terms:
        text = f"{significant(term.coefficient)} {spoken(term.term)}"
        if term.ci95 is not None:
            text += f" (95 % interval {interval(term.ci95)})"
        parts.append(text)
    return ", ".join(parts)


RULES = {
    "bic": "BIC",
    "held_out": "held-out runs",
    "stability": "stability",
    "pysindy": "pysindy at its default",
}
"""Rules for choosing a law, as readers know them."""


def selection_sentence(outcome: LearnerOutcome) -> str:
    """Return whether the rules for choosing a law agree, and on what."""
    chosen: Mapping[str, Sequence[str]] = (outcome.details.get("selectors") or {}).get("chosen", {})
    if not chosen:
        return ""
    groups: dict[tuple[str, ...], list[str]] = {}
    for rule, support in chosen.items():
        groups.setdefault(tuple(support), []).append(RULES.get(rule, rule))
    if len(groups) == 1:
        return "All rules choose the same law: " + ", ".join(chosen_names(next(iter(groups)))) + "."
    parts = [
        f"{' and '.join(rules)}: {', '.join(chosen_names(support))}"
        for support, rules in groups.items()
    ]
    return "The rules disagree. " + "; ".join(parts) + "."


def next_sentences(following: NextMeasurement) -> list[str]:
    """Return what to measure next, or that nothing allowed would help."""
    if not following.proposals:
        return []
    best = following.proposals[0]
    n_rivals = len(following.laws) - 1
    laws = f"{n_rivals} rival law{'s' if n_rivals > 1 else ''}"
    if not best.falling:
        return [
            f"None of the experiments allowed is expected to separate the chosen law from the "
            f"{laws} that these data leave."
        ]
    what = " and ".join(SYMBOLS[name] for name in best.observed)
    fall = len(best.falling)
    outcome = "all of them" if fall == n_rivals else f"{fall} of them"
    return [
        f"To decide, measure {what} in {best.experiment.title}: of the {laws} that these data "
        f"leave, it is expected to rule out {outcome} at {percent(following.noise)} noise."
    ]


def chosen_names(support: Sequence[str]) -> list[str]:
    """Return the terms of a support in the field's letters."""
    return [spoken(name) for name in support] or ["no term"]


def comparison_verdict(comparison: Comparison) -> list[str]:
    """Return the verdict on a comparison, a few sentences."""
    sentences = []
    sparse = comparison.outcomes.get("tensor_sindy")
    if sparse is not None:
        sentence = f"Sparse regression found {terms_text(sparse)}"
        if comparison.truth is not None:
            wanted = {t.term for t in comparison.truth}
            found = {t.term for t in sparse.terms}
            if found == wanted:
                sentence += ": exactly the terms of the law that made the data."
            else:
                missing = ", ".join(map(spoken, sorted(wanted - found))) or "nothing"
                extra = ", ".join(map(spoken, sorted(found - wanted))) or "nothing"
                sentence += f". Against the law that made the data, missing: {missing}; "
                sentence += f"too many: {extra}."
        else:
            sentence += "."
        sentences.append(sentence)
    network = comparison.outcomes.get("tbnn_ude")
    if network is not None and network.terms:
        largest = max(network.terms, key=lambda t: abs(t.coefficient))
        sentences.append(
            f"Put into words, the neural network's largest term is "
            f"{significant(largest.coefficient)} {spoken(largest.term)}."
        )
    elif network is not None:
        sentences.append("Put into words, the neural network found no term.")
    judged = comparison.judged
    for name in comparison.outcomes:
        errors = {flow.name: comparison.errors(name, flow) for flow in judged}
        parts = [
            f"{symbol} to {percent(value)}"
            for symbol, quantity in (("σ12", "sigma12"), ("N1", "N1"), ("N2", "N2 (of N1)"))
            if (value := worst(errors, quantity.split()[0])) is not None
        ]
        if parts:
            what = "the test flows" if len(judged) > 1 else "the test flow"
            sentences.append(f"{LEARNERS[name]} predicts {', '.join(parts)} at worst in {what}.")
    if comparison.undetermined:
        names = " and ".join(comparison.undetermined)
        shown = "it" if len(comparison.undetermined) == 1 else "them"
        sentences.append(
            f"Not determined by these data: {names}. What is shown of {shown} is the choice of the "
            "simplest law that fits, not a measurement."
        )
    for name, report in comparison.physics.items():
        failed = [c["name"] for c in (report or {}).get("checks", ()) if c["passed"] is False]
        if failed:
            sentences.append(
                f"{LEARNERS[name]}'s law fails {len(failed)} of the checks of physical soundness: "
                f"{', '.join(failed)}."
            )
    sentences += next_sentences(comparison.next_measurement)
    return sentences
