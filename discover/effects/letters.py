"""Letters of several effects on one page: each stands for one constant."""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from discover.effects.base import AbstractEffect, StateEffect


@dataclass(frozen=True)
class Spelled:
    """Equation of an effect, the letters of its parameters by name, and of its states, in LaTeX."""

    equation: str
    symbols: dict[str, str]
    states: tuple[str, ...] = ()


def spelled_apart(effects: Iterable[AbstractEffect]) -> dict[str, Spelled]:
    r"""Return equations and letters of effects that stand together, by name of the effect.

    A letter that an earlier effect has gets a prime, in an order of their names, so that equation
    and table agree in whatever order they list effects. States come first, so that a law with them
    alone is spelled as it is on a page with effects of the instrument.

    Examples
    --------
    >>> from discover.effects import make_effect
    >>> both = map(make_effect, ("thixotropy", "thixotropic_relaxation"))
    >>> spelled_apart(both)["thixotropy"].symbols["build_up_time"]
    "t_\\mathrm{b}'"
    """
    taken: set[str] = set()
    found = {}
    for effect in sorted(effects, key=lambda one: (not isinstance(one, StateEffect), one.name)):
        equation, symbols = effect.equation, {}
        own = {one.name: one.symbol for one in effect.parameters}
        letters = dict.fromkeys(symbol.removeprefix("1/") for symbol in own.values())
        for letter in [*letters, *_states(effect)]:
            new = letter
            while new in taken:
                new += "'"
            taken.add(new)
            letters[letter] = new
            equation = _replaced(equation, letter, new)
        for name, symbol in own.items():
            letter = symbol.removeprefix("1/")
            symbols[name] = symbol.removesuffix(letter) + str(letters[letter])
        states = tuple(str(letters[state]) for state in _states(effect))
        found[effect.name] = Spelled(equation, symbols, states)
    return found


def _states(effect: AbstractEffect) -> list[str]:
    """Return the letters of what an effect integrates with the fluid."""
    if not isinstance(effect, StateEffect):
        return []
    changing = re.findall(r"\\frac\{d(\\?[A-Za-z]+)", effect.equation)
    return list(dict.fromkeys(changing))


def _replaced(latex: str, letter: str, new: str) -> str:
    """Return a formula with another letter; not where it is an index or part of a word."""
    if letter == new:
        return latex
    # dX begins a derivative; a command of LaTeX ends where its letters do
    before = "" if letter.startswith("\\") else r"(?:(?<![A-Za-z\\_])(?<!mathrm\{)|(?<=\{d))"
    pattern = rf"(\^)?{before}{re.escape(letter)}(?![A-Za-z])"
    return re.sub(pattern, lambda found: f"^{{{new}}}" if found[1] else new, latex)
