"""Records of every test that a rheometer makes, as folders written by hand."""

from collections.abc import Callable
from functools import partial
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


def at_rates(folder, material, name, rate: Rate, times, jumps=(), before=(), told=None, **cells):
    """Write a run in shear at a given rate, recorded after some times before it."""
    whole = np.append(before, times)
    stress = followed(material, rate, whole, jumps=jumps)[len(before) :, 0, 1]
    rates = np.array([rate(t) for t in times])
    columns = {"time_s": times - told if told else times, "shear_rate_1_s": rates}
    folder.run(name, {**columns, "stress_Pa": folder.noisy(stress)}, **cells)


def start_up(folder, material):
    for rate in (0.5, 2.0, 5.0):
        at_rates(folder, material, f"at_{rate:g}", lambda t, r=rate: r, np.linspace(0.05, 8.0, 80))


def cessation(folder, material):
    stop, before = 20.0, np.linspace(1.0, 19.0, 4)
    for rate in (1.0, 4.0):
        at_rates(
            folder, material, f"after_{rate:g}", lambda t, r=rate: r if t < stop else 0.0,
            stop + np.linspace(0.0, 5.0, 80), (stop,), before, stop,
            start="steady", rate_before_1_s=rate,
        )  # fmt: skip


def step_rates(folder, material):
    def rate(t):
        return 0.5 if t < 4.0 else 3.0 if t < 8.0 else 1.0

    at_rates(folder, material, "steps", rate, np.linspace(0.05, 12.0, 160), (4.0, 8.0))


_TWO_CYCLES = np.linspace(0.0, 4.0 * np.pi, 121)


def laos(folder, material, times=_TWO_CYCLES, **more):
    for strain in (1.0, 4.0):
        name = f"strain_{strain:g}"
        at_rates(folder, material, name, lambda t, a=strain: a * np.cos(t), times, **more)


def laos_periodic(folder, material):
    begin = 12.0 * np.pi
    times = begin + np.linspace(0.0, 2.0 * np.pi, 65)
    laos(folder, material, times, before=[1.0], told=begin, start="periodic")


def step_strain(folder, material):
    put_on = 0.01
    times = put_on + np.geomspace(0.02, 5.0, 60)
    for strain in (0.5, 1.5, 3.0):
        rate = strain / put_on
        at_rates(
            folder, material, f"step_{strain:g}", lambda t, r=rate: r if t < put_on else 0.0,
            times, (put_on,), [0.5 * put_on], put_on, step_strain=strain, step_time_s=put_on,
        )  # fmt: skip


def crept(folder, material, name, times, stress: np.ndarray, levels):
    strain = folder.noisy(strain_at(material, levels, SOLVENT, times))
    columns = {"time_s": times, "stress_Pa": stress, "strain": strain}
    folder.run(name, columns, control="stress")


def creep(folder, material):
    times = np.append(np.geomspace(0.02, 10.0, 50), 10.0 + np.geomspace(0.02, 10.0, 40))
    for stress in (30.0, 60.0, 90.0):
        levels = [(0.0, stress), (10.0, 0.0)]
        applied = np.where(times <= 10.0, stress, 0.0)
        crept(folder, material, f"creep_{stress:g}", times, applied, levels)


def laos_stress(folder, material):
    times = np.linspace(0.0, 4.0 * np.pi, 161)[1:]
    for stress in (40.0, 100.0):
        levels = [(0.0, lambda t, s=stress: s * np.sin(t))]
        crept(folder, material, f"stress_{stress:g}", times, stress * np.sin(times), levels)


def flow_curve(folder, material):
    rates, ends = np.geomspace(0.05, 20.0, 40), np.array([0.0, 30.0, 60.0])
    stress = [followed(material, lambda t, r=rate: r, ends)[-1, 0, 1] for rate in rates]
    columns = {"shear_rate_1_s": rates, "stress_Pa": folder.noisy(np.array(stress), even=False)}
    write_table(folder.path / "flow_curve.csv", columns)


def harmonics(material, strain: float, frequency: float) -> complex:
    """Return G′ + iG″ of the first harmonic of an oscillation gone on for long."""
    cycles = int(np.ceil(25.0 * frequency / (2.0 * np.pi)))
    return modulus_of(material, strain, frequency, cycles) + 1j * frequency * SOLVENT


def sweep(folder, material, file, columns, strains, frequencies):
    """Write a table of moduli at strains and frequencies."""
    pairs = np.broadcast(strains, frequencies)
    found = np.array([harmonics(material, strain, w) for strain, w in pairs])
    moduli = {"Gp_Pa": folder.noisy(found.real, False), "Gpp_Pa": folder.noisy(found.imag, False)}
    write_table(folder.path / file, {**columns, **moduli})


def frequency_sweep(folder, material):
    omega = np.geomspace(0.05, 50.0, 20)
    sweep(folder, material, "lve.csv", {"omega_rad_s": omega}, 0.01, omega)


def amplitude_sweep(folder, material):
    strains = np.geomspace(0.05, 10.0, 24)
    columns = {"strain": strains, "omega_rad_s": np.ones(24)}
    sweep(folder, material, "amplitude_sweep.csv", columns, strains, 1.0)


def extension(folder, material, kind: str):
    times = np.linspace(0.05, 5.0, 80)
    for rate in (0.2, 0.4):
        stress = followed(material, lambda t, r=rate: r, times, kind)
        columns = {"time_s": times, "hencky_rate_1_s": np.full(80, rate)}
        columns["tensile_stress_Pa"] = folder.noisy(stress[:, 0, 0] - stress[:, 1, 1])
        folder.run(f"at_{rate:g}", columns, flow=kind)


_ALL = (start_up, cessation, step_rates, laos, laos_periodic, step_strain, creep, laos_stress,
        flow_curve, frequency_sweep, amplitude_sweep)  # fmt: skip
TESTS: dict[str, Callable] = {test.__name__: test for test in _ALL} | {
    kind: partial(extension, kind=kind) for kind in ("uniaxial", "planar", "biaxial")
}
