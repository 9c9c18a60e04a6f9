"""Effects that are declared: what may be written, and what the one error says."""

import pytest

from discover.effects import known_effects
from discover.errors import InputError


def test_an_effect_has_the_values_that_were_written_and_the_rest_to_be_fitted():
    (known,) = known_effects({"edge_fracture": {"critical_strain": 3.0, "loss": "fit"}})
    # in the order of the dictionary of effects, whatever order they were written in
    assert known.values == (None, 3.0)
    assert known.free == ("loss",)
    assert "to be fitted" in known.text


def test_fit_alone_leaves_every_parameter_to_be_fitted():
    (known,) = known_effects({"stress_gain": "fit"})
    assert known.values == (None,)


@pytest.mark.parametrize(
    ("written", "words"),
    [
        ({"stress_gian": "fit"}, "Unknown effect 'stress_gian'"),
        ({"stress_gain": {"gain": 0.1}}, "no parameter 'gain'. Write gain_error"),
        ({"edge_fracture": {"loss": 0.1}}, "needs critical_strain too"),
        ({"stress_gain": {"gain_error": 7.0}}, "between -0.8 and 4"),
        ({"stress_gain": {"gain_error": "free"}}, 'a number or "fit"'),
        ({"stress_gain": 0.1}, 'must be "fit", or give its parameters: gain_error'),
        (["stress_gain"], "must name effects with their values"),
    ],
)
def test_what_is_wrong_is_said_in_one_sentence(written, words):
    with pytest.raises(InputError, match="effects") as caught:
        known_effects(written, "[model] effects")
    assert words in str(caught.value)
