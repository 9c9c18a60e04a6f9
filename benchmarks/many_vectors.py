"""What a prediction costs where many parameter vectors are asked for at once, and how exact it is.

Measured sets of four fluids, each with the Maxwell law alone or with one effect. Prints
milliseconds of processor for one of 1, 8 and 32 vectors, here and, in turns, in another tree, in a
process of its own and with the same modes; their ratio, to the least that the other needs at that
size or a smaller one; and the largest error of each, against adaptive steps to a tolerance of 1e-9,
in units of the largest stress of a run.

    DISCOVER_DATA=... python benchmarks/many_vectors.py [--against TREE] [--turns 3]
"""

import argparse
import json
import subprocess
import sys
import time
from dataclasses import replace
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
BATCHES, CALLS = (1, 8, 32), 5
TERM = "tr(sigma.sigma.sigma)*I"
CASES = {  # study, effect, its constants
    "melt, Maxwell": ("polyisoprene-startup", "", ()),
    "melt, exponential PTT": ("polyisoprene-startup", "ptt_exponential", (0.3,)),
    "melt, library term": ("polyisoprene-startup", TERM, (0.05,)),
    "blood, Maxwell": ("blood-steps", "", ()),
    "blood, structure": ("blood-steps", "thixotropy", (0.02, 10.0)),
    "gel, Giesekus": ("gel-laos", "giesekus_mobility", (0.2,)),
    "LDPE, exponential PTT": ("ldpe-shear", "ptt_exponential", (0.3,)),
    "LDPE, library term": ("ldpe-shear", TERM, (0.05,)),
}
_CANDIDATES, _CUT = "discover.loop.task", "discover.loop.runs"
if not find_spec("discover.loop"):  # an older tree
    _CANDIDATES = "discover.closed_loop.candidates"
    _CUT = "discover.closed_loop.judging.before_after"


def problem(name: str, modes: dict):
    """Return the model with every candidate of a loop, the fitted runs of shear, and the modes."""
    from discover.forward.batches import data_scales

    from discover.effects import make_effect
    from discover.forward import AugmentedModel
    from discover.study import read_study
    from discover.study.data import load_study_data
    from discover.study.declared_model import declared_model, forward_model

    study = read_study(ROOT / "studies" / f"{name}.toml")
    data = load_study_data(study).dataset
    held = () if study.data.held_out == "each" else study.data.held_out
    shear = [run for run in data.runs if run.name not in held and run.protocol.kinematics is None]
    runs = import_module(_CUT).cut_to_strain(shear, study.loop.strain)
    declared = forward_model(declared_model(study, data))
    used = {key: getattr(declared, key) for key in ("modulus", "relaxation_time")}
    used = {key: np.asarray(modes.get(key, value)) for key, value in used.items()}
    solvent = float(modes.get("solvent_viscosity", declared.solvent_viscosity))
    effects = import_module(_CANDIDATES).candidates_of(None)
    # a structure is a candidate on request alone
    effects += [make_effect("thixotropy")] * all(one.name != "thixotropy" for one in effects)
    declared = replace(declared, **used, solvent_viscosity=solvent)
    model = AugmentedModel(declared, effects, data_scales(runs))
    given = {key: value.tolist() for key, value in used.items()}
    return model, runs, given | {"solvent_viscosity": solvent}


def reference(model, theta, effect: str, run) -> list[float]:
    """Return the shear stress to a tolerance of 1e-9; with a structure, s times that of Maxwell."""
    from scipy.integrate import solve_ivp

    from discover.loop.final_model import augmented_fluid
    from discover.simulate import simulate

    flow, fluid = run.protocol, augmented_fluid(model, theta, [effect])
    stress = np.asarray(simulate(fluid, flow, run.time, rtol=1e-9, atol=1e-11).shear_stress)
    if effect == "thixotropy":
        breakdown, build_up = theta[model.positions(effect)]
        knots, rates = np.asarray(flow.table_times), np.asarray(flow.table_rates)

        def change(t, s):
            return (1.0 - s) / build_up - breakdown * abs(np.interp(t, knots, rates)) * s

        span, tight = (float(flow.begins), run.time[-1]), {"rtol": 1e-10, "atol": 1e-12}
        state = solve_ivp(change, span, [1.0], "LSODA", run.time, max_step=0.05, **tight)
        stress = stress * state.y[0]
    return stress.tolist()


def measured(modes: dict[str, dict]) -> dict[str, dict]:
    """Return milliseconds a vector and predictions; without modes, these and references too."""
    import discover.first_use  # noqa: F401
    from discover.forward import make_batch

    found, problems = {}, {}
    for case, (name, effect, constants) in CASES.items():
        if name not in problems:
            problems[name] = problem(name, modes.get(name, {}))
        model, runs, used = problems[name]
        batch, theta = make_batch(runs), model.zero()
        at = model.positions(effect)[: len(constants)] if effect else []
        theta[at] = constants
        vectors = np.tile(theta, (max(BATCHES), 1))
        vectors[:, at[:1]] *= np.linspace(0.5, 1.0, len(vectors))[:, None]
        row: dict = {"name": name, "modes": used, "ms": []}
        for count in BATCHES:
            spent = []
            for _ in range(1 + CALLS):  # the first compiles
                begun = time.process_time()
                predicted = np.asarray(model.predictions(vectors[-count:], batch))[-1]
                spent.append(time.process_time() - begun)
            row["ms"].append(1e3 * float(np.median(spent[1:])) / count)
        pairs = list(zip(runs, predicted.reshape(*predicted.shape[:2]), strict=True))
        row["predicted"] = [values[: len(run.time)].tolist() for run, values in pairs]
        row["exact"] = [] if modes else [reference(model, theta, effect, run) for run in runs]
        found[case] = row
    return found


def of_tree(tree: Path, modes: dict[str, dict]) -> dict[str, dict]:
    """Return what a tree measures, in a process of its own."""
    code = f"import sys, json; sys.path[:0] = {[str(tree), str(Path(__file__).parent)]}\n"
    code += f"import many_vectors as m; print(json.dumps(m.measured({modes})))"
    own = tree / ".venv" / "bin" / "python"
    command = [str(own) if own.exists() else sys.executable, "-c", code]
    said = subprocess.run(command, cwd=tree, stdout=subprocess.PIPE, check=True).stdout
    return json.loads(said.splitlines()[-1])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--against", type=Path, help="another tree of the project")
    parser.add_argument("--turns", type=int, default=3)
    given = parser.parse_args()
    trees, turns, modes = [ROOT, *filter(None, [given.against])], [], {}
    for _ in range(given.turns):
        turns.append([])
        for tree in trees:
            turns[-1].append(of_tree(tree.resolve(), modes))
            modes = modes or {row["name"]: row["modes"] for row in turns[0][0].values()}
    for case, first in turns[0][0].items():
        cells = [case]
        each = [np.median([t[n][case]["ms"] for t in turns], axis=0) for n in range(len(trees))]
        cells += ["; ".join(f"{value:.2g}" for value in row) for row in each]
        cells.append("; ".join(f"{r:.1f}" for r in np.minimum.accumulate(each[-1]) / each[0]))
        for found in turns[0]:
            off = [
                np.max(np.abs(np.subtract(ours, exact))) / np.max(np.abs(exact))
                for ours, exact in zip(found[case]["predicted"], first["exact"], strict=True)
            ]
            cells.append(f"{max(off):.0e}")
        print("|", " | ".join(cells), "|", flush=True)


if __name__ == "__main__":
    main()
