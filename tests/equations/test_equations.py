"""Laws that leave the package and come back: every form says the same law, or refuses."""

import json
import re

import numpy as np
import pytest
from independent import FenePeterlin, Giesekus, oscillation
from independent import start_up as flow_at
from independent.homogeneous import UNIT
from readers import by_rheotool, module_of, rheotool_modes

from discover import equations
from discover.equations import Tested as WhereTested
from discover.equations.equation import box_of, flow_numbers
from discover.equations.formats.rheotool import rheotool_model
from discover.errors import InputError
from discover.laws import make_law
from tensor_library import LawTerm

EXPONENTIAL = "(exp(epsilon*tr(sigma))-1)*sigma"
SATURATING = "(tr(sigma)/(1+kappa*abs(tr(sigma))))*sigma"
RATE, TIMES = 1.5, np.linspace(0.0, 2.0, 21)
TESTED = WhereTested(
    equations.Box((1.0, 2.0), (0.25, 1.0)),
    equations.Box((2.0, 3.0), (0.1, 1.5)),
    {"sigma12": 0.0123},
)
MIXED = equations.Equation(
    (
        LawTerm("sigma.sigma", 0.21, ci95=(0.2, 0.22)),
        LawTerm(EXPONENTIAL, 0.9, {"epsilon": 0.31}),
        LawTerm(SATURATING, 0.1, {"kappa": 0.2}),
        LawTerm("tr(sigma)^2*(sigma.gammadot+gammadot.sigma)", -1.7e-3),
        LawTerm("tr(sigma.gammadot)*I", 0.02),
    ),
    modulus=(120.0, 30.0),
    relaxation_time=(0.7, 2.5),
    solvent_viscosity=3.0,
    title='From "study" \\ """ */ \n import os',
    notes=("a note",),
    tested=TESTED,
)


def agree(found, wanted, tolerance=1e-6):
    return np.max(np.abs(found - wanted)) <= tolerance * np.max(np.abs(wanted))


def test_python_needs_no_discover_and_json_gives_the_law_back():
    text = equations.write_equation(MIXED, "python")
    assert "discover" not in re.findall(r"^(?:import|from) (\w+)", text, re.M)
    text = equations.write_equation(MIXED, "json")
    again = equations.equation_from_json(json.loads(text))
    assert again == MIXED
    assert equations.write_equation(again, "json") == text


@pytest.mark.parametrize(
    ("rate", "flow", "times"),
    [
        # a record on a logarithmic axis has no sample at rest
        (lambda t: 4.0, flow_at(4.0), np.geomspace(0.2, 6.0, 7)),
        # every sample of the rate is zero, where it is 60 between them
        (
            lambda t: 60.0 * np.sin(2.0 * np.pi * t), oscillation(60.0, 2.0 * np.pi, -0.5 * np.pi),
            np.array([0.5, 1.0, 1.5, 2.0]),
        ),
    ],
)  # fmt: skip
def test_exported_python_starts_at_rest_and_sees_the_rate_between_samples(rate, flow, times):
    law = equations.Equation((LawTerm("sigma.sigma", 0.35),), (50.0,), (0.8,))
    module = module_of(equations.write_equation(law, "python"))
    wanted = Giesekus(0.35, 50.0, 0.8).respond(flow, times)
    # fourth-order steps of 2 % of the fastest time are off by some 1e-7
    found = np.array(module["simulate_shear"](rate, times))
    assert agree(found, np.array([wanted.sigma12, wanted.N1, wanted.N2]), 1e-5)
    for wrong in (times[::-1], times - 1.0, np.array([0.1, np.nan])):
        with pytest.raises(ValueError, match="times must increase from 0"):
            module["simulate_shear"](rate, wrong)


@pytest.mark.parametrize("form", equations.FORMATS)
def test_every_form_says_where_the_law_was_tested(form):
    equation = equations.Equation((LawTerm("sigma.sigma", 0.2),), tested=TESTED, title="A law")
    text = equations.write_equation(equation, form)
    if form == "json":
        assert json.loads(text)["tested"]["judged_in"] == {"Wi": [2.0, 3.0], "De": [0.1, 1.5]}
    else:
        assert "Tested in Wi 2 to 3, De 0.1 to 1.5; largest error: sigma12 1.2 %." in text
        assert "Learned in Wi 1 to 2, De 0.25 to 1." in text


@pytest.mark.parametrize("form", [form for form in equations.FORMATS if form != "json"])
def test_a_number_is_written_without_the_rounding_of_the_machine_and_json_keeps_it(form):
    value = 0.2999999999999975
    law = equations.Equation((LawTerm("sigma.sigma", value),), (value,), (value,), True, value)
    assert "9999" not in equations.write_equation(law, form)
    assert "9999" not in equations.FORMATS[form](law)  # as buttons of a page copy it
    assert str(value) in equations.write_equation(law, "json")


def test_density_is_refused_for_a_format_that_has_none():
    law = equations.Equation((LawTerm("sigma.sigma", 0.3),))
    for form in ("json", "python"):
        with pytest.raises(InputError, match="Density and tolerance are for --format rheotool"):
            equations.write_equation(law, form, density_kg_m3=1000.0)


def test_the_springs_of_fene_p_go_to_rheotool_from_its_terms():
    law = make_law("fene_p", {"L2": 12.0})
    equation = equations.Equation(equations.law_terms(law), (50.0,), (0.8,))
    found = by_rheotool(equations.write_equation(equation, "rheotool"), RATE * UNIT["shear"], TIMES)
    assert agree(found, FenePeterlin(12.0, 50.0, 0.8).held(RATE, TIMES), 1e-5)


def test_density_and_a_relaxation_that_was_learned_go_to_rheotool():
    equation = equations.Equation((LawTerm("sigma.sigma", 0.2),), (9.0, 3.0), (0.5, 5.0))
    text = equations.write_equation(equation, "rheotool", density_kg_m3=900.0)
    assert [entries["rho"] for entries, _ in rheotool_modes(text)] == [900.0, 900.0]
    model = rheotool_model(equations.Equation((LawTerm("sigma", 0.98),), linear_relaxation=False))
    assert (model.type, model.relax) == ("Oldroyd-B", 0.98)


@pytest.mark.parametrize(
    ("terms", "word"),
    [
        ((LawTerm("tr(sigma)*gammadot", 0.3),), r"tr\(sigma\)\*gammadot: no law of rheoTool"),
        ((LawTerm("sigma.sigma", 0.3), LawTerm("tr(sigma)*sigma", 0.1)), "these together"),
        ((LawTerm("sigma.sigma", -0.1),), "mobility alpha would be -0.1"),
        ((LawTerm(EXPONENTIAL, 0.9, {"epsilon": 0.2}),), "0.9, and rheoTool's"),
        ((LawTerm("sigma", -1.5),), "relax to rest"),
    ],
)
def test_rheotool_is_refused_with_the_term_that_stands_in_the_way(terms, word):
    with pytest.raises(InputError, match=word):
        equations.write_equation(equations.Equation(terms), "rheotool")


def test_a_deviation_within_the_tolerance_is_passed_over_and_said():
    for factor, said in ((0.96, True), (1.0, False)):
        equation = equations.Equation((LawTerm(EXPONENTIAL, factor, {"epsilon": 0.2}),))
        text = equations.write_equation(equation, "rheotool", tolerance=0.05)
        assert (f"The factor {factor:g} was taken as 1." in text) is said
        assert ("was taken as" in text) is said


BAD_LAWS = [
    ([], "the law"),
    ({}, "format"),
    ({"format": "discover law 1", "terms": [], "modes": []}, "modes"),
    ({"terms": [{"term": "__import__('os')", "coefficient": 1}]}, "Cannot read the term"),
    ({"terms": [{"term": "sigma", "coefficient": "x"}]}, "terms.0.coefficient"),
    ({"terms": [{"term": "sigma", "coefficient": float("inf")}]}, "finite"),
    ({"modes": [{"modulus_Pa": -1, "relaxation_time_s": 1}]}, "modulus_Pa"),
    ({"more": 1}, "more"),
]


@pytest.mark.parametrize(("change", "word"), BAD_LAWS)
def test_a_law_that_cannot_be_read_names_the_key(change, word):
    good = equations.equation_to_json(MIXED)
    content = {**good, **change} if change and "format" not in change else change
    with pytest.raises(InputError, match=re.escape(word)):
        equations.equation_from_json(content)


@pytest.mark.parametrize("frequency", [0.25, 1.0, 3.0])
def test_the_frequency_of_a_record_is_found_from_its_changes_of_sign(frequency):
    times = np.linspace(0.0, 20.0, 401)
    weissenberg, deborah = flow_numbers(times, 2.0 * np.cos(frequency * times), 0.5)
    assert weissenberg == 1.0
    assert deborah == pytest.approx(0.5 * frequency, rel=0.02)


def test_a_flow_that_does_not_oscillate_is_as_fast_as_it_is_long_and_the_box_holds_every_flow():
    times = np.linspace(0.0, 20.0, 401)
    for rate in (np.where(times < 10.0, 3.0, -3.0), np.full(401, 3.0)):
        assert flow_numbers(times, rate, 2.0) == (6.0, 0.1)
    assert flow_numbers(times, np.zeros(401), 2.0) == (0.0, 0.1)
    box = box_of([(1.0, 0.5), (2.0, 0.25)])
    assert (box.weissenberg, box.deborah) == ((1.0, 2.0), (0.25, 0.5))
    assert box.text == "Wi 1 to 2, De 0.25 to 0.5"
    assert box_of([]) is None
