"""Several numbers at once: what the kernels write for one element or node is done for WIDTH of them in the registers of the processor.

`Lanes` is a numba type of WIDTH doubles with the arithmetic of a number, so that a formula of `so3` or `element` takes either.

`below` asks whether all lanes are below a bound (for a series), `lane_by_lane` takes a function to the lanes that no series will do for;
both take plain numbers too. `above` is 1 in the lanes above a bound and 0 elsewhere, `total` and `largest` reduce lanes to a number. How
lanes are read from arrays and written: simd/lane_arrays.py.
"""

import math
import operator
from typing import Any

from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typeconv import Conversion
from numba.core.typing.templates import AbstractTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, lower_cast, models, overload, register_jitable, register_model

WIDTH = 8

INDEX = ir.IntType(64)
DOUBLE = ir.DoubleType()


class Lanes(types.Type):
    """Doubles side by side."""

    def __init__(self, width: int) -> None:
        self.width = width
        self.machine = ir.VectorType(DOUBLE, width)
        super().__init__(name=f"Lanes{width}")

    def can_convert_from(self, typingctx: Any, other: Any) -> Any:
        return Conversion.unsafe if isinstance(other, types.Number) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        return self if isinstance(other, types.Number) else None


lanes = Lanes(WIDTH)


@register_model(Lanes)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, dmm: Any, fe_type: Any) -> None:
        super().__init__(dmm, fe_type, fe_type.machine)


def _splat(builder: Any, kind: Lanes, value: Any) -> Any:
    one = builder.insert_element(ir.Constant(kind.machine, ir.Undefined), value, INDEX(0))
    return builder.shuffle_vector(one, one, ir.Constant(ir.VectorType(ir.IntType(32), kind.width), [0] * kind.width))


@lower_cast(types.Number, Lanes)
def _number_to_lanes(context: Any, builder: Any, fromty: Any, toty: Any, value: Any) -> Any:
    return _splat(builder, toty, context.cast(builder, value, fromty, types.float64))


# Arithmetic


def _arithmetic(function: Any, count: int, build: Any) -> None:
    """`function` of `count` numbers or lanes, at least one of them lanes, built by `build(builder, *vectors)`."""

    @infer_global(function)
    class _Typing(AbstractTemplate):
        def generic(self, args: Any, kws: Any) -> Any:
            kinds = {a for a in args if isinstance(a, Lanes)}
            fits = len(args) == count and len(kinds) == 1 and all(isinstance(a, Lanes | types.Number) for a in args)
            return signature(*[*kinds] * (count + 1)) if fits else None

    lower_builtin(function, *[Lanes] * count)(lambda context, builder, sig, args: build(builder, *args))


def _named(name: str) -> Any:
    """Builder of a call of LLVM's function `name` of vectors."""

    def build(builder: Any, *args: Any) -> Any:
        kind = args[0].type
        declared = ir.FunctionType(kind, [kind] * len(args))
        return builder.call(cgutils.get_or_insert_function(builder.module, declared, f"llvm.{name}.v{kind.count}f64"), args)

    return build


for _name, _build in (("add", "fadd"), ("sub", "fsub"), ("mul", "fmul"), ("truediv", "fdiv")):
    for _operator in (getattr(operator, _name), getattr(operator, f"i{_name}")):
        _arithmetic(_operator, 2, lambda builder, a, b, build=_build: getattr(builder, build)(a, b))
_arithmetic(operator.neg, 1, lambda builder, a: builder.fneg(a))
_arithmetic(math.sqrt, 1, _named("sqrt"))
_arithmetic(math.fabs, 1, _named("fabs"))
_arithmetic(math.copysign, 2, _named("copysign"))
_arithmetic(max, 2, _named("maxnum"))
_arithmetic(min, 2, _named("minnum"))


# Lanes one by one


def number_in(context: Any, builder: Any, sig: Any, args: Any) -> Any:
    """Code of the number in lane args[1] of args[0]."""
    return builder.extract_element(args[0], context.cast(builder, args[1], sig.args[1], types.intp))


@intrinsic
def _lane(typingctx, a, k):
    """The number in lane k."""
    return types.float64(a, k), number_in


@intrinsic
def _put_lane(typingctx, out, k, value):
    """`out` with `value`, a number or a tuple of them, in lane k; `out` None: in all lanes."""
    many = isinstance(value, types.BaseTuple)

    def build(context, builder, sig, args):
        k = context.cast(builder, args[1], sig.args[1], types.intp)
        numbers = cgutils.unpack_tuple(builder, args[2]) if many else [args[2]]
        if sig.args[0] == types.none:
            made = [_splat(builder, lanes, number) for number in numbers]
        else:
            before = cgutils.unpack_tuple(builder, args[0]) if many else [args[0]]
            made = [builder.insert_element(vector, number, k) for vector, number in zip(before, numbers, strict=True)]
        return context.make_tuple(builder, sig.return_type, made) if many else made[0]

    return (types.UniTuple(lanes, value.count) if many else lanes)(out, k, value), build


def lane_by_lane(function: Any) -> Any:
    """A compiled function of one number, giving a number or a tuple of numbers, for use in kernels on a number or on lanes."""

    def either(a):
        raise NotImplementedError("in kernels only")

    @overload(either)
    def _either(a):
        if a != lanes:
            return lambda a: function(a)

        def one_by_one(a):
            out = _put_lane(None, 0, function(_lane(a, 0)))
            for k in range(1, WIDTH):
                out = _put_lane(out, k, function(_lane(a, k)))
            return out

        return one_by_one

    return either


def total(a):
    """Sum of the lanes."""
    raise NotImplementedError("in kernels only")


def largest(a):
    """Largest of the lanes; NaN if one is."""
    raise NotImplementedError("in kernels only")


def below(a, bound):
    """Whether a number, or all lanes, are below a bound (number)."""
    raise NotImplementedError("in kernels only")


def above(a, bound):
    """1 in the lanes above a bound (number), 0 elsewhere."""
    raise NotImplementedError("in kernels only")


def _reduction(function: Any, fold: Any) -> None:
    @overload(function)
    def _reduce(a):
        def folded(a):
            out = _lane(a, 0)
            for k in range(1, WIDTH):
                out = fold(out, _lane(a, k))
            return out

        return folded if a == lanes else None


@register_jitable
def _sum(a, b):
    return a + b


@register_jitable
def larger(a, b):
    """The larger of two numbers; NaN if one is."""
    return a if a >= b or a != a else b


_reduction(total, _sum)
_reduction(largest, larger)


@overload(below)
def _below(a, bound):
    if a == lanes:
        return lambda a, bound: largest(a) < bound
    return lambda a, bound: a < bound


@overload(above)
def _above(a, bound):
    return (lambda a, bound: _exceeds(a, bound)) if a == lanes else None


@intrinsic
def _exceeds(typingctx, a, bound):
    def build(context, builder, sig, args):
        return builder.uitofp(builder.fcmp_ordered(">", *args), lanes.machine)

    return lanes(lanes, lanes), build
