"""How far N1 and N2 move between laws that fit; curves are written by hand."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.judging.bands.room_left import room_left
from discover.comparison.judging.identifiability import Rival
from discover.comparison.outcomes.flows import Flow
from discover.comparison.outcomes.outcome import LearnerOutcome

from discover.protocols import start_up
from discover.protocols.protocol import in_flow
from tensor_library.law_terms import LawTerms

TIMES = np.linspace(0.0, 4.0, 9)
FLOW = Flow("startup", "held_out", start_up(2.0), TIMES, np.full(9, 2.0), {})
RISING = 1.0 - np.exp(-TIMES)


def outcome(learner, n1=1.0, n2=0.0):
    curves = {"sigma12": RISING, "N1": n1 * RISING, "N2": n2 * RISING}
    return LearnerOutcome(
        learner, (), 1.0, (np.zeros(0), np.zeros(0)), {}, "", {FLOW.key: curves}, None, {}
    )


BOTH = {"tensor_sindy": outcome("tensor_sindy"), "tbnn_ude": outcome("tbnn_ude", 1.25, -0.1)}


def test_two_laws_that_fit_alike_leave_the_difference_of_their_normal_stresses():
    found = room_left(BOTH, {"tensor_sindy": 0.02, "tbnn_ude": 0.03}, (), [FLOW])
    # the network against the sparse law, relative to the sparse law's: 0.25, and −0.1 of N1
    assert found == pytest.approx({"N1": 0.25, "N2": 0.1})


def test_a_law_that_fits_far_worse_and_a_runaway_say_nothing():
    assert room_left(BOTH, {"tensor_sindy": 0.01, "tbnn_ude": 0.05}, (), [FLOW]) == {}
    lost = replace(BOTH["tbnn_ude"], predictions={FLOW.key: None})
    misfits = {"tensor_sindy": 0.02, "tbnn_ude": 0.02}
    assert room_left({**BOTH, "tbnn_ude": lost}, misfits, (), [FLOW]) == {}


def test_rivals_and_members_of_the_network_count_and_extension_does_not():
    apart = {"sigma12": 0.0, "N1": 0.4, "N2": None}
    rival = Rival(LawTerms({"gammadot": 0.1}), errors_to_chosen=apart)
    sparse = {"tensor_sindy": BOTH["tensor_sindy"]}
    assert room_left(sparse, {"tensor_sindy": 0.02}, [rival], [FLOW]) == {"N1": 0.4}
    limits = {q: (0.9 * RISING, 1.1 * RISING) for q in ("sigma12", "N1")}
    network = replace(outcome("tbnn_ude"), bands={FLOW.key: limits})
    assert room_left({"tbnn_ude": network}, {"tbnn_ude": 0.02}, (), [FLOW])["N1"] == pytest.approx(
        0.2
    )
    pull = replace(FLOW, protocol=in_flow(FLOW.protocol, "uniaxial"))
    assert room_left(BOTH, {"tensor_sindy": 0.02, "tbnn_ude": 0.03}, (), [pull]) == {}
