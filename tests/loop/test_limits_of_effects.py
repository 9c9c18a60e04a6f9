"""An effect of which the records show only a limit has the other name of that limit too."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import discover as dc
from discover.dataset import load_dataset

MODULUS, TIME, NOISE = 100.0, 1.0, 0.01
STEPS = (0.1, 0.5, 1.0, 2.0, 4.0)
DAMPING, BREAKDOWN, BUILD_UP = 0.25, 0.3, 1.0
CANDIDATES = ["thixotropy", "convective_constraint_release", "giesekus_mobility"]


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


def damped_steps(damping=lambda strain: np.exp(-DAMPING * strain)):
    """σ = G e^{−t/λ} γ h(γ), h = e^{−nγ}   [Wagner 1976, Rheol. Acta 15, 136]."""
    times = np.geomspace(0.02, 6.0, 40)
    return {
        f"step{strain}.csv": (
            times, 0.0, MODULUS * np.exp(-times / TIME) * strain * damping(strain), strain
        )
        for strain in STEPS
    }  # fmt: skip


def damped_by_a_power():
    """The same with h = 1/(1 + a γ²)   [Soskey & Winter 1984, J. Rheol. 28, 625]."""
    return damped_steps(lambda strain: 1.0 / (1.0 + 0.3 * strain**2))


def structure_in_start_up():
    """Maxwell's stress times a structure that flow breaks and time builds up, by scipy."""
    times = np.linspace(0.05, 6.0, 60)

    def stress(rate):
        def change(t, y):
            return [(1.0 - y[0]) / BUILD_UP - BREAKDOWN * rate * y[0]]

        structure = solve_ivp(change, (0.0, 6.0), [1.0], t_eval=times, rtol=1e-9).y[0]
        return structure * MODULUS * TIME * rate * (1.0 - np.exp(-times / TIME))

    return {f"up{rate}.csv": (times, rate, stress(rate), "") for rate in (0.3, 1.0, 3.0)}


def retracting(release):
    """Start-ups of a law whose strands retract, by scipy, with and without released constraints.

    σ▽ + ⅓ tr(σ·γ̇)[(1 + β)σ + I] + σ = γ̇   [Likhtman & Graham 2003; β = 0, ⅓: Larson 1984].
    """
    times = np.linspace(0.05, 6.0, 60)

    def stress(rate):
        def change(t, y):
            first, second, shear = y
            back = 2.0 * rate * shear / 3.0
            return [
                2.0 * rate * shear - first - back * ((1.0 + release) * first + 1.0),
                -second - back * ((1.0 + release) * second + 1.0),
                rate * (1.0 + second) - shear - back * (1.0 + release) * shear,
            ]

        return MODULUS * solve_ivp(change, (0.0, 6.0), [0.0] * 3, t_eval=times, rtol=1e-9).y[2]

    return {f"up{rate}.csv": (times, rate, stress(rate), "") for rate in (0.3, 1.0, 3.0)}


def giesekus_steps():
    """Relaxation of a Giesekus fluid, whose short times depend on the strain, by scipy."""
    times = np.geomspace(0.02, 6.0, 40)

    def change(t, y):
        first, second, shear = y
        return [
            -first - 0.3 * (first**2 + shear**2),
            -second - 0.3 * (second**2 + shear**2),
            -shear - 0.3 * shear * (first + second),
        ]

    def stress(strain):
        start = [strain**2, 0.0, strain]
        return MODULUS * solve_ivp(change, (0.0, 6.0), start, t_eval=times, rtol=1e-9).y[2]

    return {f"step{strain}.csv": (times, 0.0, stress(strain), strain) for strain in STEPS}


@pytest.mark.parametrize(
    ("records", "name", "others"),
    [
        (damped_steps, "thixotropy", ("strain_damping",)),
        pytest.param(
            damped_by_a_power,
            "convective_constraint_release",
            ("strain_damping",),
            marks=pytest.mark.slow,
        ),
        pytest.param(structure_in_start_up, "thixotropy", (), marks=pytest.mark.slow),
        (giesekus_steps, "giesekus_mobility", ()),
        (
            lambda: retracting(0.0),
            "convective_constraint_release",
            ("partly_retracting_strands",),
        ),
        (lambda: retracting(0.7), "convective_constraint_release", ()),
    ],
    ids=[
        "exponential steps",
        "steps",
        "start-ups",
        "steps that do not separate",
        "nothing released",
        "constraints released",
    ],
)
def test_an_effect_of_which_only_a_limit_shows_has_the_name_of_the_limit_too(
    tmp_path, records, name, others
):
    data = folder(tmp_path, records())
    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
    loop = dc.close_loop(data, base, effects=CANDIDATES, max_effects=1, explanations=1)
    (stage,) = loop.stages
    assert stage.effect == name
    assert stage.aliases == others
    told = loop.explanations
    assert told.likeliest_first[0].twins == tuple((other,) for other in others)
    assert all(told.inclusion[other] == told.inclusion[name] for other in others)
