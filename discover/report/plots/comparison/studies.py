"""Loss, high Deborah numbers, sweeps over a parameter, coefficients."""

import numpy as np

from discover.comparison.comparison import Comparison
from discover.learners.registry import learner_title
from discover.report.plots.comparison.flows import curves, units
from discover.report.plots.style import Picture, figure, learner_style, legend_above, picture
from discover.words import readable


def loss_picture(comparison: Comparison) -> Picture:
    """Return the loss of each learner against its iterations."""
    outcomes = {n: o for n, o in comparison.outcomes.items() if o.loss_history[0].size}
    with figure(1, max(len(outcomes), 1), height=2.6) as (drawing, axes):
        for panel, (name, outcome) in zip(axes[0], outcomes.items(), strict=False):
            iterations, losses = outcome.loss_history
            positive = np.where(np.isfinite(losses), np.maximum(losses, 1e-30), np.nan)
            panel.semilogy(iterations, positive, color=learner_style(name)["color"])
            panel.set_title(learner_title(name))
            panel.set_xlabel(
                "support refitted" if name == "tensor_sindy" else "optimiser iteration"
            )
            panel.set_ylabel(
                "best squared relative misfit" if name == "tensor_sindy" else "training loss"
            )
        return picture(
            drawing,
            "loss",
            "Loss while learning. The sparse learner's is the best misfit so far over the supports "
            "it refitted; the two scales are not comparable.",
        )


def third_harmonic(stress: np.ndarray) -> float:
    """Return I₃/I₁ of one cycle, sampled evenly with the end equal to the beginning.

    Zero for an ellipse.
    """
    spectrum = np.abs(np.fft.rfft(stress[:-1]))
    return float(spectrum[3] / spectrum[1]) if spectrum[1] > 0 else 0.0


def high_deborah_picture(comparison: Comparison) -> Picture | None:
    """Return Lissajous curves that become elliptical as De grows."""
    flows = comparison.flows_of("high_deborah")
    if not flows:
        return None
    stress_unit, _, rate_label = units(comparison)
    with figure(1, len(flows), height=2.8) as (drawing, axes):
        for panel, flow in zip(axes[0], flows, strict=True):
            for label, style, stresses in curves(comparison, flow):
                if "sigma12" in stresses:
                    # the first sample is rest at t = 0, the others one late cycle
                    panel.plot(flow.rate[1:], stresses["sigma12"][1:], label=label, **style)
            harmonic = third_harmonic(flow.reference["sigma12"][1:])
            deborah = float(np.max(np.asarray(flow.protocol.frequencies)))
            panel.set_title(f"De = {deborah:g}, I₃/I₁ = {100 * harmonic:.2g} %")
            panel.set_xlabel(f"shear rate {rate_label}")
        axes[0, 0].set_ylabel("σ₁₂" + stress_unit)
        legend_above(drawing, axes)
        return picture(
            drawing,
            "high_deborah",
            "γ̇ = 3 cos(De t), one cycle after the transient. As De grows the stress has no time to "
            "change the structure within a cycle, and the strain, 3/De, falls: the curve becomes "
            "an ellipse (quasi-linear LAOS) although the rate is large. A law that names the rate, "
            "such as Johnson–Segalman's, would bend it at any De if the strain were above one. "
            "I₃/I₁ is the third harmonic of the truth over the first.",
        )


def sweep_picture(comparison: Comparison) -> Picture | None:
    """Return stress in the test flow, and errors, over the swept parameter."""
    points = comparison.sweep
    if not points:
        return None
    from discover.laws.registry import LAWS
    from discover.report.plots.style import TRUTH_STYLE

    laws = list(dict.fromkeys(p.law for p in points))
    values = list(dict.fromkeys(p.value for p in points))
    stress_unit, _, rate_label = units(comparison)
    with figure(len(laws), len(values) + 1, width=11.0, height=2.4) as (drawing, axes):
        for row, law in zip(axes, laws, strict=True):
            mine = [p for p in points if p.law == law]
            for panel, point in zip(row, mine, strict=False):
                late = point.flow.times > 0.75 * point.flow.times[-1]
                rate = point.flow.rate[late]
                truth = point.flow.reference["sigma12"][late]
                panel.plot(rate, truth, label="truth", **TRUTH_STYLE)
                for name, outcome in point.outcomes.items():
                    prediction = outcome.predictions[point.flow.key]
                    if prediction is not None:
                        panel.plot(
                            rate,
                            prediction["sigma12"][late],
                            label=learner_title(name),
                            **learner_style(name),
                        )
                panel.set_title(f"{readable(point.parameter)} = {point.value:g}")
                panel.set_xlabel(rate_label)
            row[0].set_ylabel(f"{LAWS[law].title}\nσ₁₂{stress_unit}")
            for name in mine[0].outcomes:
                for quantity, marker in (("sigma12", "o"), ("N1", "^")):
                    errors = [p.errors()[name][quantity] for p in mine]
                    row[-1].semilogy(
                        [p.value for p in mine],
                        [np.nan if e is None else 100.0 * max(e, 1e-8) for e in errors],
                        marker=marker,
                        markersize=4,
                        color=learner_style(name)["color"],
                        label=f"error, {'σ₁₂' if quantity == 'sigma12' else 'N₁'}, "
                        f"{learner_title(name)}",
                    )
            row[-1].set_title("error in this flow (%)")
            row[-1].set_xlabel(readable(points[0].parameter))
        legend_above(drawing, axes, columns=4)
        return picture(
            drawing,
            "sweep",
            f"The comparison again over {readable(points[0].parameter)}, "
            f"in {points[0].flow.title}: late Lissajous curves of σ₁₂, and on the right the "
            "relative errors of σ₁₂ and N₁.",
        )
