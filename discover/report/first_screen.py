"""The first screen of a page: law, constants, expected errors, what to measure next."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from discover import words
from discover.answer import Answer, Constant, Suspect, sentences
from discover.answer import modes_in_words as modes
from discover.answer.error_table import errors
from discover.effects import StateEffect
from discover.equations import FORMATS, Equation
from discover.equations.markup import law_element
from discover.errors import InputError
from discover.plain_numbers import json_text
from discover.report.mathtext import formula
from discover.report.wording import in_cell, unbroken

# Buttons, with the formats that they copy; JSON is that of the answer
_COPIED = {"rheoTool": "rheotool", "Python": "python", "LaTeX": "latex"}


def answer_screen(answer: Answer | None) -> dict[str, Any] | None:
    """Return what the template ``answer.html`` shows; None shows nothing."""
    if answer is None:
        return None
    headline, quality = map(unbroken, sentences.first_lines(answer))
    symbols = [one.symbol for one in answer.constants]
    if (answer.equation or answer.shown) is not None:
        # terms as the equation in Pa and s has them: over the stress of a mode in units of G
        for i, one in enumerate(answer.constants):
            if one.is_term:
                symbols[i] = one.symbol.replace("σ", "τ")
                headline = headline.replace(one.symbol, symbols[i])
    ends = answer.range.rate_1_s
    shifts = [
        (modes.degrees(at), words.significant(one, 3),
         modes.span((ends[0] / one, ends[1] / one)) if ends else "–")
        for at, one in modes.shifts(answer)
    ]  # fmt: skip
    timed = any(one.unit == "s" for suspect in answer.suspects for one in suspect.constants[:1])
    clock = "; times on the instrument's clock" if timed and answer.shift_factors else ""
    return {
        "answer": answer,
        "title": (answer.title or answer.instead.lower()).partition(":")[0],
        "headline": headline,
        "quality": quality,
        "fitted": _fitted(answer),
        "law": _typeset(answer),
        "constants": [
            (symbol, unbroken(_said(one)), in_cell(one.number), in_cell(one.interval))
            for symbol, one in zip(symbols, answer.constants, strict=True)
        ],
        "shifts": shifts,
        "suspects": [_suspected(one, sentences.separable(answer)) for one in answer.suspects],
        "suspected": sentences.SUSPECTED.lower() + clock,
        "expected": errors(answer) if answer.title else (),
        "copies": (copies := _copies(answer) if answer.title else []),
        "copied": "Copy as" if answer.classical is None else "Copy the best classical law as",
        "missing": _not_there(copies),
        "behind": unbroken(answer.alternative),
        "next_test": unbroken(answer.next_test),
    }  # fmt: skip


def _fitted(answer: Answer) -> str:
    """Return in which flows constants were fitted, and at which temperature times hold."""
    flows = f"fitted in {sentences.flows_of(answer.range.flows)}"
    at = f"; times are for {modes.reduced_to(answer.temperature_C)}" * bool(answer.shift_factors)
    return f" ({flows}{at})" * any(one.ci95 is not None for one in answer.constants)


def _said(one: Constant) -> str:
    """Return what a constant is, and that its value is at an end of what is possible."""
    end = "at its physical limit" * one.at_limit
    absent = "may be infinite: equally good laws do without" * one.may_be_absent
    return "; ".join(filter(None, [one.said, end, absent]))


def _suspected(one: Suspect, has_size: bool) -> tuple[str, str, str, str]:
    """Return the row of an effect of the instrument, its amplitude if it has one of its own."""
    title = one.title
    if one.amplitude is None or not has_size:
        return title, "", "" if has_size else sentences.NOT_SEPARABLE, ""
    said = one.amplitude.meaning if one.amplitude.unit == "%" else ""
    most = f"changes a run by up to {words.percent_of(one.correction)}" * bool(one.correction)
    said = "; ".join(filter(None, [said, most, "may be zero" * (not one.is_established)]))
    return title, said, in_cell(one.amplitude.number), in_cell(one.amplitude.interval)


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
        own = (one.in_equation for one in answer.constants if np.isclose(one.value, value))
        return next(own, float(f"{value:.3g}"))

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
        return text + _formulas(_factors_first(parts))
    except InputError:  # nobody said how a law of their own is written
        return ""


def _factors_first(equations: Sequence[str]) -> list[str]:
    """Return equations of states behind what these multiply, each with its factors, in words."""
    factors: dict[str, list[str]] = {}
    rest = []
    for one in equations:
        first, _, others = one.partition(r",\quad")
        what, arrow, product = first.partition(r" \to ")
        if arrow:
            factor = re.sub(rf"(?:\\,)?\s*{re.escape(what)}", "", product, count=1)
            factors.setdefault(what, []).append(factor.strip())
        rest.append(others if arrow else one)
    said = [
        rf"{what}\ \mathrm{{is\ multiplied\ by}}\ " + r"\,".join(f) + _PART
        for what, f in factors.items()
    ]
    return [r",\quad".join(said), *rest] if said else rest


_PART = r"\ \mathrm{(part\ of\ the\ law)}"  # so that no simulation leaves it out


def _at_rest(states: Sequence[str], effect: StateEffect) -> str:
    """Return what the states of a fluid are at rest, as it goes on behind their equation."""
    index = "" if effect.levels == 1 else "_i"
    rest = rf"{index} = {effect.rest:g}\ \mathrm{{at\ rest}}"
    what = r"\mathrm{structure}\ " if effect.rest else ""
    return "".join(rf",\quad {what}{state}{rest}" for state in states)


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
