"""The field's own test: which of five laws made twelve oscillations, modulus and time unknown.

Twenty fluids of each law of `independent.five_hundred`, without noise and with 1 %. The product is
asked which law and effects explain the runs. An answer is *right* by name, a *twin* where the truth
stands among the twins of the likeliest explanation, *withheld* where none is claimed, else *wrong*.
"""

from pathlib import Path

import numpy as np
import product
from independent import five_hundred as fluids
from independent.folders import write_table

QUESTIONS, SEED, LIMIT = ("exact", "noisy"), 20261201, 300.0
FLUIDS = 20
GROUPS = {law: [f"{law} {n}" for n in range(FLUIDS)] for law in fluids.RANGES}
_SOLVENT = "solvent_viscosity"
PARTS = {
    "Newtonian": {"newtonian"}, "Carreau-Yasuda": {"carreau_yasuda"}, "Oldroyd-B": {_SOLVENT},
    "Giesekus": {"giesekus_mobility", _SOLVENT},
    "linear PTT": {"ptt_linear", "non_affine_motion", _SOLVENT},
}  # fmt: skip
MODEL = {"law": "ucm", "modulus_Pa": "fit", "relaxation_time_s": "fit"}
LOOP = {
    "effects": [_SOLVENT, "giesekus_mobility", "ptt_linear", "non_affine_motion"],
    "max_effects": 3,
}
"""What the paper's laws differ by."""
INELASTIC = "newtonian", "carreau_yasuda"
"""Laws that the product weighs beside every search, as it names them."""
OF_LAW = {
    "ucm": set(), "johnson_segalman": {"non_affine_motion"}, "giesekus": {"giesekus_mobility"},
    "ptt_linear_non_affine": {"ptt_linear", "non_affine_motion"},
    "giesekus_non_affine": {"giesekus_mobility", "non_affine_motion"},
}  # fmt: skip
"""What a law of the product has beside a Maxwell mode; of others their own name."""


def names(seed: int) -> list[str]:
    del seed
    return [name for group in GROUPS.values() for name in group]


def parts(law: str, effects) -> set[str]:
    return {*OF_LAW.get(law, {law}), *effects}


def run(name: str, question: str, seed: int, folder: Path) -> dict:
    law, number = name.rsplit(" ", 1)
    data = folder / "data"
    data.mkdir(parents=True, exist_ok=True)
    lot = np.random.default_rng([seed, list(PARTS).index(law), int(number), 1])
    runs = fluids.records(law, seed, int(number))
    for file, columns in runs.items():
        exact = columns["stress_Pa"]
        size = 0.01 * np.sqrt(np.mean(exact**2)) * (question == "noisy")
        noisy = exact + size * lot.standard_normal(len(exact))
        write_table(data / file, {**columns, "stress_Pa": noisy}, 12)
    (data / "runs.csv").write_text("\n".join(["file", *runs]) + "\n", encoding="utf-8")
    sections = {"data": {"folder": str(data.resolve())}, "model": MODEL, "loop": LOOP}
    said = product.answer(folder, "close-loop", sections)
    laws = said.get("laws") or [{"law": "ucm"}]
    alike = [laws[0]["law"], *(o["law"] for o in laws[1:] if not o.get("is_told_apart", True))]
    named = [[stage["effect"], *stage["aliases"]] for stage in said["stages"]]
    if said["use"].get("law") in INELASTIC:
        alike, named = [said["use"]["law"]], []
    found = {"verdict": said["verdict"], "law": alike[0], "as_well": alike[1:], "named": named}
    found |= {
        "error": said["error_after"]["fit"],
        "constants": fluids.drawn(law, seed, int(number)),
    }
    return {**found, "answer": judged(law, said["verdict"], alike, named, said["explanations"][:1])}


def judged(law: str, verdict: str, alike: list[str], named: list[list[str]], also=()) -> str:
    """Return what an answer is: right, twin, withheld or wrong."""
    if verdict not in product.CONFIDENT:
        return "withheld"
    truth = PARTS[law]
    if parts(alike[0], [names[0] for names in named]) == truth:
        return "right"
    told = [parts(one, [n[0] for n in named]) for one in alike]
    told += [parts(alike[0], twin) for one in also for twin in one["twins"]]
    spelled = all(truth & parts(alike[0], names) for names in named) and named
    return "twin" if truth in told or (spelled and len(named) == len(truth)) else "wrong"


def line(row: dict) -> str:
    effects = " + ".join(" or ".join(names) for names in row["named"])
    return f"{row['answer']}: {row['law']} + {effects or 'nothing'}, {100 * row['error']:.2g} %"


def table(rows: list[dict]) -> str:
    """Return counts of answers by law and noise, and the median seconds."""
    heads = ("right", "twin", "withheld", "wrong")
    lines = [f"| law | | {' | '.join(heads)} | seconds |", "|---" * 7 + "|"]
    for law in PARTS:
        for question in QUESTIONS:
            some = [r for r in rows if r["case"].startswith(law) and r["question"] == question]
            if some:
                of = [r.get("answer", "withheld") for r in some]
                counts = " | ".join(str(of.count(head)) for head in heads)
                seconds = np.median([r["seconds"] for r in some])
                lines.append(f"| {law} | {question} | {counts} | {seconds:.0f} |")
    return "\n".join(lines)
