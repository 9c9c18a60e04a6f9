"""A data folder of a Giesekus fluid that scipy integrated, in plain numbers."""

import numpy as np
from scipy.integrate import solve_ivp

MODULUS, TIME, MOBILITY = 100.0, 2.0, 0.3
RATES = {"slow.csv": 0.4, "medium.csv": 1.0, "fast.csv": 2.0}


def start_up_stress(rate, times):
    """Shear stress in Pa: λ dσ/dt = Gλγ̇ + λ(L·σ + σ·Lᵀ) − σ − (α/G) σ·σ, by components."""

    def field(_, s):
        s11, s22, s12 = s
        return [
            2.0 * rate * s12 - (s11 + MOBILITY / MODULUS * (s11**2 + s12**2)) / TIME,
            -(s22 + MOBILITY / MODULUS * (s22**2 + s12**2)) / TIME,
            MODULUS * rate + rate * s22 - (s12 + MOBILITY / MODULUS * s12 * (s11 + s22)) / TIME,
        ]

    found = solve_ivp(field, (0.0, times[-1]), np.zeros(3), t_eval=times, rtol=1e-10, atol=1e-10)
    return found.y[2]


def write_folder(folder, samples=40, noise=0.005):
    """Write three start-ups and a linear sweep; return the folder."""
    folder.mkdir()
    generator = np.random.default_rng(0)
    times = np.linspace(0.0, 8.0, samples)
    (folder / "runs.csv").write_text("file\n" + "\n".join(RATES) + "\n")
    for name, rate in RATES.items():
        stress = start_up_stress(rate, times)
        stress += noise * np.sqrt(np.mean(stress**2)) * generator.standard_normal(samples)
        columns = np.column_stack([times, np.full(samples, rate), stress])
        header = "time_s,shear_rate_1_s,stress_Pa"
        np.savetxt(folder / name, columns, delimiter=",", header=header, comments="")
    omega = np.geomspace(0.005, 50.0, 21)
    x = omega * TIME
    sweep = np.column_stack([omega, MODULUS * x**2 / (1 + x**2), MODULUS * x / (1 + x**2)])
    np.savetxt(folder / "lve.csv", sweep, delimiter=",", header="omega_rad_s,Gp_Pa,Gpp_Pa",
               comments="")  # fmt: skip
    return folder
