"""How far an answer is off in flows that no contestant saw, and a table of all of them."""

import time
from collections.abc import Mapping, Sequence
from types import ModuleType

import numpy as np

from field.cases import FLUIDS, UNSEEN, training, truth
from field.contract import Answer

QUANTITIES = {"sigma12": "σ12", "N1": "N1", "N2": "N2", "tensile": "extension"}


def judged(contestant: ModuleType, fluid: str, seed: int) -> dict:
    """Return one result: processor seconds, law, words, and the largest error of each quantity."""
    given = training(fluid, seed, getattr(contestant, "SEES_STRESS", False))
    started = time.process_time()  # a shared machine does not slow this clock
    answer = contestant.learn(given)
    seconds = time.process_time() - started
    errors = worst_errors(answer, fluid)
    return {"law": answer.law, "words": answer.words, "errors": errors, "learning": seconds}


def worst_errors(answer: Answer, fluid: str) -> dict[str, float | None]:
    """Return the largest relative error over the unseen flows by quantity.

    In the L2 norm, relative to the truth, that of N2 to the truth's N1. None where nothing is
    predicted, infinite where the equation runs away.
    """
    worst: dict[str, float | None] = dict.fromkeys(QUANTITIES)
    for flow in UNSEEN:
        true = truth(fluid, flow)
        try:
            said: Mapping[str, np.ndarray] | None = answer.predict(flow)
        except ArithmeticError:
            said = None
        for name, value in true.items():
            if said is not None and name not in said:
                continue
            error = np.inf
            if said is not None and np.all(np.isfinite(said[name])):
                size = np.linalg.norm(true["N1" if name == "N2" else name])
                error = float(np.linalg.norm(said[name] - value) / size)
            worst[name] = max(worst[name] or 0.0, error)
    return worst


def tables(results: Mapping[tuple[str, str], dict], titles: Mapping[str, str]) -> str:
    """Return the table of all contestants and one of each by fluid, as Markdown.

    `results`: by contestant and fluid. `titles`: of the contestants by file name, in the order of
    the lines.
    """
    lines = [
        "| | " + " | ".join(QUANTITIES.values()) + " | right | wrong | seconds |",
        "|---|" + "---|" * (len(QUANTITIES) + 3),
    ]
    for name, title in titles.items():
        rows = {fluid: results[name, fluid] for fluid in FLUIDS if (name, fluid) in results}
        done = {fluid: row for fluid, row in rows.items() if "errors" in row}
        if not done:
            reason = next(iter(rows.values()))["message"] if rows else "not run"
            lines.append(f"| {title} | {reason} |" + " |" * (len(QUANTITIES) + 2))
            continue
        cells = [_middle([row["errors"][q] for row in done.values()]) for q in QUANTITIES]
        named = {fluid: row["law"] for fluid, row in done.items()}
        right = sum(law is not None and law == FLUIDS[fluid][0] for fluid, law in named.items())
        wrong = sum(law is not None and law != FLUIDS[fluid][0] for fluid, law in named.items())
        cells += [str(right), str(wrong)] if any(named.values()) else ["–", "–"]
        cells.append(f"{np.median([row['learning'] for row in done.values()]):.0f}")
        missing = "" if len(done) == len(FLUIDS) else f" ({len(done)} of {len(FLUIDS)} fluids)"
        lines.append(f"| {title}{missing} | " + " | ".join(cells) + " |")
    lines += ["", "| N1; extension | " + " | ".join(FLUIDS) + " |", "|---|" + "---|" * len(FLUIDS)]
    for name, title in titles.items():
        cells = []
        for fluid in FLUIDS:
            row = results.get((name, fluid), {})
            errors = row.get("errors")
            pair = [percent(errors[q]) for q in ("N1", "tensile")] if errors else []
            cells.append("; ".join(pair) or row.get("message", "not run"))
        lines.append(f"| {title} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def percent(error: float | None) -> str:
    """Return an error in percent; a dash where nothing is predicted."""
    if error is None:
        return "–"
    if not np.isfinite(error):
        return "runs away"
    return f"{100 * error:.2g} %" if error < 0.995 else f"{100 * error:.0f} %"


def _middle(errors: Sequence[float | None]) -> str:
    """Return the median and, in brackets, the largest of the errors."""
    said = [error for error in errors if error is not None]
    if not said:
        return "–"
    return f"{percent(float(np.median(said)))} ({percent(max(said))})"
