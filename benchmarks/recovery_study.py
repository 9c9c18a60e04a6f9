"""Which class of laws sparse regression finds: five laws, four noise levels, twenty seeds.

A law counts as found if its terms, refitted to the data without noise, reproduce them to the error
of integration with no more terms than the law that made them: twins count, superfluous terms do
not. Then linear against exponential PTT, told apart or not, over the extensibility. Every fit is a
line of a file, so the study can be stopped and goes on where it was.
"""

import argparse
import json
import time
from pathlib import Path

import numpy as np

from discover.compilation_cache import enable_compilation_cache
from discover.precision import enable_x64

LAWS = (
    ("ucm", {}, False, 1),
    ("johnson_segalman", {"xi": 0.4}, True, 1),
    ("giesekus", {"alpha": 0.2}, True, 1),
    ("ptt_linear", {"epsilon": 0.4}, True, 1),
    ("ptt_exponential", {"epsilon": 0.4}, True, 1),
)
NOISE = (0.0, 0.01, 0.02, 0.05)
PTT = tuple(
    (law, {"epsilon": e}) for law in ("ptt_linear", "ptt_exponential") for e in (0.1, 0.2, 0.3, 0.4)
)


def cases(seeds: int, ptt_seeds: int):
    """Yield every fit of the study, those with the same program next to each other."""
    for law, parameters, known, size in LAWS:
        for noise in NOISE:
            for seed in range(seeds if noise else 1):
                yield "laws", law, parameters, known, size, noise, seed
    for law, parameters in PTT:
        for noise in NOISE:
            for seed in range(ptt_seeds if noise else 1):
                yield "ptt", law, parameters, True, 1, noise, seed


def fit(study, law, parameters, known, size, noise, seed) -> dict:
    """Return what one fit found."""
    from discover.learners.tensor_sindy import TensorSINDy
    from discover.learners.tensor_sindy.refit import refit
    from discover.learners.trajectories.problem import make_problem
    from discover.simulate import synthetic_dataset
    from tensor_library import TermLibrary, build_library, parse_term

    if study == "laws":
        library = build_library(degree=1, closed_forms=("exp",))
    else:
        extra = ("tr(sigma)*sigma", "tr(sigma)^2*sigma", "(exp(epsilon*tr(sigma))-1)*sigma")
        library = TermLibrary((*build_library().terms, *map(parse_term, extra)))
    started = time.perf_counter()
    data = synthetic_dataset(law, parameters, noise=noise, seed=seed)
    model = TensorSINDy(library, known_relaxation=known, n_stability=0, n_folds=0).fit(data)
    seconds = time.perf_counter() - started
    names = [term.term for term in model.terms_]
    clean = make_problem(synthetic_dataset(law, parameters), library, known_relaxation=known)
    support = tuple(library.names.index(name) for name in names)
    start = [(model.coefficients_, model.inner_)]
    misfit = refit(clean, [support], start, model.search_.scale, model.search_.slots)[0].misfit
    rivals = [row["support"] for row in model.result_.details["rivals"] if row["exact"]]
    return {
        "terms": names,
        "coefficients": [term.coefficient for term in model.terms_],
        "inner": {k: v for term in model.terms_ for k, v in term.inner.items()},
        "ci95": [term.ci95 for term in model.terms_],
        "clean_misfit": misfit,
        "right": bool(misfit < 2e-5 and len(names) <= size),
        "twins": rivals,
        "seconds": seconds,
    }


def main() -> None:
    """Run what is missing, and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("recovery.jsonl"))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--ptt-seeds", type=int, default=10)
    parser.add_argument("--part", default="1/1", help="this share of the fits: 1/2, then 2/2")
    options = parser.parse_args()
    enable_x64()
    enable_compilation_cache()
    done = read(options.out)
    wanted = [(json.dumps(case), case) for case in cases(options.seeds, options.ptt_seeds)]
    part, parts = (int(text) for text in options.part.split("/"))
    for i, (key, case) in enumerate(wanted):
        if key not in done and i % parts == part - 1:
            done[key] = {"key": key, **fit(*case)}
            with options.out.open("a", encoding="utf-8") as stream:
                stream.write(json.dumps(done[key]) + "\n")
            print(f"{i + 1}/{len(wanted)} {key} {done[key]['terms']}", flush=True)
    done = read(options.out)
    for study in ("laws", "ptt"):
        rows = [(case, done[key]) for key, case in wanted if case[0] == study and key in done]
        if rows:
            table(study, rows)


def read(path: Path) -> dict[str, dict]:
    """Return the fits that are done, by case."""
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    return {row["key"]: row for row in map(json.loads, lines)}


def table(study: str, rows: list) -> None:
    """Print one line for each law: how often its class was found at each noise level."""
    print(f"\n{study:>26}" + "".join(f"{100 * noise:>11g} %" for noise in NOISE))
    for law, parameters in dict.fromkeys((c[1], tuple(c[2].items())) for c, _ in rows):
        cells = []
        for noise in NOISE:
            found = [
                row["right"]
                for case, row in rows
                if (case[1], tuple(case[2].items()), case[5]) == (law, parameters, noise)
            ]
            cells.append(f"{sum(found):>5}/{len(found):<3}")
        text = f"{law} {' '.join(f'{v:g}' for _, v in parameters)}"
        print(f"{text:>26}" + "".join(f"{cell:>13}" for cell in cells))
    seconds = [row["seconds"] for _, row in rows]
    print(f"median seconds a fit: {np.median(seconds):.1f}")


if __name__ == "__main__":
    main()
