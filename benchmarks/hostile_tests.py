"""Hostile records of other tests than flows from rest, and tables beside the runs."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from hostile_records import BAD_DAYS, FLOWS, GIESEKUS, UCM, Record, Runs, record_of, recorded
from independent import (
    Flow,
    Material,
    Modes,
    RateLaw,
    UpperConvectedMaxwell,
    oscillation,
    start_up,
    step_strain,
    steps,
)
from independent.folders import maxwell_sweep
from independent.instruments import Instrument, alternation_as_from_rest, nothing, relaxation_as_run
from independent.material import integrate
from independent.sweeps import modulus_of, strain_at
from scipy.integrate import solve_ivp

_GROWTH = FLOWS["slow.csv"][1]
Tables = dict[str, dict[str, np.ndarray]]


def by_name(make: Callable[[float], Record], values: Sequence[float], names="abch") -> Runs:
    """Return a run for each of some values; the last judges."""
    files = [f"{name}.csv" if name != "h" else "held.csv" for name in names]
    return {file: make(value) for file, value in zip(files, values, strict=True)}


def alternating(material: Material, phase: float = 0.7, frequency: float = 1.0) -> Runs:
    """Return two cycles in steady alternation, which begin at a phase."""
    amplitudes = {"one.csv": 0.7, "two.csv": 1.5, "three.csv": 3.0, "held.csv": 4.0}
    cycle = 2 * np.pi / frequency
    times = np.linspace(0.0, 2 * cycle, 121)
    made = {}
    for name, amplitude in amplitudes.items():
        flow = oscillation(amplitude, frequency, phase)
        run = Instrument().record(material, flow, np.append(0.5 * cycle, times + 8 * cycle))
        made[name] = record_of(run, start="periodic").kept(slice(1, None)).told(time_s=times)
    return made


def alternations(material: Material, frequency: float, cycles: float) -> Runs:
    """Return oscillations in steady alternation, taken for such from rest."""
    times = np.linspace(0.0, cycles * 2 * np.pi / frequency, 200)
    strains = {"one.csv": 0.5, "two.csv": 1.0, "three.csv": 2.0, "held.csv": 1.5}
    return {
        name: record_of(alternation_as_from_rest(material, s * frequency, frequency, times))
        for name, s in strains.items()
    }


def relaxations(*others: str) -> Runs:
    """Return relaxations after 3 and 6 % strain, told as runs, and some sound ones."""
    times = np.geomspace(0.01, 5.0, 100)
    runs = {n: r for n, r in recorded(UCM, BAD_DAYS).items() if n in others}
    both = Modes(UCM, UpperConvectedMaxwell(60.0, 0.1))
    for name, strain in (("step.csv", 0.03), ("step2.csv", 0.06)):
        # its strain is there within the first samples, as an instrument records it
        run = record_of(relaxation_as_run(both, strain, 0.02, times))
        ramp, rate = strain * -np.expm1(-times / 0.02), strain / 0.02 * np.exp(-times / 0.02)
        runs[name] = run.told(shear_rate_1_s=rate, strain=ramp)
    return runs


def absent(level: float, names: Sequence[str] = tuple(BAD_DAYS)) -> Runs:
    """Return runs of which some are a constant stress and no fluid."""
    runs = {name: Instrument().record(UCM, *flow) for name, flow in BAD_DAYS.items()}
    return {
        name: record_of(nothing(run, level) if name in names else run) for name, run in runs.items()
    }


def swapped() -> Runs:
    """Return runs with the stresses of two of them exchanged."""
    runs = recorded(GIESEKUS, BAD_DAYS)
    slow, fast = (runs[name].columns["stress_Pa"] for name in ("slow.csv", "fast.csv"))
    told = {"slow.csv": fast, "fast.csv": slow}
    return runs | {name: runs[name].told(stress_Pa=stress) for name, stress in told.items()}


def crept(times: np.ndarray, stress: np.ndarray, strain: np.ndarray) -> Record:
    columns = {"time_s": times, "stress_Pa": stress, "strain": strain}
    return Record(columns, "strain", {"control": "stress"})


def creeping(law: RateLaw, solvent: float = 5.0) -> Runs:
    """Return creep and recovery at four stresses."""
    times = np.append(np.geomspace(0.02, 8.0, 50), 8.0 + np.geomspace(0.02, 8.0, 40))

    def at(stress):
        strain = strain_at(law, [(0.0, stress), (8.0, 0.0)], solvent, times)
        return crept(times, np.where(times <= 8.0, stress, 0.0), strain)

    return by_name(at, (30.0, 60.0, 90.0, 120.0))


def ringing_creep(law: RateLaw, inertia: float, solvent: float = 2.0) -> Runs:
    """Return creep with the inertia of a tool: I γ'' = σ − what the fluid carries."""
    times = np.geomspace(0.02, 12.0, 90)
    scale = np.append(law.scale(), [1.0, 1.0])

    def at(imposed):
        def change(t, scaled):
            state = scale * scaled
            rate = state[-1]
            carried = law.stress(state[:-2], rate)[0, 1] + solvent * rate
            grown = (imposed - carried) / inertia
            return np.concatenate([law.change(state[:-2], rate), [rate, grown]]) / scale

        start = np.concatenate([law.rest(), [0.0, 0.0]]) / scale
        found = solve_ivp(change, (0.0, times[-1]), start, "LSODA", times, rtol=1e-9, atol=1e-10)
        return crept(times, np.full(len(times), imposed), found.y[-2])

    return by_name(at, (30.0, 60.0, 90.0, 75.0))


_PULLED = 0.2, 0.6, 2.0, 1.2


def stretched_at(times: np.ndarray, rate: float, stress: np.ndarray) -> Record:
    columns = {"time_s": times, "hencky_rate_1_s": np.full(len(times), rate)}
    columns["tensile_stress_Pa"] = stress
    return Record(columns, "tensile_stress_Pa", {"flow": "uniaxial"})


def pulled(law: RateLaw, over_first_area: bool = False, names="abch") -> Runs:
    """Return uniaxial extensions, the stress told as it is or over the first area."""

    def at(rate):
        times = np.linspace(0.03, 3.0 / rate, 80) if rate > 0.3 else np.linspace(0.1, 12.0, 80)
        stress = law.pull(rate, times) * (np.exp(-rate * times) if over_first_area else 1.0)
        return stretched_at(times, rate, stress)

    return by_name(at, _PULLED, names)


def stretched_otherwise(law: RateLaw, rate_at, shape: Sequence[float], told) -> Runs:
    """Return extensions of a rate that varies, and of a shape, told as uniaxial."""

    def at(rate):
        times = np.linspace(0.03, 3.0 / rate, 80)

        def change(t, s):
            return law.change(s, rate_at(rate, t) * np.diag(shape))

        states = integrate(change, law.rest(), times, scale=law.scale())
        tensors = [law.stress(s, np.zeros((3, 3))) for s in states]
        stress = np.array([one[0, 0] - one[1, 1] for one in tensors])
        return stretched_at(times, rate, told(stress, rate, times))

    return by_name(at, _PULLED)


def necked(law: RateLaw, begins: float = 1.5, more: float = 0.6) -> Runs:
    """Return extensions that neck, the force told over the area of a sample without a neck."""

    def faster(rate, t):
        return rate * (1 + more * max(rate * t - begins, 0.0))

    def over_the_told_area(stress, rate, times):
        return stress * np.exp(-(0.5 * more * np.maximum(rate * times - begins, 0.0) ** 2))

    return stretched_otherwise(law, faster, [1.0, -0.5, -0.5], over_the_told_area)


def planar_told_uniaxial(law: RateLaw) -> Runs:
    return stretched_otherwise(law, lambda rate, t: rate, [1.0, -1.0, 0.0], lambda s, r, t: s)


def then_sheared(law: RateLaw, rate: float = 1.0) -> Runs:
    """Return uniaxial extensions, with a start-up in shear held out."""
    (sheared,) = recorded(law, {"held.csv": (start_up(rate), _GROWTH)}).values()
    sheared = replace(sheared, cells={"flow": "shear"})
    return {**pulled(law, names="abcd"), "held.csv": sheared}


def _after(material: Material, flow: Flow, begin: float, after: np.ndarray, **cells) -> Record:
    """Return the record of a flow from a time on, which is its zero."""
    run = record_of(Instrument().record(material, flow, begin + after), **cells)
    return run.told(time_s=after)


def relaxing(material: Material, takes: float = 0.02) -> Runs:
    """Return relaxations after steps of strain, each put on in a declared time."""

    def at(strain):
        cells = {"step_strain": strain, "step_time_s": takes}
        after = np.geomspace(0.02, 6.0, 60)
        return _after(material, step_strain(strain, takes), takes, after, **cells)

    return by_name(at, (0.5, 1.5, 3.0, 2.0))


def strains(put_on: float) -> Runs:
    """Return steps of strain, told as at once and dated from their beginning."""
    times = np.geomspace(1.5 * put_on, 5.0, 60)

    def at(size):
        run = _after(GIESEKUS, step_strain(size, put_on), 0.0, times, step_strain=size)
        return run.told(shear_rate_1_s=np.zeros(len(times)))

    return by_name(at, (0.5, 1.5, 4.0, 3.0))


def stopped(material: Material, then: Mapping[str, float] = {}) -> Runs:
    """Return stresses after a steady flow has stopped, and of start-ups beside."""
    after, lasted = np.linspace(0.0, 5.0, 80), 25.0

    def at(rate):
        flow, cells = steps([0.0, lasted], [rate, 0.0]), {"rate_before_1_s": rate}
        return _after(material, flow, lasted, after, start="steady", **cells)

    made = by_name(at, (0.5, 1.0, 3.0, 2.0), "abcd" if then else "abch")
    starts = {name: (start_up(rate), _GROWTH) for name, rate in then.items()}
    return made | recorded(material, starts)


# tables beside the runs

RATES = np.geomspace(0.05, 20.0, 30)
THREE_TIMES, THREE_MODULI = (10.0, 1.0, 0.1), (20.0, 60.0, 120.0)


def swept(law: RateLaw) -> Tables:
    """Return an amplitude sweep at 1 rad/s."""
    strains = np.geomspace(0.05, 6.0, 20)
    found = np.array([modulus_of(law, strain, 1.0, 6) for strain in strains])
    columns = {"strain": strains, "omega_rad_s": np.ones(20)}
    return {"amplitude_sweep.csv": {**columns, "Gp_Pa": found.real, "Gpp_Pa": found.imag}}


def steady(law: Material, rates: np.ndarray, ends: Sequence[float]) -> np.ndarray:
    return np.array([law.respond(start_up(r), np.array(ends)).sigma12[-1] for r in rates])


def flow_curve(rates: np.ndarray, stress: np.ndarray) -> Tables:
    return {"flow_curve.csv": {"shear_rate_1_s": rates, "stress_Pa": stress}}


def curve(law: Material) -> Tables:
    return flow_curve(RATES, steady(law, RATES, [30.0, 60.0]))


def in_haste(law: RateLaw) -> Tables:
    """Return a flow curve swept upwards, with a second for each point."""
    begin = np.arange(len(RATES)) * 1.0
    return flow_curve(RATES, law.respond(steps(begin, RATES), begin + 0.999).sigma12)


def by_cox_and_merz(modulus: float, time: float) -> Tables:
    """Return a curve that nobody measured: |η*| of one mode."""
    return flow_curve(RATES, modulus * time * RATES / np.sqrt(1 + (time * RATES) ** 2))


def banded(law: RateLaw, solvent: float = 5.0) -> Tables:
    """Return a flow curve with a plateau between two branches, as bands have it."""
    rates = np.geomspace(0.05, 50.0, 30)
    stress = steady(law, rates, [60.0, 90.0]) + solvent * rates
    top = 0.9 * float(np.max(stress[rates < 3.0]))
    first, last = np.argmax(stress > top), np.flatnonzero(stress < top)[-1]
    stress[first : max(last + 1, first)] = top
    return flow_curve(rates, stress)


def apparent(law: RateLaw) -> Tables:
    """Return a flow curve of a capillary at rates as of a Newtonian fluid."""
    rates = np.geomspace(1e-3, 20.0, 120)
    stress = steady(law, rates, [20.0, 60.0])
    both, wall = np.append(0.0, stress**2 * rates), np.append(0.0, stress)
    through = np.append(0.0, np.cumsum((both[1:] + both[:-1]) / 2 * np.diff(wall)))[1:]
    told, left = 4 * through / stress**3, np.searchsorted(rates, RATES[:-1])
    return flow_curve(told[left], stress[left])


def sweep_at(law: RateLaw, strain: float) -> Tables:
    """Return a sweep at a strain that is not small, told as linear."""
    omega = np.geomspace(0.03, 50.0, 17)
    found = np.array([modulus_of(law, strain, w, 8) for w in omega])
    return {"lve.csv": {"omega_rad_s": omega, "Gp_Pa": found.real, "Gpp_Pa": found.imag}}


def sweep_of(
    moduli: Sequence[float], times: Sequence[float], low=0.01, high=100.0, points=33
) -> Tables:
    """Return a linear sweep of Maxwell modes."""
    omega = np.geomspace(low, high, points)
    return {"lve.csv": maxwell_sweep(np.array(moduli), np.array(times), omega)}


_LOG = np.geomspace(20.0, 0.04, 10)
BROAD = 60.0 * np.exp(-0.5 * (np.log(_LOG / 0.3) / 2.0) ** 2), _LOG
"""Moduli and times of a broad spectrum, evenly in log time."""
