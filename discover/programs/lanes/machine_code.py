"""Machine code of a function written for LLVM, with the loops that hold it."""

import ctypes
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Any

import llvmlite.binding as llvm
import llvmlite.ir as ir

from discover.programs import store
from discover.programs.lanes.arithmetic import DOUBLE, DOUBLES, INTEGER

_NAME = "predict"

Place = Any
"""Where something lies: a whole number, known or of LLVM."""

# arrays of NumPy begin at any double
_ALIGNED = 8

# how far LLVM optimises what is written here, and the machine code that it makes of it, 0 to 3
_LEVELS = 2, 2

# Of code with large products of matrices, as a network's: else it takes four times as long to make,
# and three quarters of the time to run
_LEVELS_OF_LARGE = 1, 0


class Writing:
    """A function of counts and of arrays while it is being written.

    `counts`, `arrays`: names of its arguments: whole numbers first, then addresses. Those of `wide`
    hold eight doubles at each place, those of `whole` whole numbers, the others a double.
    """

    def __init__(
        self, counts: Sequence[str], arrays: Sequence[str], wide: Sequence[str],
        whole: Sequence[str],
    ):  # fmt: skip
        self.module = ir.Module("lanes")
        self.module.triple = llvm.get_process_triple()
        held = {name: DOUBLES if name in wide else DOUBLE for name in arrays}
        held |= dict.fromkeys(whole, INTEGER)
        kinds = [*(INTEGER for _ in counts), *(held[name].as_pointer() for name in arrays)]
        function = ir.Function(self.module, ir.FunctionType(ir.VoidType(), kinds), _NAME)
        self.counts = dict(zip(counts, function.args, strict=False))
        self.arrays = dict(zip(arrays, function.args[len(counts) :], strict=True))
        for address in self.arrays.values():
            address.add_attribute("noalias")
        self.builder = ir.IRBuilder(function.append_basic_block("entry"))

    def load(self, name: str, place: Place) -> Any:
        """Return what an array holds at a place."""
        found: Any = self.builder.load(self._address(name, place))
        if found.type == DOUBLES:
            found.align = _ALIGNED
        return found

    def store(self, value: Any, name: str, place: Place) -> None:
        """Let an array hold a value at a place."""
        stored: Any = self.builder.store(value, self._address(name, place))
        if value.type == DOUBLES:
            stored.align = _ALIGNED

    def _address(self, name: str, place: Place) -> Any:
        place = INTEGER(place) if isinstance(place, int) else place
        return self.builder.gep(self.arrays[name], [place], inbounds=True)

    def at(self, *places: tuple[Place, Place]) -> Any:
        """Return the sum of indices times the strides of their axes."""
        total: Any = INTEGER(0)
        for index, stride in places:
            index = INTEGER(index) if isinstance(index, int) else index
            stride = INTEGER(stride) if isinstance(stride, int) else stride
            total = self.builder.add(total, self.builder.mul(index, stride))
        return total

    @contextmanager
    def loop(self, count: Place, goes_on: Callable[[], Any] | None = None) -> Iterator[Any]:
        """Write what is done for each number below a count, as long as something holds."""
        builder = self.builder
        count = INTEGER(count) if isinstance(count, int) else count
        head, body, after = (builder.append_basic_block(name) for name in ("head", "body", "after"))
        before = builder.block
        builder.branch(head)
        builder.position_at_end(head)
        number = builder.phi(INTEGER)
        number.add_incoming(INTEGER(0), before)
        inside = builder.icmp_signed("<", number, count)
        if goes_on is not None:
            inside = builder.and_(inside, goes_on())
        builder.cbranch(inside, body, after)
        builder.position_at_end(body)
        yield number
        number.add_incoming(builder.add(number, INTEGER(1)), builder.block)
        builder.branch(head)
        builder.position_at_end(after)

    def compiled(self, is_large: bool = False) -> bytes:
        """Return the machine code of the function."""
        self.builder.ret_void()
        of_passes, of_machine = _LEVELS_OF_LARGE if is_large else _LEVELS
        module, machine = llvm.parse_assembly(str(self.module)), _machine(of_machine)
        module.verify()
        tuning = llvm.create_pipeline_tuning_options(speed_level=of_passes)
        # all is in lanes already, and the loops are long
        tuning.slp_vectorization = tuning.loop_vectorization = tuning.loop_unrolling = False
        passes = llvm.create_pass_builder(machine, tuning)
        passes.getModulePassManager().run(module, passes)
        return machine.emit_object(module)


def callable_of(code: bytes, counts: int, arrays: int) -> Callable[..., None]:
    """Return the function of a machine code, which takes whole numbers and addresses.

    `code`: from `Writing.compiled`. `counts`, `arrays`: how many of each it takes.
    """
    machine = _machine(_LEVELS[1])
    engine = llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine)
    engine.add_object_file(llvm.ObjectFileRef.from_data(code))
    engine.finalize_object()
    kind = ctypes.CFUNCTYPE(None, *[ctypes.c_int64] * counts, *[ctypes.c_void_p] * arrays)
    function = kind(engine.get_function_address(_NAME))

    def call(*arguments: int) -> None:
        # the engine owns the code, and lives as long as this does
        assert engine is not None
        function(*arguments)

    return call


def kept(made_from: Any, write: Callable[[], tuple[bytes, bool]]) -> bytes:
    """Return machine code for this processor as `discover.programs.store.kept` does."""
    return store.kept((_LEVELS, _LEVELS_OF_LARGE, *_processor(), made_from), write)


def _machine(level: int) -> llvm.TargetMachine:
    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    cpu, features = _processor()
    target = llvm.Target.from_default_triple()
    return target.create_target_machine(cpu=cpu, features=features, opt=level)


@cache
def _processor() -> tuple[str, str]:
    features = llvm.get_host_cpu_features().flatten()
    if llvm.get_default_triple().startswith("x86_64"):
        # registers as wide as there are: by default LLVM keeps to half of them. Of a feature that
        # a processor has not, LLVM complains on standard error
        features = f"{features},-prefer-256-bit"
    return llvm.get_host_cpu_name(), features
