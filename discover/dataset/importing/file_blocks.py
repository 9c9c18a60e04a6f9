"""The numbered tables of a file: its blocks, and the tests that one block holds."""

from pathlib import Path

from discover.dataset.importing.mapping import Mapping
from discover.dataset.importing.readings import Readings
from discover.dataset.importing.registry import blocks_of_importer
from discover.dataset.importing.side_by_side import tests_side_by_side
from discover.dataset.importing.stacked import tests_in_rows
from discover.dataset.importing.text_export import Block, blocks_of_rows, require_blocks
from discover.dataset.importing.text_rows import read_rows
from discover.dataset.importing.waveforms import without_names
from discover.errors import InputError


def blocks_of_file(path: Path, mapping: Mapping) -> list[tuple[int, Block]]:
    """Return the tables of a file with their numbers, from 1; those that the user chose.

    Raises InputError if it cannot be read, holds no table, or none of those chosen.
    """
    layout = mapping.layout
    found = blocks_of_importer(path, layout.format)
    if found is None:
        rows = read_rows(path, layout.delimiter, layout.decimal, layout.encoding)
        found = blocks_of_rows(rows, layout.header_row)
        if not any(Readings.of(block, mapping, path.name).columns for block in found):
            wave = without_names(rows)
            found = found if wave is None else [wave]
        require_blocks(found, path.name)
    parts = [
        part
        for block in found
        for one in tests_side_by_side(block)
        for part in tests_in_rows(one, mapping, path.name)
    ]
    blocks = list(enumerate(parts, start=1))
    if mapping.blocks is None:
        return blocks
    chosen = [pair for pair in blocks if pair[0] in mapping.blocks]
    if not chosen:
        raise InputError(
            f"{path.name} has {len(blocks)} blocks of numbers; none of those asked for "
            f"({', '.join(map(str, mapping.blocks))}). Correct --block."
        )
    return chosen
