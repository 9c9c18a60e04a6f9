"""A data folder of a Giesekus fluid that scipy integrated, in plain numbers."""

import numpy as np
from independent import Giesekus
from independent.folders import maxwell_sweep, write_runs, write_table
from noisy_runs import start_ups

MODULUS, TIME, MOBILITY = 100.0, 2.0, 0.3
RATES = {"slow.csv": 0.4, "medium.csv": 1.0, "fast.csv": 2.0}


def write_folder(folder):
    """Write three start-ups and a linear sweep; return the folder."""
    fluid, times = Giesekus(MOBILITY, MODULUS, TIME), np.linspace(0.0, 8.0, 40)
    runs = start_ups(fluid, RATES.values(), times, noise=0.005, names=[*RATES])
    columns = {
        run.name: {"time_s": times, "shear_rate_1_s": run.rate, "stress_Pa": run.stress}
        for run in runs
    }
    write_runs(folder, columns, {}, digits=17)
    sweep = maxwell_sweep([MODULUS], [TIME], np.geomspace(0.005, 50.0, 21))
    write_table(folder / "lve.csv", sweep, digits=17)
    return folder
