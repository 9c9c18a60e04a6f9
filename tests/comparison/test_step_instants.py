"""Both learners are given rates that step when the stresses say so. Truth by scipy alone."""

from dataclasses import replace

import numpy as np
import pytest
from discover.comparison.fitting.step_instants import with_step_instants
from independent import Giesekus
from independent.flow import start_up, steps
from independent.folders import write_folder
from independent.instruments import Instrument

import discover as dc
from discover.study.in_memory import data_in_memory, declared_fluid
from tensor_library import TermLibrary, parse_term

MODULUS, TIME, NOISE = 100.0, 1.0, 0.01
BASE = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
# each term is one more column of a program, and takes as long to compile
LIBRARY = TermLibrary((parse_term("sigma.sigma"), parse_term("tr(sigma)*sigma")))
INSTANTS = {"up.csv": 4.01, "down.csv": 3.99, "judge.csv": 3.02}
FLOWS = {
    "up.csv": (steps([0.0, 4.01], [1.0, 3.0]), 8.0),
    "down.csv": (steps([0.0, 3.99], [3.0, 0.5]), 8.0),
    "steady.csv": (start_up(2.0), 6.0),
    "judge.csv": (steps([0.0, 3.02], [5.0, 1.0]), 6.0),
}


def data_on(folder, flows):
    generator, runs = np.random.default_rng(0), {}
    for name, (flow, end) in flows.items():
        run = Instrument().record(Giesekus(0.3, MODULUS, TIME), flow, np.linspace(0.02, end, 120))
        size = NOISE * np.sqrt(np.mean(run.stress**2))
        runs[name] = replace(run, stress=run.stress + size * generator.standard_normal(120))
    return data_in_memory(dc.load_dataset(write_folder(folder, runs)), ["judge.csv"])


def dated(data):
    return with_step_instants(declared_fluid(BASE, data.dataset), data, LIBRARY)


def test_steps_of_fitted_and_of_unseen_runs_are_dated(tmp_path):
    before = data_on(tmp_path / "data", FLOWS)
    after, said = dated(before)
    assert "up.csv, down.csv and judge.csv" in said
    for part in ("dataset", "fit", "held_out"):
        for old, new in zip(getattr(before, part).runs, getattr(after, part).runs, strict=True):
            knots, rates = np.asarray(new.protocol.table_times), new.protocol.table_rates
            jumps = knots[1:][np.diff(knots) <= 0.0]
            if new.name not in INSTANTS:
                assert not jumps.size
                continue
            # 1 % of noise, and a slope that changes by GΔγ̇: some ten samples date it to this
            assert jumps == pytest.approx([INSTANTS[new.name]], abs=0.006)
            at = np.isin(knots, np.asarray(old.protocol.table_times))
            np.testing.assert_array_equal(np.asarray(rates)[at], old.protocol.table_rates)
            np.testing.assert_array_equal(new.stress, old.stress)


def test_data_without_such_steps_are_the_same_object(tmp_path):
    data = data_on(tmp_path / "data", {n: (start_up(1.0 + i), 5.0) for i, n in enumerate(FLOWS)})
    assert dated(data) == (data, "")
