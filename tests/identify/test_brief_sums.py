"""Sums of terms in a sentence."""

from discover.identify.relations import spell_briefly
from tensor_library.law_terms import spell


def test_a_sum_of_few_terms_is_spelled_out():
    few = {"sigma.sigma": 0.5, "gammadot": -1.0}
    assert spell_briefly(few) == spell(few) == "0.5 sigma.sigma − gammadot"


def test_a_sum_of_many_terms_is_its_largest_two_and_a_number():
    names = ("I", "sigma", "gammadot", "sigma.sigma", "gammadot.gammadot", "tr(sigma)*sigma")
    many = {name: (-1.0) ** i * 0.1 * i for i, name in enumerate(names)}
    said = spell_briefly(many)
    assert said == "−0.5 tr(sigma)*sigma + 0.4 gammadot.gammadot with 4 smaller terms"
