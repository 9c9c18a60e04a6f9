"""Modes, solvent and elastic constant as a study declares them, beside a sweep written by hand."""

import tomllib

import numpy as np
import pytest

from discover.dataset import Dataset, LinearSweep
from discover.study import parse_study
from discover.study.declared_model import declared_model

OMEGA = np.geomspace(0.1, 100.0, 31)
MODULUS, TIME, SOLVENT = np.array([6000.0, 1200.0]), np.array([0.08, 1.5]), 25.0


def sweep(elastic=0.0):
    x = 1j * OMEGA[:, None] * TIME
    moduli = (x / (1 + x)) @ MODULUS + elastic + 1j * OMEGA * SOLVENT
    lot = np.random.default_rng(5)
    off = 1 + 0.01 * lot.standard_normal((2, len(OMEGA)))
    return LinearSweep(OMEGA, moduli.real * off[0], moduli.imag * off[1])


def declared(*lines, elastic=0.0):
    content = tomllib.loads("\n".join(["[data]", 'folder = "x"', "[model]", *lines]))
    return declared_model(parse_study(content), Dataset("x", (), sweep(elastic)))


def test_the_solvent_of_the_sweep_is_found_and_its_error_handed_on():
    model = declared('modes = "lve"')
    assert model.solvent_viscosity == pytest.approx(SOLVENT, rel=0.05)
    np.testing.assert_allclose(model.modulus, MODULUS, rtol=0.05)
    np.testing.assert_allclose(model.relaxation_time, TIME, rtol=0.05)
    errors = np.sqrt(np.diag(model.modulus_covariance))
    assert len(errors) == 3
    assert 0.001 < errors[-1] / SOLVENT < 0.02


def test_a_declared_solvent_counts_once():
    model = declared('modes = "lve"', "solvent_viscosity_Pa_s = 25.0")
    assert model.solvent_viscosity == 25.0
    assert len(model.modulus) == 2
    assert declared('modes = "lve"', "solvent_viscosity_Pa_s = 0.0").solvent_viscosity == 0.0


def test_modes_may_be_listed_or_counted():
    model = declared("modulus_Pa = [1200, 6000]", "relaxation_time_s = [1.5, 0.08]")
    np.testing.assert_allclose(model.modulus, [1200.0, 6000.0])
    assert model.solvent_viscosity == 0.0
    assert len(declared("modes = 3").modulus) == 3
    free = declared("modulus_Pa = 3.0", 'solvent_viscosity_Pa_s = "fit"')
    assert [one.name for one in free.effects if one.free] == ["solvent_viscosity"]


def test_a_solid_is_a_mode_that_does_not_relax_and_is_named():
    with pytest.warns(UserWarning, match="is a solid"):
        of_sweep = declared('modes = "lve"', elastic=5000.0)
    assert of_sweep.modulus[-1] == pytest.approx(5000.0, rel=0.05)
    assert of_sweep.relaxation_time[-1] > 100.0 / OMEGA[0]
    with pytest.warns(UserWarning, match="is a solid"):
        by_hand = declared("elastic_modulus_Pa = 40.0")
    assert by_hand.relaxation_time[-1] >= 1000.0
    assert "solid" in by_hand.modes_in_words
