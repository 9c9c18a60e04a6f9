"""From a rheometer's text export to a data folder."""

from discover.dataset.importing.convert import ImportedFolder, import_files
from discover.dataset.importing.mapping import Mapping, read_mapping

__all__ = ["ImportedFolder", "Mapping", "import_files", "read_mapping"]
