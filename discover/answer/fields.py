"""What is said of a law that one can use: constants, modes, how well it describes, and where."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from discover.answer.constant import Constant
from discover.answer.parts import ExpectedError, Mode, Range, Suspect
from discover.equations.equation import Equation
from discover.inference.posterior import Discrepancy
from discover.plain_numbers import plain
from discover.summary_view import Estimate

TOLERANCE = 0.05
"""Relative discrepancy that is accepted where nobody says otherwise."""

QUANTITIES = ("sigma12", "N1", "N2", "uniaxial")
"""Quantities of which an expected error is given, in the order of the table."""

EMPIRICAL = "empirical fit: "
"""Begin of the title of a sum of effects that the field has no name for."""


@dataclass(frozen=True)
class AnswerFields:
    """What is said of a law that one can use, as `Answer` has it.

    `constants`: of the law, dimensionless or with units; moduli and times that were fitted among
        them.
    `modes`, `solvent_viscosity_Pa_s`: linear part of the fluid.
    `temperature_C`: of its moduli and times; None where unknown.
    `shift_factors`: a_T, relaxation times over those at `temperature_C`, by temperature of the runs
        in °C, where these were shifted.
    `error`, `noise`: relative residual of the fitted runs, and relative noise, mean over runs.
    `discrepancy`: size of what it leaves, noise subtracted; None where unknown.
    `expected_error`: by quantity of `QUANTITIES`; one that is missing has no data.
    `equation`: law written out; None where it cannot be.
    `shown`: law as a page shows it where it cannot be written out, constants that differ from mode
        to mode at their mean.
    `classical`: law of the field to take instead where the law cannot be written out.
    `written`: a law that is no `equation`, by format: ``latex``, ``python``, ``formula`` (LaTeX
        alone; of a law that is `shown`, what its h holds besides).
    `alternative`: what comes next to this law, one short sentence; empty where it is settled.
    `best_classical`: the best law of the field with its constants, and its error, where this law
        has no name.
    """

    title: str  # law by name, as a rheologist writes it; empty where there is no law to use
    law: str | None = None  # key of `discover.laws.LAWS`; None for a law without a name
    constants: tuple[Constant, ...] = ()
    modes: tuple[Mode, ...] = ()
    solvent_viscosity_Pa_s: float = 0.0
    error: float | None = None
    noise: float | None = None
    fits_to_the_noise: bool = False  # whether what the law leaves is noise
    discrepancy: Discrepancy | None = None
    range: Range = field(default_factory=Range)  # where it may be used
    expected_error: Mapping[str, ExpectedError] = field(default_factory=dict)
    next_test: str = ""  # what to measure next, one sentence without *Next:*
    suspects: tuple[Suspect, ...] = ()  # effects of the instrument that were found or are suspected
    equation: Equation | None = field(default=None, repr=False)
    shown: Equation | None = field(default=None, repr=False)
    classical: Equation | None = field(default=None, repr=False)
    written: Mapping[str, str] = field(default_factory=dict, repr=False)
    failed: str = ""  # a test that the law failed, one short sentence; empty where none
    alternative: str = ""
    best_classical: tuple[str, float] | None = None
    instead: str = ""  # first line where there is no law to use, such as for pure noise
    tolerance: float = TOLERANCE  # relative discrepancy that is good enough
    temperature_C: float | None = None
    shift_factors: Mapping[float, float] = field(default_factory=dict)
    falls_above: str = ""  # rate above which the law's steady shear stress falls with the rate

    @property
    def is_empirical(self) -> bool:
        """Whether it is a sum of effects that the field has no name for."""
        return self.title.startswith(EMPIRICAL)

    @property
    def size(self) -> float | None:
        """Relative discrepancy; None where unknown."""
        if self.discrepancy is not None:
            return self.discrepancy.size
        return 0.0 if self.fits_to_the_noise else self.error

    @property
    def error_by_run(self) -> Mapping[str, float]:
        """Discrepancy of each run by its name; empty where unknown."""
        return {} if self.discrepancy is None else self.discrepancy.by_run

    @property
    def met_up_to(self) -> str:
        """Rate up to which each run meets the tolerance; empty where all or none do."""
        return "" if self.discrepancy is None else self.discrepancy.met_up_to

    @property
    def adequate(self) -> bool | None:
        """Whether the discrepancy is within the tolerance; None where it is unknown."""
        if not self.title or self.size is None:
            return None
        return self.size <= self.tolerance

    @property
    def estimates(self) -> list[Estimate]:
        """Constants of the law, then those of the instrument, as a summary lists them.

        One that may be zero is not determined, nor is what is suspected of the instrument where
        the law is not all there is.
        """
        own = [(one.name, one, "law", True) for one in self.constants]
        for suspect in self.suspects:
            sure = self.fits_to_the_noise and suspect.is_established
            own += [
                (f"{suspect.effect}.{c.name}", c, "instrument", sure) for c in suspect.constants
            ]
        return [
            Estimate(
                (name,), c.value, c.ci95, c.unit,
                notes={"of": of, "determined": sure and c.determined and not c.may_be_zero},
            )
            for name, c, of, sure in own
        ]  # fmt: skip

    def expected(self, quantity: str) -> ExpectedError:
        """Return the expected error of a quantity."""
        return self.expected_error.get(quantity, ExpectedError())

    @property
    def use(self) -> dict[str, Any] | None:
        """What a simulation needs, as the contract writes it; None where there is no law."""
        if not self.title:
            return None
        return plain(
            {
                "law": self.law or self.title,
                "constants": {
                    one.name: {"value": one.value, "ci95": one.ci95, "unit": one.unit}
                    for one in self.constants
                },
                "modes": self.modes,
                "solvent_viscosity_Pa_s": self.solvent_viscosity_Pa_s,
                "temperature_C": self.temperature_C,
                "shift_factors": {f"{at:g}": one for at, one in self.shift_factors.items()},
                "range": self.range.to_json(),
                "expected_error": {name: self.expected(name).inside for name in QUANTITIES},
                "expected_error_beyond": {name: self.expected(name).beyond for name in QUANTITIES},
                "why_unknown": {
                    name: one.why_unknown
                    for name in QUANTITIES
                    if not (one := self.expected(name)).is_known
                },
                "suspects": {
                    suspect.effect: {
                        one.name: {"value": one.value, "ci95": one.ci95, "unit": one.unit}
                        for one in suspect.constants
                    }
                    for suspect in self.suspects
                },
            }
        )

    def to_json(self) -> dict[str, Any]:
        """Return ``use``, ``adequate`` and ``tolerance`` as result files hold them."""
        return {"use": self.use, "adequate": self.adequate, "tolerance": self.tolerance}
