"""A fluid at a given stress and in steady states, against closed forms and scipy."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from independent import Giesekus
from independent.sweeps import strain_at
from scipy.optimize import brentq
from vectors import sweep_of, vector_of

from discover import protocols
from discover.dataset.run import Run
from discover.effects import named_effects
from discover.forward import AugmentedModel, DeclaredModel, make_batch
from discover.forward.flows import PeriodicFlows

MODULUS, TIME = 100.0, 1.0
TIMES = np.geomspace(0.01, 10.0, 60)
# in every model, used or not, so that all share their code
IN_SERIES = "wall_slip", "tool_compliance"


def giesekus(mobility, solvent=0.0):
    return DeclaredModel.named(
        "giesekus", {"alpha": mobility}, MODULUS, TIME, solvent_viscosity=solvent
    )


MAXWELL = giesekus(0.0)


def flow_curve(rates, stress=None, **columns):
    stress = np.ones(len(rates)) if stress is None else stress
    times = np.arange(1.0, len(rates) + 1.0)
    return Run("flow_curve.csv", times, protocols.steady_rates(rates), rates, stress, **columns)


def at_stress(times, stress, strain=None):
    strain = np.ones(len(times)) if strain is None else strain
    protocol = protocols.imposed_stress(times, stress)
    return Run("creep", times, protocol, np.zeros(len(times)), stress, strain=strain)


def predicted(declared, *runs, effects=(), **values):
    names = dict.fromkeys([*IN_SERIES, *effects])
    model = AugmentedModel(declared, [named_effects()[name] for name in names])
    return model.predict(vector_of(model, **values), make_batch(runs))


def test_what_needs_time_or_strain_does_not_act_on_steady_states():
    run = flow_curve(np.geomspace(0.1, 10.0, 9), first_normal_stress_difference=np.ones(9))
    runs = run, run.observing("N1")
    plain = predicted(giesekus(0.3), *runs)
    values = {"stress_drift": 1.0, "edge_fracture": 0.5, "transducer_lag": 0.2,
              "rate_rise_time": 0.2}  # fmt: skip
    names = [*values, "stress_gain"]
    together = predicted(giesekus(0.3), *runs, effects=names, **values)
    np.testing.assert_array_equal(together, plain)
    gained = predicted(giesekus(0.3), *runs, effects=names, stress_gain=0.1, **values)
    np.testing.assert_allclose(gained[0], 1.1 * plain[0], rtol=1e-12)


# second order in time: 7e-6 was measured where the solvent carries most of the stress
@pytest.mark.parametrize("solvent", [0.1, 10.0])
def test_a_giesekus_fluid_with_solvent_creeps_as_scipy_has_it(solvent):
    exact = strain_at(Giesekus(0.3, MODULUS, TIME), [(0.0, 60.0)], solvent, TIMES)
    strain = predicted(giesekus(0.3, solvent), at_stress(TIMES, np.full(60, 60.0)))[0]
    assert np.linalg.norm(strain - exact) < 5e-5 * np.linalg.norm(exact)


def test_a_spectrum_over_five_decades_creeps_by_its_closed_form():
    modulus, time = np.geomspace(1e5, 10.0, 9), np.geomspace(1e-3, 100.0, 9)
    times, stress = np.geomspace(1e-3, 100.0, 60), 100.0

    # 1/(s² G(s)), G(s) the sum of G λ/(1 + λs): an elastic part, a flow, and a retardation at each
    # zero between two relaxation rates   [Ferry 1980, Viscoelastic Properties of Polymers, ch. 3]
    def relaxing(s):
        return np.sum(modulus * time / (1.0 + time * s))

    rates = 1.0 / time
    ends = [(-a * (1.0 - 1e-12), -b * (1.0 + 1e-12)) for a, b in pairwise(rates)]
    zeros = np.array([brentq(relaxing, *end, xtol=1e-300, rtol=1e-14) for end in ends])
    slopes = np.array([np.sum(modulus * time**2 / (1.0 + time * s) ** 2) for s in zeros])
    parts = 1.0 / (zeros**2 * slopes)
    compliance = 1.0 / np.sum(modulus) + times / np.sum(modulus * time)
    compliance = compliance + parts @ (1.0 - np.exp(np.outer(zeros, times)))
    declared = DeclaredModel.named("giesekus", {"alpha": 0.0}, modulus, time)
    strain = predicted(declared, at_stress(times, np.full(60, stress)))[0]
    # the jump takes a thousandth of the time to the first sample, in which it flows: 2e-4 there
    np.testing.assert_allclose(strain, stress * compliance, rtol=3e-4)
    assert np.max(np.abs(strain - stress * compliance)) < 5e-5 * strain[-1]


def test_runs_of_every_kind_are_predicted_together_as_each_alone():
    rates, ones = np.geomspace(0.1, 10.0, 9), np.ones(60)
    strains, wave = np.array([0.1, 1.0, 10.0]), protocols.oscillatory_shear(1.0, 1.0)
    swing = protocols.after_alternation(wave, 2.0 * np.pi, TIMES)
    storage, loss = sweep_of(strains, np.ones(3)).records
    flows = {
        "start": protocols.start_up(2.0), "swing": swing,
        "stretched": protocols.in_flow(protocols.start_up(0.6), "uniaxial"),
        "step": protocols.after_step_strain(protocols.start_up(0.0), 2.0, first=float(TIMES[0])),
    }  # fmt: skip
    in_time = [Run(name, TIMES, flow, ones, ones) for name, flow in flows.items()]
    creep = at_stress(TIMES[:50], np.full(50, 30.0))
    runs = [loss, *in_time, flow_curve(rates), creep, storage]
    declared = giesekus(0.3)
    batch = make_batch(runs)
    # both moduli of a sweep are of one solution
    assert [len(p.strain) for p in batch.parts if isinstance(p, PeriodicFlows)] == [len(strains)]
    for row, run in zip(predicted(declared, *runs), runs, strict=True):
        # where a cycle closes Newton's last step differs
        rtol = 1e-6 if run.name == "swing" else 1e-9
        np.testing.assert_allclose(row[: len(run)], predicted(declared, run)[0], rtol=rtol)


def test_a_protocol_of_samples_that_impose_no_rate_is_not_smoothed():
    run = at_stress(TIMES, 5.0 * np.sin(TIMES))
    assert protocols.another_between_samples(run.protocol, run.time) is None
    rates = replace(run, protocol=protocols.start_up(1.0)).protocol
    assert rates.control == "rate"
