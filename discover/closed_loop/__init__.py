"""Find what a model misses, trace it to an effect it lacks, add it, report before and after."""

from discover.closed_loop.each_run import run_loop_on_each
from discover.closed_loop.loop import run_loop
from discover.closed_loop.results.candidate_score import CandidateScore
from discover.closed_loop.results.free_curve import FreeForm
from discover.closed_loop.results.loop_result import ErrorPair, LoopResult, RunRecord
from discover.closed_loop.results.next_test import NextTest, NextTests
from discover.closed_loop.results.stages import Stage
from discover.forward import DeclaredModel
from discover.inference.by_mode.constants import StageParameter

__all__ = [
    "CandidateScore",
    "DeclaredModel",
    "ErrorPair",
    "FreeForm",
    "LoopResult",
    "NextTest",
    "NextTests",
    "RunRecord",
    "Stage",
    "StageParameter",
    "run_loop",
    "run_loop_on_each",
]
