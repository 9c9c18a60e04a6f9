"""A learner, one file outside the package, as its page describes it."""

import numpy as np
import pytest
from user_packages import LEARNER_CODE, install, project

from discover.errors import InputError
from discover.learners.registry import LEARNERS, learner_title, register_learner
from discover.study import read_study

PAGE = "adding-a-learner.md"


@pytest.mark.slow
def test_the_learner_of_the_page_is_trained_judged_reported_and_exported(workplace):
    workplace.follow(PAGE)
    study = workplace.study(PAGE, more="high_deborah = [1.5]\n")
    workplace.run("compare", study, "--out", "out", "--quiet")
    found = workplace.json("out/comparison.json")
    assert set(found["learners"]) == {"tensor_sindy", "one_term"}
    (term,) = found["learners"]["one_term"]["terms"]
    assert term["term"] == "sigma.sigma"
    np.testing.assert_allclose(term["coefficient"], 0.2, atol=0.02)
    assert found["learners"]["one_term"]["train_seconds"] > 0
    assert found["lack_of_fit"]["one_term"]["misfit"] < 0.05
    errors = found["learners"]["one_term"]["errors"]
    assert all(e["sigma12"] < 0.05 for e in errors.values() if e["sigma12"] is not None)
    report = (workplace.folder / "out" / "report.html").read_text("utf-8")
    assert "one term" in report
    assert "the best of 8 terms" in report.lower()
    assert "one_term" in (workplace.folder / "out" / "predictions.csv").read_text("utf-8")
    latex = workplace.run("export", "out", "--law", "one_term", "--format", "latex").stdout
    assert "Law found by one term" in latex


def compared_alone(workplace, code, more="", status=0):
    """Compare a learner of a package with nothing beside it."""
    install(workplace.packages, "mine", code, project("learners", mine="mine"))
    study = workplace.folder / workplace.study(PAGE, more=more)
    study.write_text(study.read_text("utf-8").replace('["tensor_sindy", "one_term"]', '["mine"]'))
    return workplace.run("compare", study.name, "--out", "out", "--quiet", code=status)


@pytest.mark.slow
def test_a_learner_may_be_asked_alone(workplace):
    compared_alone(workplace, LEARNER_CODE, "high_deborah = [1.5]\n")
    found = workplace.json("out/comparison.json")
    assert list(found["learners"]) == ["mine"]
    assert "mine" in (workplace.folder / "out" / "report.html").read_text("utf-8")


@pytest.mark.slow
def test_what_returns_no_result_is_an_error_that_names_the_learner(workplace):
    code = "import discover as dc\ndc.register_learner('mine', lambda task: None)\n"
    done = compared_alone(workplace, code, status=2)
    assert "The learner 'mine' must return a LearnerResult; got a NoneType" in done.stderr


def test_without_the_package_the_study_of_the_page_is_refused(workplace):
    # negative control of the first test, in this process, where nothing is installed
    said = "unknown learner 'one_term'. Write one of: tensor_sindy, tbnn_ude"
    with pytest.raises(InputError, match=said):
        read_study(workplace.folder / workplace.study(PAGE))


def test_a_name_is_not_given_twice():
    register_learner("mine", lambda task: None)
    try:
        assert learner_title("mine") == "mine"
        for name in ("mine", "tensor_sindy"):
            with pytest.raises(InputError, match="known already"):
                register_learner(name, lambda task: None)
    finally:
        del LEARNERS["mine"]
