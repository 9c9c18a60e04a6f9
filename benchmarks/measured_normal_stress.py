"""Whether a measured N1 can be right, judged without any law: numpy and the sweep alone.

    python benchmarks/measured_normal_stress.py [FOLDER]

FOLDER holds start-ups with N1 and an ``lve.csv``; by default it is $DISCOVER_DATA/pi95k-startup.
Two rules:

- late in a run, Laun's rule N1 = 2G'(1 + (G'/G'')²)^0.7 at ω = γ̇   [Laun 1986, J. Rheol. 30, 459],
  beside Cox and Merz's σ12 = |G*| at ω = γ̇, which says how far such rules hold for this sample;
- early in a run, N1 = 2γ̇² ∫ s G(s) ds up to t, which holds for every fluid with fading memory to
  second order in the strain   [Coleman & Markovitz 1964, J. Appl. Phys. 35, 1]. Over σ12 γ, with γ
  the strain, it is 1 for an elastic solid and less for a fluid.
"""

import os
import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.optimize import nnls


def main():
    default = Path(os.environ.get("DISCOVER_DATA", ".")) / "pi95k-startup"
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else default
    sweep = pd.read_csv(folder / "lve.csv").sort_values("omega_rad_s")
    omega, storage, loss = (sweep[c].to_numpy() for c in ("omega_rad_s", "Gp_Pa", "Gpp_Pa"))

    times = np.geomspace(1.0 / omega.max(), 1.0 / omega.min(), 60)
    x = omega[:, None] * times
    design = np.vstack([x**2 / (1 + x**2) / storage[:, None], x / (1 + x**2) / loss[:, None]])
    moduli, _ = nnls(design, np.ones(2 * omega.size))

    print("run, rate in 1/s | late: s12 over Cox-Merz, N1 over Laun | N1/(s12 strain) at strains")
    print("of 0.2 to 0.5 and 0.5 to 1: measured (by the sweep) | s12 over the sweep's, there")
    for row in pd.read_csv(folder / "runs.csv")["file"]:
        run = pd.read_csv(folder / row)
        time, stress, normal = (run[c].to_numpy() for c in ("time_s", "stress_Pa", "N1_Pa"))
        rate = float(run["shear_rate_1_s"].iloc[-1])
        strain = rate * time
        late = (strain > 0.8 * min(strain[-1], 25.0)) & (strain <= 25.0)
        g1, g2 = (
            np.exp(np.interp(np.log(rate), np.log(omega), np.log(g))) for g in (storage, loss)
        )
        laun = 2.0 * g1 * (1.0 + (g1 / g2) ** 2) ** 0.7
        decay = np.exp(-time[:, None] / times)
        linear = rate * (moduli * times * (1 - decay)).sum(1)
        growth = 1 - decay * (1 + time[:, None] / times)
        second = 2 * rate**2 * (moduli * times**2 * growth).sum(1)
        parts = []
        for low, high in ((0.2, 0.5), (0.5, 1.0)):
            at = (strain > low) & (strain <= high)
            if not at.any():
                parts.append("no sample")
                continue
            measured, said = (
                np.median(n[at] / (s[at] * strain[at]))
                for n, s in ((normal, stress), (second, linear))
            )
            ratio = np.median(stress[at] / linear[at])
            parts.append(f"{measured:5.2f} ({said:.2f}) | {ratio:.2f}")
        cox_merz = np.median(stress[late]) / np.hypot(g1, g2)
        over = np.median(normal[late]) / laun
        print(f"{row:24s} {rate:8.2g} | {cox_merz:.2f}, {over:5.2f} |", "; ".join(parts))


if __name__ == "__main__":
    main()
