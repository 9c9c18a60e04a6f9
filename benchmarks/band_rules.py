"""Which rule for the dense library's band holds N1 and N2, and how wide is it? On the same draws.

Development worlds of `independent.worlds` (seeds 1 to 9) are asked by `compare` with the dense
library alone. What each of its laws predicts is kept, a file a case, so that rules are compared in
pairs without another fit. Where something in a world has no name, effects with a name are not
tried.

    python benchmarks/band_rules.py --out FOLDER 3-9 7-9 8-2   # seed-index
    python benchmarks/band_rules.py --out FOLDER               # only the table
"""

import argparse
import pickle
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
from band_rules_tables import table
from independent.folders import write_folder
from independent.worlds import MODULUS, TIME, draw_world

import discover as dc
from discover.comparison import judgement
from discover.comparison.judging.bands.dense_library import DENSE
from discover.learners.results import weighted_laws

DEVELOPMENT = range(1, 10)
"""Seeds of worlds that may decide a rule; any other judges."""


def record(seed: int, index: int) -> dict[str, Any]:
    """Return what the dense library's laws predict in one world, beside what is there."""
    world, kept = draw_world(seed, index), {}

    def predict(*arguments):
        kept["predicted"] = [np.asarray(own_predict(*arguments))]
        return kept["predicted"][0]

    def bands(laws, *arguments):
        kept["weights"] = np.asarray(laws.weights)
        return own_bands(laws, *arguments)

    def refute(outcomes, flows, *arguments):
        dense = outcomes[DENSE]
        kept["dense_bands"], kept["details"] = dict(dense.bands), dict(dense.details)
        kept["flows"] = [
            {
                "key": flow.key, "kind": flow.kind, "name": flow.name,
                "times": np.asarray(flow.times),
                "ref": {q: np.asarray(v) for q, v in flow.reference.items()},
            }
            for flow in flows
        ]  # fmt: skip
        found, said = own_refute(outcomes, flows, *arguments)
        kept["refuted_bands"] = kept["final_bands"] = dict(found[DENSE].bands)
        return found, said

    def beside(outcomes, flows, explanations):
        found = own_beside(outcomes, flows, explanations)
        kept["named"] = [{"predicted": one.predicted} for one in explanations]
        kept["final_bands"] = dict(found[DENSE].bands)
        return found

    def none(*_arguments):
        return ()

    own_predict, own_bands = weighted_laws._predict, weighted_laws.WeightedLaws.bands
    own_refute, own_beside = judgement.without_refuted_bands, judgement.with_named_effects
    named = none if world.effects is None else judgement.fit_named_effects
    runs = world.make(np.random.default_rng([seed, index, 1]))
    with (
        tempfile.TemporaryDirectory() as folder,
        patch.object(weighted_laws, "_predict", predict),
        patch.object(weighted_laws.WeightedLaws, "bands", bands),
        patch.object(judgement, "without_refuted_bands", refute),
        patch.object(judgement, "with_named_effects", beside),
        patch.object(judgement, "fit_named_effects", named),
        patch.object(judgement, "fit_classical_laws", none),
    ):
        data = dc.load_dataset(write_folder(Path(folder) / "data", runs))
        base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
        held_out = [name for name in data.names if name.startswith("held_")]
        dc.compare(data, base, held_out=held_out, learners=[DENSE])
    exact = {
        name: {"time": r.time, "sigma12": r.stress, "N1": r.N1, "N2": r.N2}
        for name, r in world.make(None).items()
    }
    return {
        **kept, "exact": exact, "seed": seed, "index": index, "law": world.law,
        "flaw": world.flaw, "library_laws": list(world.library_laws),
    }  # fmt: skip


def main() -> None:
    """Record the cases that are not there yet, and print the table of all."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("cases", nargs="*", help="seed-index")
    parser.add_argument("--out", type=Path, required=True, help="folder of the records")
    asked = parser.parse_args()
    asked.out.mkdir(parents=True, exist_ok=True)
    for case in asked.cases:
        seed, index = map(int, case.split("-"))
        path = asked.out / f"{seed}-{index}.pkl"
        if seed not in DEVELOPMENT:
            parser.error(f"{case}: seeds 1 to 9 are for development, others judge.")
        if not path.exists():
            path.write_bytes(pickle.dumps(record(seed, index)))
            print(f"{case} recorded", flush=True)
    cases: list[Mapping[str, Any]] = [
        pickle.loads(path.read_bytes()) for path in sorted(asked.out.glob("*.pkl"))
    ]
    print(table(cases))


if __name__ == "__main__":
    main()
