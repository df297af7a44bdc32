"""CasADi expressions -> LLVM code that evaluates them for many windows at once, one window per lane of a vector.

The instruction list of an SX function becomes straight-line code over vectors of LANES doubles. Values that depend on
uniform inputs only (parameters) are computed once, as scalars, before the loops. A function is f(state, row
inputs, lane inputs, uniform inputs) -> (next state, others ...). Its kernel runs over blocks of lanes and, inside, over
rows. Without a state it is evaluated once per row. Arrays hold components first and lanes last:

    state (S, N) or (H + 1, S, N), row inputs (H, I, N), lane inputs (I, N), uniform inputs (I,), others (H, O, N).
"""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from .ops import import_casadi

LANES = 8
"""Doubles per vector: one register with AVX-512, two with AVX2."""
ROLES = ("state", "row", "lane", "uniform")

_VECTOR, _SCALAR = f"<{LANES} x double>", "double"
_ARITHMETIC = {"OP_ADD": "fadd", "OP_SUB": "fsub", "OP_MUL": "fmul", "OP_DIV": "fdiv"}
_INTRINSIC = {"OP_SQRT": "sqrt", "OP_FABS": "fabs", "OP_EXP": "exp", "OP_LOG": "log", "OP_SIN": "sin", "OP_COS": "cos",
              "OP_FLOOR": "floor", "OP_CEIL": "ceil", "OP_POW": "pow", "OP_CONSTPOW": "pow", "OP_COPYSIGN": "copysign",
              "OP_FMIN": "minimum", "OP_FMAX": "maximum"}
_LIBRARY = {"OP_TAN": "tan", "OP_ASIN": "asin", "OP_ACOS": "acos", "OP_ATAN": "atan", "OP_ATAN2": "atan2",
            "OP_SINH": "sinh", "OP_COSH": "cosh", "OP_TANH": "tanh", "OP_ERF": "erf", "OP_FMOD": "fmod",
            "OP_HYPOT": "hypot", "OP_EXPM1": "expm1", "OP_LOG1P": "log1p"}
_COMPARE = {"OP_LT": "olt", "OP_LE": "ole", "OP_EQ": "oeq", "OP_NE": "une"}


class Value(NamedTuple):
    """A number in the code: its name, whether it is one scalar for all lanes, whether it is a truth (i1)."""

    name: str
    uniform: bool
    truth: bool = False


@dataclass
class Kernel:
    """LLVM text of a kernel named ``kernel`` and the sizes of what goes in and out.

    Called with (pointers of all inputs, of all outputs, N, first lane, end lane, rows, step between states).
    """

    text: str
    roles: tuple[str, ...]
    inputs: tuple[tuple[int, int], ...]
    outputs: tuple[tuple[int, int], ...]


@dataclass
class _Writer:
    """Lines of code before all loops (``head``) and inside them (``body``), and what has been declared."""

    head: list[str] = field(default_factory=list)
    body: list[str] = field(default_factory=list)
    declared: dict[str, str] = field(default_factory=dict)
    splats: dict[str, str] = field(default_factory=dict)
    count: int = 0

    def new(self) -> str:
        self.count += 1
        return f"%v{self.count}"

    def emit(self, uniform: bool, code: str) -> str:
        name = self.new()
        (self.head if uniform else self.body).append(f"  {name} = {code}")
        return name

    def number(self, value: Value) -> Value:
        """A truth as 0.0 or 1.0."""
        if not value.truth:
            return value
        one = "i1" if value.uniform else f"<{LANES} x i1>"
        kind = _SCALAR if value.uniform else _VECTOR
        return Value(self.emit(value.uniform, f"uitofp {one} {value.name} to {kind}"), value.uniform)

    def truth(self, value: Value) -> Value:
        """A number as whether it is not 0."""
        if value.truth:
            return value
        kind, zero = (_SCALAR, constant(0.0)) if value.uniform else (_VECTOR, "zeroinitializer")
        return Value(self.emit(value.uniform, f"fcmp une {kind} {value.name}, {zero}"), value.uniform, True)

    def spread(self, value: Value) -> str:
        """A value as a vector; uniform ones are copied to all lanes once, before the loops."""
        if not value.uniform:
            return value.name
        if value.name not in self.splats:
            one = "i1" if value.truth else _SCALAR
            many = f"<{LANES} x {one}>"
            single = self.emit(True, f"insertelement {many} poison, {one} {value.name}, i32 0")
            self.splats[value.name] = self.emit(
                True, f"shufflevector {many} {single}, {many} poison, <{LANES} x i32> zeroinitializer")
        return self.splats[value.name]

    def named(self, value: Value, uniform: bool) -> str:
        return value.name if uniform else self.spread(value)


def constant(value: float) -> str:
    """A double in LLVM's exact spelling."""
    return f"0x{struct.unpack('<Q', struct.pack('<d', value))[0]:016X}"


def kernel(function: Any, roles: Sequence[str]) -> Kernel:
    """Code of a casadi.Function; ``roles`` of its inputs, the first may be ``state`` (then output 0 is the next one).

    Raises ValueError for roles that do not fit and for operations without a translation.
    """
    function = function if function.is_a("SXFunction") else function.expand()
    shapes_in = tuple(function.size_in(i) for i in range(function.n_in()))
    shapes_out = tuple(function.size_out(i) for i in range(function.n_out()))
    if len(roles) != len(shapes_in) or set(roles) - set(ROLES) or "state" in roles[1:]:
        raise ValueError(f"{len(shapes_in)} inputs need a role each of {', '.join(ROLES)}; only the first may be state")
    if "state" in roles and shapes_in[0] != shapes_out[0]:
        raise ValueError(f"state {shapes_in[0]} and next state {shapes_out[0]} differ in shape")
    if not all(function.sparsity_in(i).is_dense() for i in range(len(shapes_in))):
        raise ValueError("inputs of a compiled function have to be dense")
    writer = _Writer()
    results = _translate(function, roles, writer)
    rows_out = [_dense_rows(function.sparsity_out(i)) for i in range(len(shapes_out))]
    stateful = roles[0] == "state"
    for (output, element), value in results.items():
        row = rows_out[output][element]
        base = "%next" if stateful and output == 0 else f"%out{output}.row"
        _store(writer, base, row, writer.spread(writer.number(value)))
    return Kernel(_assemble(writer, roles, shapes_in, shapes_out), tuple(roles), shapes_in, shapes_out)


def _dense_rows(sparsity: Any) -> list[int]:
    """Place of every structural element in the dense array, columns one after another."""
    rows, starts, height = sparsity.row(), sparsity.colind(), sparsity.size1()
    return [r + c * height for c in range(sparsity.size2()) for r in rows[starts[c]:starts[c + 1]]]


def _element(writer: _Writer, base: str, element: int) -> str:
    """Address of lane %l of a component; %N lanes lie between components."""
    offset = writer.emit(False, f"mul i64 %N, {element}")
    return writer.emit(False, f"getelementptr double, ptr {base}, i64 {offset}")


def _store(writer: _Writer, base: str, element: int, vector: str) -> None:
    writer.body.append(f"  store {_VECTOR} {vector}, ptr {_element(writer, base, element)}, align 8")


def _load(writer: _Writer, role: str, which: int, element: int) -> Value:
    if role == "uniform":
        address = writer.emit(True, f"getelementptr double, ptr %in{which}, i64 {element}")
        return Value(writer.emit(True, f"load double, ptr {address}, align 8"), True)
    base = "%now" if role == "state" else f"%{role}{which}"
    return Value(writer.emit(False, f"load {_VECTOR}, ptr {_element(writer, base, element)}, align 8"), False)


def _translate(function: Any, roles: Sequence[str], writer: _Writer) -> dict[tuple[int, int], Value]:
    """Instruction by instruction; work registers are renamed, so that every value is written once."""
    ca = import_casadi()
    names = {getattr(ca, name): name for name in dir(ca) if name.startswith("OP_")}
    work: dict[int, Value] = {}
    loaded: dict[tuple[int, int], Value] = {}
    results: dict[tuple[int, int], Value] = {}
    for k in range(function.n_instructions()):
        operation = names[function.instruction_id(k)]
        given, out = function.instruction_input(k), function.instruction_output(k)
        if operation == "OP_OUTPUT":
            results[out[0], out[1]] = work[given[0]]
        elif operation == "OP_INPUT":
            place = (given[0], given[1])
            if place not in loaded:
                loaded[place] = _load(writer, roles[given[0]], *place)
            work[out[0]] = loaded[place]
        elif operation == "OP_CONST":
            work[out[0]] = Value(constant(function.instruction_constant(k)), True)
        else:
            work[out[0]] = _operation(writer, operation, [work[i] for i in given])
    return results


def _operation(writer: _Writer, operation: str, given: list[Value]) -> Value:
    uniform = given[0].uniform and given[-1].uniform
    kind = _SCALAR if uniform else _VECTOR
    if operation in _ARITHMETIC:  # most of what there is
        a, b = (writer.named(writer.number(value), uniform) for value in given)
        return Value(writer.emit(uniform, f"{_ARITHMETIC[operation]} contract {kind} {a}, {b}"), uniform)

    def emit(code: str) -> Value:
        return Value(writer.emit(uniform, code), uniform)

    if operation == "OP_NOT":
        one = "i1" if uniform else f"<{LANES} x i1>"
        value = writer.named(writer.truth(given[0]), uniform)
        zero = "false" if uniform else "zeroinitializer"
        return Value(writer.emit(uniform, f"icmp eq {one} {value}, {zero}"), uniform, True)
    if operation in ("OP_AND", "OP_OR"):
        one = "i1" if uniform else f"<{LANES} x i1>"
        a, b = (writer.named(writer.truth(v), uniform) for v in given)
        return Value(writer.emit(uniform, f"{operation[3:].lower()} {one} {a}, {b}"), uniform, True)
    if operation == "OP_IF_ELSE_ZERO":
        one, zero = ("i1", constant(0.0)) if uniform else (f"<{LANES} x i1>", "zeroinitializer")
        condition = writer.named(writer.truth(given[0]), uniform)
        value = writer.named(writer.number(given[1]), uniform)
        return emit(f"select {one} {condition}, {kind} {value}, {kind} {zero}")
    a, *rest = (writer.named(writer.number(v), uniform) for v in given)
    b = rest[0] if rest else ""
    if operation in _COMPARE:
        return Value(writer.emit(uniform, f"fcmp {_COMPARE[operation]} {kind} {a}, {b}"), uniform, True)
    if operation == "OP_NEG":
        return emit(f"fneg {kind} {a}")
    if operation in ("OP_SQ", "OP_TWICE"):
        return emit(f"{'fmul' if operation == 'OP_SQ' else 'fadd'} contract {kind} {a}, {a}")
    if operation == "OP_INV":
        one = writer.named(Value(constant(1.0), True), uniform)
        return emit(f"fdiv {kind} {one}, {a}")
    if operation == "OP_ASSIGN":
        return Value(a, uniform)
    if operation == "OP_SIGN":
        return _sign(writer, a, uniform)
    if operation in _INTRINSIC:
        name = f"llvm.{_INTRINSIC[operation]}.{'f64' if uniform else f'v{LANES}f64'}"
        writer.declared[name] = f"declare {kind} @{name}({', '.join([kind] * len(given))})"
        return emit(f"call {kind} @{name}({', '.join(f'{kind} {x}' for x in [a, *rest])})")
    if operation in _LIBRARY:
        return _library_call(writer, _LIBRARY[operation], [a, *rest], uniform)
    raise ValueError(f"no translation of the operation {operation[3:].lower()}")


def _sign(writer: _Writer, a: str, uniform: bool) -> Value:
    """-1, 0 or 1."""
    kind, zero = (_SCALAR, constant(0.0)) if uniform else (_VECTOR, "zeroinitializer")
    above = writer.number(Value(writer.emit(uniform, f"fcmp ogt {kind} {a}, {zero}"), uniform, True))
    below = writer.number(Value(writer.emit(uniform, f"fcmp olt {kind} {a}, {zero}"), uniform, True))
    return Value(writer.emit(uniform, f"fsub {kind} {above.name}, {below.name}"), uniform)


def _library_call(writer: _Writer, name: str, given: list[str], uniform: bool) -> Value:
    """A function of the C library, lane by lane."""
    writer.declared[name] = f"declare double @{name}({', '.join([_SCALAR] * len(given))})"
    if uniform:
        return Value(writer.emit(True, f"call double @{name}({', '.join(f'double {x}' for x in given)})"), True)
    result = "poison"
    for lane in range(LANES):
        single = [writer.emit(False, f"extractelement {_VECTOR} {x}, i32 {lane}") for x in given]
        found = writer.emit(False, f"call double @{name}({', '.join(f'double {x}' for x in single)})")
        result = writer.emit(False, f"insertelement {_VECTOR} {result}, double {found}, i32 {lane}")
    return Value(result, False)


def _assemble(writer: _Writer, roles: Sequence[str], shapes_in: Sequence[tuple[int, int]],
              shapes_out: Sequence[tuple[int, int]]) -> str:
    """The whole module: heads, the loop over blocks of lanes, and in it the loop over rows."""
    stateful = roles[0] == "state"
    arguments = [f"ptr %in{i}" for i in range(len(roles))] + [
        f"ptr %out{i}" for i in range(len(shapes_out))] + [
        "i64 %N", "i64 %first", "i64 %end", "i64 %rows", "i64 %stride"]
    lane, row = [], []
    for i, (role, shape) in enumerate(zip(roles, shapes_in, strict=True)):
        if role == "lane":
            lane.append(f"  %lane{i} = getelementptr double, ptr %in{i}, i64 %l")
        elif role == "row":
            row += [f"  %skip{i} = mul i64 %width{i}, %j", f"  %from{i} = add i64 %skip{i}, %l",
                    f"  %row{i} = getelementptr double, ptr %in{i}, i64 %from{i}"]
            writer.head.append(f"  %width{i} = mul i64 %N, {shape[0] * shape[1]}")
    for i, shape in enumerate(shapes_out):
        if stateful and i == 0:
            row += ["  %before = mul i64 %stride, %j", "  %at = add i64 %before, %l", "  %after = add i64 %at, %stride",
                    "  %now = getelementptr double, ptr %out0, i64 %at",
                    "  %next = getelementptr double, ptr %out0, i64 %after"]
        else:
            writer.head.append(f"  %size{i} = mul i64 %N, {shape[0] * shape[1]}")
            row += [f"  %gone{i} = mul i64 %size{i}, %j", f"  %to{i} = add i64 %gone{i}, %l",
                    f"  %out{i}.row = getelementptr double, ptr %out{i}, i64 %to{i}"]
    return "\n".join([
        *writer.declared.values(), f"define void @kernel({', '.join(arguments)}) {{", "start:", *writer.head,
        "  %any = icmp slt i64 %first, %end", "  %some = icmp sgt i64 %rows, 0", "  %work = and i1 %any, %some",
        "  br i1 %work, label %block, label %done",
        "block:", "  %l = phi i64 [ %first, %start ], [ %l.next, %block.end ]", *lane, "  br label %loop",
        "loop:", "  %j = phi i64 [ 0, %block ], [ %j.next, %loop ]", *row, *writer.body,
        "  %j.next = add i64 %j, 1", "  %more = icmp slt i64 %j.next, %rows",
        "  br i1 %more, label %loop, label %block.end",
        "block.end:", f"  %l.next = add i64 %l, {LANES}", "  %left = icmp slt i64 %l.next, %end",
        "  br i1 %left, label %block, label %done", "done:", "  ret void", "}", ""])
