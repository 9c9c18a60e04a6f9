"""Templates → one self-contained page. The only place that knows jinja2."""

import logging
import os
import platform
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Any, TypeVar
from urllib.parse import quote

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined, select_autoescape
from markupsafe import Markup, escape

from discover import words
from discover._version import __version__
from discover.answer import Answer, Constant, Suspect, sentences
from discover.answer import modes_in_words as modes
from discover.effects import StateEffect
from discover.equations import FORMATS, Equation
from discover.equations.spelling.markup import law_element, term_element
from discover.errors import InputError
from discover.learners.registry import learner_title
from discover.plain_numbers import json_text
from discover.protocols.kinematics import in_words
from discover.report.mathtext import formula
from discover.report.plots.style import style_sheet
from discover.report.wording import parameter_name, percent, percent_range
from discover.statistics.noise.noise_model import rms

_CALCULATES = ("numpy", "scipy", "jax", "diffrax", "optimistix", "optax", "pysindy")


def made_by(fingerprint: str, command: str, files: tuple[str, ...], study_text: str) -> dict:
    """Return what a page says of the run that made it; every table links to it.

    `fingerprint`: of the study, its data and the version of this software. `command`: what makes it
    again. `files`: written with the page.
    """
    packages = [f"Python {platform.python_version()}"]
    for name in _CALCULATES:
        try:
            packages.append(f"{name} {version(name)}")
        except PackageNotFoundError:  # a copy that was not installed
            continue
    return {
        "id": fingerprint[:8],
        "fingerprint": fingerprint,
        "command": command,
        "packages": ", ".join(packages),
        "files": files,
        "study_text": study_text,
    }


# Characters of a file that a page carries; more would make the page slow to open
_MOST_INSIDE = 3_000_000


def render(template: str, data: Mapping[str, str] | None = None, **content: Any) -> str:
    """Return a page.

    Everything is escaped except pictures and mathematics that this package wrote itself.

    `data`: text of files that each picture links to, by name. The page carries those that are not
    too long, so that it hands them out where it stands alone; the others lie in its folder.
    """
    carried = {name: text for name, text in (data or {}).items() if len(text) <= _MOST_INSIDE}
    return (
        _environment()
        .get_template(template)
        .render(
            version=__version__,
            style_sheet=Markup(style_sheet()),
            data=data or {},
            carried=carried,
            **content,
        )
    )


@cache
def _environment() -> Environment:
    environment = Environment(
        loader=PackageLoader("discover.report"),
        autoescape=select_autoescape(default=True, default_for_string=True),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(
        percent=percent,
        percent_range=percent_range,
        significant=words.significant,
        interval=words.interval,
        estimate=words.estimate,
        readable=words.readable,
        subscripts=_subscripts,
        explained=_explained,
        # a name of a file may break behind an underscore
        file_name=lambda text: Markup(str(escape(text)).replace("_", "_<wbr>")),
        safe_svg=Markup,
        as_link=lambda name: quote(os.fsencode(name)),  # be it UTF-8 or not
        in_units=in_units,
        unbroken=_unbroken,
        in_cell=_in_cell,
        formula=formula,
        safe_name=safe_name,
        parameter_name=parameter_name,
        effect_title=words.effect_title,
        effects_title=words.effects_title,
        rms=rms,
        term_element=term_element,
        learner_title=learner_title,
        quantities=in_words,
    )
    environment.globals.update(
        answer_sentences=sentences, modes=modes, symbols=words.FIGURE_SYMBOLS
    )
    return environment


def safe_name(name: str) -> str:
    """Return a file name without anything that a file system could take amiss."""
    return "".join(c if c.isalnum() or c in "._-" else "_" for c in name)[:100]


_log = logging.getLogger(__name__)
_LONGEST = 200

Part = TypeVar("Part")


@dataclass(frozen=True)
class Missing:
    """A part of a page that could not be drawn."""

    title: str  # the part, as the subject of a sentence
    reason: str  # what went wrong

    @property
    def sentence(self) -> str:
        """What the page says in place of the part."""
        return f"{self.title} could not be drawn: {self.reason}."


def attempt(title: str, draw: Callable[[], Part]) -> Part | Missing:
    """Return a part of a page, or what stands in its place where it cannot be drawn.

    A report comes after minutes or hours of computing, and its numbers lie in JSON already. No
    fault of one picture or table is worth the rest of the page. The logger of this module has the
    traceback, at level debug.
    """
    try:
        return draw()
    except Exception as error:
        _log.debug("%s could not be drawn", title, exc_info=True)
        text = " ".join(str(error).split())[:_LONGEST].rstrip(". ")
        return Missing(title, f"{type(error).__name__}, {text}" if text else type(error).__name__)


# Buttons, with the formats that they copy; JSON is that of the answer
_COPIED = {"rheoTool": "rheotool", "Python": "python", "LaTeX": "latex"}


def answer_screen(answer: Answer | None) -> dict[str, Any] | None:
    """Return what the template ``answer.html`` shows; None shows nothing."""
    if answer is None:
        return None
    headline, symbols = _unbroken(sentences.law(answer)), [one.symbol for one in answer.constants]
    if (answer.equation or answer.shown) is not None:
        # terms as the equation in Pa and s has them: over the stress of a mode in units of G
        for i, one in enumerate(answer.constants):
            if one.is_term:
                symbols[i] = one.symbol.replace("σ", "τ")
                headline = headline.replace(one.symbol, symbols[i])
    reduced = modes.reduced_to(answer)
    shifted = [
        ("a_T", f"at {modes.degrees(at)}: times {modes.shortened(one)} than at {reduced}",
         words.significant(one, 3), "") for at, one in modes.shifts(answer)
    ]  # fmt: skip
    timed = any(one.unit == "s" for suspect in answer.suspects for one in suspect.constants[:1])
    clock = "; times on the instrument's clock" if timed and answer.shift_factors else ""
    return {
        "answer": answer,
        "title": (answer.title or answer.instead.lower()).partition(":")[0],
        "headline": headline,
        "quality": _unbroken(sentences.quality(answer)),
        "errors": sentences.error_title(answer).lower(),
        "open": not answer.title or answer.adequate is False,
        "law": _typeset(answer),
        "constants": [
            *((symbol, _unbroken(_said(one)), _in_cell(one.number), _in_cell(one.interval))
              for symbol, one in zip(symbols, answer.constants, strict=True)),
            *shifted,
        ],
        "suspects": [_suspected(one, sentences.separable(answer)) for one in answer.suspects],
        "suspected": sentences.SUSPECTED.lower() + clock,
        "expected": [*_expected(answer), *_worst(answer)] if answer.title else (),
        "copies": (copies := _copies(answer) if answer.title else []),
        "copied": "Copy as" if answer.classical is None else "Copy the best classical law as",
        "missing": _not_there(copies),
        "behind": _unbroken(answer.alternative),
        "next_test": _unbroken(answer.next_test),
    }  # fmt: skip


def _said(one: Constant) -> str:
    """Return what a constant is, and that its value is at an end of what is possible."""
    skewed = "at an end of its interval" if one.is_skewed or one.bound else ""
    at_end = "at its physical limit" if one.at_limit else skewed
    return "; ".join(filter(None, [one.said, at_end]))


def _expected(answer: Answer) -> list[dict[str, Any]]:
    """Return the rows of expected errors; quantities that nothing is known of share one."""
    found: list[dict[str, Any]] = []
    for name, symbol in sentences.SYMBOLS.items():
        one = answer.expected(name)
        row = {
            "symbol": symbol,
            "inside": _in_cell(sentences.expected(one, "inside")),
            "beyond": _in_cell(sentences.expected(one, "beyond")),
            "beyond_at": _unbroken(one.beyond_at) if one.beyond is not None else "",
            "known": one.is_known,
            "note": _unbroken(sentences.note(answer, name)),
        }
        if found and not one.is_known and found[-1] == row | {"symbol": found[-1]["symbol"]}:
            found[-1]["symbol"] += f", {symbol}"
        else:
            found.append(row)
    return found


def _worst(answer: Answer) -> list[dict[str, Any]]:
    """Return the rows of the run that is missed most, if it is, and of the best classical law."""
    told = (
        [] if (worst := sentences.worst_run(answer)) is None else [("worst run in range", *worst)]
    )
    if answer.best_classical is not None:
        near, error = answer.best_classical
        told.append((sentences.CLASSICAL.lower(), near, words.percent_of(error)))
    return [
        {"symbol": symbol, "note": _unbroken(said), "inside": _in_cell(error), "beyond": "",
         "beyond_at": "", "known": True}
        for symbol, said, error in told
    ]  # fmt: skip


def _suspected(one: Suspect, has_size: bool) -> tuple[str, str, str, str]:
    """Return the row of an effect of the instrument, its amplitude if it has one of its own."""
    title = words.effect_title(one.effect)
    if one.amplitude is None or not has_size:
        return title, "", "" if has_size else sentences.NOT_SEPARABLE, ""
    said = one.amplitude.meaning if one.amplitude.unit == "%" else ""
    said = said if one.is_established else "; ".join(filter(None, [said, "may be zero"]))
    return title, said, _in_cell(one.amplitude.number), _in_cell(one.amplitude.interval)


def _not_there(copies: Sequence[Mapping[str, str]]) -> str:
    """Return why buttons are grey, in one sentence."""
    grey = [one for one in copies if not one["text"]]
    if not grey:
        return ""
    reason = grey[0]["reason"].partition(". ")[0].rstrip(".").rpartition(": ")[2]
    names = words.listed([one["name"] for one in grey])
    if any(one["name"] in reason for one in grey):
        return f"{reason}."
    return f"Cannot be exported to {names}: {reason[:1].lower()}{reason[1:]}."


_TOGETHER = re.compile(
    r" (?=[=≤≥<] )|(?<=[=≤≥<]) |(?<=\d) (?=(?:%|Pa|1/|s|rad/s|modes?)\b|%|1/|°C)|(?<=Pa) (?=s)"
    r"|(?<=[\d)⁰¹²³⁴⁵⁶⁷⁸⁹]) (?=×|1/|Pa|s\b|%)|(?<=×) |(?<=% CI) |(?<=%) (?=CI\b)|(?<=\() "
)


def _unbroken(text: str) -> str:
    """Return text whose numbers keep to one line with their units and symbols."""
    whole = _TOGETHER.sub("\N{NO-BREAK SPACE}", in_units(text))
    return whole.replace("–", "–\N{WORD JOINER}")


def in_units(text: str) -> str:
    """Return text whose reciprocal units cannot be read as a number: 3 s⁻¹ for 3 1/s."""
    return re.sub(r" 1/(s|Pa)\b", "\N{NARROW NO-BREAK SPACE}\\1⁻¹", text)


_LOWERED = re.compile(r"(?<!\w)([^\W\d_]\u0307?)_([^\W_]|\+)(?!\w)")


def _subscripts(text: str) -> Markup:
    """Return text, escaped, with what follows a letter and an underscore lowered."""
    return Markup(_LOWERED.sub(r"\1<sub>\2</sub>", str(escape(text))))


_NUMERALS = {
    "Wi": "Weissenberg number: mean relaxation time λ times the largest shear rate",
    "De": "Deborah number: mean relaxation time λ times the frequency ω, or over the time of a run",
}


def _explained(text: str) -> Markup:
    """Return text, escaped, whose dimensionless numbers say what they are where one points."""

    def said(found: re.Match[str]) -> str:
        return f'<abbr title="{_NUMERALS[found[0]]}">{found[0]}</abbr>'

    return Markup(re.sub(rf"\b({'|'.join(_NUMERALS)})(?=\s=)", said, str(_subscripts(text))))


def _in_cell(text: str) -> str:
    """Return a number that breaks between a power of ten and its unit, or an interval before it.

    Words without a number break anywhere.
    """
    if not any(map(str.isdigit, text)):
        return text
    whole = _unbroken(text).replace(" ", "\N{NO-BREAK SPACE}").replace(")\N{NO-BREAK SPACE}", ") ")
    return re.sub("(×\N{NO-BREAK SPACE}10[⁰¹²³⁴⁵⁶⁷⁸⁹⁻]+)\N{NO-BREAK SPACE}", r"\1 ", whole)


def _typeset(answer: Answer) -> str:
    equation = answer.equation or answer.shown
    lines = answer.written.get("formula", "").splitlines()
    if equation is None:
        return _formulas(lines)
    rest = any(line.startswith("h = ") for line in lines)
    return _law(_rounded(equation, answer), rest) + _formulas(lines)


def _rounded(equation: Equation, answer: Answer) -> Equation:
    """Return an equation with the digits that the intervals leave, three at most."""

    def short(value: float) -> float:
        digits = next((one.digits for one in answer.constants if np.isclose(one.value, value)), 3)
        return float(f"{value:.{digits}g}")

    def all_short(values: Mapping[str, float]) -> dict[str, float]:
        return {name: short(value) for name, value in values.items()}

    terms = tuple(
        replace(term, coefficient=short(term.coefficient), inner=all_short(term.inner))
        for term in equation.terms
    )
    named = equation.named
    if named is not None:
        named = replace(named, constants=tuple(map(all_short, named.constants)))
    return replace(equation, terms=terms, named=named)


_LARGE = 15.0  # Size in points of an equation that the answer rests on


def _formulas(lines: Sequence[str]) -> str:
    """Return equations in LaTeX, each in a paragraph that breaks between its parts."""
    parts = [
        [formula(part, f"answer{i}_{k}", _LARGE) for k, part in enumerate(line.split(r",\quad"))]
        for i, line in enumerate(lines)
    ]
    return "".join(f'<p class="scroll">{" &emsp; ".join(one)}</p>' for one in parts)


def _law(equation: Equation, rest: bool = False) -> str:
    """Return the law typeset, in Pa and s where its modes have units; empty where it has none."""
    count = len(equation.modulus)
    solvent = equation.solvent_viscosity > 0.0
    try:
        text = law_element(
            equation.terms, equation.linear_relaxation, equation.named, count, solvent, rest
        )
        # what a state of the whole fluid does stands below the law of a mode
        index = "_k" if count > 1 else ""
        parts = [
            one.equation.replace("_k", index) + _at_rest(one.states, part.own)
            for one, part in zip(equation.spelled_states, equation.states, strict=True)
        ]
        return text + _formulas(_scaled_once(parts))
    except InputError:  # nobody said how a law of their own is written
        return ""


_SCALED = re.compile(r"(\S+) \\to (.+?)(?:\\,)?\s*\1")


def _scaled_once(equations: Sequence[str]) -> list[str]:
    """Return equations of states, with one product for what several of them scale."""
    parted = [one.partition(r",\quad") for one in equations]
    found = [_SCALED.fullmatch(first) for first, _, _ in parted]
    scaled = {one[1] for one in found if one}
    if len(scaled) != 1 or not all(found) or len(found) < 2:
        return list(equations)
    product = r"\,".join(one[2] for one in found if one)
    (what,) = scaled
    return [rf"{what} \to {product}\,{what}", *(rest for _, _, rest in parted)]


def _at_rest(states: Sequence[str], effect: StateEffect) -> str:
    """Return what the states of a fluid are at rest, as it goes on behind their equation."""
    index = "" if effect.levels == 1 else "_i"
    rest = rf"{index} = {effect.rest:g}\ \mathrm{{at\ rest}}"
    return "".join(rf",\quad {state}{rest}" for state in states)


def _copies(answer: Answer) -> list[Mapping[str, str]]:
    """Return the law in every format that a button copies, or why it is not there."""
    found = []
    for name, form in _COPIED.items():
        text, reason = answer.written.get(form, ""), "It cannot be written out."
        if (equation := answer.equation or answer.classical) is not None:
            try:
                text = FORMATS[form](equation)
            except InputError as error:
                reason = str(error)
        found.append({"name": name, "text": text, "reason": reason})
    return [*found, {"name": "JSON", "text": json_text(answer.to_json()), "reason": ""}]


def batch_page(studies: Sequence[Any]) -> str:
    """Return the page over a batch: how each study ended (`discover.batch.status.StudyStatus`)."""
    return render(
        "batch.html",
        studies=studies,
        failed=[study for study in studies if study.status == "failed"],
        waiting=sum(study.status == "waiting" for study in studies),
    )
