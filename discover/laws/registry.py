"""Named laws, as study files and the command line spell them."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.fene_p import FenePeterlin
from discover.laws.giesekus import Giesekus
from discover.laws.johnson_segalman import JohnsonSegalman
from discover.laws.maxwell import UpperConvectedMaxwell
from discover.laws.phan_thien_tanner import ExponentialPhanThienTanner, LinearPhanThienTanner


@dataclass(frozen=True)
class NamedLaw:
    """A law that can be asked for by name.

    Attributes
    ----------
    title
        Name as a rheologist writes it.
    build
        Makes the law from its parameters, in the order of `parameters`.
    parameters
        Name and admissible range of each parameter.
    """

    title: str
    build: Callable[..., AbstractConstitutiveLaw]
    parameters: Mapping[str, tuple[float, float]]


LAWS: Mapping[str, NamedLaw] = {
    "ucm": NamedLaw("upper convected Maxwell", UpperConvectedMaxwell, {}),
    "johnson_segalman": NamedLaw("Johnson–Segalman", JohnsonSegalman, {"xi": (0.0, 2.0)}),
    "giesekus": NamedLaw("Giesekus", Giesekus, {"alpha": (0.0, 1.0)}),
    "ptt_linear": NamedLaw("linear PTT", LinearPhanThienTanner, {"epsilon": (0.0, 10.0)}),
    "ptt_exponential": NamedLaw(
        "exponential PTT", ExponentialPhanThienTanner, {"epsilon": (0.0, 10.0)}
    ),
    "fene_p": NamedLaw("FENE-P", FenePeterlin, {"L2": (3.0 + 1e-6, 1e6)}),
}


def make_law(name: str, parameters: Mapping[str, float] | None = None) -> AbstractConstitutiveLaw:
    """Return the named law with these parameters.

    Parameters
    ----------
    name
        Key of `LAWS`.
    parameters
        Every parameter of the law, by the contract's name.

    Raises
    ------
    InputError
        If the law is unknown, or a parameter is missing, unknown or outside its range.
    """
    parameters = dict(parameters or {})
    if name not in LAWS:
        raise InputError(f"Unknown law {name!r}; write one of {', '.join(LAWS)}.")
    entry = LAWS[name]
    unknown = [key for key in parameters if key not in entry.parameters]
    if unknown:
        wanted = ", ".join(entry.parameters) or "none"
        raise InputError(
            f"The law {name!r} has no parameter {unknown[0]!r}; its parameters are: {wanted}."
        )
    values = []
    for key, (low, high) in entry.parameters.items():
        if key not in parameters:
            raise InputError(f"The law {name!r} needs its parameter {key!r} ({low:g} to {high:g}).")
        value = parameters[key]
        if (
            not isinstance(value, int | float)
            or not math.isfinite(value)
            or not low <= value <= high
        ):
            raise InputError(
                f"The parameter {key!r} of the law {name!r} must be a number from {low:g} to "
                f"{high:g}; got {value!r}."
            )
        values.append(float(value))
    return entry.build(*values)
