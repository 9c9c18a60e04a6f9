"""Comparisons that nothing computed, and their page."""

import html

import numpy as np

from discover.comparison import Comparison, Flow, LearnerOutcome
from discover.comparison.rivals import Rival
from discover.comparison.statements import IN_LIBRARY, Statement
from discover.learners import RecoveredTerm
from discover.learners.lack_of_fit import LackOfFit
from discover.loop import ErrorPair, LoopResult
from discover.protocols.protocol import oscillatory_shear
from discover.report.comparison.report import write_comparison
from discover.study import RunFolder
from tensor_library.law_terms import LawTerms

NOT_THERE = (None, float("nan"), float("inf"))
TIMES = np.linspace(0.0, 10.0, 41)
ROW = {
    "log_evidence": 0.0, "size": 1, "support": ["sigma.sigma"], "inner": {}, "misfit": 0.02,
    "held_out": 0.03,
}  # fmt: skip


def flow(name, kind):
    stress, oscillates = np.sin(TIMES), oscillatory_shear(1.0, 1.0)
    measured = stress if kind == "training" else None
    told = {"sigma12": stress}
    return Flow(name, kind, oscillates, TIMES, np.cos(TIMES), told, measured)


def outcome(learner, number, predicted, verdict="explained"):
    """Return an outcome in which every number that may be missing is `number`."""
    ends = None if number is None else (number, number)
    term = RecoveredTerm("sigma.sigma", 0.2, coefficient_penalised=number, ci95=ends)
    path = [
        {**ROW, "size": 0, "support": [], "misfit": 0.4, "held_out": number},
        {**ROW, "held_out": number},
    ]
    details = {
        "path": path, "inclusion": {"sigma.sigma": 0.5}, "misfit": number,
        "coefficients": {"sigma": {"mean": number, "spread": number}},
    }  # fmt: skip
    stresses = {q: np.sin(TIMES) for q in ("sigma12", "N1", "N2")} if predicted else None
    keys = ("training/a", "held_out/b")
    predictions, left = dict.fromkeys(keys, stresses), LackOfFit(verdict, 0.01, 0.01, 0.0, 0.9)
    return LearnerOutcome(learner, (term,), 1.0, details, "ended", predictions, left=left)


def posterior(verdict, number):
    """Return a posterior that says so, without an explanation."""
    pair = ErrorPair(0.01, number)
    verdicts = {"explained": "no_effect_needed"}
    return LoopResult(verdicts.get(verdict, verdict), pair, pair, 0.01, (), {}, (), ())


def made_up(number=0.01, predicted=True, sparse="explained", network="explained", **changes):
    flows = [flow("a", "training"), flow("b", "held_out")]
    learners = {"tensor_sindy": sparse, "tbnn_ude": network}
    learners = {name: verdict for name, verdict in learners.items() if verdict}
    apart = dict.fromkeys(("sigma12", "N1", "N2"), number)
    rival = Rival(LawTerms({"sigma": 0.1}), "A twin.", apart)
    statements = [
        Statement("N1", IN_LIBRARY, "If the law is in the library, σ12 gives N1."),
        Statement("N2", "no", "No."),
    ]
    content = {
        "name": "made up", "data_summary": "none", "known_part": "Maxwell", "flows": flows,
        "before": {f.key: None for f in flows}, "truth": None, "noise": None, "rivals": [rival],
        "outcomes": {name: outcome(name, number, predicted, one) for name, one in learners.items()},
        "statements": statements, "posterior": posterior(sparse or network, number),
        "shares": {"tensor_sindy": 0.9},
    }  # fmt: skip
    return Comparison(**{**content, **changes})


def page_of(comparison, folder):
    write_comparison(comparison, RunFolder(folder, "x"), True)
    return html.unescape((folder / "report.html").read_text("utf-8"))
