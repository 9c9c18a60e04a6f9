"""A law and an effect, each one file outside the package, as their pages describe them."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

import discover as dc
from discover.laws import LAWS
from tensor_library import square, trace

LAW, EFFECT = "adding-a-law.md", "adding-an-effect.md"


@pytest.mark.slow
def test_the_law_of_the_page_is_listed_fitted_reported_and_exported(workplace):
    workplace.follow(LAW)
    listed = json.loads(workplace.run("laws", "--json").stdout)
    (mine,) = [law for law in listed if law["name"] == "quadratic_ptt"]
    assert mine["title"] == "quadratic PTT"
    assert (mine["parameter"], mine["high"]) == ("k", 10.0)

    study = workplace.study(LAW, more='[loop]\neffects = ["giesekus_mobility"]\n')
    workplace.run("close-loop", study, "--out", "out", "--quiet")
    loop = workplace.json("out/loop.json")
    assert loop["verdict"] == "no_effect_needed"
    low, high = loop["declared_parameters"]["k"]["ci95"]
    assert low < 0.3 < high
    assert high - low < 0.1
    assert "quadratic PTT" in (workplace.folder / "out" / "report.html").read_text("utf-8")

    latex = workplace.run("export", "out", "--format", "latex").stdout
    assert r"\left(\operatorname{tr}\left(\boldsymbol{\sigma}\right)\right)^{2}" in latex
    code = workplace.run("export", "out", "--format", "python").stdout
    assert "s.trace() ** 2 * s" in code


def test_the_law_of_the_page_is_right_in_steady_shear(workplace):
    workplace.follow(LAW)
    script = """
import discover as dc, numpy as np, quadratic_ptt
law, rate = dc.make_law("quadratic_ptt", {"k": 0.3}), 2.0
factor = 1.0
for _ in range(200):
    shear = rate / factor
    factor = 0.5 * (factor + 1.0 + 0.3 * (2 * rate * shear / factor) ** 2)
stress = np.array([2 * rate * shear / factor, 0.0, 0.0, shear])
print(np.abs(law.stress_rate(stress, np.asarray(rate))).max())
"""
    assert float(workplace.run(script=script).stdout) < 1e-9


@pytest.mark.slow
def test_the_effect_of_the_page_is_listed_found_and_reported(workplace):
    workplace.follow(EFFECT)
    listed = json.loads(workplace.run("effects", "--json").stdout)
    (mine,) = [effect for effect in listed if effect["name"] == "transducer_saturation"]
    assert mine["kind"] == "signal"

    saturated = """
import numpy as np, pathlib, discover as dc
data = dc.synthetic_dataset("ucm", {}, noise=0.005, seed=1)
folder = pathlib.Path("data"); folder.mkdir()
names = []
for number, run in enumerate(list(data)[:4]):
    table = run.to_dataframe()[["time_s", "shear_rate_1_s", "stress_Pa"]].iloc[::4]
    table["stress_Pa"] /= 1.0 + 0.2 * table["stress_Pa"].abs()
    table.to_csv(folder / f"run{number}.csv", index=False)
    names.append(f"run{number}.csv")
(folder / "runs.csv").write_text("\\n".join(["file", *names]) + "\\n")
"""
    workplace.run(script=saturated)
    study = workplace.study(EFFECT)
    text = (workplace.folder / study).read_text("utf-8")
    start, end = text.index("synthetic"), text.index("[model]")
    (workplace.folder / study).write_text(text[:start] + 'folder = "data"\n' + text[end:])
    workplace.run("close-loop", study, "--out", "out", "--quiet")
    loop = workplace.json("out/loop.json")
    assert [stage["effect"] for stage in loop["stages"]] == ["transducer_saturation"]
    np.testing.assert_allclose(loop["stages"][0]["parameters"]["s"]["value"], 0.2, rtol=0.1)
    report = (workplace.folder / "out" / "report.html").read_text("utf-8")
    assert "transducer_saturation" in report
    assert "Hang several known weights" in report


@pytest.mark.slow
def test_the_study_of_the_page_on_effects_runs_as_it_stands(workplace):
    workplace.follow(EFFECT)
    workplace.run("close-loop", workplace.study(EFFECT), "--out", "out", "--quiet")
    loop = workplace.json("out/loop.json")
    assert loop["stages"][0]["effect"] == "giesekus_mobility"
    considered = {c["effect"] for stage in loop["ranking"] for c in stage}
    assert "transducer_saturation" in considered


def test_the_table_of_effects_has_the_effect_too(workplace):
    workplace.follow(EFFECT)
    script = "import discover; print([*discover.effects().index])"
    assert "'transducer_saturation'" in workplace.run(script=script).stdout


@pytest.mark.slow
def test_without_the_package_the_study_is_refused(workplace):
    # negative control of the tests above
    study = workplace.study(LAW)
    done = workplace.run("close-loop", study, "--out", "out", code=2)
    assert "unknown law 'quadratic_ptt'" in done.stderr
    study = workplace.study(EFFECT)
    done = workplace.run("close-loop", study, "--out", "out", code=2)
    assert "Unknown effect 'transducer_saturation'" in done.stderr


@pytest.fixture
def registered():
    before = set(LAWS.present)
    yield
    for name in set(LAWS.present) - before:
        del LAWS[name]


def test_a_law_of_a_function_is_the_law_that_is_built_in(registered):
    def mobility(stress, rate, alpha):
        return alpha * square(stress)

    dc.register_law("own_mobility", extra_term=mobility, parameters={"alpha": (0.0, 1.0)})
    own, built_in = (dc.make_law(n, {"alpha": 0.3}) for n in ("own_mobility", "giesekus"))
    for stress in (np.array([0.5, -0.1, 0.0, 0.7]), np.diag([0.4, 0.1, -0.2])):
        rate = jnp.asarray(2.0) if stress.ndim == 1 else jnp.eye(3, k=1)
        ours, theirs = (law.stress_rate(jnp.asarray(stress), rate) for law in (own, built_in))
        np.testing.assert_allclose(ours, theirs, rtol=1e-14)
    assert "own_mobility" in dc.laws().index


def test_constants_of_such_a_law_are_fitted(registered):
    def softening(stress, rate, k):
        return k * trace(stress) ** 2 * stress

    dc.register_law("softening", extra_term=softening, parameters={"k": (0.0, 10.0)})
    data = dc.synthetic_dataset("softening", {"k": 0.3}, noise=0.01, n_samples=41)
    base = dc.Fluid(modulus=1.0, relaxation_time=1.0)
    fitted = dc.fit("softening", data, base=base)
    low, high = fitted.conf_int(0.999).loc["k"]
    assert low < 0.3 < high
    # negative control: the law's function decides what is fitted
    other = dc.fit("ptt_linear", data, base=base)
    assert other.error > 2.0 * fitted.error


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({}, "either build"),
        ({"build": dc.AbstractConstitutiveLaw, "extra_term": trace}, "either build"),
        ({"extra_term": lambda stress: stress}, "def mine(stress, rate, k)"),
        ({"extra_term": lambda stress, rate, q: stress}, "def mine(stress, rate, k)"),
        ({"extra_term": lambda stress, rate, k: k * trace(stress)}, "shape"),
    ],
)
def test_what_is_no_law_is_refused(registered, options, said):
    with pytest.raises(dc.InputError) as error:
        dc.register_law("mine", parameters={"k": (0.0, 1.0)}, **options)
    assert said in str(error.value)
    assert "mine" not in LAWS
