"""A data folder of a Giesekus fluid that scipy integrated, in plain numbers."""

import numpy as np
from independent import Giesekus, start_up

MODULUS, TIME, MOBILITY = 100.0, 2.0, 0.3
RATES = {"slow.csv": 0.4, "medium.csv": 1.0, "fast.csv": 2.0}


def write_folder(folder, samples=40, noise=0.005):
    """Write three start-ups and a linear sweep; return the folder."""
    folder.mkdir()
    generator = np.random.default_rng(0)
    times = np.linspace(0.0, 8.0, samples)
    (folder / "runs.csv").write_text("file\n" + "\n".join(RATES) + "\n")
    for name, rate in RATES.items():
        stress = Giesekus(MOBILITY, MODULUS, TIME).respond(start_up(rate), times).sigma12
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
