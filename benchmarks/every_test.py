"""Every test that a rheometer makes, one at a time: what each tells of a law that scipy made.

Four materials (`independent`, which shares nothing with the software under test) with G = 100 Pa,
λ = 1 s and 1 Pa s of solvent: the declared one, one with a term of the library, one whose term has
an invariant, one with a structure variable. Each is told by one test alone, as a folder written by
hand, with 1 % noise. Both commands are told the upper convected Maxwell law.

Counted as false: an effect that is neither the planted one nor said to be its alias; a constant
outside three half-widths of its interval; *explained* by a law whose N1 is wrong by more than a
tenth in a start-up at 2 1/s and yet not undetermined. To leave open what a test cannot tell is
right.

    python benchmarks/every_test.py --out every_test
    python benchmarks/every_test.py --out every_test --tests creep,uniaxial --materials giesekus
    python benchmarks/every_test.py --out every_test --table

The last one writes the tables of docs/every-test.md from the answers that are there, and runs
nothing.
"""

import argparse
import json
import time
import traceback
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
from independent import Giesekus, PhanThienTanner
from independent.folders import write_table
from independent.homogeneous import UNIT
from independent.material import integrate
from independent.structured import Structured
from independent.sweeps import modulus_of

MODULUS, TIME, SOLVENT, NOISE = 100.0, 1.0, 1.0, 0.01
MATERIALS = {
    "declared": Giesekus(0.0, MODULUS, TIME),
    "giesekus": Giesekus(0.3, MODULUS, TIME),
    "ptt": PhanThienTanner(0.2, "linear", 0.0, MODULUS, TIME),
    "structure": Structured(2.0, (2.0,), in_modulus=True, modulus=MODULUS, mobility=0.0),
}
PLANTED = {
    "declared": {},
    "giesekus": {"giesekus_mobility": {"alpha": 0.3}},
    "ptt": {"ptt_linear": {"epsilon": 0.2}},
    # in the modulus, with the exponent 1: t ds/dt = 1 − s − (γ̇/γ̇_c) s, so that k = 1/(γ̇_c t)
    "structure": {"thixotropy": {"breakdown": 0.25, "build_up_time": 2.0}},
}
TERMS = {"giesekus": {"sigma.sigma": 0.3}, "ptt": {"tr(sigma)*sigma": 0.2}}
Rate = Callable[[float], float]


def followed(material, rate: Rate, times, kind="shear", jumps=()) -> np.ndarray:
    """Return the stress tensor with solvent at times of 0 and more, from rest, shape (n, 3, 3)."""
    states = integrate(
        lambda t, state: material.change(state, rate(t) * UNIT[kind]),
        material.rest(), times, jumps, material.scale(),
    )  # fmt: skip
    out = []
    for t, state in zip(times, states, strict=True):
        gradient = rate(t) * UNIT[kind]
        out.append(material.stress(state, gradient) + SOLVENT * (gradient + gradient.T))
    return np.array(out)


def crept(material, stress: Rate, times, jumps=()) -> np.ndarray:
    """Return the strain at a given shear stress, from rest: the solvent takes the rest of it."""
    size = len(material.rest())

    def change(t, y):
        # the stress of these materials at a rate of zero: none of them has a viscosity of its own
        polymer = material.stress(y[:size], 0.0)[0, 1]
        rate = (stress(t) - polymer) / SOLVENT
        return np.append(material.change(y[:size], rate * UNIT["shear"]), rate)

    start, scale = np.append(material.rest(), 0.0), np.append(material.scale(), 1.0)
    return integrate(change, start, times, jumps, scale)[:, -1]


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

        def put_on(t, s=stress):
            return s if t < 10.0 else 0.0

        strain = crept(material, put_on, times, (10.0,))
        applied = np.array([stress if t <= 10.0 else 0.0 for t in times])
        columns = {"time_s": times, "stress_Pa": applied, "strain": folder.noisy(strain)}
        folder.run(f"creep_{stress:g}", columns, control="stress")


def laos_stress(folder, material):
    times = np.linspace(0.0, 4.0 * np.pi, 161)[1:]
    for stress in (40.0, 100.0):
        strain = crept(material, lambda t, s=stress: s * np.sin(t), times)
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


def true_n1(material: str) -> np.ndarray:
    times = np.linspace(0.1, 8.0, 40)
    stress = followed(MATERIALS[material], lambda t: 2.0, times)
    return stress[:, 0, 0] - stress[:, 1, 1]


def data_of(folder: Path):
    """Return the data of a folder, tables as the runs that they are."""
    import discover as dc

    data = dc.load_dataset(folder)
    return data if len(data) else data.with_material_functions()


def of_loop(folder: Path, material: str, base) -> dict:
    """Return what the loop says, and whether it is false."""
    import discover as dc

    loop = dc.close_loop(data_of(folder), base)
    planted = PLANTED[material]
    row = {"verdict": loop.verdict, "named": [], "constants": [], "false": []}
    for stage in loop.stages:
        names = {stage.effect, *stage.aliases}
        row["named"].append([stage.effect, *stage.aliases])
        if loop.verdict == "effects_added" and not names & planted.keys():
            row["false"].append(f"{stage.effect} is not there")
        for name, value in planted.get(stage.effect, {}).items():
            found = stage.parameters[name]
            row["constants"].append([name, value, found.value, *found.ci95])
            low, high = found.ci95
            away = max(low - value, value - high)
            if np.isfinite([low, high]).all() and away > high - low:
                row["false"].append(f"{name} is {value:g} and not {low:.3g} to {high:.3g}")
    if loop.verdict == "no_effect_needed" and planted and loop.error_after.fit > 1.5 * NOISE:
        row["false"].append("something is needed")
    return row


def of_compare(folder: Path, material: str, base) -> dict:
    """Return what a comparison says, and whether it is false."""
    import discover as dc

    found = dc.compare(data_of(folder), base, learners=["tensor_sindy"], library={"degree": 1})
    terms = found.outcomes["tensor_sindy"].terms
    row = {
        "verdict": found.explanation.verdict,
        "named": [[term.term] for term in terms],
        "constants": [],
        "undetermined": list(found.undetermined),
        "false": [],
    }
    planted = TERMS.get(material, {})
    for term in terms:
        if term.term in planted and term.ci95 is not None:
            low, high = term.ci95
            value = planted[term.term]
            row["constants"].append([term.term, value, term.coefficient, low, high])
            explained = row["verdict"] == "explained" and len(terms) == len(planted)
            if explained and max(low - value, value - high) > high - low:
                row["false"].append(f"{term.term} is {value:g} and not {low:.3g} to {high:.3g}")
    if row["verdict"] == "explained" and "N1" not in row["undetermined"]:
        times = np.linspace(0.1, 8.0, 40)
        fluid = dc.Fluid(found.outcomes["tensor_sindy"].law, MODULUS, TIME, SOLVENT)
        said = dc.simulate(fluid, dc.start_up(2.0), times).first_normal_stress_difference
        exact = true_n1(material)
        miss = float(np.sqrt(np.mean((np.asarray(said) - exact) ** 2) / np.mean(exact**2)))
        row["n1_miss"] = miss
        if miss > 0.1:
            row["false"].append(f"N1 is off by {100 * miss:.0f} % and counts as determined")
    return row


def line(row: dict) -> str:
    """Return a row of the table."""
    named = "; ".join(
        names[0] + (f" (or {len(names) - 1} more)" if len(names) > 1 else "")
        for names in row["named"]
    )
    constants = ", ".join(
        f"{name} {value:.3g} ({low:.3g} to {high:.3g})"
        for name, _, value, low, high in row["constants"]
    )
    text = (
        f"{row['test']:16s} {row['material']:10s} {row['task']:10s} {row['verdict']:17s} "
        f"{named or '-':42s} {constants:40s} {row['seconds']:4.0f} s"
    )
    return "\n".join([text, *(f"    FALSE: {text}" for text in row["false"])])


def cell(row: dict | None) -> str:
    """Return one answer as it stands in a table of a page."""
    if row is None:
        return ""
    if row["verdict"] in ("refused", "fault"):
        return f"*{row['verdict']}*"
    constants = {name: (value, low, high) for name, _, value, low, high in row["constants"]}
    planted = {*PLANTED[row["material"]], *TERMS.get(row["material"], {})}
    said = []
    for first, *aliases in row["named"]:
        named = f"`{first}`"
        if first in constants:
            value, low, high = constants[first]
            named += f" {value:.3g} ({low:.3g} to {high:.3g})"
        elif planted & set(aliases):
            named += " or " + ", ".join(f"`{name}`" for name in aliases if name in planted)
        said.append(named)
    own = constants.keys() - {names[0] for names in row["named"]}
    said += [
        f"{name} {value:.3g} ({low:.3g} to {high:.3g})"
        for name, (value, low, high) in constants.items()
        if name in own
    ]
    if row["task"] == "compare" and said and not planted & {n[0] for n in row["named"]}:
        said = [f"{len(said)} other terms"]
    said = said or ["nothing"]
    if row["verdict"] == "unexplained":
        said.append("*unexplained*")
    if row.get("undetermined"):
        said.append(f"open: {', '.join(row['undetermined'])}")
    return "; ".join([*said, *(f"**{text}**" for text in row["false"])])


def tables(out: Path) -> str:
    """Return a table for each command, of the answers that are there."""
    parts = []
    for task in ("compare", "close-loop"):
        rows = {}
        for kept in out.glob(f"*_{task}.json"):
            row = json.loads(kept.read_text())
            rows[row["test"], row["material"]] = row
        lines = [f"| test | {' | '.join(MATERIALS)} |", "|---" * (1 + len(MATERIALS)) + "|"]
        lines += [
            f"| {test} | {' | '.join(cell(rows.get((test, one))) for one in MATERIALS)} |"
            for test in TESTS
            if any((test, one) in rows for one in MATERIALS)
        ]
        parts.append(f"{task}\n\n" + "\n".join(lines))
    return "\n\n".join(parts)


def main() -> None:
    """Run or resume the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("every_test"))
    parser.add_argument("--tests", default=",".join(TESTS))
    parser.add_argument("--materials", default=",".join(MATERIALS))
    parser.add_argument("--task", choices=["close-loop", "compare", "both"], default="both")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--table", action="store_true", help="Write what is there, run nothing.")
    options = parser.parse_args()
    if options.table:
        print(tables(options.out))
        return
    import discover as dc

    base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME, SOLVENT)
    tasks = {"close-loop": of_loop, "compare": of_compare}
    rows = []
    for test in options.tests.split(","):
        for place, material in enumerate(options.materials.split(",")):
            folder = options.out / f"{test}_{material}"
            if not folder.exists():
                made = Folder(folder, options.seed + 1000 * place + 10 * list(TESTS).index(test))
                TESTS[test](made, MATERIALS[material])
                made.close()
            for task, ask in tasks.items():
                if options.task not in ("both", task):
                    continue
                kept = options.out / f"{test}_{material}_{task}.json"
                if kept.exists():
                    rows.append(json.loads(kept.read_text()))
                    continue
                started = time.perf_counter()
                try:
                    with warnings.catch_warnings():
                        warnings.simplefilter("ignore")
                        row = ask(folder, material, base)
                except dc.InputError as error:
                    row = {"verdict": "refused", "named": [], "constants": [], "false": []}
                    row["message"] = str(error)
                except Exception as error:
                    traceback.print_exc()
                    row = {"verdict": "fault", "named": [], "constants": [], "false": [str(error)]}
                row |= {"test": test, "material": material, "task": task}
                row["seconds"] = time.perf_counter() - started
                kept.write_text(json.dumps(row) + "\n")
                rows.append(row)
                print(line(row), flush=True)
    false = sum(bool(row["false"]) for row in rows)
    held = [c for row in rows for c in row["constants"] if row["verdict"] != "unexplained"]
    inside = sum(low <= true <= high for _, true, _, low, high in held)
    print(f"{len(rows)} answers, {false} with something false; intervals {inside} of {len(held)}")


if __name__ == "__main__":
    main()
