"""A fluid that the work done on it weakens."""

from discover.effects.base import EffectParameter
from discover.effects.constitutive.viscous_heating import ViscousHeating


class SofteningByWork(ViscousHeating):
    """Relaxation times shortened by work, which the fluid forgets in a time t_r.

    The equation is that of viscous heating, and the cause is not: junctions or structure that work
    breaks, at energies that warm nothing.
    """


EFFECT = SofteningByWork(
    name="softening_by_work",
    parameters=(
        EffectParameter(
            "softening",
            "b",
            "1/Pa",
            low=0.0,
            high=10.0,
            scale="inverse_stress",
            first_trial=0.01,
            range_source="the work 1/b, σ times a strain, takes a deformation of more than 10 %: "
            "networks of chains, which are known to soften by work, are linear up to there "
            "(Treloar 1975, The Physics of Rubber Elasticity, ch. 5)",
            range_scale="inverse_stress",
        ),
        EffectParameter(
            "recovery_time",
            r"t_\mathrm{r}",
            "s",
            low=1e-3,
            high=1e6,
            scale="run_time",
            first_trial=0.3,
            range_source="like the build-up time of thixotropy, from milliseconds to never: "
            "rubber stays as soft as its first stretch made it (Mullins 1969)",
            ends=("high",),
        ),
    ),
    equation=(
        r"\lambda_k \to \lambda_k e^{-\Theta},\quad \frac{d\Theta}{dt} ="
        r" b\,\sigma\dot\gamma - \frac{\Theta}{t_\mathrm{r}}"
    ),
    source="Mullins 1969, Rubber Chem. Technol. 42, 339, and Ogden & Roxburgh 1999, Proc. R. Soc. "
    "A 455, 2861 for softening by work; that it shortens times, as heat would, is an assumption",
    check="Repeat a weak flow after a strong one, at once and after rests; the temperature does "
    "not change.",
    visible="b times the work done per volume within t_r of about 0.05.",
    complexity=3,
)
