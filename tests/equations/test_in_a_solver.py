"""How long the steps of a solver may be, and whether A stays a conformation, by closed forms."""

import numpy as np
import pytest

from discover.equations import Box, Equation, NamedPart, write_equation
from discover.equations import Tested as Where
from discover.equations.formats.in_a_solver import in_a_solver
from tensor_library import LawTerm

WI = 3.0
# oscillation so fast that start-up goes furthest
TESTED = Where(Box((0.5, WI), (20.0, 20.0)))


def test_a_maxwell_fluid_has_the_eigenvalue_of_its_start_up_and_twice_its_shortest_time():
    """σ12 = Wi (1 − e^−t), σ11 = 2 Wi² (1 − (1 + t) e^−t)   [Bird, Armstrong & Hassager 1987]."""
    found = in_a_solver(Equation((), (10.0,), (2.0,), tested=TESTED))
    assert found is not None
    t = np.linspace(0.0, 10.0, 200)
    s12, s11 = WI * (1 - np.exp(-t)), 2 * WI**2 * (1 - (1 + t) * np.exp(-t))
    wanted = min(
        np.linalg.eigvalsh([[1 + a, b], [b, 1.0]])[0] for a, b in zip(s11, s12, strict=True)
    )
    # rtol 1e-6 of the integration, of an eigenvalue that is a small difference of large numbers
    assert found.smallest_eigenvalue == pytest.approx(wanted, rel=1e-3)
    # four eigenvalues of -1 that are one Jordan block come out within the fourth root of 1e-16
    assert found.largest_step == pytest.approx(4.0, rel=1e-3)


def test_the_step_follows_the_relaxation_that_the_flow_quickens():
    """White & Metzner's relaxation rate in shear is that of the rate alone."""
    k, n, times = 0.8, 0.4, (2.0, 0.3)
    named = NamedPart("white_metzner", ({"k": k, "n": n},))
    equation = Equation((), (10.0, 5.0), times, tested=TESTED, named=named)
    found = in_a_solver(equation)
    assert found is not None
    assert found.limiting_mode == 2
    rate = WI / equation.mean_relaxation_time * times[1]
    quickened = (1 + (k * rate) ** 2) ** ((1 - n) / 2)
    assert found.largest_step == pytest.approx(2 * times[1] / quickened, rel=1e-3)


def test_a_law_that_loses_its_conformation_and_one_that_runs_away_say_so():
    # h = 3 γ̇ turns the sign of σ around; h = −tr(σ) σ lets the trace grow on itself
    beyond = Equation((LawTerm("gammadot", 3.0),), tested=TESTED)
    text = write_equation(beyond, "python")
    assert "no conformation any more" in text
    runaway = Equation((LawTerm("tr(sigma)*sigma", -1.0),), tested=TESTED)
    assert "mode 1 diverges" in write_equation(runaway, "ufl")
    # negative controls: UCM does neither, and without a box nothing is said
    text = write_equation(Equation((), tested=TESTED), "python")
    assert "smallest eigenvalue" in text
    assert "conformation any" not in text
    assert "smallest eigenvalue" not in write_equation(Equation(()), "python")


@pytest.mark.parametrize(
    ("terms", "modulus", "times", "wi"),
    [
        ((LawTerm("sigma.sigma", -1e300),), (1.0,), (1.0,), 3.0),
        ((), (1.0,) * 1000, tuple(np.geomspace(1e-9, 1e9, 1000)), 3.0),
        ((LawTerm("sigma.sigma", 0.3),), (1.0,), (1.0,), 1e308),
    ],
    ids=["coefficient", "modes", "rate"],
)
def test_a_check_that_would_not_end_is_given_up_and_the_export_says_so(
    terms, modulus, times, wi, monkeypatch
):
    # the same limit as in use, reached sooner
    monkeypatch.setattr("discover.equations.formats.in_a_solver._MOST_EVALUATIONS", 3000)
    tested = Where(Box((0.5, wi), (20.0, 20.0)))
    equation = Equation(terms, modulus, times, tested=tested)
    text = write_equation(equation, "python")
    assert "not checked" in text or "diverges" in text
