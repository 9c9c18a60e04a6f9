"""Which public data sets can be fetched: where they lie, their licence, and hashes of the files."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from discover.dataset.fetching.reptate import start_up_folder


@dataclass(frozen=True)
class PublicDataset:
    """A data set inside a published package.

    `package`, `version` in the package index.
    `licence`: what a user has to accept, in a few lines.
    `citation`: whom to cite.
    `files`: SHA-256 of every file that is used, by the end of its path in the package.
    `convert`: from the content of these files, by the same key, to those of a data folder.
    """

    title: str
    package: str
    version: str
    licence: str
    citation: str
    files: Mapping[str, str]
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
        files={
            f"data/PI_LINEAR/{name}": digest
            for name, digest in (
                (
                    "PI_94.9k_T-35.tts",
                    "b8032d7ecac424a0016bc46fd821d4cabc06f11221ae265be8610cfba23a4bd7",
                ),
                (
                    "shear/PI90k_-10C_CR001.shear",
                    "f82a6cbad0bbfea3686e72cefd80db8fdd96f3fe1fbc7d28ab4059b51f5e956f",
                ),
                (
                    "shear/PI90k_-10C_CR003.shear",
                    "28e04143c621726eaa419d413caed3abdc00225d3b4f07ac2d4d746273e3721f",
                ),
                (
                    "shear/PI90k_-10C_CR006.shear",
                    "7e524aedd7ee29436e2c8299680ed1c0e230ac6a8fbe0e8b40e619392313f166",
                ),
                (
                    "shear/PI90k_-10C_CR01.shear",
                    "0af8d34b9bc16dc13a596736509a6f91cba4437091cadfd19cf757a9d9b870c5",
                ),
                (
                    "shear/PI90k_-10C_CR03.shear",
                    "c85d091321805ae761448c3c6f7e67770b200f06532163f29a90bb6d95831ed3",
                ),
                (
                    "shear/PI90k_-10C_CR06.shear",
                    "258199abfa8b2d0695506629274420039e4787e3cef67b61c927e5c69d0fe8b3",
                ),
                (
                    "shear/PI90k_-10C_CR1.shear",
                    "47f9b4f78f100bbd5662949a7cac96c07d1e902b832419f573966bdaf8026f91",
                ),
                (
                    "shear/PI90k_-10C_CR3.shear",
                    "86fd8348800c8c52521fd3c1665bde9bc561cd01662fd20c83ea4e06d0cbbd01",
                ),
                (
                    "shear/PI90k_-23C_CR1.shear",
                    "a26b712dcf9997ed9913723960551b493d13d27f6f5988221c57be55d78719db",
                ),
                (
                    "shear/PI90k_-23C_CR2.shear",
                    "1a1f85c17e636fc9623bfae6187e12cc708d4d3829e7a0eb3dc67df7a4c21388",
                ),
                (
                    "shear/PI90k_-23C_CR5.shear",
                    "076fd2f5e92404eb961e5ab1e167d7b191d60e4d897a4294c27b907291f3eb5a",
                ),
            )
        },
        convert=start_up_folder,
    ),
}
"""Public data sets by name."""
