"""How much the loading of a sample may differ, as a factor on what is recorded of it."""

from dataclasses import dataclass

LARGEST = 0.1
"""By more no two loadings of one sample differ; `discover.dataset.repeats` takes it so, too."""


@dataclass(frozen=True)
class Loading:
    """By how much one loading of a sample may differ from another.

    Filling, trimming and temperature differ by some per cent, as a factor on every stress that is
    recorded of one loading.

    Attributes
    ----------
    deviation
        Standard deviation of the factor.
    noise
        Relative noise of the record, where it is known.
    """

    deviation: float
    noise: float | None = None
