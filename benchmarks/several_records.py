"""Records of every test that a rheometer makes, as folders written by hand."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from independent import Giesekus, PhanThienTanner, Structured
from independent.folders import write_table
from independent.homogeneous import UNIT
from independent.material import integrate
from independent.sweeps import modulus_of, strain_at

MODULUS, TIME, SOLVENT, NOISE = 100.0, 1.0, 1.0, 0.01
MATERIALS = {
    "declared": Giesekus(0.0, MODULUS, TIME),
    "giesekus": Giesekus(0.3, MODULUS, TIME),
    "ptt": PhanThienTanner(0.2, "linear", 0.0, MODULUS, TIME),
    "structure": Structured(2.0, (2.0,), in_modulus=True, modulus=MODULUS, mobility=0.0),
}
Rate = Callable[[float], float]


def followed(material, rate: Rate, times, kind="shear", jumps=()) -> np.ndarray:
    """Return the stress tensor with solvent at times from rest on, shape (n, 3, 3)."""
    states = integrate(
        lambda t, state: material.change(state, rate(t) * UNIT[kind]),
        material.rest(), times, jumps, material.scale(),
    )  # fmt: skip
    out = []
    for t, state in zip(times, states, strict=True):
        gradient = rate(t) * UNIT[kind]
        out.append(material.stress(state, gradient) + SOLVENT * (gradient + gradient.T))
    return np.array(out)


class Folder:
    """A folder of records with noise, and its table of runs."""

    def __init__(self, path: Path, seed: int):
        self.path, self.rng = path, np.random.default_rng(seed)
        path.mkdir(parents=True, exist_ok=True)
        self.rows: list[dict] = []

    def noisy(self, values: np.ndarray, even: bool = True) -> np.ndarray:
        """Return values with noise of one size, or of a share of each."""
        size = np.sqrt(np.mean(values**2)) if even else np.abs(values)
        return values + NOISE * size * self.rng.standard_normal(np.shape(values))

    def run(self, name: str, columns: dict[str, np.ndarray], **cells) -> None:
        """Write a record, and its line in the table of runs."""
        write_table(self.path / f"{name}.csv", columns)
        self.rows.append({"file": f"{name}.csv", **cells})

    def close(self) -> Path:
        """Write the table of runs."""
        if self.rows:
            keys = list(dict.fromkeys(key for row in self.rows for key in row))
            lines = [",".join(keys)]
            lines += [",".join(str(row.get(key, "")) for key in keys) for row in self.rows]
            (self.path / "runs.csv").write_text("\n".join(lines) + "\n")
        return self.path


def at_rates(folder, material, name, rate: Rate, times, jumps=(), keep=None, **cells) -> None:
    """Write a run in shear at a given rate; `keep` is the sample from which it is recorded."""
    stress = followed(material, rate, times, jumps=jumps)[:, 0, 1]
    kept = slice(keep, None)
    begins = 0.0 if keep is None else times[keep]
    rates = np.array([rate(t) for t in times])
    columns = {
        "time_s": times[kept] - begins,
        "shear_rate_1_s": rates[kept],
        "stress_Pa": folder.noisy(stress[kept]),
    }
    folder.run(name, columns, **cells)


def start_up(folder, material):
    for rate in (0.5, 2.0, 5.0):
        at_rates(folder, material, f"at_{rate:g}", lambda t, r=rate: r, np.linspace(0.05, 8.0, 80))


def cessation(folder, material):
    stop, after = 20.0, np.linspace(0.0, 5.0, 80)
    for rate in (1.0, 4.0):
        times = np.append(np.linspace(1.0, 19.0, 4), stop + after)
        at_rates(
            folder, material, f"after_{rate:g}", lambda t, r=rate: r if t < stop else 0.0, times,
            (stop,), keep=4, start="steady", rate_before_1_s=rate,
        )  # fmt: skip


def step_rates(folder, material):
    def rate(t):
        return 0.5 if t < 4.0 else 3.0 if t < 8.0 else 1.0

    at_rates(folder, material, "steps", rate, np.linspace(0.05, 12.0, 160), (4.0, 8.0))


def laos(folder, material):
    for strain in (1.0, 4.0):
        at_rates(
            folder, material, f"strain_{strain:g}", lambda t, a=strain: a * np.cos(t),
            np.linspace(0.0, 4.0 * np.pi, 121),
        )  # fmt: skip


def laos_periodic(folder, material):
    for strain in (1.0, 4.0):
        times = np.concatenate([[1.0], 12.0 * np.pi + np.linspace(0.0, 2.0 * np.pi, 65)])
        at_rates(
            folder, material, f"strain_{strain:g}", lambda t, a=strain: a * np.cos(t), times,
            keep=1, start="periodic",
        )  # fmt: skip


def step_strain(folder, material):
    put_on = 0.01
    for strain in (0.5, 1.5, 3.0):
        times = np.append([0.5 * put_on], put_on + np.geomspace(0.02, 5.0, 60))
        rate = strain / put_on
        stress = followed(
            material, lambda t, r=rate: r if t < put_on else 0.0, times, jumps=(put_on,)
        )[1:, 0, 1]
        columns = {
            "time_s": times[1:] - put_on,
            "shear_rate_1_s": np.zeros(60),
            "stress_Pa": folder.noisy(stress),
        }
        folder.run(f"step_{strain:g}", columns, step_strain=strain, step_time_s=put_on)


def creep(folder, material):
    times = np.append(np.geomspace(0.02, 10.0, 50), 10.0 + np.geomspace(0.02, 10.0, 40))
    for stress in (30.0, 60.0, 90.0):
        strain = strain_at(material, [(0.0, stress), (10.0, 0.0)], SOLVENT, times)
        applied = np.array([stress if t <= 10.0 else 0.0 for t in times])
        columns = {"time_s": times, "stress_Pa": applied, "strain": folder.noisy(strain)}
        folder.run(f"creep_{stress:g}", columns, control="stress")


def laos_stress(folder, material):
    times = np.linspace(0.0, 4.0 * np.pi, 161)[1:]
    for stress in (40.0, 100.0):
        imposed = [(0.0, lambda t, s=stress: s * np.sin(t))]
        strain = strain_at(material, imposed, SOLVENT, times)
        columns = {
            "time_s": times, "stress_Pa": stress * np.sin(times), "strain": folder.noisy(strain)
        }  # fmt: skip
        folder.run(f"stress_{stress:g}", columns, control="stress")


def flow_curve(folder, material):
    rates = np.geomspace(0.05, 20.0, 40)
    ends = np.array([0.0, 30.0, 60.0])
    stress = [followed(material, lambda t, r=rate: r, ends)[-1, 0, 1] for rate in rates]
    columns = {"shear_rate_1_s": rates, "stress_Pa": folder.noisy(np.array(stress), even=False)}
    write_table(folder.path / "flow_curve.csv", columns)


def harmonics(material, strain: float, frequency: float) -> complex:
    """Return G′ + iG″ of the first harmonic of an oscillation gone on for long."""
    cycles = int(np.ceil(25.0 * frequency / (2.0 * np.pi)))
    return modulus_of(material, strain, frequency, cycles) + 1j * frequency * SOLVENT


def frequency_sweep(folder, material):
    omega = np.geomspace(0.05, 50.0, 20)
    found = np.array([harmonics(material, 0.01, w) for w in omega])
    columns = {
        "omega_rad_s": omega,
        "Gp_Pa": folder.noisy(found.real, even=False),
        "Gpp_Pa": folder.noisy(found.imag, even=False),
    }
    write_table(folder.path / "lve.csv", columns)


def amplitude_sweep(folder, material):
    strains = np.geomspace(0.05, 10.0, 24)
    found = np.array([harmonics(material, strain, 1.0) for strain in strains])
    columns = {
        "strain": strains,
        "omega_rad_s": np.ones(24),
        "Gp_Pa": folder.noisy(found.real, even=False),
        "Gpp_Pa": folder.noisy(found.imag, even=False),
    }
    write_table(folder.path / "amplitude_sweep.csv", columns)


def extension(kind: str):
    """Return the test of start-ups in one extension."""

    def test(folder, material):
        times = np.linspace(0.05, 5.0, 80)
        for rate in (0.2, 0.4):
            stress = followed(material, lambda t, r=rate: r, times, kind)
            tensile = stress[:, 0, 0] - stress[:, 1, 1]
            columns = {
                "time_s": times,
                "hencky_rate_1_s": np.full(80, rate),
                "tensile_stress_Pa": folder.noisy(tensile),
            }
            folder.run(f"at_{rate:g}", columns, flow=kind)

    return test


TESTS = {
    "start_up": start_up, "cessation": cessation, "step_rates": step_rates, "laos": laos,
    "laos_periodic": laos_periodic, "step_strain": step_strain, "creep": creep,
    "laos_stress": laos_stress, "flow_curve": flow_curve, "frequency_sweep": frequency_sweep,
    "amplitude_sweep": amplitude_sweep, "uniaxial": extension("uniaxial"),
    "planar": extension("planar"), "biaxial": extension("biaxial"),
}  # fmt: skip
