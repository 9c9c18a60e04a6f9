"""The script of the page on Python runs as it stands."""

from functools import partial

import pytest
from fewer_hypotheses import few_candidates, verdict_alone, without_pictures
from independent_folder import MOBILITY, write_folder
from user_packages import blocks

import discover as dc
from discover.learners.tbnn_ude import DefaultRecipe
from discover.learners.tbnn_ude.estimator import TBNNUDE
from discover.learners.tensor_sindy.estimator import TensorSINDy
from discover.loop import in_memory
from tensor_library import parse_term
from tensor_library.library import TermLibrary

LIBRARY = TermLibrary((parse_term("sigma.sigma"), parse_term("tr(sigma)*sigma")))


def script():
    return next(b for b in blocks("python.md", "python") if b.startswith("import discover as dc"))


# constants alone, which is all that these data need: functions have tests of their own
SMALL = DefaultRecipe(width=4, steps=6, polish_steps=30, max_tensors=0)


@pytest.fixture(scope="module", params=[False, pytest.param(True, marks=pytest.mark.slow)],
                ids=["verdict", "whole"])  # fmt: skip
def after(request, tmp_path_factory):
    """What the script leaves behind, with settings that cost less: its words are not changed."""
    folder = tmp_path_factory.mktemp("door")
    write_folder(folder / "FOLDER")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        quick = {"library": LIBRARY, "max_terms": 1}
        said: dict = {"sindy": [], "network": [], "loop": []}
        heard = {name: lambda *news, name=name: said[name].append(news) for name in said}
        network, loop = {"quick": True}, {}
        if not request.param:
            network, loop = {"recipe": SMALL}, {"explanations": 1}
            verdict_alone(patch)
            without_pictures(patch)
        network["progress"], loop["progress"] = heard["network"], heard["loop"]
        patch.setattr(dc, "TensorSINDy", partial(TensorSINDy, progress=heard["sindy"], **quick))
        patch.setattr(dc, "TBNNUDE", partial(TBNNUDE, **network))
        patch.setattr(dc, "close_loop", partial(in_memory.close_loop, **loop))
        run_study = in_memory.run_study

        def with_few(study, data, declared, progress, _):
            return run_study(study, data, declared, progress, ["giesekus_mobility", "stress_gain"])

        patch.setattr(in_memory, "run_study", with_few)
        few_candidates(patch, ("giesekus_mobility", "ptt_linear", "stress_gain"))
        left: dict = {"folder": folder, "said": said, "is_drawn": request.param}
        exec(compile(script(), "docs/python.md", "exec"), left)
        yield left


def test_the_page_has_the_script_word_for_word():
    lines = script().splitlines()
    assert lines[0].startswith("import discover as dc ")
    for call in ("dc.load_dataset", "data.split(", "Fluid.from_sweep", "dc.TensorSINDy(base=base)",
                 "dc.TBNNUDE(base=base)", "dc.compare([sindy, network], test)",
                 "dc.close_loop(train, base, held_out=test)", ".to_html(", ".save(", "dc.load(",
                 ".score(test)", ".equation_.latex()", ".to_dataframe()", "dc.laws()",
                 "dc.effects()"):  # fmt: skip
        assert call in script(), call


def test_the_script_finds_what_scipy_planted(after):
    (term,) = after["sindy"].terms_
    assert (term.term, term.coefficient) == ("sigma.sigma", pytest.approx(MOBILITY, abs=0.03))
    loop = after["loop"]
    assert [stage.effect for stage in loop.stages] == ["giesekus_mobility"]
    table = loop.to_dataframe()
    assert table.loc[0, "value"] == pytest.approx(MOBILITY, abs=0.03)
    assert loop.error_after.held_out < 0.02 < loop.error_before.held_out
    assert "giesekus_mobility" in repr(loop)


def test_progress_has_one_shape_for_learners_and_loop(after):
    for name, news in after["said"].items():
        assert len(news) > 1, name
        fractions = [fraction for _, fraction in news]
        assert all(isinstance(text, str) and text for text, _ in news)
        assert fractions == sorted(fractions)
        assert 0.0 <= fractions[0] < fractions[-1] <= 1.0


def test_the_comparison_judges_on_what_no_fit_saw(after):
    comparison = after["comparison"]
    assert list(comparison.outcomes) == ["tensor_sindy", "tbnn_ude"]
    assert [flow.name for flow in comparison.unseen_flows] == ["fast.csv"]
    errors = comparison.errors_table().loc[("fast.csv", "sigma12")]
    assert errors["tensor_sindy"] < 0.02 < errors["before"]
    assert errors["tensor_sindy"] == pytest.approx(1.0 - after["sindy"].score(after["test"]), 0.01)
    assert comparison.verdict == "explained"
    assert set(comparison.to_dataframe()) >= {"flow", "quantity", "before", "tbnn_ude"}
    assert len(repr(comparison)) < 200


def test_pages_are_whole_and_say_that_no_command_made_them(after):
    for name, call in (("comparison", "discover.compare(...)"), ("loop", "discover.close_loop(")):
        page = (after["folder"] / f"{name}.html").read_text("utf-8")
        assert page.lstrip().lower().startswith("<!doctype html>")
        assert "</html>" in page
        assert call in page
        assert "<svg" in page or not after["is_drawn"]
    left = sorted(path.name for path in after["folder"].iterdir())
    assert left == ["FOLDER", "comparison.html", "law.discover", "loop.html"]


def test_an_estimator_from_a_file_is_compared_with_its_runs_at_hand(after):
    saved = dc.load(after["folder"] / "law.discover")
    with pytest.raises(dc.InputError, match="train=train"):
        dc.compare([saved], after["test"])
    with pytest.raises(dc.InputError, match="does not hold the samples"):
        dc.compare([saved], after["test"], train=after["test"])
    again = dc.compare([saved], after["test"], train=after["train"])
    first, second = (
        c.errors_table().loc[("fast.csv", "sigma12"), "tensor_sindy"]
        for c in (after["comparison"], again)
    )
    assert second == pytest.approx(first, rel=1e-9)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda s: dc.compare([s["sindy"]], s["train"]), "both fitted and held out"),
        (lambda s: dc.compare([s["sindy"], s["sindy"]], s["test"]), "one TensorSINDy at most"),
        (lambda s: dc.compare([TBNNUDE()], s["test"]), "is not fitted"),
        (lambda s: dc.compare([], s["test"]), "got none"),
        (lambda s: dc.compare(["law.discover"], s["test"]), "got a str"),
        (lambda s: dc.compare([s["sindy"]], s["base"]), "Give the data set that tests"),
        (lambda s: dc.compare([s["sindy"]], s["test"], quick=True), "fitted already"),
        (lambda s: dc.compare(s["data"], s["base"], gremlins=1), "unknown key"),
        (lambda s: dc.compare(s["data"], "ucm"), "must be a Fluid"),
        (lambda s: dc.close_loop(s["train"], s["base"], held_out=s["train"]), "proves nothing"),
        (lambda s: dc.close_loop(s["train"], s["base"], held_out="fast.csv"), "for this run"),
        (lambda s: dc.close_loop(s["train"], s["base"], gremlins=1), "no option 'gremlins'"),
        (lambda s: dc.close_loop(s["train"], s["base"], free=["alpha"]), "cannot be fitted"),
    ],
)
@pytest.mark.usefixtures("as_users_run_it")
def test_what_cannot_be_compared_is_refused(after, call, message):
    with pytest.raises(dc.InputError, match=message):
        call(after)
