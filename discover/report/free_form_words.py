"""What is said of a free function."""

from discover.loop import FreeForm
from discover.words import effect_title

_WHAT = {
    "recorded_stress": "a function of the recorded stress alone",
    "drift": "a function of the time alone",
    "rate": "a function of the shear rate alone",
    "network": "a factor that depends on the strain alone",
    "position": "a function of the tool's position alone",
    "gap": "a factor that depends on the tool's position alone",
    "phase": "a function of the phase of the cycle alone",
    "relaxation": "a rate of relaxation that depends on the {variable} alone",
    "breakdown": "a structure that flow breaks at a rate that depends on the {variable} alone",
    "slip": "a rate of slip that depends on the {variable} alone",
}


def free_form_sentence(found: FreeForm) -> str:
    """Return what a free function is and where it stands, without a full stop."""
    beside = " and ".join(map(effect_title, found.beside)) or "the declared model"
    shape = f", near to a {found.nearest} form" if found.nearest else ", near to no closed form"
    what = _WHAT[found.slot].format(variable=found.variable)
    return f"{what}{shape}, with {beside} explains the residual"
