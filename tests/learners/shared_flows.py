"""Small data sets on which all tests of the sparse learner agree, so that they share programs."""

from dataclasses import replace

from discover.protocols import oscillatory_shear
from discover.simulate import synthetic_dataset
from tensor_library import build_library, parse_term

FLOWS = {f"laos_{wi:g}_{de:g}": oscillatory_shear(wi, de) for wi in (1.0, 2.0) for de in (0.5, 1.0)}

LIBRARY = build_library().extended(
    parse_term(name)
    for name in (
        "tr(sigma)*sigma",
        "tr(sigma)*gammadot",
        "tr(sigma.gammadot)*I",
        "tr(sigma)^2*sigma",
        "(exp(epsilon*tr(sigma))-1)*sigma",
    )
)
"""The eight tensors, the twins of Johnson–Segalman, and the terms of both PTT laws."""


def small_dataset(law, parameters=None, noise=0.0, seed=0, n_samples=65):
    return synthetic_dataset(
        law, parameters, protocol=FLOWS, noise=noise, seed=seed, n_samples=n_samples, duration=8.0
    )


def with_normal_stresses(dataset):
    """Return the runs with their exact normal stress differences as if measured."""
    names = "first_normal_stress_difference", "second_normal_stress_difference"
    return [
        replace(run, **{name: getattr(dataset.exact[run.name], name) for name in names})
        for run in dataset
    ]
