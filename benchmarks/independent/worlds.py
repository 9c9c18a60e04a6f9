"""Whole experiments drawn by lot: a law, an instrument, a protocol and a noise, from scipy alone.

Half of the laws and some of the flaws are in no library and no dictionary of the software under
test. What is told of each is the upper-convected Maxwell fluid with G = 100 Pa and λ = 1 s.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace

import numpy as np

import independent as made
from independent.flow import Flow, oscillation, start_up, steps
from independent.instruments import Instrument, Recording
from independent.material import Material, RateLaw
from independent.noise import correlated, outliers, proportional, white

MODULUS, TIME, SAMPLES = 100.0, 1.0, 120
SCALE = {"modulus": MODULUS, "relaxation_time": TIME}
VISCOSITY = MODULUS * TIME

Draw = Callable[[float, float], float]
Constants = Mapping[str, Mapping[str, float]]
Named = tuple[tuple[frozenset[str], ...], Constants]
"""For each effect that is there, the names it has; and the constants that go with the first."""

_NAMES = "a.csv", "b.csv", "c.csv", "d.csv", "held_e.csv", "held_f.csv"
_FLOWS: dict[str, list[tuple[Flow, float]]] = {
    "start-ups and oscillations": [
        (start_up(1.0), 6.0), (start_up(3.0), 5.0), (oscillation(2.0, 1.0), 12.0),
        (oscillation(3.0, 0.5), 14.0), (start_up(5.0), 4.0), (oscillation(5.0, 1.5), 8.0),
    ],
    "start-ups": [
        (start_up(0.5), 8.0), (start_up(1.0), 6.0), (start_up(2.0), 6.0), (start_up(4.0), 5.0),
        (start_up(6.0), 4.0), (start_up(3.0), 5.0),
    ],
    "oscillations": [
        (oscillation(1.0, 0.5), 14.0), (oscillation(2.0, 0.5), 14.0), (oscillation(2.0, 1.0), 12.0),
        (oscillation(4.0, 1.0), 12.0), (oscillation(5.0, 1.5), 8.0), (oscillation(6.0, 0.75), 10.0),
    ],
    "steps": [
        (steps([0.0, 4.0], [1.0, 3.0]), 8.0), (steps([0.0, 4.0], [3.0, 0.5]), 8.0),
        (steps([0.0, 4.0], [2.0, 0.0]), 7.0), (steps([0.0, 3.0], [2.0, -2.0]), 7.0),
        (steps([0.0, 3.0], [5.0, 1.0]), 6.0), (steps([0.0, 3.0], [4.0, -4.0]), 6.0),
    ],
}  # fmt: skip
FLOWS = {name: dict(zip(_NAMES, flows, strict=True)) for name, flows in _FLOWS.items()}
"""Six flows of each protocol, each with its duration in s; those named ``held_`` are to judge."""


def _alone(name: str, value: float, *spelled: str, constant: str) -> Named:
    return (frozenset({name, *spelled}),), {name: {constant: value}}


def known_laws(draw: Draw) -> dict[str, tuple[Material, Named]]:
    """Return laws that the software has a name for, with their names."""
    mobility, slip, linear, exponential = (draw(0.1, 0.5), draw(0.1, 0.4), draw(0.1, 0.4),
                                           draw(0.1, 0.4))  # fmt: skip
    length, breakdown, build_up = draw(20.0, 60.0), draw(0.1, 0.4), draw(1.0, 4.0)
    return {
        "Maxwell": (made.UpperConvectedMaxwell(**SCALE), ((), {})),
        "Giesekus": (made.Giesekus(mobility, **SCALE), _alone(
            "giesekus_mobility", mobility, "sigma.sigma", constant="alpha")),
        # σ12 in shear tells none of these from its twins (FACTS on twins; Johnson & Segalman 1977)
        "Johnson-Segalman": (made.JohnsonSegalman(slip, **SCALE), _alone(
            "non_affine_motion", slip, "tr(sigma)*gammadot",
            "sigma.gammadot+gammadot.sigma", constant="xi")),
        "linear PTT": (made.PhanThienTanner(linear, "linear", 0.0, **SCALE), _alone(
            "ptt_linear", linear, "tr(sigma)*sigma", constant="epsilon")),
        "exponential PTT": (made.PhanThienTanner(exponential, "exponential", 0.0, **SCALE), _alone(
            "ptt_exponential", exponential, constant="epsilon")),
        "FENE-P": (made.FenePeterlin(length, **SCALE), (
            (frozenset({"finite_extensibility"}),), {})),
        "thixotropic Maxwell": (
            made.Thixotropic(made.UpperConvectedMaxwell(**SCALE), breakdown, build_up),
            ((frozenset({"thixotropy"}),),
             {"thixotropy": {"breakdown": breakdown, "build_up_time": build_up}}),
        ),
    }  # fmt: skip


def library_laws(law: str, constants: Constants) -> tuple[Mapping[str, float], ...]:
    """Return the sums of the terms of the default library that a known law is, twins included.

    Coefficients by term, beside −σ. None where the law is no such sum: the exponential is a closed
    form, which is searched on request.
    """
    if law == "Maxwell":
        return ({},)
    if law == "Giesekus":
        return ({"sigma.sigma": constants["giesekus_mobility"]["alpha"]},)
    if law == "Johnson-Segalman":
        xi = constants["non_affine_motion"]["xi"]
        # one σ12 and one N1 in any simple shear   [docs/identifiability.md]
        return (
            {"sigma.gammadot+gammadot.sigma": xi / 2},
            {"tr(sigma)*gammadot": xi * (1 - xi / 2)},
        )
    if law == "linear PTT":
        return ({"tr(sigma)*sigma": constants["ptt_linear"]["epsilon"]},)
    return ()


def unknown_laws(draw: Draw) -> dict[str, Material]:
    """Return laws that it has no name for among its effects and terms, in flows that turn."""
    return {
        "Rolie-Poly": made.RoliePoly(draw(0.5, 1.0), draw(0.05, 0.2), -0.5, **SCALE),
        "pom-pom": made.PomPom(draw(3.0, 6.0), draw(0.2, 0.6), **SCALE),
        "extended pom-pom": made.ExtendedPomPom(draw(3.0, 8.0), draw(0.05, 0.3), draw(0.2, 0.6),
                                           **SCALE),
        "White-Metzner": made.WhiteMetzner(draw(0.4, 0.7), draw(0.5, 1.5), **SCALE),
        "K-BKZ": made.KBKZ(draw(0.1, 0.3), -0.15, **SCALE),
        "two modes": made.multimode_giesekus(
            (draw(0.05, 0.2), draw(0.5, 0.9)), (0.5 * MODULUS, 0.5 * MODULUS),
            (draw(1.1, 1.6) * TIME, draw(0.3, 0.6) * TIME)),
        "soft glass": made.SoftGlass(draw(0.1, 0.3), draw(0.1, 0.3), **SCALE),
        "square-root thixotropy": made.Thixotropic(
            made.UpperConvectedMaxwell(**SCALE), draw(0.2, 0.5), draw(2.0, 6.0), 0.5, 2.0
        ),
    }  # fmt: skip


def known_flaws(draw: Draw) -> dict[str, tuple[Instrument, Named]]:
    """Return instruments with a flaw that the software has a name for."""
    gain, lag, rise = draw(0.05, 0.15), draw(0.05, 0.15), draw(0.05, 0.2)
    slip, friction = draw(0.1, 0.3) / VISCOSITY, draw(0.03, 0.1) * MODULUS
    return {
        "gain": (Instrument(gain=gain), _alone("stress_gain", gain, constant="gain_error")),
        "lag": (Instrument(lag=lag), _alone("transducer_lag", lag, constant="tau")),
        "rise": (Instrument(rise_time=rise), _alone("rate_rise_time", rise, constant="tau")),
        "slip": (Instrument(slip=slip), _alone("wall_slip", slip, constant="slip")),
        "friction": (Instrument(friction=friction), _alone(
            "bearing_friction", friction, constant="friction")),
    }  # fmt: skip


def unknown_flaws(draw: Draw) -> dict[str, Instrument]:
    """Return instruments with a flaw of other kinetics than any it has a name for."""
    return {
        # of the largest stress, which `World.make` knows
        "saturated": Instrument(limit=draw(0.6, 0.8)),
        "ringing": Instrument(resonance=draw(6.0, 15.0), damping=draw(0.1, 0.3)),
        "cubic slip": Instrument(slip=draw(0.1, 0.3) / VISCOSITY / MODULUS**2, slip_power=3.0),
        "settling drift": Instrument(
            drift=draw(0.1, 0.3) * MODULUS / TIME, settling_time=draw(0.5, 2.0) * TIME
        ),
    }


NOISES: dict[str, Callable[[np.ndarray, np.random.Generator], np.ndarray]] = {
    "white": lambda stress, lot: white(stress, 0.01, lot),
    "correlated": lambda stress, lot: correlated(stress, 0.01, 0.6, lot),
    "proportional": lambda stress, lot: proportional(stress, 0.015, lot),
    "outliers": lambda stress, lot: outliers(white(stress, 0.01, lot), 0.01, 0.5, lot),
}


@dataclass(frozen=True)
class World:
    """One experiment.

    `law`, `flaw`, `protocol`, `noise` in words; the flaw is ``"sound"`` if the instrument has none.
    `material`, `instrument`: what makes the records.
    `effects`: for each effect that is there, the names that are right; None if one of them has no
        name.
    `constants`: of effects that are there, by name of effect and parameter.
    """

    law: str
    flaw: str
    protocol: str
    noise: str
    material: Material
    instrument: Instrument
    effects: tuple[frozenset[str], ...] | None
    constants: Constants = field(default_factory=dict)

    @property
    def inside(self) -> bool:
        """Whether everything that is there has a name."""
        return self.effects is not None

    @property
    def library_laws(self) -> tuple[Mapping[str, float], ...]:
        """Laws of the library that are what the records hold; none behind an instrument's flaw."""
        return library_laws(self.law, self.constants) if self.flaw == "sound" else ()

    def make(self, lot: np.random.Generator | None) -> dict[str, Recording]:
        """Return the runs by file name, with noise; without it where there is no lot."""
        flows, instrument = FLOWS[self.protocol], self.instrument
        if self.flaw == "saturated":
            largest = max(
                np.max(np.abs(self.material.respond(flow, np.linspace(0.0, end, 200)).sigma12))
                for name, (flow, end) in flows.items()
                if not name.startswith("held_")
            )
            instrument = replace(instrument, limit=instrument.limit * float(largest))
        runs = {}
        for name, (flow, end) in flows.items():
            run = instrument.record(self.material, flow, np.linspace(0.02, end, SAMPLES))
            if lot is not None:
                run = replace(run, stress=NOISES[self.noise](run.stress, lot))
            runs[name] = run
        return runs


def draw_world(seed: int, index: int) -> World:
    """Return one experiment; those of odd index have a law without a name.

    Laws, protocols and noises come in turn, so that a few hundred cover all combinations; half of
    the instruments are sound, three in ten have a flaw with a name, two in ten one without.
    """
    lot = np.random.default_rng([seed, index])

    def draw(low: float, high: float) -> float:
        return float(lot.uniform(low, high))

    known, unknown = known_laws(draw), unknown_laws(draw)
    flawed, strange = known_flaws(draw), unknown_flaws(draw)
    protocol = list(FLOWS)[int(lot.integers(len(FLOWS)))]
    noise = list(NOISES)[int(lot.integers(len(NOISES)))]
    chance, which = draw(0.0, 1.0), draw(0.0, 1.0)
    if index % 2:
        law = list(unknown)[(index // 2) % len(unknown)]
        material, effects, constants = unknown[law], None, {}
        if isinstance(material, made.KBKZ) and protocol == "start-ups":
            # where no flow turns, strain added up is the strain of the damping function
            effects, constants = _alone("strain_damping", material.damping, constant="n")
    else:
        law = list(known)[(index // 2) % len(known)]
        material, (effects, constants) = known[law]
    flaw, instrument = "sound", Instrument()
    if chance > 0.8 and isinstance(material, RateLaw):
        flaw = list(strange)[int(which * len(strange))]
        instrument, effects = strange[flaw], None
    elif chance > 0.5 and isinstance(material, RateLaw):
        flaw = list(flawed)[int(which * len(flawed))]
        instrument, (names, sizes) = flawed[flaw]
        effects = None if effects is None else effects + names
        constants = {**constants, **sizes}
    return World(law, flaw, protocol, noise, material, instrument, effects, constants)
