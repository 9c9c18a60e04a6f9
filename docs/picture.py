"""Draws docs/lissajous.svg, the picture of the README: the comparison of `discover demo`.

python docs/picture.py
"""

from importlib.resources import as_file, files
from pathlib import Path

from discover.comparison.comparison import Comparison
from discover.comparison.flows import QUANTITIES
from discover.comparison.run_comparison import compare
from discover.compilation_cache import enable_compilation_cache
from discover.first_use import enable_x64
from discover.report.plots.comparison import curves
from discover.report.plots.style import Picture, figure, last_cycle, legend_above, picture
from discover.study.data import read_study
from discover.words import FIGURE_SYMBOLS

FLOW = "laos_3_1.5"
TITLES = {
    "sigma12": "σ₁₂: the kind of data that was fitted",
    "N1": "N₁: seen by no fit",
    "N2": "N₂: seen by no fit",
}


def draw(comparison: Comparison) -> Picture:
    """Return σ12, N1 and N2 against the shear rate in a flow that no fit saw."""
    flow = next(flow for flow in comparison.unseen_flows if flow.name == FLOW)
    last = last_cycle(flow.times, flow.rate)
    with figure(1, 3, width=9.0, height=2.9) as (drawing, axes):
        for panel, quantity in zip(axes[0], QUANTITIES, strict=True):
            for label, style, stresses in curves(comparison, flow):
                panel.plot(flow.rate[last], stresses[quantity][last], label=label, **style)
            panel.set_title(TITLES[quantity])
            panel.set_xlabel("λγ̇")
            panel.set_ylabel(f"{FIGURE_SYMBOLS[quantity]} / G")
        legend_above(drawing, axes)
        return picture(
            drawing,
            "lissajous",
            f"Stresses of a Giesekus fluid in {flow.title}, one cycle against the shear rate: "
            "truth, known part, and what both learners predict from σ12 of other flows with 1 % "
            "noise.",
        )


def main() -> None:
    """Run the comparison and write the picture."""
    enable_x64()
    enable_compilation_cache()
    study = files("discover.batch") / "demo_studies" / "comparison.toml"
    with as_file(study) as path:
        comparison = compare(read_study(path))
    Path(__file__).with_name("lissajous.svg").write_text(draw(comparison).adaptive, "utf-8")


if __name__ == "__main__":
    main()
