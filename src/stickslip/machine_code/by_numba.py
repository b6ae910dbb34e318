"""An entry of the engine as machine code that knows neither numba nor Python: a function of two
tables, from which it takes its arguments (:mod:`stickslip.machine_code.tables`)."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from llvmlite import binding as llvm
from llvmlite.ir import Constant
from numba.core import cgutils, codegen, compiler, ir, types
from numba.core.compiler_lock import global_compiler_lock
from numba.core.typing.templates import AttributeTemplate
from numba.extending import (
    infer_getattr,
    intrinsic,
    lower_getattr_generic,
    models,
    register_model,
)
from numba.np import arrayobj
from numba.np.arrayobj import make_array, populate_array

from stickslip.machine_code.caching import njit
from stickslip.machine_code.kinds import (
    ADDRESS,
    PLAIN,
    REAL_NUMBER,
    TRUTH,
    ArgumentKind,
    axis_count,
    class_called,
    dtype,
    numba_type,
    sizes,
)
from stickslip.machine_code.objects import MATHEMATICS, machine, processor

if TYPE_CHECKING:
    from stickslip.machine_code.functions import Entry

_ERRORS = frozenset(
    "numba_gil_ensure numba_gil_release numba_unpickle numba_runtime_build_excinfo_struct "
    "numba_do_raise PyBytes_FromStringAndSize PyErr_Clear PyErr_SetNone PyErr_SetObject "
    "PyErr_SetString PyErr_WriteUnraisable PyImport_ImportModule PyLong_AsVoidPtr "
    "PyObject_CallFunctionObjArgs PyObject_GetAttrString PyUnicode_FromString Py_DecRef".split()
)
_HELPERS = {
    "numba_frexp": "define double @numba_frexp(double %x, ptr %n) { "
    "%m = call double @frexp(double %x, ptr %n) ret double %m }",
    "numba_ldexp": "define double @numba_ldexp(double %x, i32 %n) { "
    "%m = call double @ldexp(double %x, i32 %n) ret double %m }",
}
_OUTSIDE = """
declare void @llvm.trap()
declare double @frexp(double, ptr)
declare double @ldexp(double, i32)
"""
_RESULTS: dict[str, Any] = {
    "None": types.void,
    "int": types.int64,
    "float": types.float64,
    "bool": types.boolean,
}
_OPTIONS: dict[str, Any] = {"error_model": "numpy", "_nrt": False}
_WORDS = {"None": "void", "int": "i64", "float": "double", "bool": "i8"}


class _Part(codegen.JITCodeLibrary):
    """Code that is only part of other code: it is neither optimised by itself nor put into
    memory."""

    def _optimize_functions(self, ll_module: Any) -> None:
        ll_module.data_layout = self._codegen._data_layout

    def _optimize_final_module(self) -> None:
        pass

    def _finalize_final_module(self) -> None:
        self._finalized = True


class _Whole(_Part):
    """Code of a function with all its parts, optimised at once."""

    def _optimize_final_module(self) -> None:
        codegen.JITCodeLibrary._optimize_final_module(self)


class Inside(compiler.Compiler):
    """numba's compiler, of functions that compiled functions call alone: they need no machine code
    of their own, nor anything by which Python could call them."""

    library: type[codegen.JITCodeLibrary] = _Part

    def define_pipelines(self) -> Any:
        """As numba does it, with other results."""
        state = self.state
        state.flags.no_compile = True
        state.flags.no_cpython_wrapper = True
        state.flags.no_cfunc_wrapper = True
        state.library = self.library(state.targetctx.codegen(), state.func_id.func_qualname)
        return super().define_pipelines()

    def _compile_core(self) -> Any:
        # numba knows a function by what Python would call, some method of C: here one that nobody
        # calls.
        made = super()._compile_core()._replace(entry_point=[].append)
        made.library._ensure_finalized()
        self.state.targetctx.insert_user_function(made.entry_point, made.fndesc, [made.library])
        return made


class _Outermost(Inside):
    """The same, of the function that C calls."""

    library = _Whole


def bitcode(function: Entry, kind: ArgumentKind, symbol: str) -> bytes:
    """The optimised code of an entry, for one kind of arguments.

    Parameters
    ----------
    function : Entry
    kind : ArgumentKind
        Of the tuple of all arguments.
    symbol : str
        Name of the function in the code.
    """
    compiled = function.inside

    @intrinsic
    def taken(typing: Any, wholes: Any, reals: Any) -> Any:
        """The arguments, out of the tables."""

        def generate(context: Any, builder: Any, signature: Any, tables: Any) -> Any:
            return _Reader(context, builder, *tables).value(kind)

        return _type_of(kind)(wholes, reals), generate

    tables = types.CPointer(types.int64), types.CPointer(types.float64)
    signature = _RESULTS[function.result](*tables)

    options: dict[str, Any] = {**_OPTIONS, "pipeline_class": _Outermost}
    outermost: Any = njit(**options)
    with _leaner_compiler():

        @outermost
        def called(wholes: Any, reals: Any) -> Any:
            return compiled(*taken(wholes, reals))  # pyright: ignore[reportCallIssue]

        dispatcher: Any = called
        dispatcher.compile(signature)
    made = dispatcher.overloads[signature.args]
    module = llvm.parse_assembly(made.library.get_llvm_str())
    _close(module, made.fndesc.llvm_func_name, symbol, function.result)
    return module.as_bitcode()


@contextmanager
def _leaner_compiler() -> Iterator[None]:
    """Have numba do less.

    To inline a function, it would copy all its names with each of its blocks, two thirds of its
    time, and only reads them. And the code would ask of every index whether it is negative and
    counts from the end, up to a fifth of the time of a motion; ours do so where they are constant.
    """
    with global_compiler_lock:
        scopes, indices = vars(ir.Scope).get("__deepcopy__"), arrayobj.fix_integer_index

        def index_of(context: Any, builder: Any, type_: Any, index: Any, size: Any) -> Any:
            if isinstance(index, Constant):
                return indices(context, builder, type_, index, size)
            return context.cast(builder, index, type_, types.intp)

        ir.Scope.__deepcopy__ = lambda self, memo: self  # pyright: ignore[reportAttributeAccessIssue]
        arrayobj.fix_integer_index = index_of
        try:
            yield
        finally:
            arrayobj.fix_integer_index = indices
            if scopes is None:
                del ir.Scope.__deepcopy__  # pyright: ignore[reportAttributeAccessIssue]
            else:
                ir.Scope.__deepcopy__ = scopes  # pyright: ignore[reportAttributeAccessIssue]


def _close(module: Any, name: str, symbol: str, result: str) -> None:
    """Have a module stand for itself: one function that C could call, and a body for what it calls
    of numba and of Python, helpers and paths for errors, none of which our functions raise."""
    outside = {function.name for function in module.functions if function.is_declaration}
    asked = {name for name in outside if not name.startswith("llvm.")} - set(MATHEMATICS)
    unknown = asked - _ERRORS - _HELPERS.keys()
    if unknown:
        raise RuntimeError(f"machine code of the engine would need {', '.join(sorted(unknown))}")
    trap = "define void @{} () {{ call void @llvm.trap() unreachable }}"
    bodies = [_HELPERS.get(name, trap.format(name)) for name in sorted(asked)]
    globals_ = [f"@{v.name} = global ptr null" for v in module.global_variables if v.is_declaration]
    module.link_in(llvm.parse_assembly("\n".join([_OUTSIDE, *globals_, *bodies])))
    for function in module.functions:
        if not function.is_declaration:
            function.linkage = "external" if function.name == name else "internal"
    word = _WORDS[result]
    value = "ret void" if word == "void" else f"%r = load {word}, ptr %result ret {word} %r"
    module.link_in(
        llvm.parse_assembly(
            f"""
declare i32 @{name}(ptr, ptr, ptr, ptr)
define {word} @{symbol}(ptr %wholes, ptr %reals) {{
  %result = alloca i64
  %error = alloca ptr
  %status = call i32 @{name}(ptr %result, ptr %error, ptr %wholes, ptr %reals)
  {value}
}}
"""
        )
    )
    module.get_function(name).linkage = "internal"
    # The parts of an array that a function does not need are not handed to it, now that nobody else
    # can call it: a fifth of the time of a Taylor step.
    passes = llvm.create_new_module_pass_manager()
    passes.add_dead_arg_elimination_pass()
    passes.add_global_dead_code_eliminate_pass()
    options = llvm.create_pipeline_tuning_options()
    passes.run(module, llvm.create_pass_builder(machine(processor()), options))


class Tables(types.Type):
    """numba's type of a tuple that stays in the tables: two addresses, where each table goes on
    with its parts.

    A part is read where it is asked for. The tuples of the engine have hundreds of parts, which
    would otherwise be handed from function to function one by one.

    Parameters
    ----------
    kind : ArgumentKind
        Of a named tuple.
    """

    def __init__(self, kind: ArgumentKind) -> None:
        self.kind = kind
        super().__init__(name=f"Tables{kind}")

    def place(self, name: str) -> int:
        """Which part has that name, from 1 on; 0 if none has."""
        fields = class_called(self.kind[0])._fields
        return fields.index(name) + 1 if name in fields else 0


def _type_of(kind: ArgumentKind) -> Any:
    """numba's type of what stands in the tables."""
    if isinstance(kind, str):
        return numba_type(kind)
    if kind[0] == PLAIN:
        return types.BaseTuple.from_types([_type_of(part) for part in kind[1:]])
    return Tables(kind)


@register_model(Tables)
class _TwoAddresses(models.StructModel):
    def __init__(self, manager: Any, type_: Any) -> None:
        super().__init__(
            manager,
            type_,
            [("wholes", types.CPointer(types.int64)), ("reals", types.CPointer(types.float64))],
        )


@infer_getattr
class _PartsOfTables(AttributeTemplate):
    key = Tables

    def generic_resolve(self, value: Any, attr: str) -> Any:
        """The type of a part; None if there is no such part."""
        place = value.place(attr)
        return _type_of(value.kind[place]) if place else None


@lower_getattr_generic(Tables)
def _part_of_tables(context: Any, builder: Any, type_: Any, value: Any, attr: str) -> Any:
    tables = cgutils.create_struct_proxy(type_)(context, builder, value=value)
    place = type_.place(attr)
    reader = _Reader(context, builder, tables.wholes, tables.reals)
    for kind in type_.kind[1:place]:
        reader.skip(kind)
    return reader.value(type_.kind[place])


class _Reader:
    """Reads values from the tables, one after the other."""

    def __init__(self, context: Any, builder: Any, wholes: Any, reals: Any) -> None:
        self.context = context
        self.builder = builder
        self.wholes = wholes
        self.reals = reals
        self.read = [0, 0]

    def skip(self, kind: ArgumentKind) -> None:
        """Go past a value of that kind."""
        self.read = [at + size for at, size in zip(self.read, sizes(kind), strict=True)]

    def value(self, kind: ArgumentKind) -> Any:
        """The next value, of that kind."""
        if isinstance(kind, str):
            return self._array(kind) if ":" in kind else self._number(kind)
        if kind[0] == PLAIN:
            parts = [self.value(part) for part in kind[1:]]
            return self.context.make_tuple(self.builder, _type_of(kind), parts)
        made = cgutils.create_struct_proxy(Tables(kind))(self.context, self.builder)
        made.wholes = self._at(self.wholes, 0)
        made.reals = self._at(self.reals, 1)
        self.skip(kind)
        return made._getvalue()

    def _at(self, table: Any, which: int) -> Any:
        return self.builder.gep(table, [self.context.get_constant(types.intp, self.read[which])])

    def _next(self, table: Any, which: int) -> Any:
        """The next entry of a table; nobody writes there."""
        found = self.builder.load(self._at(table, which))
        found.set_metadata("invariant.load", self.builder.module.add_metadata([]))
        self.read[which] += 1
        return found

    def _number(self, kind: str) -> Any:
        if kind == REAL_NUMBER:
            return self._next(self.reals, 1)
        whole = self._next(self.wholes, 0)
        if kind.startswith(ADDRESS):
            return self._function(kind, whole)
        # A truth value is one bit here.
        return self.builder.trunc(whole, cgutils.bool_t) if kind == TRUTH else whole

    def _array(self, kind: str) -> Any:
        """An array whose entries lie one after the other, owned by whoever calls."""
        array = make_array(numba_type(kind))(self.context, self.builder)
        address = self._next(self.wholes, 0)
        shape = [self._next(self.wholes, 0) for _ in range(axis_count(kind))]
        size = self.context.get_constant(types.intp, dtype(kind).itemsize)
        strides = []
        stride = size
        for length in reversed(shape):
            strides.insert(0, stride)
            stride = self.builder.mul(stride, length)
        populate_array(
            array,
            data=self.builder.inttoptr(address, array.data.type),
            shape=shape,
            strides=strides,
            itemsize=size,
            meminfo=None,
        )
        return array._getvalue()

    def _function(self, kind: str, address: Any) -> Any:
        """A function of a system, as numba hands functions over."""
        made = cgutils.create_struct_proxy(numba_type(kind))(self.context, self.builder)
        nothing = cgutils.voidptr_t(None)
        made.c_addr = self.builder.inttoptr(address, cgutils.voidptr_t)
        made.py_addr = nothing
        made.jit_addr = nothing
        return made._getvalue()
