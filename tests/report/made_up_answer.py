"""An answer that is made up: a melt with one suspect and one open normal stress."""

from dataclasses import replace

from discover.answer import Answer, Constant, Discrepancy, ExpectedError, Mode, Range, Suspect
from discover.equations import Equation
from discover.report.first_screen import answer_screen
from discover.report.page import render
from tensor_library.law_terms import LawTerm

MELT = Answer(
    "linear PTT", "ptt_linear", (Constant("epsilon", 0.82, (0.58, 1.07)),),
    (Mode(1000.0, 1.0), Mode(100.0, 10.0)), error=0.06, noise=0.0025,
    discrepancy=Discrepancy(
        0.06, (0.04, 0.07), {"a.csv": 0.08, "b.csv": 0.03}, unseen="unseen runs"
    ),
    range=Range(rate_1_s=(0.003, 3.0)),
    expected_error={
        "sigma12": ExpectedError(0.06, note="2 unseen runs"),
        "N1": ExpectedError(
            missing="not determined",
            note="not determined, laws differ by over 20 %",
            spread=(0.4, 0.5),
        ),
    },
    suspects=(Suspect("stress_gain", (Constant("gain_error", -0.11, (-0.36, 0.02)),)),),
    next_test="Repeat one shear run on a second filling.",
    equation=Equation((LawTerm("tr(sigma)*sigma", 0.82),), (1000.0, 100.0), (1.0, 10.0)),
)  # fmt: skip


def headline(answer=MELT, **changes):
    return replace(answer, **changes).headline


def screen_of(answer=MELT, **changes):
    return answer_screen(replace(answer, **changes))


def page_of(answer=MELT, **changes):
    return render("answer.html", screen=screen_of(answer, **changes))
