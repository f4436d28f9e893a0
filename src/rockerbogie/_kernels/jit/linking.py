"""Loading of compiled kernels, each in an engine of its own, and calls by address.

A compiled kernel is always run in the form that the cache holds, also by the process that compiles it: its object file in
an execution engine of its own. In one common engine, the linker takes a callee's code from whichever object came first,
and results depend in their last bits on what was compiled before.

Numba copies the code of all callees into a caller, and optimises and stores it there again, along the whole chain of calls.
Here, a caller receives the code of small callees only, which LLVM may insert into it. It calls a larger one at the address
where that one is loaded. The linker finds it by the name of its file in the cache, which stands for all that its code depends on.
"""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import llvmlite.binding as llvm
import llvmlite.ir as llvm_ir
from numba.core.codegen import JITCPUCodegen
from numba.core.compiler import CompileResult

#: Number of LLVM instructions of the largest kernel that callers receive as code. LLVM inserts callees of up to about 50.
MOST_COPIED = 400
#: First part of the names under which kernels are called by address.
PREFIX = "rockerbogie."

#: Loaded kernels, by the names of their files. They stay in memory while the process lives: others hold their addresses.
loaded: dict[str, Any] = {}


class Stored(NamedTuple):
    """Stored form of a compiled kernel."""

    callees: list[str]  #: names of the files of the kernels that it calls by address
    payload: tuple[Any, ...]  #: as of `CompileResult._reduce`, with the code that callers receive


def reduce(result: Any, name: str) -> Stored:
    """Return what the cache stores of a fresh compile result.

    Args:
        result: numba's compile result.
        name: of the kernel's file.
    """
    payload = result._reduce()
    module = result.library._final_module
    callees = [f.name.removeprefix(PREFIX) for f in module.functions if f.is_declaration and f.name.startswith(PREFIX)]
    code = module.get_function(result.fndesc.llvm_func_name)
    size = sum(1 for block in code.blocks for _ in block.instructions)
    if size <= MOST_COPIED or b"alwaysinline" in code.attributes:
        return Stored(callees, payload)
    (library, kind, (machine_code, _)), *rest = payload
    return Stored(callees, ((library, kind, (machine_code, _call_by_address(result, name))), *rest))


def _call_by_address(result: Any, name: str) -> bytes:
    """Return what callers receive of a large kernel: a call by address, as LLVM bitcode.

    Args:
        result: numba's compile result.
        name: of the kernel's file.
    """
    convention, described = result.target_context.call_conv, result.fndesc
    module = llvm_ir.Module(name)
    module.triple, module.data_layout = result.library._final_module.triple, result.library._final_module.data_layout
    kind = convention.get_function_type(described.restype, described.argtypes)
    target, copied = (llvm_ir.Function(module, kind, f) for f in (PREFIX + name, described.llvm_func_name))
    for function in (target, copied):
        convention.decorate_function(function, described.args, described.argtypes, noalias=described.noalias)
    copied.linkage = "linkonce_odr"
    copied.attributes.add("alwaysinline")
    builder = llvm_ir.IRBuilder(copied.append_basic_block())
    builder.ret(builder.call(target, copied.args))
    return llvm.parse_assembly(str(module)).as_bitcode()


def load(target_context: Any, stored: Stored, name: str) -> Any:
    """Load a kernel, after those that it calls by address, into an engine of its own.

    Args:
        target_context: numba's context of the processor.
        stored: result of `reduce`.
        name: of the kernel's file.

    Returns:
        The compile result, ready to be called and to be linked into callers.
    """
    context = copy.copy(target_context)
    codegen = context._internal_codegen = JITCPUCodegen("rockerbogie")
    described = stored.payload[1]
    # numba reads these names from the code for callers, which has not all of them
    codegen._engine._defined_symbols |= {described.llvm_func_name, described.llvm_cpython_wrapper_name, described.env_name}
    result = CompileResult._rebuild(context, *stored.payload)._replace(target_context=target_context)
    llvm.add_symbol(PREFIX + name, result.library.get_pointer_to_function(described.llvm_func_name))
    loaded[name] = result
    return result
