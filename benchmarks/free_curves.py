"""Flaws that no dictionary holds, found as curves: each beside the true one.

Start-up and oscillations by scipy (`independent`), 1 % noise, a Maxwell fluid declared. The loop
tries its whole dictionary, as it does by default. Printed are the curve's place and variable, the
nearest closed form, the share of the curve whose 95 % band holds the truth, the largest error over
the largest value, and what is left of the runs fitted and held out without the curve and with it.

    python benchmarks/free_curves.py --picture docs/curves.svg
"""

import argparse
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from independent import WhiteMetzner
from independent.instruments import JUDGE, as_it_is, curve_records
from independent.flow import Flow
from independent.folders import write_folder
from independent import Giesekus
from independent.instruments import Instrument, Recording
from independent.material import Material
from independent import Thixotropic

import discover as dc
from discover.closed_loop import LoopResult
from discover.closed_loop.results.free_curve import FreeForm
from discover.report.plots.style import legend_above, panels_of, picture

MODULUS, TIME = 100.0, 1.0
SCALE = {"modulus": MODULUS, "relaxation_time": TIME}
SOUND, GIESEKUS = Instrument(), Giesekus(0.3, **SCALE)
LIMIT, SLIP, BREAKDOWN = 60.0, 0.4 / MODULUS**3, 0.03


def _on_bearing(run: Recording, flow: Flow) -> np.ndarray:
    return run.stress + _of_bearing(flow.strain(run.time))


def _of_bearing(strain: np.ndarray) -> np.ndarray:
    return 3.0 * np.sin(2.0 * np.pi * strain / 9.0)


def _wobbling(run: Recording, flow: Flow) -> np.ndarray:
    return run.stress * (1.0 + _of_wobble(flow.strain(run.time)))


def _of_wobble(strain: np.ndarray) -> np.ndarray:
    return 0.1 * np.sin(2.0 * np.pi * strain / 20.0)


@dataclass(frozen=True)
class Flaw:
    """What is there and in no dictionary.

    Attributes
    ----------
    title, axes
        Of its panel; what is drawn against what.
    true
        The curve that is there, of the variable of the one found.
    material, instrument
        What was measured, and on what.
    read
        What the transducer makes of the stress of a run in a flow.
    """

    title: str
    axes: tuple[str, str]
    true: Callable[[np.ndarray], np.ndarray]
    material: Material = GIESEKUS
    instrument: Instrument = SOUND
    read: Callable[[Recording, Flow], np.ndarray] = as_it_is


FLAWS = {
    "saturates": Flaw(
        "a transducer that saturates at 60 Pa",
        ("stress (Pa)", "recorded − true (Pa)"),
        lambda stress: LIMIT * np.tanh(stress / LIMIT) - stress,
        read=lambda run, _: LIMIT * np.tanh(run.stress / LIMIT),
    ),
    "slips": Flaw(
        "slip with the third power of the stress",
        ("stress (Pa)", "slip (1/s)"),
        lambda stress: SLIP * stress**3,
        instrument=Instrument(slip=SLIP, slip_power=3.0),
    ),
    "relaxes": Flaw(
        "White–Metzner: relaxation of the rate",
        ("λγ̇", "added rate of relaxation"),
        np.sqrt,
        material=WhiteMetzner(0.5, 1.0, **SCALE),
    ),
    "breaks": Flaw(
        "a structure that the square of the rate breaks",
        ("shear rate (1/s)", "breakdown (1/s)"),
        lambda rate: BREAKDOWN * rate**2,
        material=Thixotropic(GIESEKUS, BREAKDOWN, 5.0, rate_power=2.0),
    ),
    "hums": Flaw(
        "a hum of 3 Pa",
        ("time (s)", "recorded − true (Pa)"),
        lambda time: 3.0 * np.sin(0.9 * time),
        read=lambda run, _: run.stress + 3.0 * np.sin(0.9 * run.time),
    ),
    "bears": Flaw(
        "a bearing's torque, by where it stands",
        ("strain", "recorded − true (Pa)"),
        _of_bearing,
        read=_on_bearing,
    ),
    "wobbles": Flaw(
        "a cone that wobbles by 10 %",
        ("strain", "relative change of the stress"),
        _of_wobble,
        read=_wobbling,
    ),
}


def loop_on(flaw: Flaw, seed: int) -> LoopResult:
    """Return the loop on records of a flaw."""
    runs = curve_records(flaw.material, flaw.instrument, flaw.read, seed)
    with tempfile.TemporaryDirectory() as folder:
        data = dc.load_dataset(write_folder(Path(folder), runs))
        base = dc.Fluid(dc.make_law("ucm"), MODULUS, TIME)
        return dc.close_loop(data, base, held_out=[JUDGE])


def line(name: str, flaw: Flaw, loop: LoopResult) -> str:
    """Return what was found, in a line."""
    before = loop.error_after
    if not loop.free_form:
        return f"{name}: {loop.verdict}, no curve; {_errors(before)} left"
    found = loop.free_form[0]
    true = flaw.true(found.grid)
    held = np.mean((found.low95 <= true) & (true <= found.high95))
    off = np.max(np.abs(found.value - true)) / np.max(np.abs(true))
    return (
        f"{name}: {loop.verdict}, {found.slot} of {found.variable} beside "
        f"{', '.join(found.beside) or 'nothing'}, nearest {found.nearest}; band holds {held:.0%}, "
        f"off by {off:.1%} at most; {_errors(before)} without it, {_errors(found.error)} with it"
    )


def _errors(error) -> str:
    return ", ".join(f"{value:.2%}" for value in (error.fit, error.held_out))


def draw(found: dict[str, FreeForm]) -> str:
    """Return the picture: each curve with its band, and the true one."""
    with panels_of(len(found), columns=2, width=9.0, height=2.8) as (drawing, axes, panels):
        for panel, (name, curve) in zip(panels, found.items(), strict=True):
            flaw = FLAWS[name]
            panel.fill_between(
                curve.grid, curve.low95, curve.high95, alpha=0.3, label="found, 95 % band", lw=0
            )
            panel.plot(curve.grid, curve.value, label="found")
            panel.plot(curve.grid, flaw.true(curve.grid), "k--", lw=1.0, label="what is there")
            panel.set_title(flaw.title)
            panel.set_xlabel(flaw.axes[0])
            panel.set_ylabel(flaw.axes[1])
        legend_above(drawing, axes)
        return picture(
            drawing,
            "curves",
            "Flaws that no dictionary holds, as the loop finds them in records with 1 % noise: "
            "each curve with its band, and the curve that is there.",
        ).adaptive


def main() -> None:
    """Ask, print what was found, and draw it."""
    parser = argparse.ArgumentParser(description="flaws found as curves")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="*", choices=[*FLAWS], default=[*FLAWS])
    parser.add_argument("--picture", type=Path)
    asked = parser.parse_args()
    found = {}
    for name in asked.only:
        loop = loop_on(FLAWS[name], asked.seed)
        print(line(name, FLAWS[name], loop), flush=True)
        if loop.free_form:
            found[name] = loop.free_form[0]
    if asked.picture and found:
        asked.picture.write_text(draw(found), "utf-8")


if __name__ == "__main__":
    main()
