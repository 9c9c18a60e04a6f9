"""What a fit and a whole loop cost on a melt with a broad spectrum, and how exact the steps are.

A synthetic melt of 13 modes in eleven start-ups, or, where `DISCOVER_DATA` has them, the measured
runs. Prints

- the largest error of the stress on the steps of the loop, against a solution with adaptive steps
  and a tolerance of 1e-9, and the seconds of both;
- the seconds of one law's fit with the rise time of the rate, with and without compiling;
- the seconds of the whole loop with every candidate.

    python benchmarks/loop_speed.py
"""

import os
import time
from pathlib import Path

import numpy as np

FAST = "pi_Tm23_rate1.csv", "pi_Tm23_rate2.csv", "pi_Tm23_rate5.csv"
STRAIN = (0.02, 25.0)


def measured():
    """Return the melt's runs, declared model and held-out names; None where there are none."""
    from discover.dataset import load_dataset
    from discover.dataset.linear_viscoelasticity import relaxation_spectrum
    from discover.forward.declared import DeclaredModel

    folder = os.environ.get("DISCOVER_DATA")
    if not folder or not (Path(folder) / "pi95k-startup").exists():
        return None
    data = load_dataset("pi95k-startup", "time_factor")
    assert data.linear_sweep is not None
    modes = relaxation_spectrum(data.linear_sweep)
    return data, DeclaredModel.maxwell(modes.modulus, modes.relaxation_time), FAST


def synthetic():
    """Return a synthetic melt likewise: exponential PTT, a slow motor, one per cent of noise."""
    from discover.dataset import Dataset, Run
    from discover.forward.declared import DeclaredModel
    from discover.laws import Fluid, make_law
    from discover.protocols import start_up
    from discover.simulate import simulate

    times = np.geomspace(1e-3, 1e3, 13)
    moduli = 3e4 * times**-0.25
    fluid = Fluid(make_law("ptt_exponential", {"epsilon": 0.3}), moduli, times)
    generator = np.random.default_rng(0)
    runs = []
    for i, rate in enumerate(np.geomspace(1e-3, 0.3, 11)):
        when = np.geomspace(0.02, 25.0, 300) / rate
        stress = np.asarray(simulate(fluid, start_up(float(rate)), when).shear_stress)
        noisy = stress * (1.0 + 0.01 * generator.standard_normal(stress.size))
        held = np.full(when.size, rate)
        runs.append(Run(f"run_{i:02d}", when, start_up(float(rate)), held, noisy))
    unseen = tuple(run.name for run in runs[-3:])
    return Dataset("made", tuple(runs)), DeclaredModel.maxwell(moduli, times), unseen


def with_all_candidates():
    """Return a model with every candidate, and the melt's fitted runs as a batch."""
    from discover.forward import AugmentedModel, make_batch
    from discover.forward.batches import data_scales
    from discover.loop.candidates import candidates_of
    from discover.loop.runs import cut_to_strain

    data, declared, held = measured() or synthetic()
    runs = cut_to_strain([run for run in data.runs if run.name not in held], STRAIN)
    batch = make_batch(runs)
    return AugmentedModel(declared, candidates_of(None), data_scales(runs), fitted=batch), batch


def main() -> None:
    """Print errors and seconds."""
    from discover.compilation_cache import enable_compilation_cache
    from discover.precision import enable_x64

    enable_x64()
    enable_compilation_cache()
    from discover.effects import make_effect
    from discover.forward.augmented_model import AugmentedModel
    from discover.forward.batches import data_scales, make_batch
    from discover.inference.least_squares import fit_batch
    from discover.laws import Fluid, make_law
    from discover.loop import run_loop
    from discover.loop.runs import cut_to_strain
    from discover.simulate import simulate

    data, declared, held = measured() or synthetic()
    runs = cut_to_strain([run for run in data.runs if run.name not in held], STRAIN)
    print(f"{data.name}: {len(declared.modulus)} modes, {len(data.runs)} runs", flush=True)

    effects = [make_effect("ptt_exponential"), make_effect("rate_rise_time")]
    model = AugmentedModel(declared, effects, data_scales(runs))
    batch = make_batch(runs)
    theta = model.zero()
    theta[model.positions("ptt_exponential")] = 0.3
    model.predict(theta, batch)
    started = time.perf_counter()
    predicted = model.predict(theta, batch)
    ours = time.perf_counter() - started
    law = make_law("ptt_exponential", {"epsilon": 0.3})
    fluid = Fluid(law, declared.modulus, declared.relaxation_time)
    started, worst = time.perf_counter(), 0.0
    for run, row in zip(runs, predicted, strict=True):
        tight = simulate(fluid, run.protocol, run.time, rtol=1e-9, atol=1e-9)
        exact = np.asarray(tight.shear_stress)
        worst = max(worst, float(np.max(np.abs(row[: len(run)] - exact)) / np.max(exact)))
    theirs = time.perf_counter() - started
    print(
        f"all fitted runs: {1e3 * ours:.0f} ms, off by {worst:.1e} of the largest stress at most; "
        f"adaptive at 1e-9 {theirs:.1f} s with compiling",
        flush=True,
    )

    free = [p for effect in effects for p in model.positions(effect.name)]
    start = model.zero()
    start[free[0]] = 0.05
    for what in ("first", "second"):
        started = time.perf_counter()
        fit = fit_batch(model, batch, [start], [free])[0]
        print(
            f"{what} fit of exponential PTT and the rise time: {time.perf_counter() - started:.1f} "
            f"s, error {100 * np.mean(fit.run_errors):.2f} %",
            flush=True,
        )

    started, processor = time.perf_counter(), time.process_time()
    result = run_loop(data, declared, held_out=held, max_effects=5, strain=STRAIN)
    print(
        f"whole loop: {time.perf_counter() - started:.0f} s, {time.process_time() - processor:.0f} "
        f"s of processor; {', '.join(stage.effect for stage in result.stages)}; held out "
        f"{100 * (result.error_after.held_out or np.nan):.1f} %"
    )


if __name__ == "__main__":
    main()
