"""Make the data folder that the polyisoprene studies need from RepTate's own files.

python polyisoprene.py UNPACKED FOLDER, where UNPACKED holds PI_94.9k_T-35.tts and the
PI90k_*.shear of the package RepTate 1.3.3 (GPL-3.0-or-later; the data keep that licence).
"""

import sys
from pathlib import Path

import pandas as pd

unpacked, folder = map(Path, sys.argv[1:])
folder.mkdir(exist_ok=True)


def _write(name: str, table: pd.DataFrame) -> None:
    table.to_csv(folder / name, index=False, float_format="%.6g", lineterminator="\n")


def _table(path: Path, header: int, columns: str) -> pd.DataFrame:
    read = pd.read_csv(path, sep=r"\s+", skiprows=header, header=None, encoding="cp1252")
    return read.iloc[:, : len(columns.split())].set_axis(columns.split(), axis=1)


sweep = _table(unpacked / "PI_94.9k_T-35.tts", 1, "omega_rad_s Gp_Pa Gpp_Pa")
_write("lve.csv", sweep.sort_values("omega_rad_s", kind="stable"))
rows = []
for path in unpacked.glob("PI90k_*.shear"):
    first = path.read_text("cp1252").splitlines()[0]
    rate = float(dict(part.split("=", 1) for part in first.split(";") if "=" in part)["gdot"])
    run = _table(path, 3, "time_s stress_Pa N1_Pa measured celsius")
    # times and rates are those at the reference temperature; the instrument's clock ran by this
    measured, celsius = run["measured"][0], float(run["celsius"].mean())
    words = (f"{x:g}".replace("-", "m").replace(".", "p") for x in (round(celsius), measured))
    name = "pi_T{}_rate{}.csv".format(*words)
    _write(name, run[["time_s", "stress_Pa", "N1_Pa"]].assign(shear_rate_1_s=rate))
    rows.append({"file": name, "temperature_C_measured": celsius, "time_factor": measured / rate})
_write("runs.csv", pd.DataFrame(rows).sort_values("file"))
