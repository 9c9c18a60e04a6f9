"""Files in the shapes that the software of rheometers writes, with numbers of a Maxwell element.

Each is a text of its own, and shares nothing with the reader under test.
"""

from typing import NamedTuple

import numpy as np

G, LAMBDA = 100.0, 2.0
OMEGA = np.geomspace(0.1, 100.0, 13)
STRAINS = np.geomspace(0.001, 1.0, 9)
TIMES = np.geomspace(0.01, 10.0, 30)
RATES = np.geomspace(0.01, 100.0, 11)
START = 30.0 * (1.0 - np.exp(-TIMES / LAMBDA))
DECAY = G * np.exp(-TIMES / LAMBDA)


class Export(NamedTuple):
    """A file, what it holds, and what has to be told beside it.

    Attributes
    ----------
    shape
        Which software and format.
    name
        Of the file.
    text
        What stands in it.
    holds
        Files of the data folder that has to come of it: columns by their names, in SI units. Of
        a run, `cells` of the table of runs stand under that key.
    options
        Of the import, where the file does not say what is needed.
    encoding
        Of the file.
    """

    shape: str
    name: str
    text: str
    holds: dict[str, dict]
    options: tuple[str, ...] = ()
    encoding: str = "utf-8"


def moduli(omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return G′ and G″ in Pa."""
    x = omega * LAMBDA
    return G * x**2 / (1.0 + x**2), G * x / (1.0 + x**2)


def softening(strain: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return moduli in Pa at 10 rad/s that fall with strain."""
    storage, loss = moduli(np.full_like(strain, 10.0))
    return storage / (1.0 + strain**2), loss / (1.0 + strain**2)


def _lines(*columns: np.ndarray, mark: str = "\t", comma: bool = False, before: str = "") -> list:
    rows = [before + mark.join(map(repr, map(float, row))) for row in zip(*columns, strict=True)]
    return [row.replace(".", ",") for row in rows] if comma else rows


_SWEEP = {"lve.csv": {"omega_rad_s": OMEGA, "Gp_Pa": moduli(OMEGA)[0], "Gpp_Pa": moduli(OMEGA)[1]}}
_AMPLITUDES = {
    "amplitude_sweep.csv": {
        "strain": STRAINS,
        "omega_rad_s": np.full(9, 10.0),
        "Gp_Pa": softening(STRAINS)[0],
        "Gpp_Pa": softening(STRAINS)[1],
    }
}
_CURVE = {"flow_curve.csv": {"shear_rate_1_s": RATES, "stress_Pa": 3.0 * RATES}}


def _run(name: str, cells: dict, **columns: np.ndarray) -> dict:
    return {name: {**columns, "cells": cells}}


def exports() -> list[Export]:
    """Return a file of each shape."""
    return [
        *_trios(),
        _ares(),
        *_rheocompass(),
        _rspace(),
        _rheowin(),
        *_reptate(),
        *_without_names(),
        *_header_constants(),
        _two_header_rows(),
    ]


def _trios() -> list[Export]:
    made = []
    for shape, name, mark in (("TRIOS, text", "trios.txt", "\t"), ("TRIOS, CSV", "trios.csv", ",")):
        names = mark.join(
            ("Angular frequency", "Oscillation strain", "Storage modulus", "Loss modulus")
        )
        units = mark.join(("rad/s", "%", "MPa", "kPa"))
        a, b = softening(STRAINS)
        rows = [f"Filename{mark}a.tri", f"Gap{mark}1000.0 µm", "[step]", "Amplitude sweep - 1"]
        rows += [names, units]
        rows += _lines(np.full(9, 10.0), 100 * STRAINS, a * 1e-6, b * 1e-3, mark=mark)
        a, b = moduli(OMEGA)
        rows += ["", "[step]", "Frequency sweep - 2", names, units]
        rows += _lines(OMEGA, np.ones(13), a * 1e-6, b * 1e-3, mark=mark)
        rows += ["", "[step]", "Flow sweep - 3", mark.join(("Stress", "Shear rate", "Step time"))]
        rows += [mark.join(("Pa", "1/s", "min"))]
        rows += _lines(3.0 * RATES, RATES, np.arange(1.0, 12.0), mark=mark)
        holds = {**_AMPLITUDES, **_SWEEP, **_CURVE}
        made.append(Export(f"{shape}: three steps", name, "\n".join(rows), holds))
    rise, still = 0.2 + 0.1 * TIMES, np.zeros(30)
    fall = rise[-1] - 0.2 * (1.0 - np.exp(-TIMES))
    rows = []
    for step, stress, strain in (("Creep - 1", still + 50, rise), ("Recovery - 2", still, fall)):
        rows += ["[step]", step, "Step time\tStress\tStrain", "s\tPa\t%"]
        rows += [*_lines(TIMES, stress, 100 * strain), ""]
    whole = _run(
        "creep-1.csv",
        {"control": "stress"},
        time_s=np.concatenate([TIMES, 10.0 + TIMES]),
        stress_Pa=np.repeat([50.0, 0.0], 30),
        strain=np.concatenate([rise, fall]),
    )
    made.append(Export("TRIOS, text: creep and recovery", "creep.txt", "\n".join(rows), whole))
    return made


def _ares() -> Export:
    rows = ["TA Instruments LIMS export format version\t0", "[Header]", "Run date\t1/2/2023"]
    rows += ["[Step]", "Step name\tFrequency sweep (150 °C)", "Number of points\t13"]
    rows += ["Variables\tTemperature\tAngular frequency\tStorage modulus\tLoss modulus"]
    rows += ["Units\t°C\trad/s\tPa\tPa"]
    rows += _lines(np.full(13, 150.0), OMEGA, *moduli(OMEGA), before="Data point\t")
    shape = "LIMS of an ARES: rows of data points"
    return Export(shape, "ares.txt", "\n".join(rows), _SWEEP, encoding="cp1252")


def _rheocompass() -> list[Export]:
    names = ["Intervalldaten:", "Messpkt.", "Deformation", "Kreisfrequenz", "Speichermodul"]
    names += ["Verlustmodul", "Scherdeformation (Rohdaten)", "Schubspannung (Rohdaten)"]
    rows = ["Projekt:\tGel", "Test:\tLAOS 1", "Ergebnis:\tLAOS", "", "\t".join(names), ""]
    rows += ["\t\t[%]\t[rad/s]\t[kPa]\t[Pa]\t[%]\t[Pa]"]
    phase = 2.0 * np.pi * np.arange(2000) / 2000
    holds = dict(_AMPLITUDES)
    for i, (g, a, b) in enumerate(zip(STRAINS, *softening(STRAINS), strict=True), start=1):
        point = [str(i), *(repr(float(v)) for v in (100 * g, 10.0, a / 1e3, b)), "", ""]
        rows.append("\t".join(["", *point]).replace(".", ","))
        strain, stress = g * np.sin(phase), g * (a * np.sin(phase) + b * np.cos(phase))
        rows += _lines(100 * strain, stress, comma=True, before="\t\t\t\t\t\t")
        holds |= _run(
            f"waves-point-{i}.csv", {"start": "periodic"}, strain=strain, stress_Pa=stress
        )
    german = Export(
        "RheoCompass, German, UTF-16: sweep with 2000 rows of waveform a point",
        "waves.csv", "\r\n".join(rows), holds, encoding="utf-16",
    )  # fmt: skip
    names = ["Interval données:", "Point No.", "Intervalle Temps", "Déformation de Cisaillement"]
    names += ["Contrainte de Cisaillement", "Température"]
    rows = ["\t".join(names), "", "\t\t[s]\t[%]\t[mPa]\t[°C]"]
    columns = TIMES, np.full(30, 5.0), 50.0 * DECAY, np.full(30, 25.0)
    rows += [f"\t{i}\t{row}" for i, row in enumerate(_lines(*columns, comma=True), start=1)]
    held = _run("relaxation-run.csv", {"step_strain": 0.05}, time_s=TIMES, stress_Pa=0.05 * DECAY)
    french = Export(
        "RheoCompass, French, UTF-16: relaxation", "relaxation.csv", "\r\n".join(rows), held,
        encoding="utf-16",
    )  # fmt: skip
    rows = ["Interval data:\tPoint No.\tTime\tShear Rate\tShear Stress", "\t\t[s]\t[1/s]\t[Pa]"]
    columns = TIMES, np.full(30, 0.5), START
    rows += [f"\t{i}\t{row}" for i, row in enumerate(_lines(*columns), start=1)]
    start = _run("start.csv", {}, time_s=TIMES, shear_rate_1_s=np.full(30, 0.5), stress_Pa=START)
    english = Export(
        "RheoCompass, English, UTF-16: start-up", "start.csv", "\r\n".join(rows), start,
        encoding="utf-16",
    )  # fmt: skip
    return [german, french, english]


def _rspace() -> Export:
    rows = [
        "Action Name;Time (action)(s);Shear stress(Pa);Shear rate(s-¹);Complex shear strain(%);"
        "Frequency(Hz);Shear modulus (elastic component)(Pa);"
        "Shear modulus (viscous component)(Pa);Temperature(°C)"
    ]
    rows += [
        f"Table of shear rates;{t:g};{float(3 * r)!r};{float(r)!r};;;;;25.0".replace(".", ",")
        for r, t in zip(RATES, np.arange(11.0), strict=True)
    ]
    rows += [
        f"Frequency table;1.0;;;1.0;{row};25.0".replace(".", ",")
        for row in _lines(OMEGA / (2.0 * np.pi), *moduli(OMEGA), mark=";")
    ]
    shape = "rSpace: names of actions in the first column, s-¹, decimal commas"
    return Export(shape, "rspace.csv", "\n".join(rows), {**_CURVE, **_SWEEP})


def _rheowin() -> Export:
    rows = ["Company;Institute", "Date;1.2.2020 / 10:00", ";t in s;GP in 1/s;Tau in Pa;T in °C"]
    rows += [f"1|{n};{row}" for n, row in enumerate(
        _lines(TIMES, np.full(30, 0.15), START, np.full(30, 25.0), mark=";"), start=1)]  # fmt: skip
    rows += [f"2|{n};{row}" for n, row in enumerate(
        _lines(10.0 * np.arange(1, 12), RATES, 3.0 * RATES, np.full(11, 25.0), mark=";"),
        start=1)]  # fmt: skip
    holds = _run("rheowin-1.csv", {}, time_s=TIMES, stress_Pa=START) | _CURVE
    shape = "RheoWin: segment and row in the first column"
    return Export(shape, "rheowin.csv", "\n".join(rows), holds, encoding="cp1252")


def _reptate() -> list[Export]:
    x = np.linspace(0.0, 4.0 * np.pi, 200)
    sine, answer = 2.0 * np.sin(x), 3.0 * np.sin(x + 0.5)
    run = {"time_s": TIMES}
    files = (
        ("tts", ["Mw=10;T=160;", "w G' G''", "rad/s Pa Pa", *_lines(OMEGA, *moduli(OMEGA))],
         _SWEEP),
        # RepTate divides this column by the rate, whatever stands above it
        ("shear", ["gdot=0.5;T=160;", "time\th", "s\tPa-s", *_lines(TIMES, 2.0 * TIMES)],
         _run("reptate.csv", {}, **run, stress_Pa=2.0 * TIMES, shear_rate_1_s=np.full(30, 0.5))),
        ("uext", ["gdot=0.1;T=160", *_lines(TIMES, 7.0 * TIMES)],
         _run("reptate.csv", {"flow": "uniaxial"}, **run, tensile_stress_Pa=7.0 * TIMES)),
        ("laos", ["omega=1.0;gamma=2.0;", "#Time(s)\tStrain(-)\ttau_yx(Pa)",
                  *_lines(x, sine, answer)],
         _run("reptate.csv", {"start": "periodic"}, strain=sine, stress_Pa=answer)),
        ("creep", ["T=150;stress=10;", "t\tstrain", "s\t-", *_lines(TIMES, 0.1 * TIMES)],
         _run("reptate.csv", {"control": "stress"}, **run, strain=0.1 * TIMES)),
    )  # fmt: skip
    return [
        Export(f"RepTate .{suffix}", f"reptate.{suffix}", "\n".join(rows), holds)
        for suffix, rows, holds in files
    ]


def _without_names() -> list[Export]:
    time = 0.02 * np.arange(400)
    strain, rate = 2.0 * np.sin(3.0 * time), 6.0 * np.cos(3.0 * time)
    stress = 40.0 * np.sin(3.0 * time + 0.4) + 5.0 * np.sin(9.0 * time + 1.0)
    tables = ("MITlaos", (time, strain, stress)), ("SPP", (time, strain, rate, stress))
    return [
        Export(
            f"{shape}: no names", f"{shape.lower()}.txt", "\n".join(_lines(*columns, mark="  ")),
            _run(f"{shape.lower()}.csv", {"start": "periodic"}, strain=strain, stress_Pa=stress),
        )
        for shape, columns in tables
    ]  # fmt: skip


def _header_constants() -> list[Export]:
    torque = _lines(TIMES, 1e3 * START * np.pi * 0.0125**3 / 2.0)
    rest = ["Gap [µm]: 800", "Shear rate = 6 1/min", "", "Time [s]\tTorque [mN.m]", *torque]
    columns = {"time_s": TIMES, "stress_Pa": START, "shear_rate_1_s": np.full(30, 0.1)}
    told = "--geometry", "plate_plate:radius_mm=12.5,gap_mm=0.8"
    return [
        Export(
            "Torque, with radius, gap and rate in lines above", "header.txt",
            "\n".join(["Radius: 12.5 mm", *rest]), _run("header.csv", {}, **columns),
        ),
        Export(
            "The same, with a masked radius", "masked.txt",
            "\n".join(["Radius: 00.0 mm", *rest]), _run("masked.csv", {}, **columns), told,
        ),
    ]  # fmt: skip


def _two_header_rows() -> Export:
    rows = ["Frequency,Complex viscosity,Phase angle", "Hz,Pa.s,°"]
    a, b = moduli(OMEGA)
    columns = OMEGA / (2.0 * np.pi), np.hypot(a, b) / OMEGA, np.degrees(np.arctan2(b, a))
    rows += _lines(*columns, mark=",")
    shape = "Units in a second row; complex viscosity and δ"
    return Export(shape, "angle.csv", "\n".join(rows), _SWEEP)
