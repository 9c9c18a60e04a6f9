"""Free functions that explain what named effects leave."""

from discover.loop import LoopResult
from discover.report.free_form_words import free_form_sentence
from discover.report.plots.style import NETWORK, SHADE, Picture, figure, legend_above, picture

_AXES = {
    "recorded_stress": ("true stress (Pa)", "recorded less true stress (Pa)"),
    "drift": ("time on the instrument's clock (s)", "recorded less true stress (Pa)"),
    "rate": ("shear rate (1/s)", "recorded less true stress (Pa)"),
    "network": ("strain", "relative change of the stress"),
    "position": ("strain, as the tool stands", "recorded less true stress (Pa)"),
    "gap": ("strain, as the tool stands", "relative change of the stress"),
    "phase": ("phase of the cycle, from the largest rate (rad)", "recorded less true stress (Pa)"),
    "relaxation": ("{variable}, dimensionless", "relative change of the rate of relaxation"),
    "breakdown": ("shear rate (1/s)", "rate at which structure breaks (1/s)"),
    "slip": ("stress (Pa)", "rate taken by slip (1/s)"),
}


def free_form_picture(result: LoopResult) -> Picture | None:
    """Return each free function with its band; None where there is none."""
    forms = result.free_form
    if not forms:
        return None
    with figure(1, len(forms), width=9.0, height=2.8) as (drawing, axes):
        for panel, one in zip(axes[0], forms, strict=True):
            panel.fill_between(one.grid, one.low95, one.high95, color=SHADE, label="95 % band")
            panel.plot(one.grid, one.value, color=NETWORK, lw=1.5, label="free function")
            panel.axhline(0.0, color="0.6", lw=0.6)
            along, up = _AXES[one.slot]
            panel.set_xlabel(along.format(variable=one.variable))
            panel.set_ylabel(up)
        legend_above(drawing, axes)
        said = "; ".join(map(free_form_sentence, forms))
        return picture(
            drawing,
            "free_form",
            f"What nobody wrote down: {said}. The bands take it that it is of this variable alone.",
        )
