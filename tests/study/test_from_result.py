"""[model] from: what an earlier result found becomes what is declared, or one clear error."""

import json
from dataclasses import replace

import numpy as np
import pytest
from independent import multimode_giesekus
from independent import start_up as independent_start_up
from noisy_runs import sweep as sweep_of

from discover.dataset import Dataset, Run
from discover.dataset.linear_viscoelasticity import relaxation_spectrum
from discover.errors import InputError
from discover.forward import AugmentedModel, make_batch
from discover.protocols import start_up
from discover.simulate import simulate
from discover.study import fingerprint, read_study
from discover.study.declared_model import declared_model, forward_model

LAW = {
    "format": "discover law 1",
    "terms": [{"term": "sigma.sigma", "coefficient": 0.3}],
    "modes": [{"modulus_Pa": g, "relaxation_time_s": t} for g, t in ((90.0, 1.0), (40.0, 0.1))],
}


def effect(name, kind, parameter, value, ci95, **more):
    found = {"value": value, "ci95": ci95, "unit": "", **more}
    return {"effect": name, "kind": kind, "parameters": {parameter: found}}


def mobility_by_mode(modes):
    more = {"degree": 1, "evidence": [0.0, 9.0], "modes": modes}
    return effect("giesekus_mobility", "constitutive", "alpha", 0.2, [0.1, 0.3], **more)


GAIN = effect("stress_gain", "signal", "gain_error", -0.1, [-0.12, -0.08])
MOBILITY = effect("ptt_linear", "constitutive", "epsilon", 0.2, [0.1, 0.3])
_MODES = [
    {"relaxation_time_s": t, "value": a, "ci95": [a, a], "left_open": False}
    for t, a in ((1.0, 0.1), (0.1, 0.5))
]
MOBILITY_BY_MODE = mobility_by_mode(_MODES)
_OF_THREE = mobility_by_mode([*_MODES, _MODES[0]])
LOOP = {
    "verdict": "effects_added",
    "declared": {"law": LAW, "effects": [GAIN]},
    "stages": [MOBILITY],
}
COMPARISON = {
    "verdict": "explained",
    "declared": {"law": LAW, "effects": []},
    "posterior": {"effects": [GAIN]},
}


def write(tmp_path, name, content, model='from = "earlier"'):
    folder = tmp_path / "earlier"
    folder.mkdir(exist_ok=True)
    if content is not None:
        (folder / name).write_text(json.dumps(content))
    file = tmp_path / "s.toml"
    file.write_text(f'[data]\nsynthetic = {{ law = "ucm" }}\n[model]\n{model}\n')
    return file


DATA = Dataset("one run", (Run("r", np.array([0.0, 1.0]), start_up(1.0), np.ones(2), np.ones(2)),))


def declared(file):
    return declared_model(read_study(file), DATA)


def test_a_loop_and_a_comparison_give_their_laws_modes_and_effects_with_values(tmp_path):
    found = declared(write(tmp_path, "loop.json", LOOP))
    assert [(t.term, t.coefficient) for t in found.law.as_terms()] == [("sigma.sigma", 0.3)]
    assert found.modulus.tolist() == [90.0, 40.0]
    constants = {known.name: known.values for known in found.effects}
    assert constants == {"stress_gain": (-0.1,), "ptt_linear": (0.2,)}
    assert not found.free_constants
    assert "the loop's declared law" in found.source
    assert "stress gain (gain_error = -0.1)" in found.source
    (tmp_path / "compared").mkdir()
    found = declared(write(tmp_path / "compared", "comparison.json", COMPARISON))
    assert [known.name for known in found.effects] == ["stress_gain"]
    assert "the comparison's declared law" in found.source
    # the loop takes a law of terms as it takes one with a name
    model = forward_model(found)
    assert model.free_positions == []
    assert [known.name for known in model.effects] == ["stress_gain"]


def test_a_law_is_taken_by_name_with_constants_and_terms_or_is_maxwells(tmp_path):
    plain = {**LOOP, "declared": {"law": {**LAW, "terms": []}, "effects": []}}
    assert declared(write(tmp_path, "loop.json", plain)).law_name == "ucm"
    constants = {"stretch_time_ratio": 0.2, "beta": 0.5}
    law = {**LAW, "named": {"law": "rolie_poly", "constants": [constants]}}
    loop = {**LOOP, "declared": {"law": {**law, "terms": []}, "effects": []}}
    found = declared(write(tmp_path, "loop.json", loop))
    assert (found.law_name, found.parameters) == ("rolie_poly", constants)
    assert "Rolie–Poly (stretch_time_ratio = 0.2, beta = 0.5)" in found.source
    model = forward_model(found)
    assert model.free_positions == []
    assert dict(model.parameters) == constants
    # with a term
    beside = {**loop, "declared": {"law": law, "effects": []}}
    found = declared(write(tmp_path, "loop.json", beside))
    core, terms = found.law.split()
    assert type(core).__name__ == "RoliePoly"
    assert [share.term for share in terms] == ["sigma.sigma"]
    assert "1 term added to Rolie–Poly" in found.source
    assert forward_model(found).free_positions == []


def test_constants_count_as_exact_with_intervals_said_unless_the_study_frees_them(tmp_path):
    said = declared(write(tmp_path, "loop.json", LOOP)).source
    assert "count as exact" in said
    assert "gain_error of stress_gain -0.12 to -0.08, epsilon of ptt_linear 0.1 to 0.3" in said
    # what was fitted of the declared law too
    fitted = {"modulus_Pa": {"value": 90.0, "ci95": [80.0, 99.0], "unit": "Pa"}}
    for name, content in (
        ("loop.json", {**LOOP, "declared_parameters": fitted}),
        ("comparison.json", {**COMPARISON, "posterior": {"effects": [], "constants": fitted}}),
    ):
        (tmp_path / name).mkdir()
        assert "modulus_Pa 80 to 99" in declared(write(tmp_path / name, name, content)).source
    model = 'from = "earlier"\neffects = { ptt_linear = "fit" }'
    found = declared(write(tmp_path, "loop.json", LOOP, model))
    assert found.free_constants == ("ptt_linear.epsilon",)
    assert "epsilon of ptt_linear" not in found.source


@pytest.mark.parametrize("name", ["loop.json", "comparison.json"])
def test_what_is_unexplained_is_taken_with_doubt_if_it_is_more_than_maxwell(tmp_path, name):
    """A law or an instrument that was declared, or an effect that was found."""
    doubtful = {**(LOOP if name == "loop.json" else COMPARISON), "verdict": "unexplained"}
    assert "did not explain" in declared(write(tmp_path, name, doubtful)).source
    for i, (terms, known) in enumerate(((LAW["terms"], []), ([], [GAIN]))):
        (tmp_path / f"{i}").mkdir()
        started = {"law": {**LAW, "terms": terms}, "effects": known}
        found = declared(write(tmp_path / f"{i}", name, {**_NOTHING, "declared": started}))
        assert len(found.law.as_terms()) == len(terms)
        assert [one.name for one in found.effects] == [effect["effect"] for effect in known]
        assert "did not explain" in found.source


def shear(found, rate=5.0):
    times = np.geomspace(0.02, 20.0, 30)
    return times, simulate(found.fluid, start_up(rate), times).components[:, 3]


def of_scipy(mobilities, times, rate=5.0):
    fluid = multimode_giesekus(mobilities, (90.0, 40.0), (1.0, 0.1))
    return fluid.respond(independent_start_up(rate), times).sigma12


@pytest.mark.parametrize("added", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_constants_by_mode_of_a_loop_are_taken_with_those_of_every_mode(tmp_path, added):
    """Of the declared law, and of what the loop added to it (which is asked below too)."""
    named = {"law": "giesekus", "constants": [{"alpha": 0.1}, {"alpha": 0.5}]}
    law = {**LAW, "terms": [], "named": named}
    of_law = {**LOOP, "declared": {"law": law, "effects": [GAIN]}, "stages": []}
    plain = {"law": {**LAW, "terms": []}, "effects": [GAIN]}
    of_effect = {**LOOP, "declared": plain, "stages": [MOBILITY_BY_MODE]}
    found = declared(write(tmp_path, "loop.json", of_effect if added else of_law))
    assert [known.name for known in found.effects] == ["stress_gain"]
    assert not found.free_constants
    times, stress = shear(found)
    assert stress == pytest.approx(of_scipy((0.1, 0.5), times), rel=1e-5)
    # control: the constant at the mean time in both is another fluid
    assert np.max(np.abs(stress / of_scipy((0.2, 0.2), times) - 1.0)) > 0.02
    # the loop starts from it
    model = AugmentedModel(forward_model(found), [])
    run = Run("r", times, start_up(5.0), np.full(len(times), 5.0), stress)
    predicted = model.predict(model.zero(), make_batch([run]))[0]
    assert predicted == pytest.approx(0.9 * stress, rel=1e-5)
    if added:
        assert "in each mode its own giesekus mobility (alpha = 0.5) at 0.1 s to" in found.source


def test_a_constant_that_is_the_same_in_all_modes_is_one_and_the_fingerprint_changes(tmp_path):
    alpha = {**MOBILITY_BY_MODE["parameters"]["alpha"], "degree": 0}
    stage = {**MOBILITY_BY_MODE, "parameters": {"alpha": alpha}}
    found = declared(write(tmp_path, "loop.json", {**LOOP, "stages": [stage]}))
    assert ("giesekus_mobility", (0.2,)) in [(known.name, known.values) for known in found.effects]
    file = write(tmp_path, "loop.json", LOOP)
    before = fingerprint(read_study(file))
    assert fingerprint(read_study(file)) == before
    write(tmp_path, "loop.json", {**LOOP, "stages": []})
    assert fingerprint(read_study(file)) != before


_BY_MODE = {"law": None, "effects": [], "by_mode": ["alpha"]}
_NOTHING = {
    "verdict": "unexplained",
    "declared": {"law": {**LAW, "terms": []}, "effects": []},
    "stages": [],
    "posterior": {"effects": []},
}


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("loop.json", None, "holds neither loop.json nor comparison.json"),
        ("loop.json", {"verdict": "no_signal"}, "hold no signal"),
        ("loop.json", {"verdict": "effects_added"}, "does not say what its loop started from"),
        ("loop.json", {**LOOP, "declared": _BY_MODE}, "has alpha by mode and has no name"),
        ("loop.json", {**LOOP, "stages": [_OF_THREE]}, "damaged"),
        ("loop.json", {**LOOP, "declared": {"law": None}}, "is no sum of library terms"),
        ("loop.json", {**LOOP, "stages": [{"effect": "stress_gain"}]}, "is damaged"),
        ("loop.json", {**LOOP, "declared": {**LOOP["declared"], "effects": 3}}, "is damaged"),
        ("loop.json", _NOTHING, "there is nothing to take"),
        ("loop.json", [1, 2], "is not a result of discover"),
        ("loop.json", {**LOOP, "declared": None}, "found a material that does not relax"),
        ("comparison.json", _NOTHING, "there is nothing to take"),
        ("comparison.json", {"learners": {}}, "does not say what its comparison started from"),
        ("comparison.json", {**COMPARISON, "posterior": None}, "does not say what its comparison"),
    ],
)
def test_where_nothing_can_be_taken_one_error_says_why(tmp_path, name, content, words):
    file = write(tmp_path, name, content)
    with pytest.raises(InputError, match=r"\[model\] from") as caught:
        declared(file)
    assert words in str(caught.value)


def test_a_result_that_is_not_finished_or_not_there_and_a_law_beside_it_are_refused(tmp_path):
    with pytest.raises(InputError, match="there is no folder"):
        declared(write(tmp_path, "loop.json", LOOP, 'from = "elsewhere"'))
    file = write(tmp_path, "loop.json", LOOP, 'from = "earlier"\nlaw = "giesekus"')
    with pytest.raises(InputError, match="law is given too"):
        read_study(file)
    file = write(tmp_path, "loop.json", LOOP)
    state = tmp_path / "earlier" / "state"
    state.mkdir()
    (state / "study.json").write_text('{"fingerprint": "f", "complete": false}')
    with pytest.raises(InputError, match="is not finished"):
        declared(file)


def test_modes_of_the_sweep_keep_its_error_and_other_modes_have_none(tmp_path):
    """A result holds modes alone, and intervals that ignore their errors would be too narrow."""
    # an error of a tenth of a per cent that no modes have
    sweep = sweep_of([90.0, 40.0], [1.0, 0.1], noise=1e-3)
    data, spectrum = replace(DATA, linear_sweep=sweep), relaxation_spectrum(sweep)
    rows = [
        {"modulus_Pa": 0.9 * g, "relaxation_time_s": t}
        for g, t in zip(spectrum.modulus, spectrum.relaxation_time, strict=True)
    ]
    loop = {**LOOP, "declared": {"law": {**LAW, "modes": rows}, "effects": []}}
    found = declared_model(read_study(write(tmp_path, "loop.json", loop)), data)
    assert forward_model(found).linear_error == spectrum.relative_error > 0.0
    assert found.modulus_covariance == pytest.approx(0.81 * spectrum.modulus_covariance)
    # control
    other = declared_model(read_study(write(tmp_path, "loop.json", LOOP)), data)
    assert other.spectrum is None
