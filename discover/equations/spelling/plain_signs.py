"""LaTeX in plain signs, to be read aloud or on a terminal."""

import re

from tensor_library.notation import greek_letter

_SIGNS = dict(
    cdot=" · ", times=" × ", to=" → ", sum="Σ ", int="∫ ", partial="∂", infty="∞", nabla="∇",
    le=" ≤ ", leq=" ≤ ", ge=" ≥ ", geq=" ≥ ", approx=" ≈ ", pm=" ± ", quad=" ", left="", right="",
)  # fmt: skip
_FONTS = {"mathrm", "mathbf", "mathrel", "text", "operatorname", "boldsymbol", "bm"}
_ACCENTS = {"dot": "\u0307", "ddot": "\u0308", "hat": "\u0302", "bar": "\u0304", "tilde": "\u0303"}


def plain(latex: str) -> str:
    """Return a formula in plain signs, to be read aloud or where it cannot be set."""
    tokens = re.findall(r"\\[A-Za-z]+|\\.|\s+|.", latex.strip().strip("$"), flags=re.S)
    tokens.reverse()
    return re.sub(r"\s+", " ", _until_brace(tokens)).strip()


def _until_brace(tokens: list[str]) -> str:
    text = ""
    while tokens and tokens[-1] != "}":
        text += _next(tokens)
    if tokens:
        tokens.pop()
    return text


def _next(tokens: list[str]) -> str:
    """Return the next sign or group of tokens that are taken from the end of a list."""
    token = tokens.pop()
    name = token[1:]
    if token == "{":
        return _until_brace(tokens)
    if token in "^_":
        argument = _argument(tokens)
        return token + (argument if argument.isalnum() or len(argument) == 1 else f"({argument})")
    if not token.startswith("\\"):
        return token
    if name in _FONTS:
        return _argument(tokens)
    if name in _ACCENTS:
        return _argument(tokens) + _ACCENTS[name]
    if name in ("frac", "tfrac", "dfrac"):
        over, under = _argument(tokens), _argument(tokens)
        return "/".join(part if part.isalnum() else f"({part})" for part in (over, under))
    if name == "overset":
        over, under = _argument(tokens), _argument(tokens)
        return f"{under}^{over}"
    letter = greek_letter(name.removeprefix("var"))
    return letter or _SIGNS.get(name, name if name.isalpha() else " ")


def _argument(tokens: list[str]) -> str:
    while tokens and tokens[-1].isspace():
        tokens.pop()
    return _next(tokens) if tokens else ""
