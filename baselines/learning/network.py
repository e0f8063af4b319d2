"""Small neural network, evaluated with NumPy alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...planner.errors import BadOption, BadShape, NotFinite
from ...planner.ranges import check_choice

ACTIVATIONS = ("relu", "tanh")
OUTPUTS = ("tanh", "clip")


@dataclass(frozen=True, slots=True, eq=False)
class Network:
    """Multilayer perceptron in single precision; its output is reproducible bit for bit on one machine.

    Attributes:
        weights: (out, in) float32 per layer, read-only.
        biases: (out,) float32 per layer, read-only.
        activation: activation between layers, one of `ACTIVATIONS`.
        output: function that maps the last layer's output to [-1, 1], one of `OUTPUTS`.

    Raises:
        BadShape: the layers do not fit together.
        NotFinite: a weight or a bias is not finite.
        BadOption: an unknown activation or output, or no layer.
    """

    weights: tuple[np.ndarray, ...]
    biases: tuple[np.ndarray, ...]
    activation: str = "relu"
    output: str = "tanh"

    def __post_init__(self):
        if not self.weights or len(self.weights) != len(self.biases):
            raise BadOption("layers", f"there are {len(self.weights)} weights and {len(self.biases)} biases")
        for key, allowed in (("activation", ACTIVATIONS), ("output", OUTPUTS)):
            check_choice(key, getattr(self, key), allowed)
        for key in ("weights", "biases"):
            arrays = tuple(_single(f"{key} of layer {k}", array) for k, array in enumerate(getattr(self, key)))
            object.__setattr__(self, key, arrays)
        width = self.weights[0].shape[-1] if self.weights[0].ndim else 0
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            if weight.ndim != 2 or weight.shape[1] != width or 0 in weight.shape:
                raise BadShape(f"weights of layer {k}", weight.shape, f"(out, {width})")
            if bias.shape != weight.shape[:1]:
                raise BadShape(f"biases of layer {k}", bias.shape, f"({weight.shape[0]},)")
            width = weight.shape[0]

    @property
    def sizes(self) -> tuple[int, ...]:
        """Number of inputs, then number of outputs of each layer."""
        return (self.weights[0].shape[1], *(len(bias) for bias in self.biases))

    def __call__(self, x: np.ndarray) -> np.ndarray:
        """Return the output (m,) float32, in [-1, 1], for an input (n,) float32."""
        last = len(self.weights) - 1
        for k, (weight, bias) in enumerate(zip(self.weights, self.biases, strict=True)):
            # einsum, not BLAS, whose sums depend on the number of its threads
            x = np.einsum("oi,i->o", weight, x) + bias
            if k < last:
                x = np.maximum(x, np.float32(0.0)) if self.activation == "relu" else np.tanh(x)
        return np.tanh(x) if self.output == "tanh" else np.clip(x, np.float32(-1.0), np.float32(1.0))


def _single(what: str, value: np.ndarray) -> np.ndarray:
    with np.errstate(over="ignore"):
        array = np.array(value, dtype=np.float32, order="C")
    if not np.isfinite(array).all():
        raise NotFinite(what, tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0]))
    array.flags.writeable = False
    return array
