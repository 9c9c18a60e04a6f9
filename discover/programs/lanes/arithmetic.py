"""Arithmetic on eight numbers side by side, written down for LLVM as it is asked for.

A value is a Python number, which is known while code is written, or a value of LLVM: eight doubles,
eight truths, or one truth that all eight lanes share. What is known is computed at once, and what
was computed before in the same place is not computed again.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import llvmlite.ir as ir

LANES = 8
"""Numbers side by side: as many doubles as the widest registers hold, or twice those of others."""

DOUBLE, INTEGER, TRUTH = ir.DoubleType(), ir.IntType(64), ir.IntType(1)
DOUBLES, INTEGERS = ir.VectorType(DOUBLE, LANES), ir.VectorType(INTEGER, LANES)

Value = Any
"""A number of Python or a value of LLVM."""

# Sums may be contracted with products, which rounds less often; infinities and what is not a number
# stay what they are, for a trial that runs away is told by them
_ROUNDING = ("contract", "nsz", "arcp")

# 1.5 · 2^52: added to a number of moderate size it leaves the nearest integer in the last bits
_TO_INTEGER = 6755399441055744.0
_LN2_HIGH, _LN2_LOW = 6.93147180369123816490e-01, 1.90821492927058770002e-10

# Past so many operations a function is no small one, and JAX is better at it
_MOST = 60_000


class NotTranslatable(Exception):
    """A function uses what is not known in lanes, or is too large for them."""


class Arithmetic:
    """Operations on lanes at one place of a function that is being written.

    `builder`: writes where operations are asked for.
    """

    def __init__(self, builder: ir.IRBuilder):
        self.builder = builder
        self.operations = 0
        self._known: dict[tuple, tuple[Value, tuple]] = {}

    @staticmethod
    def is_known(*values: Value) -> bool:
        """Return whether values are numbers already."""
        return not any(isinstance(value, ir.Value) for value in values)

    @staticmethod
    def is_truth(value: Value) -> bool:
        """Return whether a value is a truth yet to be found."""
        return isinstance(value, ir.Value) and getattr(value, "type", None) != DOUBLES

    def lanes(self, value: Value) -> Value:
        """Return a value as eight doubles."""
        if value is None:
            raise NotTranslatable("a part of what is only known as a whole")
        if self.is_known(value):
            return ir.Constant(DOUBLES, [float(value)] * LANES)
        return value if value.type == DOUBLES else self.chosen(value, 1.0, 0.0)

    def splat(self, value: Value) -> Value:
        """Return one double in all lanes."""
        blank = ir.Constant(DOUBLES, ir.Undefined)
        first = self.builder.insert_element(blank, value, ir.IntType(32)(0))
        return self.builder.shuffle_vector(
            first, blank, ir.Constant(ir.VectorType(ir.IntType(32), LANES), [0] * LANES)
        )

    def mark(self) -> Callable[[], None]:
        """Return what takes back all that is written from here on."""
        block: Any = self.builder.block
        blocks = self.builder.function.blocks
        count, instructions, known = len(blocks), len(block.instructions), dict(self._known)
        self.operations = 0

        def undo() -> None:
            del blocks[count:], block.instructions[instructions:]
            block.terminator = None
            self.builder.position_at_end(block)
            self._known = known

        return undo

    @contextmanager
    def apart(self) -> Iterator[None]:
        """Forget afterwards what is computed inside: other places are not reached through it."""
        before = dict(self._known)
        try:
            yield
        finally:
            self._known = before

    def _once(self, name: str, parts: tuple, write: Callable[[], Value]) -> Value:
        key = (name, *(x if self.is_known(x) else id(x) for x in parts))
        if key not in self._known:
            self.operations += 1
            if self.operations > _MOST:
                raise NotTranslatable(f"more than {_MOST} operations")
            self._known[key] = (write(), parts)  # parts are kept, so that no other takes their id
        return self._known[key][0]

    def _binary(self, name: str, x: Value, y: Value) -> Value:
        def write():
            return getattr(self.builder, name)(self.lanes(x), self.lanes(y), flags=_ROUNDING)

        return self._once(name, (x, y), write)

    def add(self, x: Value, y: Value) -> Value:
        """Return x + y."""
        if self.is_known(x, y):
            return x + y
        if self.is_known(x):
            x, y = y, x
        return x if self.is_known(y) and y == 0 else self._binary("fadd", x, y)

    def subtract(self, x: Value, y: Value) -> Value:
        """Return x − y."""
        if self.is_known(x, y):
            return x - y
        return x if self.is_known(y) and y == 0 else self._binary("fsub", x, y)

    def multiply(self, x: Value, y: Value) -> Value:
        """Return x y; what is zero already stays zero, whatever it is multiplied with."""
        if self.is_known(x, y):
            return x * y
        if self.is_known(x):
            x, y = y, x
        if self.is_known(y) and y in (0, 1):
            return 0.0 if y == 0 else x
        return self._binary("fmul", x, y)

    def divide(self, x: Value, y: Value) -> Value:
        """Return x / y."""
        if isinstance(x, int) and isinstance(y, int):
            raise NotTranslatable("a division of whole numbers")
        if self.is_known(x, y) and y != 0:
            return x / y
        if self.is_known(y) and y == 1:
            return x
        return 0.0 if self.is_known(x) and x == 0 else self._binary("fdiv", x, y)

    def negative(self, x: Value) -> Value:
        """Return −x."""
        return -x if self.is_known(x) else self._binary("fsub", 0.0, x)

    def compare(self, how: str, x: Value, y: Value, of_nothing: bool = False) -> Value:
        """Return whether x stands so to y: ``<``, ``<=``, ``>``, ``>=``, ``==`` or ``!=``.

        `of_nothing`: what is said where one of them is not a number.
        """
        if self.is_known(x, y):
            pairs = {"<": x < y, "<=": x <= y, ">": x > y, ">=": x >= y, "==": x == y}
            return pairs.get(how, x != y)
        compared = self.builder.fcmp_unordered if of_nothing else self.builder.fcmp_ordered
        name = f"{how}{of_nothing}"
        return self._once(name, (x, y), lambda: compared(how, self.lanes(x), self.lanes(y)))

    def chosen(self, which: Value, yes: Value, no: Value) -> Value:
        """Return one of two by a truth, or lane by lane by eight."""
        if self.is_known(which):
            return yes if which else no
        if yes is no or (self.is_known(yes, no) and yes == no):
            return yes
        if self.is_truth(yes) or self.is_truth(no):
            raise NotTranslatable("a choice between truths")
        return self._once(
            "select",
            (which, yes, no),
            lambda: self.builder.select(which, self.lanes(yes), self.lanes(no)),
        )

    def both(self, name: str, x: Value, y: Value) -> Value:
        """Return the logical ``and`` or ``or`` of truths."""
        for known, other in ((x, y), (y, x)):
            if self.is_known(known):
                if not isinstance(known, bool):
                    raise NotTranslatable("bits of whole numbers")
                decides = bool(known) == (name == "or")
                return bool(known) if decides else other
        if x.type != y.type:
            raise NotTranslatable("truths of all lanes with those of each")
        return getattr(self.builder, f"{name}_")(x, y)

    def opposite(self, x: Value) -> Value:
        """Return the logical not of a truth."""
        return not x if self.is_known(x) else self.builder.not_(x)

    def in_some(self, truths: Value) -> Value:
        """Return the truth whether one holds in any of the lanes."""
        bits = ir.IntType(LANES)
        return self.builder.icmp_unsigned("!=", self.builder.bitcast(truths, bits), bits(0))

    def larger(self, x: Value, y: Value) -> Value:
        """Return the larger of two; not a number where one is not."""
        return self._extreme(">", x, y)

    def smaller(self, x: Value, y: Value) -> Value:
        """Return the smaller of two; not a number where one is not."""
        return self._extreme("<", x, y)

    def _extreme(self, how: str, x: Value, y: Value) -> Value:
        if self.is_known(x, y):
            return max(x, y) if how == ">" else min(x, y)
        if self.is_known(x):
            x, y = y, x
        found = self.chosen(self.compare(how, x, y, of_nothing=True), x, y)
        if self.is_known(y):
            return found
        return self.chosen(self.compare("==", y, y), found, y)

    def size(self, x: Value) -> Value:
        """Return |x|."""
        return abs(x) if self.is_known(x) else self._intrinsic("fabs", x)

    def root(self, x: Value) -> Value:
        """Return √x; not a number below zero."""
        if self.is_known(x):
            return math.sqrt(x) if x >= 0 else math.nan
        return self._intrinsic("sqrt", x)

    def _intrinsic(self, name: str, x: Value) -> Value:
        def write():
            full, module = f"llvm.{name}.v{LANES}f64", self.builder.module
            kind = ir.FunctionType(DOUBLES, [DOUBLES])
            function = module.globals.get(full) or ir.Function(module, kind, full)
            return self.builder.call(function, [x])

        return self._once(name, (x,), write)

    def polynomial(self, x: Value, coefficients: Sequence[float]) -> Value:
        """Return a polynomial, constant first, by Estrin's scheme: fewer steps that wait."""
        terms: list[Value] = list(coefficients)
        power = x
        while len(terms) > 1:
            pairs = range(0, len(terms) - 1, 2)
            last = terms[-1:] if len(terms) % 2 else []
            terms = [self.add(terms[i], self.multiply(power, terms[i + 1])) for i in pairs] + last
            power = self.multiply(power, power)
        return terms[0]

    def exponential(self, x: Value, less_one: bool = False) -> Value:
        """Return e^x, or e^x − 1 with all its digits: 2^k (e^r − 1) + (2^k − 1), |r| ≤ ln 2/2."""
        if self.is_known(x):
            return math.expm1(x) if less_one else math.exp(x)
        name = "expm1" if less_one else "exp"
        return self._once(name, (x,), lambda: self._exponential(x, less_one))

    def _exponential(self, x: Value, less_one: bool) -> Value:
        b = self.builder
        inside = self.larger(self.smaller(x, 709.0), -708.0)
        shifted = b.fadd(b.fmul(inside, self.lanes(math.log2(math.e))), self.lanes(_TO_INTEGER))
        k = b.fsub(shifted, self.lanes(_TO_INTEGER))
        r = self.subtract(inside, self.multiply(k, _LN2_HIGH))
        r = self.subtract(r, self.multiply(k, _LN2_LOW))
        tail = self.polynomial(r, [1.0 / math.factorial(i) for i in range(1, 14)])
        tail = self.multiply(r, tail)
        bits = b.shl(b.bitcast(shifted, INTEGERS), ir.Constant(INTEGERS, [52] * LANES))
        one = ir.Constant(INTEGERS, [0x3FF0000000000000] * LANES)
        power = b.bitcast(b.add(bits, one), DOUBLES)
        if less_one:
            found = self.add(self.multiply(power, tail), self.subtract(power, 1.0))
        else:
            found = self.multiply(power, self.add(1.0, tail))
        return self.chosen(self.compare(">", x, 709.7), math.inf, found)

    def logarithm(self, x: Value) -> Value:
        """Return ln x: of zero minus infinity, below it not a number."""
        if self.is_known(x):
            return math.log(x) if x > 0 else (-math.inf if x == 0 else math.nan)
        return self._once("log", (x,), lambda: self._logarithm(x))

    def _logarithm(self, x: Value) -> Value:
        b = self.builder
        bits = b.bitcast(x, INTEGERS)
        # the mantissa between √½ and √2, so that the series is of small numbers
        above = b.sub(bits, ir.Constant(INTEGERS, [0x3FE6A09E667F3BCD] * LANES))
        exponent = b.ashr(above, ir.Constant(INTEGERS, [52] * LANES))
        shift = b.shl(exponent, ir.Constant(INTEGERS, [52] * LANES))
        mantissa = b.bitcast(b.sub(bits, shift), DOUBLES)
        offset = ir.Constant(INTEGERS, [0x4338000000000000] * LANES)
        number = b.fsub(b.bitcast(b.add(exponent, offset), DOUBLES), self.lanes(_TO_INTEGER))
        f = self.divide(self.subtract(mantissa, 1.0), self.add(mantissa, 1.0))
        series = self.polynomial(self.multiply(f, f), [2.0 / (2 * i + 1) for i in range(11)])
        found = self.multiply(number, _LN2_LOW)
        found = self.add(
            self.add(self.multiply(f, series), found), self.multiply(number, _LN2_HIGH)
        )
        # minus infinity of zero, infinity of infinity, and else not a number: x − x or 0 / 0
        beyond = self.chosen(self.compare("==", x, 0.0), -math.inf, math.nan)
        beyond = self.chosen(self.compare("==", x, math.inf), math.inf, beyond)
        inside = self.compare(">=", x, 2.2250738585072014e-308)
        inside = self.both("and", inside, self.compare("<", x, math.inf))
        return self.chosen(inside, found, beyond)

    def whole_power(self, x: Value, n: int) -> Value:
        """Return x to a whole power."""
        if n < 0:
            return self.divide(1.0, self.whole_power(x, -n))
        found: Value = 1.0
        while n:
            if n & 1:
                found = self.multiply(found, x)
            n >>= 1
            if n:
                x = self.multiply(x, x)
        return found

    def power(self, x: Value, y: Value) -> Value:
        """Return x^y; of a negative x not a number, but where y is a whole number already."""
        if self.is_known(y) and float(y).is_integer() and abs(y) < 17:
            return self.whole_power(x, int(y))
        found = self.exponential(self.multiply(y, self.logarithm(x)))
        return self.chosen(self.compare("==", y, 0.0), 1.0, found)
