"""The closed loop: what a model lacks, added with its probability, before and after."""

from discover.forward import DeclaredModel
from discover.inference.design import NextTest, NextTests
from discover.inference.free_form import FreeForm
from discover.loop.loop import run_loop, run_loop_on_each
from discover.loop.loop_result import LoopResult
from discover.loop.parts import CandidateScore, ErrorPair, Stage, StageParameter
from discover.loop.runs import RunRecord

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
