"""LaTeX of effects as SVG, for formulas that come as text."""

import html
import io
import re

from matplotlib.figure import Figure

from discover.report.plots.style import INK, Picture, only_settings

_REPLACEMENTS = (
    (r"\mathrel{+}=", r"\,+\!=\,"),
    (r"\mathrel{-}=", r"\,-\!=\,"),
    (r"\operatorname{tr}", r"\mathrm{tr}\,"),
    (r"\operatorname", r"\mathrm"),
    (r"\tfrac", r"\frac"),
    (r"\dfrac", r"\frac"),
    (r"\boldsymbol", r"\mathbf"),
    (r"\bm", r"\mathbf"),
    (r"\text{", r"\mathrm{"),
    (r"\left", ""),
    (r"\right", ""),
    (r"\;", r"\ "),
)


def formula(latex: str, name: str) -> str:
    """Return a formula as inline SVG, or in plain signs where matplotlib cannot set it.

    `latex`: without dollar signs. `name`: unique on the page.
    """
    text = latex.strip().strip("$")
    for old, new in _REPLACEMENTS:
        text = text.replace(old, new)
    buffer = io.StringIO()
    try:
        with only_settings({"svg.fonttype": "path", "svg.hashsalt": "discover"}):
            drawing = Figure(figsize=(0.01, 0.01))
            drawing.text(0, 0, f"${text}$", fontsize=12, color=INK)
            drawing.savefig(
                buffer,
                format="svg",
                bbox_inches="tight",
                pad_inches=0.02,
                transparent=True,
                metadata={"Date": None, "Creator": None},
            )
    except (ValueError, RuntimeError):
        return f"<code>{html.escape(plain(latex))}</code>"
    # matplotlib leaves the source in a comment
    drawn = re.sub(r"<!--.*?-->", "", buffer.getvalue(), flags=re.S)
    picture = Picture(name, plain(latex), drawn)
    height = picture.svg.split('height="')[1].split('"')[0]
    return picture.inline.replace("<svg ", f'<svg class="formula" style="height:{height}" ', 1)


_LETTERS = dict(
    alpha="α", beta="β", gamma="γ", delta="δ", epsilon="ε", varepsilon="ε", zeta="ζ", eta="η",
    theta="θ", Theta="Θ", kappa="κ", lambda_="λ", mu="μ", nu="ν", xi="ξ", pi="π", rho="ρ",
    sigma="σ", tau="τ", phi="φ", chi="χ", psi="ψ", omega="ω", Omega="Ω", Delta="Δ", Lambda="Λ",
    Gamma="Γ", Sigma="Σ",
)  # fmt: skip
_SIGNS = dict(
    cdot=" · ", times=" × ", to=" → ", sum="Σ ", int="∫ ", partial="∂", infty="∞", nabla="∇",
    le=" ≤ ", leq=" ≤ ", ge=" ≥ ", geq=" ≥ ", approx=" ≈ ", pm=" ± ", quad=" ", left="", right="",
)  # fmt: skip
_SAID = {name.rstrip("_"): sign for name, sign in (_LETTERS | _SIGNS).items()}
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
    return _SAID.get(name, name if name.isalpha() else " ")


def _argument(tokens: list[str]) -> str:
    while tokens and tokens[-1].isspace():
        tokens.pop()
    return _next(tokens) if tokens else ""
