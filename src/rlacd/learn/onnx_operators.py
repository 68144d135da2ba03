"""ONNX versions of our torch operators. onnxscript reads the source of these functions; they never run as Python."""

# mypy: ignore-errors
# Tensors have ONNX's types here, which onnxscript checks; mypy understands only some of them.

from __future__ import annotations

from onnxscript import FLOAT, INT64, script
from onnxscript import opset18 as op


@script()
def farthest_points(points: FLOAT, count: int) -> INT64:
    """`rlacd.learn.encoders.point_groups.farthest_points` as a loop: the same products, sums and ties."""
    axes = op.Transpose(points, perm=[2, 0, 1])
    one = op.Constant(value_ints=[1])
    last = op.Expand(op.Constant(value_ints=[0]), op.Concat(op.Shape(points, start=0, end=1), one, axis=0))
    chosen = op.Identity(last)
    nearest = op.Expand(op.Constant(value_float=3.0e38), op.Shape(axes, start=1))
    for _ in range(op.Sub(op.Constant(value_int=count), 1)):
        index = op.Expand(op.Unsqueeze(last, [0]), op.Constant(value_ints=[3, 1, 1]))
        gaps = op.Sub(axes, op.GatherElements(axes, index, axis=2))
        squares = op.Mul(gaps, gaps)
        x_and_y = op.Add(op.Gather(squares, 0), op.Gather(squares, 1))
        nearest = op.Min(nearest, op.Add(x_and_y, op.Gather(squares, 2)))
        last = op.ArgMax(nearest, axis=1, keepdims=1)
        chosen = op.Concat(chosen, last, axis=1)
    return chosen
