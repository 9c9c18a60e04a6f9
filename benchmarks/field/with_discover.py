"""Records as runs of this package, and a fluid of it as a predictor."""

from collections.abc import Sequence
from functools import partial

from field.contract import Flow, Training

NAMES = {
    (): "ucm",
    ("sigma.sigma",): "giesekus",
    ("sigma.gammadot+gammadot.sigma",): "johnson_segalman",
    # the same σ12 and N1 in every shear: see docs/identifiability.md
    ("tr(sigma)*gammadot",): "johnson_segalman",
    ("tr(sigma)*sigma",): "ptt_linear",
    ("(exp(epsilon*tr(sigma))-1)*sigma",): "ptt_exponential",
}
"""The name of a law beyond upper convected Maxwell by its terms."""


def runs(training: Training) -> list:
    """Return the records as `dc.Run`."""
    import discover as dc

    return [
        dc.Run(r.flow.name, r.flow.times, _protocol(r.flow), r.flow.rate(r.flow.times), r.sigma12)
        for r in training.records
    ]


def predictor(fluid):
    """Return the function from a flow to the stresses of a fluid."""
    return partial(_predict, fluid)


def in_words(terms: Sequence) -> tuple[str | None, str]:
    """Return the name of a sum of terms, or None, and the terms."""
    name = NAMES.get(tuple(term.term for term in terms))
    words = " + ".join(f"{term.coefficient:.3g} {term.term}" for term in terms)
    inner = {key: value for term in terms for key, value in term.inner.items()}
    return name, words + "".join(f", {key} = {value:.3g}" for key, value in inner.items())


def _predict(fluid, flow: Flow) -> dict:
    from discover.simulate import SimulationError, simulate

    try:
        found = simulate(fluid, _protocol(flow), flow.times)
    except SimulationError as error:
        raise ArithmeticError(str(error)) from error
    if flow.kind == "uniaxial":
        return {"tensile": found.first_normal_stress_difference}
    return {
        "sigma12": found.shear_stress,
        "N1": found.first_normal_stress_difference,
        "N2": found.second_normal_stress_difference,
    }


def _protocol(flow: Flow):
    import discover as dc

    if flow.frequency:
        return dc.oscillatory_shear(flow.amplitude, flow.frequency)
    return dc.in_flow(dc.start_up(flow.amplitude), flow.kind)
