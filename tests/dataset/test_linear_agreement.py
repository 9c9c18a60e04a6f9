"""One spectrum predicts oscillation, relaxation and creep, or it is said that it does not."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from discover.dataset.linear.linear_tests import (
    LinearTest,
    creep_compliance,
    linear_agreements,
    modes_of_retardation,
    read_linear_tests,
    spectrum_of,
)
from discover.dataset.linear_viscoelasticity import RelaxationSpectrum
from discover.report.data import agreement_words

TIME = np.geomspace(0.01, 100.0, 40)
OMEGA = np.geomspace(0.01, 100.0, 30)
MODULUS, RELAXATION = np.array([300.0, 80.0, 20.0]), np.array([0.05, 1.0, 30.0])


def spectrum(modulus, times):
    return RelaxationSpectrum(np.asarray(modulus), np.asarray(times), 0.0, 0.0, {})


def test_one_maxwell_element_creeps_as_spring_and_dashpot():
    found = creep_compliance(spectrum([50.0], [2.0]), TIME)
    np.testing.assert_allclose(found, 1 / 50.0 + TIME / 100.0, rtol=1e-12)


def compliance():
    """Return the creep of the three elements under a unit stress, by scipy."""

    def slope(_, state):
        rate = np.sum(state[:3] / RELAXATION) / MODULUS.sum()
        return np.append(MODULUS * rate - state[:3] / RELAXATION, rate)

    start = np.append(MODULUS, 1.0) / MODULUS.sum()
    ends = 0.0, TIME[-1]
    return solve_ivp(slope, ends, start, "LSODA", TIME, rtol=1e-10, atol=1e-13).y[3]


def test_several_elements_creep_as_their_differential_equation_does():
    # tolerance of the integration, over some hundred steps
    np.testing.assert_allclose(
        creep_compliance(spectrum(MODULUS, RELAXATION), TIME), compliance(), rtol=1e-7
    )


@pytest.mark.parametrize("gain", [1.0, 0.75])
def test_a_gain_of_one_test_is_found_and_none_where_there_is_none(tmp_path, gain):
    x = OMEGA[:, None] * RELAXATION
    sweep = OMEGA, (x**2 / (1 + x**2)) @ MODULUS, (x / (1 + x**2)) @ MODULUS
    relaxing = gain * np.exp(-TIME[:, None] / RELAXATION) @ MODULUS
    tables = {
        "lve": ("omega_rad_s,Gp_Pa,Gpp_Pa", sweep),
        "relaxation": ("time_s,relaxation_modulus_Pa", (TIME, relaxing)),
        "creep": ("time_s,compliance_1_Pa", (TIME, compliance())),
    }
    rows = ["file,test,temperature_C"]
    for celsius in (20, 40):
        for test, (head, columns) in tables.items():
            name = f"{test}_{celsius}C.csv"
            np.savetxt(
                tmp_path / name, np.stack(columns, 1), "%.17g", ",", header=head, comments=""
            )
            rows.append(f"{name},{test},{celsius}")
    (tmp_path / "tests.csv").write_text("\n".join(rows))
    found = linear_agreements(read_linear_tests(tmp_path))
    assert len(found) == 12  # each of three tests from each other one, at two temperatures
    for one in found:
        if "relaxation" not in (one.source, one.test) or gain == 1.0:
            assert one.agrees
        else:
            assert not one.agrees
            # a compliance that is predicted falls with the modulus
            factor = gain if (one.source, one.test) == ("relaxation", "lve") else 1 / gain
            # modes fit each test to about 1 %, and those of creep bend a little with its ends
            assert one.bias == pytest.approx(factor - 1, abs=0.05)
            assert one.left < 0.1  # what agreement is judged by
    said = " ".join(agreement_words(found))
    assert ("relaxation modulus stands apart from both" in said) == (gain != 1.0)


def test_maxwell_elements_and_their_retarded_elements_are_one_fluid():
    # Burgers' fluid, a Maxwell and a Kelvin element in a row, whose creep is a closed form
    instant, retarded, slow, fluidity = 2e-3, 5e-3, 3.0, 1e-3
    modulus, time = modes_of_retardation(instant, fluidity, np.array([retarded]), np.array([slow]))
    found = creep_compliance(spectrum(modulus, time), TIME)
    exact = instant + retarded * -np.expm1(-TIME / slow) + fluidity * TIME
    np.testing.assert_allclose(found, exact, rtol=1e-10)


def test_creep_alone_leads_to_the_moduli_of_its_fluid():
    found = spectrum_of(LinearTest("creep", TIME, compliance()[None]))
    x = OMEGA[:, None] * RELAXATION
    inside = (OMEGA > 0.03) & (OMEGA < 30.0)  # half a decade from the ends of the times
    for seen, part in zip(found.moduli(OMEGA), (x**2, x), strict=True):
        exact = (part / (1 + x**2)) @ MODULUS
        # tests are said to agree to 10 %, so a fluid has to agree with itself to that
        np.testing.assert_allclose(seen[inside], exact[inside], rtol=0.1)
