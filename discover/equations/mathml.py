"""Terms of a law as MathML, which browsers typeset without any script."""

from collections.abc import Sequence

from discover.equations.equation import TermLike
from tensor_library.terms import CandidateTerm, parse_term

_SIGMA = '<mi mathvariant="normal" style="font-weight:bold">σ</mi>'
# the combining dot sits well in every font, an accent over a letter only in mathematical ones
_RATE = '<mi mathvariant="normal" style="font-weight:bold">γ̇</mi>'
_UNIT = '<mi mathvariant="normal" style="font-weight:bold">I</mi>'
_DOT = "<mo>·</mo>"
_TRACE = '<mi mathvariant="normal">tr</mi><mo>&#x2061;</mo>'


def _product(*factors: str) -> str:
    return _DOT.join(factors)


def _bracketed(content: str) -> str:
    return f"<mrow><mo>(</mo>{content}<mo>)</mo></mrow>"


_TENSORS = (
    _UNIT,
    _SIGMA,
    _RATE,
    _product(_SIGMA, _SIGMA),
    _product(_RATE, _RATE),
    _bracketed(f"{_product(_SIGMA, _RATE)}<mo>+</mo>{_product(_RATE, _SIGMA)}"),
    _bracketed(f"{_product(_SIGMA, _SIGMA, _RATE)}<mo>+</mo>{_product(_RATE, _SIGMA, _SIGMA)}"),
    _bracketed(f"{_product(_SIGMA, _RATE, _RATE)}<mo>+</mo>{_product(_RATE, _RATE, _SIGMA)}"),
)
_INVARIANTS = tuple(
    _TRACE + _bracketed(_product(*factors))
    for factors in (
        (_SIGMA,),
        (_SIGMA, _SIGMA),
        (_RATE, _RATE),
        (_SIGMA, _SIGMA, _SIGMA),
        (_RATE, _RATE, _RATE),
        (_SIGMA, _SIGMA, _RATE),
        (_SIGMA, _RATE, _RATE),
        (_SIGMA, _RATE),
    )
)


def number(value: float) -> str:
    """Return a number as MathML, four digits, powers of ten where it is very small or large."""
    text = f"{abs(value):.4g}"
    mantissa, _, exponent = text.partition("e")
    body = f"<mn>{mantissa}</mn>"
    if exponent:
        body += f"<mo>×</mo><msup><mn>10</mn><mn>{int(exponent)}</mn></msup>"
    return body


def term_mathml(name: str, inner: dict[str, float] | None = None) -> str:
    """Return a term by its canonical spelling, without `math` element."""
    term: CandidateTerm = parse_term(name)
    inner = inner or {}
    parts = []
    if term.closed_form == "exp":
        value = inner.get("epsilon")
        rate = "<mi>ε</mi>" if value is None else number(value)
        parts.append(
            _bracketed(
                f'<mi mathvariant="normal">exp</mi>{_bracketed(rate + _INVARIANTS[0])}'
                "<mo>−</mo><mn>1</mn>"
            )
        )
    elif term.closed_form == "saturating":
        value = inner.get("kappa")
        level = "<mi>κ</mi>" if value is None else number(value)
        parts.append(
            f"<mfrac><mrow>{_INVARIANTS[0]}</mrow><mrow><mn>1</mn><mo>+</mo>{level}<mo>|</mo>"
            f"{_INVARIANTS[0]}<mo>|</mo></mrow></mfrac>"
        )
    for invariant, power in zip(_INVARIANTS, term.powers, strict=True):
        if power == 1:
            parts.append(invariant)
        elif power:
            parts.append(f"<msup><mrow>{invariant}</mrow><mn>{power}</mn></msup>")
    parts.append(_TENSORS[term.tensor])
    return "<mrow>" + "<mspace width='0.15em'/>".join(parts) + "</mrow>"


def term_element(name: str, inner: dict[str, float] | None = None) -> str:
    """Return a term as a `math` element."""
    return f"<math>{term_mathml(name, inner)}</math>"


def law_element(terms: Sequence[TermLike], linear_relaxation: bool) -> str:
    """Return the whole dimensionless law as a displayed `math` element."""
    convected = f"<mover><mrow>{_SIGMA}</mrow><mo style='font-size:70%'>▽</mo></mover>"
    right = f"<mo>=</mo>{_RATE}"
    if linear_relaxation:
        right += f"<mo>−</mo>{_SIGMA}"
    for term in terms:
        sign = "−" if term.coefficient >= 0 else "+"
        size = number(term.coefficient) + "<mspace width='0.15em'/>"
        right += f"<mo>{sign}</mo>{size}{term_mathml(term.term, dict(term.inner))}"
    return f'<math display="block"><mrow>{convected}{right}</mrow></math>'
