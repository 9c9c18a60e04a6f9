"""An effect of which the records show only a limit has the other name of that limit too."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import discover as dc
from discover.dataset import load_dataset

MODULUS, TIME, NOISE = 100.0, 1.0, 0.01
STEPS = (0.1, 0.5, 1.0, 2.0, 4.0)
DAMPING, BREAKDOWN, BUILD_UP = 0.25, 0.3, 1.0
CANDIDATES = ["thixotropy", "giesekus_mobility", "solvent_viscosity"]


def folder(path, records):
    lines = ["file,step_strain"]
    for name, (times, rate, stress, strain) in records.items():
        noise = np.random.default_rng(len(lines)).standard_normal(len(times))
        stress = stress + NOISE * np.sqrt(np.mean(stress**2)) * noise
        np.savetxt(
            path / name, np.column_stack([times, rate + 0.0 * times, stress]), delimiter=",",
            header="time_s,shear_rate_1_s,stress_Pa", comments="",
        )  # fmt: skip
        lines.append(f"{name},{strain}")
    (path / "runs.csv").write_text("\n".join(lines) + "\n")
    return load_dataset(path)


def damped_steps():
    """σ = G e^{−t/λ} γ e^{−nγ}   [Wagner 1976, Rheol. Acta 15, 136]."""
    times = np.geomspace(0.02, 6.0, 40)
    return {
        f"step{strain}.csv": (
            times, 0.0, MODULUS * np.exp(-times / TIME) * strain * np.exp(-DAMPING * strain), strain
        )
        for strain in STEPS
    }  # fmt: skip


def structure_in_start_up():
    """Maxwell's stress times a structure that flow breaks and time builds up, by scipy."""
    times = np.linspace(0.05, 6.0, 60)

    def stress(rate):
        def change(t, y):
            return [(1.0 - y[0]) / BUILD_UP - BREAKDOWN * rate * y[0]]

        structure = solve_ivp(change, (0.0, 6.0), [1.0], t_eval=times, rtol=1e-9).y[0]
        return structure * MODULUS * TIME * rate * (1.0 - np.exp(-times / TIME))

    return {f"up{rate}.csv": (times, rate, stress(rate), "") for rate in (0.3, 1.0, 3.0)}


@pytest.mark.parametrize(
    ("records", "others"),
    [(damped_steps, ("strain_damping",)), (structure_in_start_up, ())],
    ids=["steps", "start-ups"],
)
def test_breaking_without_building_up_is_also_a_damping_by_strain(tmp_path, records, others):
    data = folder(tmp_path, records())
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    loop = dc.close_loop(data, base, effects=CANDIDATES, max_effects=1)
    (stage,) = loop.stages
    assert stage.effect == "thixotropy"
    assert stage.aliases == others
    told = loop.explanations
    assert told.likeliest_first[0].twins == tuple((other,) for other in others)
    assert all(told.inclusion[other] == told.inclusion["thixotropy"] for other in others)
