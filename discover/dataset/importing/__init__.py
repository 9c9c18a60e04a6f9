"""From what a rheometer exports to a data folder."""

from discover.dataset.importing.convert import ImportedFolder, import_files
from discover.dataset.importing.mapping import Mapping, read_mapping
from discover.dataset.importing.registry import IMPORTERS, Importer, register_importer
from discover.dataset.importing.text_export import Block

__all__ = [
    "IMPORTERS",
    "Block",
    "ImportedFolder",
    "Importer",
    "Mapping",
    "import_files",
    "read_mapping",
    "register_importer",
]
