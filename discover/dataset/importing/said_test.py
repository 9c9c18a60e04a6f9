"""Which test the words above a block say that it is: its step, its title, the name of the file."""

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

from discover.dataset.importing.text_export import Block

SaidTest = Literal[
    "creep", "recovery", "relaxation", "start_up", "ramp", "loop", "intervals", "flow_curve",
    "oscillation", "uniaxial", "planar", "biaxial",
]  # fmt: skip

_WORDS: dict[SaidTest, str] = {
    "creep": r"creep|kriech|fluage|retardation|retardaci|fluencia|scorrimento viscoso|クリープ|蠕变"
    r"|蠕變|크리프",
    "recovery": r"recover[ey]|recoil|rückstell|kriecherholung|rückkriech|recouvrance|recuperaci"
    r"|recupero|回復|回复|恢复|회복",
    # a relaxation time, modulus or spectrum is a quantity, not a test
    "relaxation": r"relaxation(?!s?[ _-]?(time|zeit|modul|spe[ck]tr))|relajaci|rilassamento"
    r"|step[ _-]strain|dehnsprung|緩和|松弛|鬆弛|완화",
    "start_up": r"start[ _-]?up|stress growth|peak hold|step[ _-](shear[ _-])?rate|anlaufversuch"
    r"|spannversuch|démarrage|arranque|avviamento|スタートアップ",
    "ramp": r"ramp",  # rampe in German and French, rampa in Spanish and Italian
    "loop": r"hysteresis|hystérésis|histéresis|isteresi|thixotrop\w* loop|flow loop"
    r"|up[ _-]?(and|&)?[ _-]?down|ヒステリシス|滞回|滯回",
    "intervals": r"3[ _-]?itt|three[ _-]interval|drei[ _-]?intervall|trois intervalles"
    r"|tres intervalos|tre intervalli|step[ _-]thixotrop",
    "flow_curve": r"flow[ _-](sweep|curve)|viscosity curve|fließkurve|viskositätskurve|courbe"
    r"|curva (de|di) (flu|visc)|steady[ _-](state[ _-])?(shear|flow|sweep)|流動曲線|流动曲线"
    r"|유동 곡선",
    "oscillation": r"laos|oscillat|oszill|oscilac|oscillaz|amplitude sweep|frequency sweep|waveform"
    r"|振動|振荡|진동",
    "uniaxial": r"uniax\w*|(?<!file )\bextensi(on|onal|ometr\w*)\b|tensile|elongation\w*|hencky"
    r"|dehnrheo\w*|dehnström\w*|zugversuch|(?<!surface )\btension\b|\bfser\b|sentmanat"
    r"|élongation\w*|elongaci|allungament|伸長|拉伸|인장",
    "planar": r"planar (ext|elong)\w*",
    "biaxial": r"(equi)?biax\w*",
}  # fmt: skip
_PATTERNS: dict[SaidTest, re.Pattern[str]] = {
    test: re.compile(words, re.IGNORECASE) for test, words in _WORDS.items()
}

_SAY_THE_TEST = re.compile(
    r"test|type|mode|experiment|method|procedure|measurement|title|name|step|segment|action"
    r"|result|versuch|messung|art|essai|ensayo|prova|interval+e?|task|試験|测试|測定",
    re.IGNORECASE,
)
_OTHERS_NAME = re.compile(r"(file|sample|user|company|geometry|instrument|operator)", re.IGNORECASE)
_LONGEST = 8
"""Words of a line beyond which it is prose, of which nothing is taken."""


@dataclass(frozen=True)
class Said:
    """What words say of a test.

    `test`: which it is.
    `words`: those that say it, as the file has them.
    `by_file_name`: whether only the name of the file says so, which the numbers overrule.
    """

    test: SaidTest
    words: str
    by_file_name: bool = False


def said_of(block: Block, file: str) -> Said | None:
    """Return which test the words nearest to a block name; None if they name none, or several.

    The name of its step comes first, then the lines above it, the nearest first, then the file's.
    """
    stem = re.sub(r"[_-]+", " ", file.rpartition(".")[0] or file)
    for words in (block.name, *_titles(block.above)):
        test = _named(words)
        if test is not None:
            return Said(test, words)
    test = _named(stem)
    return None if test is None else Said(test, file, by_file_name=True)


def _named(words: str) -> SaidTest | None:
    found: list[SaidTest] = [t for t, pattern in _PATTERNS.items() if pattern.search(words)]
    if "recovery" in found and "creep" in found:  # one run, or "recovery after creep"
        places = [_PATTERNS[test].search(words) for test in ("recovery", "creep")]
        first = min(places, key=lambda place: place.start() if place else 0)
        found.remove("creep" if first is places[0] else "recovery")
    if {"planar", "biaxial"} & set(found):
        found = [test for test in found if test != "uniaxial"]
    if {"loop", "intervals"} & set(found):  # made of ramps or of steps, and relaxing meanwhile
        found = [test for test in found if test in ("loop", "intervals")]
    if "flow_curve" in found and "ramp" in found:
        found = ["ramp"]
    return found[0] if len(found) == 1 else None


def _titles(lines: Sequence[Sequence[str]]) -> Iterator[str]:
    """Yield lines that may say which test it is, the last first."""
    for line in reversed(lines):
        cells = [cell.strip(" #%:") for cell in line if cell.strip(" #%:")]
        if not cells or len(cells) > 2:
            continue  # names and units of columns
        key, mark, value = re.sub(r"\s+", " ", ": ".join(cells)).partition(":")
        if not mark:
            key, mark, value = key.partition("=")
        is_title = not mark or (_SAY_THE_TEST.search(key) and not _OTHERS_NAME.search(key))
        words = value if mark else key
        if is_title and len(words.split()) <= _LONGEST:
            yield words.strip()
