"""Letters: each stands for one constant of a page, in equation, table and exports."""

import re
from itertools import combinations

from discover.effects import make_effect
from discover.effects.letters import spelled_apart
from discover.effects.registry import named_effects
from discover.equations import Equation
from discover.equations.formats.latex_file import equation_latex
from discover.equations.parts import StatePart

RESERVED = {"G", "I", "G_k", "h", "k", "t", "s", r"\lambda", r"\sigma", r"\tau", r"\gamma"}
"""Letters that every page has: modes, stress, strain, time, the structure."""


def letters(effect):
    return {one.symbol.removeprefix("1/") for one in effect.parameters}


def test_letters_of_effects_are_their_own_whatever_their_order_and_none_of_every_pages():
    for effect in named_effects().values():
        assert not letters(effect) & RESERVED, effect.name
    clashes = 0
    for pair in combinations(named_effects().values(), 2):
        spelled = spelled_apart(pair)
        own = [*spelled[pair[0].name].symbols.values(), *spelled[pair[1].name].symbols.values()]
        own += [state for one in spelled.values() for state in one.states]
        assert len(set(own)) == len(own), [one.name for one in pair]
        clashes += bool(letters(pair[0]) & letters(pair[1]))
    assert clashes  # without any there would be nothing to spell apart
    # a table lists effects as they were added, an equation as they act
    for pair in combinations(named_effects().values(), 2):
        assert spelled_apart(pair) == spelled_apart(pair[::-1]), [one.name for one in pair]


def test_an_equation_has_the_letters_of_its_table_and_an_exported_law_each_once():
    pair = map(make_effect, ("thixotropy", "thixotropic_relaxation"))
    first, second = spelled_apart(pair).values()
    assert first.equation == make_effect("thixotropic_relaxation").equation
    for letter in second.symbols.values():
        assert letter.removeprefix("1/") in second.equation
    assert r"\frac{ds'}{dt} = \frac{1 - s'}{t_\mathrm{b}'}" in second.equation
    assert r"G_k \to s'\,G_k" in second.equation
    values = {"breakdown": 0.2, "build_up_time": 5.0}
    others = {"inverse_critical_rate": 2.0, "build_up_time": 7.0, "exponent": 0.5}
    states = StatePart("thixotropy", values), StatePart("thixotropic_relaxation", others)
    law = Equation((), (1.0,), (1.0,), states=states)
    text = equation_latex(law)
    assert len(re.findall(r"t_\\mathrm\{b\}' = 5", text)) == 1
    assert len(re.findall(r"t_\\mathrm\{b\} = 7", text)) == 1
    assert r"\frac{ds'}{dt}" in law.latex()
