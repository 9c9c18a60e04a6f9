"""What exports call each quantity, in many languages, compared word by word, however written."""

import re
import tomllib
import unicodedata
from functools import cache
from importlib.resources import files
from itertools import pairwise

# tables of names.toml that name one quantity, the better first
_PARTS = {"time": ("step_time", "time"), "omega": ("omega", "frequency")}
_GREEK = {
    "gamma": "γ", "tau": "τ", "sigma": "σ", "omega": "ω", "eta": "η", "delta": "δ",
    "epsilon": "ε", "psi": "ψ", "theta": "θ", "phi": "φ",
}  # fmt: skip
_LOOK_ALIKE = str.maketrans({"ɣ": "γ", "ɛ": "ε", "ł": "l", "ø": "o", "ı": "i", "đ": "d"})
_PRIMES = str.maketrans({
    **dict.fromkeys("′‘’´`ʹʼ＇", "'"), **dict.fromkeys('″“”"˝ʺ＂', "''"), "‴": "'''",
    **dict.fromkeys("∗⁎﹡✱", "*"),
})  # fmt: skip
_UMLAUTS = str.maketrans({"ä": "ae", "ö": "oe", "ü": "ue"})

_DOT = "\u0307"
_DOTTED = re.compile(
    rf"[γgy]{_DOT}|(?<![^\W\d_])(?:gamma|γ|g)[\s_-]*(?:dot\b|point\b|punkt\b|[·•∙⋅])"
)
_DOTTED_EPSILON = re.compile(rf"[εe]{_DOT}|(?<![^\W\d_])(?:epsilon|eps|ε|e)[\s_-]*(?:dot\b|[·•∙⋅])")
_DOT_BEFORE = re.compile(r"\bdot\W*(gamma|γ|epsilon|ε)")
_WORD = re.compile(rf"(?:[^\W_]|[{_DOT}'*+])+")
_SPELLED = re.compile(rf"({'|'.join(_GREEK)})([0-9'*+]*)")


def words_of(name: str) -> tuple[str, ...]:
    """Return the words of a name as they are compared."""
    text = unicodedata.normalize("NFKC", name.translate(_PRIMES))
    text = re.sub(rf"\s+{_DOT}", _DOT, text)
    apart = "".join(a + " " * _is_border(a, b) for a, b in pairwise(f"{text} "))
    text = unicodedata.normalize("NFD", apart.casefold().translate(_LOOK_ALIKE))
    # accents of Latin, Greek and Cyrillic; the signs of Japanese lie elsewhere
    text = "".join(c for c in text if c == _DOT or not "\u0300" <= c <= "\u036f")
    text = unicodedata.normalize("NFC", text.replace(f"g{_DOT}", f"γ{_DOT}"))
    text = _DOT_BEFORE.sub(lambda m: f"{m[1]} dot", text).replace("ġ", f"γ{_DOT}")
    text = text.replace("ẏ", f"γ{_DOT}").replace("ė", f"ε{_DOT}")
    text = _DOTTED_EPSILON.sub(f"ε{_DOT}", _DOTTED.sub(f"γ{_DOT}", text))
    return tuple(
        _SPELLED.sub(lambda m: _GREEK[m[1]] + m[2], word) if _SPELLED.fullmatch(word) else word
        for word in (w.lstrip("'") for w in _WORD.findall(text))
        if word
    )


def _is_border(a: str, b: str) -> bool:
    """Return whether a new word begins between two letters: ShearRate, 粘度η."""
    of_scripts = a.isalpha() and b.isalpha() and (a > "\u2e80") != (b > "\u2e80")
    return (a.islower() and b.isupper()) or of_scripts


def plain(name: str) -> str:
    """Return a name as it is compared, in one word."""
    return "".join(words_of(name))


@cache
def _places() -> dict[str, dict[str, int]]:
    """Return the place of each plain name in its table."""
    places: dict[str, dict[str, int]] = {}
    for section, names in shipped_names().items():
        ranks = places.setdefault(section, {})
        for one in (one for name in names for one in (name, name.translate(_UMLAUTS))):
            ranks.setdefault(plain(one), len(ranks))
    return places


def rank_of(key: str, name: str) -> int | None:
    """Return how good a name of a quantity this is, 0 the best; None if it is none."""
    ranks, before = tables_of(name), 0
    for section in _PARTS.get(key, (key,)):
        if section in ranks:
            return before + ranks[section]
        before += len(_places().get(section, ()))
    return None


@cache
def tables_of(name: str) -> dict[str, int]:
    """Return the tables in which a name stands, and its place there."""
    words = words_of(name)

    def exact(parts: tuple[str, ...]) -> dict[str, int]:
        whole = "".join(parts)
        return {key: ranks[whole] for key, ranks in _places().items() if whole in ranks}

    if known := exact(words):
        return known
    for i in range(1, len(words)):  # a name and its symbol
        first, second = exact(words[:i]), exact(words[i:])
        if both := {key: min(first[key], second[key]) for key in first if key in second}:
            return both
    return {}


@cache
def shipped_names() -> dict[str, tuple[str, ...]]:
    """Return the names of the project by the tables of ``names.toml``."""
    text = files("discover.dataset.importing").joinpath("names.toml").read_text("utf-8")
    return {
        section: tuple(name for names in lists.values() for name in names)
        for section, lists in tomllib.loads(text).items()
    }


@cache
def alternatives(table: str) -> dict[str, str]:
    """Return the regular expressions of a table of ``words.toml``, one for each key."""
    content = tomllib.loads((files("discover.dataset.importing") / "words.toml").read_text("utf-8"))
    return {key: "|".join(words) for key, words in content[table].items()}


_CODE_PAGES = ("cp1252", "cp932", "gb18030", "cp949", "big5", "cp1251", "cp1250", "utf-8")


def code_page_of(content: bytes) -> str:
    """Code page, or damaged UTF-8, of a text: the encoding in which most names are known."""
    sample = content[:20_000]

    def known(encoding: str) -> int:
        text = sample.decode(encoding, "replace")
        cells = set(re.split(r"[\t;,\r\n]|[\[(].*?[\])]", text))
        names = (cell for cell in cells if len(cell) < 80 and any(c.isalpha() for c in cell))
        return sum(bool(tables_of(name)) for name in names)

    return max(_CODE_PAGES, key=known)
