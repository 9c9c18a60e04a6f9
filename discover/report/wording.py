"""Numbers and conclusions in words, and how they are set."""

import math
import re
from collections.abc import Callable, Iterable, Sequence

from markupsafe import Markup, escape

from discover import words
from discover.comparison.outcome import LearnerOutcome
from discover.learners.registry import learner_title
from discover.loop import FreeForm
from discover.loop.parts import ConstantByMode, StageParameter
from discover.protocols.kinematics import MODULI


def recorded_symbol(quantities: Iterable[str]) -> str:
    """Return the symbol of what is recorded, or ``modulus`` or ``stress`` for several kinds."""
    found = set(quantities)
    if len(found) > 1:
        return "modulus" if found <= set(MODULI) else "stress"
    return words.FIGURE_SYMBOLS[found.pop()]


SMALL_FAULTS = (
    "for noise and for measurement errors of 0.5 to 2 %: sample loading, zero, drift and torque "
    "range of each run"
)
"""What an interval allows for."""

_LEARNERS = {"tensor_sindy": "Sparse regression", "tbnn_ude": "The neural network"}


def learner_as_subject(name: str) -> str:
    """Return a learner as a sentence begins with it."""
    return _LEARNERS.get(name, f"The learner “{learner_title(name)}”")


def sentence(parts: Iterable[str]) -> str:
    """Return one sentence of several parts, without those that are empty."""
    text = "; ".join(part for part in parts if part)
    return text[:1].upper() + text[1:] + "."


def known(value: float | None) -> bool:
    """Return whether there is a number: JSON keeps what is not finite as None."""
    return value is not None and math.isfinite(value)


def percent(value: float | None) -> str:
    """Return a fraction as a percentage with two digits; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    if value != 0 and abs(value) < 1e-5:
        return "< 0.001 %"
    return words.percent_of(value)


def percent_range(values: Sequence[float | None] | None) -> str:
    """Return the range of several fractions in brackets, to stand behind their mean.

    Those that are None, where a law diverges, are counted. A range without a width is none.
    """
    if values is None or len(values) < 2:
        return ""
    told = [value for value in values if value is not None and math.isfinite(value)]
    lost = f"{len(values) - len(told)} of {len(values)} not predicted"
    if not told:
        return f" ({lost})"
    low, high = percent(min(told)), percent(max(told))
    text = f"{low.removesuffix(' %')} to {high}" if low != high else ""
    parts = [text, "" if len(told) == len(values) else lost]
    return f" ({'; '.join(filter(None, parts))})" if any(parts) else ""


def terms_text(outcome: LearnerOutcome) -> str:
    """Return the law's terms as plain text, with the intervals of the coefficients."""
    if not outcome.terms:
        return "nothing but the known part"
    parts = []
    for term in outcome.terms:
        text = f"{words.estimate(term.coefficient, term.ci95)} {_factor(words.readable(term.term))}"
        if term.ci95 is not None:
            text += f" ({words.LEVEL} {words.interval(term.ci95)})"
        parts.append(text)
    return ", ".join(parts)


def _factor(text: str) -> str:
    """Return a term as a number may stand before it: a sum in brackets, unless it has them."""
    outside = re.sub(r"\([^()]*\)", "", text)
    return f"({text})" if "+" in outside or "−" in outside else text


def parameter_name(name: str, parameter: StageParameter) -> str:
    """Return the name of a parameter, of one by mode in the field's letters with its mean time."""
    if not isinstance(parameter, ConstantByMode):
        return name
    text = words.readable(name.replace("_", " ").replace("build up", "build-up"))
    time = words.significant(parameter.mean_time_s, 3)
    return f"{text} (varies from mode to mode) at λ = {time} s"


_WHAT = {
    "recorded_stress": "a record that is a function of the stress alone",
    "drift": "a function of the time alone",
    "response": "a transducer that answers late, by a function of the lag alone",
    "rate": "a function of the shear rate alone",
    "network": "a factor that depends on the strain alone",
    "slip": "a rate of slip that depends on the stress alone",
}


def _with_constants(found: FreeForm) -> Callable[[str], str]:
    def told(effect: str) -> str:
        values = [
            f"{words.readable(name)} = {words.estimate(value, ends)}, "
            f"{words.LEVEL} {words.interval(ends)}"
            for name, (value, *ends) in found.constants[effect].items()
        ]
        return f"{words.effect_title(effect)} ({', '.join(values)})"

    return told


def free_form_sentence(found: FreeForm) -> str:
    """Return beside what a free function explains the runs, and what it is; no full stop."""
    told = words.effect_title if found.in_answer else _with_constants(found)  # the answer has them
    effects = " and ".join(map(told, found.beside)) or "your model"
    shape = f"close to the {found.nearest} form" if found.nearest else "close to no known form"
    left = "leaves noise" if found.in_answer else "explains the residual"
    return f"{effects} with {_WHAT[found.slot]} ({shape}) {left}; that function has no name here"


_TOGETHER = re.compile(
    r" (?=[=≤≥<] )|(?<=[=≤≥<]) |(?<=\d) (?=(?:%|Pa|1/|s|rad/s|modes?)\b|%|1/|°C)|(?<=Pa) (?=s)"
    r"|(?<=[\d)⁰¹²³⁴⁵⁶⁷⁸⁹]) (?=×|1/|Pa|s\b|%)|(?<=×) |(?<=% CI) |(?<=%) (?=CI\b)|(?<=\() "
)


def unbroken(text: str) -> str:
    """Return text whose numbers keep to one line with their units and symbols."""
    whole = _TOGETHER.sub("\N{NO-BREAK SPACE}", in_units(text))
    return whole.replace("–", "–\N{WORD JOINER}")


def in_units(text: str) -> str:
    """Return text whose reciprocal units cannot be read as a number: 3 s⁻¹ for 3 1/s."""
    return re.sub(r" 1/(s|Pa)\b", "\N{NARROW NO-BREAK SPACE}\\1⁻¹", text)


_LOWERED = re.compile(r"(?<!\w)([^\W\d_]\u0307?)_([^\W_]|\+)(?!\w)")


def subscripts(text: str) -> Markup:
    """Return text, escaped, with what follows a letter and an underscore lowered."""
    return Markup(_LOWERED.sub(r"\1<sub>\2</sub>", str(escape(text))))


_EXPLAINED = {
    "Wi": "Weissenberg number: mean relaxation time λ times the largest shear rate",
    "De": "Deborah number: mean relaxation time λ times the frequency ω, or over the time of a run",
    "unseen data": "what no fit used: runs left out, or another quantity of a run",
    "unseen runs": "runs that a fit did not use: held out, or left out in turn",
    "tolerance": "largest mean error that is good enough: 5 % unless you set another",
    "removing": "mean over runs of the root of squared error less squared noise",
}
_EXPLAINS = r"\b(?:(?:Wi|De)(?=\s=)|unseen (?:runs|data)|tolerance|removing)"


def explained(text: str) -> Markup:
    """Return text, escaped, whose numerals and unseen runs say what they are where one points."""

    def said(found: re.Match[str]) -> str:
        return f'<abbr title="{_EXPLAINED[found[0]]}">{found[0]}</abbr>'

    return Markup(re.sub(_EXPLAINS, said, str(subscripts(text))))


def in_cell(text: str) -> str:
    """Return a number that breaks between a power of ten and its unit, or an interval before it.

    Words without a number break anywhere.
    """
    if not any(map(str.isdigit, text)):
        return text
    whole = unbroken(text).replace(" ", "\N{NO-BREAK SPACE}").replace(")\N{NO-BREAK SPACE}", ") ")
    return re.sub("(×\N{NO-BREAK SPACE}10[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)\N{NO-BREAK SPACE}", r"\1 ", whole)
