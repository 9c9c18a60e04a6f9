"""From what a rheometer exports to a data folder."""

from discover.dataset.importing.convert import import_files
from discover.dataset.importing.files import IMPORTERS, register_importer
from discover.dataset.importing.mapping import Mapping
from discover.dataset.importing.text_export import Block

__all__ = ["IMPORTERS", "Block", "Mapping", "import_files", "register_importer"]
