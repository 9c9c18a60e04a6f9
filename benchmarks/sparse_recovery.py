"""How often sparse regression finds the law that made the data, from shear stress alone.

First the noise-free table of the five laws, then recovery counts over noise seeds. Each line is
printed as soon as it is known, so the run may be interrupted at any time.
"""

import argparse
import time

# law, parameters, known relaxation, library, the terms that made the data, inner parameters
NOISE_FREE = (
    ("ucm", {}, False, {}, {"sigma": 1.0}, {}),
    (
        "johnson_segalman",
        {"xi": 0.4},
        True,
        {"degree": 1},
        {"sigma.gammadot+gammadot.sigma": 0.2},
        {},
    ),
    ("giesekus", {"alpha": 0.2}, True, {"degree": 1}, {"sigma.sigma": 0.2}, {}),
    ("ptt_linear", {"epsilon": 0.4}, True, {"degree": 1}, {"tr(sigma)*sigma": 0.4}, {}),
    (
        "ptt_exponential",
        {"epsilon": 0.4},
        True,
        {"degree": 1, "closed_forms": ("exp",)},
        {"(exp(epsilon*tr(sigma))-1)*sigma": 1.0},
        {"epsilon": 0.4},
    ),
)
NOISY = (
    ("giesekus", {"alpha": 0.2}, {}, {"sigma.sigma"}),
    ("giesekus", {"alpha": 0.2}, {"degree": 1}, {"sigma.sigma"}),
    ("ptt_linear", {"epsilon": 0.4}, {"degree": 1}, {"tr(sigma)*sigma"}),
)


def noise_free(optimizer: str) -> None:
    from discover.learners.tensor_sindy import TensorSINDy
    from discover.simulate import synthetic_dataset
    from tensor_library import build_library

    print(f"Noise-free, the paper's eight series, {optimizer}")
    for law, parameters, known, description, truth, inner in NOISE_FREE:
        dataset = synthetic_dataset(law, parameters)
        library = build_library(**description)
        model = TensorSINDy(library, optimizer, known_relaxation=known).fit(dataset)
        found = {term.term: term.coefficient for term in model.terms_}
        error = max(abs(found.get(name, 0.0) - value) for name, value in truth.items())
        spurious = max((abs(v) for name, v in found.items() if name not in truth), default=0.0)
        text = f"  {law:17} {len(library):3} terms  error {error:.1e}  spurious {spurious:.1e}"
        for term in model.terms_:
            for name, value in inner.items():
                if name in term.inner:
                    text += f"  {name} error {abs(term.inner[name] - value):.1e}"
        ties = [" + ".join(r["support"]) for r in model.result_.details["rivals"] if r["exact"]]
        print(f"{text}  {model.result_.train_seconds:.0f} s", flush=True)
        print(
            "    found", {k: round(v, 7) for k, v in found.items()}, "twins met", ties, flush=True
        )


def with_noise(noise: float, seeds: int, optimizer: str, selection: str) -> None:
    from discover.learners.tensor_sindy import TensorSINDy
    from discover.simulate import synthetic_dataset
    from tensor_library import build_library

    print(f"Noise {noise:.1%}, {seeds} seeds, {optimizer}, selected by {selection}")
    for law, parameters, description, truth in NOISY:
        library = build_library(**description)
        right, covered, started = 0, 0, time.perf_counter()
        for seed in range(seeds):
            dataset = synthetic_dataset(law, parameters, noise=noise, seed=seed)
            model = TensorSINDy(library, optimizer, selection=selection).fit(dataset)
            found = {term.term: term.coefficient for term in model.terms_}
            hit = set(found) == truth
            right += hit
            if hit:
                low, high = model.terms_[0].ci95
                covered += low <= next(iter(parameters.values())) <= high
            else:
                print(f"    seed {seed}: {found}", flush=True)
            print(
                f"  {law} {len(library)} terms: {right} of {seed + 1} right, "
                f"{(time.perf_counter() - started) / (seed + 1):.1f} s each",
                end="\r",
                flush=True,
            )
        print(
            f"  {law:12} {len(library):3} terms: right support {right} of {seeds}, interval covers "
            f"the truth in {covered}, {(time.perf_counter() - started) / seeds:.1f} s each"
        )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20, help="noise seeds; 0 skips this part")
    parser.add_argument("--noise", type=float, default=0.02, help="over the rms of each run")
    parser.add_argument("--optimizer", default="stlsq")
    parser.add_argument("--selection", default="bic", choices=("bic", "held_out"))
    parser.add_argument("--skip-noise-free", action="store_true")
    arguments = parser.parse_args()
    from discover.precision import enable_x64

    enable_x64()
    try:
        if not arguments.skip_noise_free:
            noise_free(arguments.optimizer)
        if arguments.seeds > 0:
            with_noise(arguments.noise, arguments.seeds, arguments.optimizer, arguments.selection)
    except KeyboardInterrupt:
        print("\ninterrupted; the lines above stand")


if __name__ == "__main__":
    main()
