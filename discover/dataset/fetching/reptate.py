"""RepTate's start-up and master-curve files as a data folder."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from discover.errors import InputError


def start_up_folder(content: Mapping[str, bytes]) -> dict[str, str]:
    """Return ``runs.csv``, ``lve.csv`` and one CSV for each start-up, by name.

    Times and rates in the source are shifted to the reference temperature; ``time_factor`` is the
    measured rate over the shifted one, so that time on the instrument is ``time_s / time_factor``.

    `content`: files of RepTate, ``*.shear`` and one ``*.tts``, by name.
    """
    rows, files = [], {}
    for name in sorted(content):
        header, numbers = _table(content[name], name)
        if name.endswith(".tts"):
            order = np.argsort(numbers[:, 0], kind="stable")
            columns = ("omega_rad_s", "Gp_Pa", "Gpp_Pa", "temperature_C_measured")
            files["lve.csv"] = _csv(dict(zip(columns, numbers[order].T[:4], strict=True)))
            continue
        rate = _number(header, "gdot", name)
        time, stress, normal, measured, temperature = numbers.T[:5]
        file = (
            f"pi_T{_plain(float(round(temperature.mean())))}_rate{_plain(float(measured[0]))}.csv"
        )
        files[file] = _csv(
            {
                "time_s": time,
                "shear_rate_1_s": np.full_like(time, rate),
                "stress_Pa": stress,
                "N1_Pa": normal,
            }
        )
        rows.append(
            {
                "file": file,
                "shear_rate_1_s_at_m35C": rate,
                "shear_rate_1_s_measured": measured[0],
                "temperature_C_measured": float(temperature.mean()),
                "time_factor": measured[0] / rate,
                "Wi_D": _number(header, "WeD", name),
                "Wi_R": _number(header, "WeR", name),
                "n_points": len(time),
                "final_strain": rate * time[-1],
                "sample_label": header.get("label", ""),
                "original_file": name.rsplit("/", 1)[-1],
            }
        )
    rows.sort(key=lambda row: row["shear_rate_1_s_at_m35C"])
    files["runs.csv"] = _csv({key: [row[key] for row in rows] for key in rows[0]})
    return files


def _table(raw: bytes, name: str) -> tuple[dict[str, str], np.ndarray]:
    lines = raw.decode("utf-8", "replace").splitlines()
    parts = (part.partition("=") for part in lines[0].split(";") if "=" in part)
    rows = [line.split() for line in lines[1:] if line.strip()]
    while rows and not _is_number(rows[0][0]):
        rows.pop(0)  # names and units of the columns
    try:
        return {key: value for key, _, value in parts}, np.array(rows, dtype=float)
    except ValueError:
        raise InputError(f"{name} is no table of numbers, though its hash is right.") from None


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _number(header: Mapping[str, str], key: str, name: str) -> float:
    try:
        return float(header[key])
    except (KeyError, ValueError):
        raise InputError(f"{name} does not give {key} in its first line.") from None


def _plain(value: float) -> str:
    return f"{value:g}".replace("-", "m").replace(".", "p")


def _csv(columns: Mapping[str, object]) -> str:
    return pd.DataFrame(columns).to_csv(index=False, float_format="%.6g", lineterminator="\n")
