"""What a prediction of transients costs where many vectors of parameters are asked for at once.

Cases: start-ups of a melt of thirteen modes, steps of the rate of a fluid with one, large
oscillations of a gel from rest and in steady alternation, a wave of its stress, start-ups in shear
and extension, a flow curve and a sweep; each with the Maxwell law alone or with an effect, and
start-ups with a law whose chains retract. Prints milliseconds of processor a vector for 1, 8 and 32
of them, in this tree and, run in turns as a process of its own, in another; their ratio; and how
far predictions are apart.

    python benchmarks/many_vectors.py [OTHER_TREE]
"""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np

# where the loop is: an older tree has it elsewhere
LOOP = "loop" if find_spec("discover.loop") else "closed_loop"
BATCHES = 1, 8, 32
CALLS = 5
TURNS = 3


def flows():
    """Return runs and modes of each fluid."""
    from discover.dataset import Run
    from discover.protocols import (
        oscillations,
        oscillatory_shear,
        start_up,
        steady_rates,
        step_rates,
    )
    from discover.protocols.control import imposed_stress
    from discover.protocols.history import after_alternation
    from discover.protocols.protocol import in_flow

    def run(name, protocol, times, rate):
        return Run(name, times, protocol, np.full(times.size, rate), np.full(times.size, 100.0))

    melt_times = np.geomspace(1e-3, 1e3, 13)
    melt = [
        run(f"m{i}", start_up(rate), np.geomspace(0.02, 25.0, 300) / rate, rate)
        for i, rate in enumerate(np.geomspace(1e-3, 0.3, 8))
    ]
    steps = np.linspace(0.1, 60.0, 400)
    blood = [run("b", step_rates([0.0, 20.0, 40.0], [1.0, 10.0, 0.5]), steps, 1.0)]
    times = np.linspace(0.02, 12.0, 500)
    gel = [run(f"g{i}", oscillatory_shear(a, 2.0), times, 0.0) for i, a in enumerate((0.5, 2.0))]
    wave = oscillatory_shear(4.0, 2.0)
    turns = [run("t", after_alternation(wave, np.pi, times), times, 0.0)]
    stress = imposed_stress(np.append(0.0, times), np.append(0.0, 150.0 * np.sin(2.0 * times)))
    driven = [replace(run("d", stress, times, 0.0), strain=np.ones(times.size))]
    ldpe_times = np.geomspace(1e-2, 1e2, 8)
    ldpe = []
    for i, rate in enumerate((0.03, 0.3, 1.0)):
        when = np.geomspace(0.05, 3.0, 80) / rate
        ldpe.append(run(f"s{i}", start_up(rate), when, rate))
        ldpe.append(run(f"e{i}", in_flow(start_up(rate), "uniaxial"), when, rate))
    rates = np.geomspace(1e-2, 1e2, 20)
    curve = [run("c", steady_rates(rates), np.arange(1.0, 21.0), 1.0)]
    curve = [replace(curve[0], rate=rates)]
    strains, frequencies = np.geomspace(0.01, 5.0, 12), np.full(12, 2.0)
    ones = np.ones(12)
    sweep = Run(
        "w", np.arange(1.0, 13.0), oscillations(strains, frequencies), strains * frequencies, ones,
        strain=strains, storage_modulus=ones, loss_modulus=ones,
    ).records  # fmt: skip
    return {
        "curve": (curve, 3e4 * melt_times**-0.25, melt_times),
        "sweep": (sweep, 1e4 * ldpe_times**-0.3, ldpe_times),
        "melt": (melt, 3e4 * melt_times**-0.25, melt_times),
        "turns": (turns, np.array([200.0, 80.0]), np.array([0.3, 4.0])),
        "driven": (driven, np.array([200.0, 80.0]), np.array([0.3, 4.0])),
        "blood": (blood, np.array([0.5]), np.array([0.1])),
        "gel": (gel, np.array([200.0, 80.0]), np.array([0.3, 4.0])),
        "ldpe": (ldpe, 1e4 * ldpe_times**-0.3, ldpe_times),
    }


CASES = {
    "melt, Maxwell": ("melt", ()),
    "melt, exponential PTT": ("melt", ("ptt_exponential",)),
    "melt, library term": ("melt", ("tr(sigma.sigma.sigma)*I",)),
    "blood, Maxwell": ("blood", ()),
    "blood, structure": ("blood", ("thixotropy",)),
    "gel, Giesekus and rise time": ("gel", ("giesekus_mobility", "rate_rise_time")),
    "steady alternation, Giesekus": ("turns", ("giesekus_mobility",)),
    "given stress, Giesekus": ("driven", ("giesekus_mobility",)),
    "LDPE, exponential PTT": ("ldpe", ("ptt_exponential",)),
    "LDPE, compliance": ("ldpe", ("ptt_exponential", "tool_compliance")),
    "LDPE, Rolie-Poly": ("ldpe", ()),
    "flow curve, exponential PTT": ("curve", ("ptt_exponential",)),
    "sweep, Giesekus": ("sweep", ("giesekus_mobility",)),
}


def measured() -> dict[str, dict]:
    """Return milliseconds a vector of every case, seconds of the first call, and a prediction."""
    from discover.compilation_cache import enable_compilation_cache
    from discover.first_use import enable_x64
    from discover.forward import AugmentedModel, make_batch
    from discover.forward.batches import data_scales
    from discover.forward.declared import DeclaredModel

    candidates_of = import_module(f"discover.{LOOP}.candidates").candidates_of
    enable_x64()
    enable_compilation_cache()
    models, found = {}, {}
    for name, (runs, modulus, relaxation_time) in flows().items():
        batch = make_batch(runs)
        declared = DeclaredModel.maxwell(modulus, relaxation_time, solvent_viscosity=0.01)
        model = AugmentedModel(declared, candidates_of(None), data_scales(runs))
        models[name] = model, batch
        if name == "ldpe":
            law = {"stretch_time_ratio": 0.1, "beta": 0.5}
            declared = DeclaredModel.named("rolie_poly", law, modulus, relaxation_time)
            model = AugmentedModel(declared, candidates_of(None), data_scales(runs))
            models["LDPE, Rolie-Poly"] = model, batch
    for case, (name, effects) in CASES.items():
        model, batch = models.get(case, models[name])
        theta = model.zero()
        for effect in effects:
            theta[model.positions(effect)] = model.first_trial[model.positions(effect)]
        amplitudes = [model.positions(effect)[0] for effect in effects]
        vectors = np.tile(theta, (max(BATCHES), 1))
        vectors[:, amplitudes] *= np.linspace(0.5, 1.0, len(vectors))[:, None]
        started = time.perf_counter()
        predicted = model.predictions(vectors[-1:], batch)
        first = time.perf_counter() - started
        each = []
        for count in BATCHES:
            some = vectors[-count:]
            model.predictions(some, batch)
            spent = []
            for _ in range(CALLS):
                begun = time.process_time()
                model.predictions(some, batch)
                spent.append(time.process_time() - begun)
            each.append(1e3 * float(np.median(spent)) / count)
        found[case] = {"ms": each, "first": first, "predicted": predicted[0].tolist()}
    return found


def of_tree(folder: str) -> dict[str, dict]:
    """Return what the tree in a folder measures, in a process of its own."""
    code = f"import sys, json; sys.path[:0] = [{folder!r}, {str(Path(__file__).parent)!r}]\n"
    code += "import many_vectors; print(json.dumps(many_vectors.measured()))"
    python = Path(folder) / ".venv" / "bin" / "python"
    command = [str(python) if python.exists() else sys.executable, "-c", code]
    told = subprocess.run(command, cwd=folder, env=os.environ, capture_output=True, check=True)
    return json.loads(told.stdout.splitlines()[-1])


def main() -> None:
    """Print the table."""
    trees = [str(Path(__file__).parents[1]), *sys.argv[1:2]]
    turns = [[of_tree(tree) for tree in trees] for _ in range(TURNS)]
    print(
        f"{'ms a vector, of ' + str(BATCHES):30}"
        + "   ".join(f"{tree[-20:]:>20}" for tree in trees)
    )
    for case in CASES:
        medians = [
            np.median([turn[i][case]["ms"] for turn in turns], axis=0) for i in range(len(trees))
        ]
        line = f"{case:30}" + "   ".join(" ".join(f"{ms:6.3f}" for ms in row) for row in medians)
        if len(trees) > 1:
            line += "   ratio " + " ".join(f"{r:5.1f}" for r in medians[1] / medians[0])
            ours, theirs = (np.array(turns[0][i][case]["predicted"]) for i in range(2))
            apart = np.max(np.abs(ours - theirs)) / np.max(np.abs(theirs))
            line += f"   apart {apart:.0e}"
        print(line, flush=True)


if __name__ == "__main__":
    main()
