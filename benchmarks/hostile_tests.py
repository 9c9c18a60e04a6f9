"""Records of other tests than flows from rest: alternation, creep, extension, relaxation."""

from collections.abc import Mapping, Sequence
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
from independent.instruments import Instrument, alternation_as_from_rest, nothing, relaxation_as_run
from independent.material import integrate
from independent.sweeps import strain_at
from scipy.integrate import solve_ivp

_GROWTH = FLOWS["slow.csv"][1]


def alternating(material: Material, phase: float = 0.7, frequency: float = 1.0) -> Runs:
    """Return two cycles in steady alternation, which begin at a phase."""
    amplitudes = {"one.csv": 0.7, "two.csv": 1.5, "three.csv": 3.0, "held.csv": 4.0}
    cycle = 2 * np.pi / frequency
    times = np.linspace(0.0, 2 * cycle, 121)
    made = {}
    for name, amplitude in amplitudes.items():
        flow = oscillation(amplitude, frequency, phase)
        run = Instrument().record(material, flow, np.append(0.5 * cycle, times + 8 * cycle))
        kept = record_of(run, start="periodic").kept(slice(1, None))
        made[name] = kept.told(time_s=times)
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
    return {
        name: record_of(nothing(run, level) if name in names else run)
        for name, flow in BAD_DAYS.items()
        for run in [Instrument().record(UCM, *flow)]
    }


def swapped() -> Runs:
    """Return runs with the stresses of two of them exchanged."""
    runs = recorded(GIESEKUS, BAD_DAYS)
    slow, fast = runs["slow.csv"], runs["fast.csv"]
    runs["slow.csv"] = slow.told(stress_Pa=fast.columns["stress_Pa"])
    runs["fast.csv"] = fast.told(stress_Pa=slow.columns["stress_Pa"])
    return runs


def creeping(law: RateLaw, solvent: float = 5.0) -> Runs:
    """Return creep and recovery at four stresses."""
    times = np.append(np.geomspace(0.02, 8.0, 50), 8.0 + np.geomspace(0.02, 8.0, 40))
    stresses = {"a.csv": 30.0, "b.csv": 60.0, "c.csv": 90.0, "held.csv": 120.0}
    made = {}
    for name, stress in stresses.items():
        strain = strain_at(law, [(0.0, stress), (8.0, 0.0)], solvent, times)
        made[name] = _crept(times, np.where(times <= 8.0, stress, 0.0), strain)
    return made


def _crept(times: np.ndarray, stress: np.ndarray, strain: np.ndarray) -> Record:
    columns = {"time_s": times, "stress_Pa": stress, "strain": strain}
    return Record(columns, "strain", {"control": "stress"})


def ringing_creep(law: RateLaw, inertia: float, solvent: float = 2.0) -> Runs:
    """Return creep with the inertia of a tool: I γ'' = σ − what the fluid carries."""
    times = np.geomspace(0.02, 12.0, 90)
    stresses = {"a.csv": 30.0, "b.csv": 60.0, "c.csv": 90.0, "held.csv": 75.0}
    scale = np.append(law.scale(), [1.0, 1.0])
    made = {}
    for name, imposed in stresses.items():

        def change(t, scaled, imposed=imposed):
            state = scale * scaled
            rate = state[-1]
            carried = law.stress(state[:-2], rate)[0, 1] + solvent * rate
            grown = (imposed - carried) / inertia
            return np.concatenate([law.change(state[:-2], rate), [rate, grown]]) / scale

        start = np.concatenate([law.rest(), [0.0, 0.0]]) / scale
        found = solve_ivp(change, (0.0, times[-1]), start, "LSODA", times, rtol=1e-9, atol=1e-10)
        made[name] = _crept(times, np.full(len(times), imposed), found.y[-2])
    return made


_PULLED = {"a.csv": 0.2, "b.csv": 0.6, "c.csv": 2.0, "held.csv": 1.2}


def _pulled_record(times: np.ndarray, rate: float, stress: np.ndarray) -> Record:
    columns = {"time_s": times, "hencky_rate_1_s": np.full(len(times), rate)}
    columns["tensile_stress_Pa"] = stress
    return Record(columns, "tensile_stress_Pa", {"flow": "uniaxial"})


def pulled(law: RateLaw, over_first_area: bool = False) -> Runs:
    """Return uniaxial extensions, the stress told as it is or over the first area."""
    made = {}
    for name, rate in _PULLED.items():
        times = np.linspace(0.03, 3.0 / rate, 80) if rate > 0.3 else np.linspace(0.1, 12.0, 80)
        stress = law.pull(rate, times) * (np.exp(-rate * times) if over_first_area else 1.0)
        made[name] = _pulled_record(times, rate, stress)
    return made


def stretched_otherwise(law: RateLaw, rate_at, shape: Sequence[float], told) -> Runs:
    """Return extensions of a rate that varies, and of a shape, told as uniaxial."""
    made = {}
    for name, rate in _PULLED.items():
        times = np.linspace(0.03, 3.0 / rate, 80)

        def change(t, s, rate=rate):
            return law.change(s, rate_at(rate, t) * np.diag(shape))

        states = integrate(change, law.rest(), times, scale=law.scale())
        tensors = [law.stress(s, np.zeros((3, 3))) for s in states]
        stress = np.array([one[0, 0] - one[1, 1] for one in tensors])
        made[name] = _pulled_record(times, rate, told(stress, rate, times))
    return made


def necked(law: RateLaw, begins: float = 1.5, more: float = 0.6) -> Runs:
    """Return extensions that neck, the force told over the area of a sample without a neck."""
    return stretched_otherwise(
        law,
        lambda rate, t: rate * (1 + more * max(rate * t - begins, 0.0)),
        [1.0, -0.5, -0.5],
        lambda stress, rate, times: (
            stress * np.exp(-(0.5 * more * np.maximum(rate * times - begins, 0.0) ** 2))
        ),
    )


def planar_told_uniaxial(law: RateLaw) -> Runs:
    return stretched_otherwise(law, lambda rate, t: rate, [1.0, -1.0, 0.0], lambda s, r, t: s)


def then_sheared(law: RateLaw, rate: float = 1.0) -> Runs:
    """Return uniaxial extensions, with a start-up in shear held out."""
    made = pulled(law)
    made["d.csv"] = made.pop("held.csv")
    (sheared,) = recorded(law, {"held.csv": (start_up(rate), _GROWTH)}).values()
    return {**made, "held.csv": replace(sheared, cells={"flow": "shear"})}


def _after(material: Material, flow: Flow, begin: float, after: np.ndarray, **cells) -> Record:
    """Return the record of a flow from a time on, which is its zero."""
    run = record_of(Instrument().record(material, flow, begin + after), **cells)
    return run.told(time_s=after)


def relaxing(material: Material, takes: float = 0.02) -> Runs:
    """Return relaxations after steps of strain, each put on in a declared time."""
    strains = {"a.csv": 0.5, "b.csv": 1.5, "c.csv": 3.0, "held.csv": 2.0}
    after = np.geomspace(0.02, 6.0, 60)
    return {
        name: _after(material, step_strain(strain, takes), takes, after,
                     step_strain=strain, step_time_s=takes)
        for name, strain in strains.items()
    }  # fmt: skip


def stopped(material: Material, then: Mapping[str, float] = {}) -> Runs:
    """Return stresses after a steady flow has stopped, and of start-ups beside."""
    rates = {"a.csv": 0.5, "b.csv": 1.0, "c.csv": 3.0, "d.csv" if then else "held.csv": 2.0}
    after, lasted = np.linspace(0.0, 5.0, 80), 25.0
    made = {
        name: _after(material, steps([0.0, lasted], [rate, 0.0]), lasted, after,
                     start="steady", rate_before_1_s=rate)
        for name, rate in rates.items()
    }  # fmt: skip
    starts = {name: (start_up(rate), _GROWTH) for name, rate in then.items()}
    return made | recorded(material, starts)


def strains(put_on: float) -> Runs:
    """Return steps of strain, told as at once and dated from their beginning."""
    times = np.geomspace(1.5 * put_on, 5.0, 60)
    made = {}
    for name, size in {"a.csv": 0.5, "b.csv": 1.5, "c.csv": 4.0, "held.csv": 3.0}.items():
        run = record_of(
            Instrument().record(GIESEKUS, step_strain(size, put_on), times), step_strain=size
        )
        made[name] = run.told(shear_rate_1_s=np.zeros(len(times)))
    return made
