"""What was measured, for titles: the material and the temperature that runs.csv names."""

from collections.abc import Iterable

from discover.dataset.run import Run

_MATERIAL = ("material", "sample", "sample_label")
_TEMPERATURE = ("temperature_C", "temperature_C_measured")


def material_and_temperature(runs: Iterable[Run], material: str = "") -> str:
    """Return material and temperature of some runs in words; empty where neither is told.

    `runs`: with the columns ``material``, ``sample`` or ``sample_label``, and ``temperature_C`` or
    ``temperature_C_measured``, of runs.csv. `material`: what a study calls the material, in place
    of the columns.
    """
    runs = list(runs)
    names, temperatures = [], []
    for run in runs:
        names += [str(run.metadata[key]) for key in _MATERIAL if run.metadata.get(key)][:1]
        values = (run.metadata.get(key) for key in _TEMPERATURE)
        temperatures += [round(v, 0) for v in values if isinstance(v, int | float)][:1]
    parts, told = [material] if material else list(dict.fromkeys(names)), sorted(set(temperatures))
    spelled = [f"{value:.0f}".replace("-", "−") for value in told]
    if told:
        word = " to " if len(told) > 2 else " and "
        ends = spelled if len(told) < 3 else [spelled[0], spelled[-1]]
        parts.append(f"{word.join(ends)} °C")
    return ", ".join(parts)
