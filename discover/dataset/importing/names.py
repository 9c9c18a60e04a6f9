"""What rheometers call the columns of their exports, in English, German and French.

Names are compared without regard to capitals, spaces, underscores and primes of another form. The
best stand first: a step's own clock before that of the whole test, the strain of the sample before
an average. Of a name of up to three letters the unit has to fit as well.
"""

import re
import unicodedata

NAMES: dict[str, tuple[str, ...]] = {
    "time": (
        "step time", "interval time", "time (action)", "segment time", "t seg", "time", "t",
        "test time", "run time", "time (sequence)", "intervallzeit", "abschnittszeit", "zeit",
        "messzeit", "intervalle temps", "temps d'intervalle", "temps", "durée",
    ),
    "shear_rate": (
        "shear rate", "rate", "gammadot", "gamma dot", "gdot", "γ̇", "ẏ", "gp",
        "scherrate", "schergeschwindigkeit", "schergefälle", "taux de cisaillement",
        "vitesse de cisaillement", "gradient de cisaillement", "gradient de vitesse",
    ),
    "stress": (
        "shear stress", "stress", "tau", "sigma", "τ", "σ", "sigma xy", "σ12", "tau yx",
        "schubspannung", "scherspannung", "contrainte de cisaillement", "contrainte",
    ),
    "strain": (
        "shear strain", "strain", "gamma", "γ", "deformation", "scherdeformation", "scherung",
        "verformung", "déformation de cisaillement", "déformation",
    ),
    "N1": (
        "n1", "first normal stress difference", "1st normal stress difference",
        "normal stress difference", "erste normalspannungsdifferenz", "1. normalspannungsdifferenz",
        "première différence de contraintes normales", "tau xx-tau yy",
    ),
    "N2": (
        "n2", "second normal stress difference", "zweite normalspannungsdifferenz",
        "deuxième différence de contraintes normales",
    ),
    "torque": ("torque", "drehmoment", "moment", "couple"),
    "angular_velocity": (
        "angular velocity", "velocity", "rotational speed", "speed", "winkelgeschwindigkeit",
        "drehzahl", "vitesse angulaire", "vitesse de rotation",
    ),
    "angle": (
        "displacement", "angular displacement", "deflection angle", "rotation angle",
        "auslenkwinkel", "drehwinkel", "déplacement angulaire", "angle de déviation",
    ),
    "normal_force": ("normal force", "axial force", "normalkraft", "force normale", "fn"),
    "omega": (
        "angular frequency", "omega", "ω", "w", "frequency", "f", "kreisfrequenz", "frequenz",
        "winkelfrequenz", "pulsation", "fréquence angulaire", "fréquence",
    ),
    "Gp": (
        "storage modulus", "g'", "gp", "g1", "shear modulus (elastic component)", "elastic modulus",
        "speichermodul", "module de stockage", "module de conservation", "module élastique",
    ),
    "Gpp": (
        "loss modulus", "g''", "gpp", "g2", "shear modulus (viscous component)", "viscous modulus",
        "verlustmodul", "module de perte", "module visqueux",
    ),
    "hencky_rate": ("hencky rate", "extension rate", "extensional rate", "elongation rate",
                    "hencky strain rate", "dehnrate", "taux d'élongation"),
    "tensile_stress": ("tensile stress", "extensional stress", "elongational stress",
                       "zugspannung", "contrainte d'élongation"),
    "hencky_strain": ("hencky strain", "hencky-dehnung", "déformation de hencky"),
    "relaxation_modulus": ("relaxation modulus", "g(t)", "gt", "relaxationsmodul",
                           "module de relaxation"),
    "compliance": ("creep compliance", "compliance", "j(t)", "j", "kriechnachgiebigkeit",
                   "nachgiebigkeit", "komplianz", "complaisance"),
    "viscosity": ("shear viscosity", "viscosity", "eta", "η", "viskosität", "scherviskosität",
                  "viscosité", "viscosité de cisaillement"),
    "strain_amplitude": (
        "oscillation strain", "complex shear strain", "strain amplitude", "γ0", "gamma0",
        "oscillation strain (cmd)", "deformationsamplitude", "amplitude de déformation",
    ),
    "stress_amplitude": (
        "oscillation stress", "complex shear stress", "stress amplitude", "schubspannungsamplitude",
        "amplitude de contrainte",
    ),
    "complex_modulus": ("complex modulus", "complex shear modulus", "g*",
                        "shear modulus (complex component)", "komplexer schubmodul",
                        "module complexe"),
    "complex_viscosity": ("complex viscosity", "η*", "eta*", "komplexe viskosität",
                          "viscosité complexe"),
    "phase_angle": ("phase angle", "delta", "δ", "phase shift angle", "phasenwinkel",
                    "phasenverschiebungswinkel", "angle de phase", "déphasage"),
    "loss_factor": ("tan(delta)", "tan delta", "tan(δ)", "tan δ", "loss factor", "damping factor",
                    "verlustfaktor", "dämpfungsfaktor", "facteur de perte",
                    "facteur d'amortissement"),
    "temperature": ("temperature", "temp", "t", "temperatur", "température"),
    "radius": ("radius", "plate radius", "cone radius", "r", "rayon"),
    "diameter": ("diameter", "plate diameter", "durchmesser", "diamètre"),
    "gap": ("gap", "measuring gap", "gap width", "h", "spalt", "messspalt", "spaltabstand",
            "entrefer"),
    "cone_angle": ("cone angle", "kegelwinkel", "angle du cône", "angle de cône"),
    "strain_wave": (
        "shear strain waveform", "strain waveform", "raw shear strain", "raw strain",
        "shear strain (for sinusoidal strain)", "scherdeformation (rohdaten)",
        "déformation de cisaillement (pour déformation sinusoïdale)",
    ),
    "stress_wave": (
        "shear stress waveform", "stress waveform", "raw shear stress", "raw stress",
        "shear stress (for sinusoidal strain)", "schubspannung (rohdaten)",
        "contrainte de cisaillement (pour déformation sinusoïdale)",
    ),
    "wave_time": ("waveform time", "raw time", "zeit (rohdaten)"),
    "point": ("point no.", "point", "messpkt.", "messpunkt", "meas. pts.", "pt no.", "point n°"),
}  # fmt: skip
"""Names of each quantity, the best first."""


def plain(name: str) -> str:
    """Return a name as it is compared."""
    name = unicodedata.normalize("NFC", name)
    name = re.sub(r"[′‘’´`]", "'", name).replace("″", "''").replace('"', "''")
    return re.sub(r"[\s_]+", " ", name).strip(" :").lower()
