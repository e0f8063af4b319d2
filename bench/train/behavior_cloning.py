"""Behavior cloning of the ONE demonstration, with the interface of a Stable-Baselines3 learner."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np

from ...baselines.extras import needed

EXTRA = "rl"
"""Extra of onedemo that brings torch."""


class Clone:
    """Network trained to act as demonstrated: least squares with Adam on the transitions of one demonstration.

    Args:
        before: (n, size) float32, scaled features of the observations.
        actions: (n, m) float32, demonstrated actions.
        values: `hidden`, `learning_rate`, `batch_size`.
        device: torch device, or "auto".
    """

    def __init__(self, before: np.ndarray, actions: np.ndarray, values: dict[str, Any], device: str):
        torch: Any = needed("torch", EXTRA)
        if device == "auto":
            device = "cuda" if torch.cuda.is_available() else "cpu"
        self._torch, self.device = torch, torch.device(device)
        self._seen, self._done = (torch.as_tensor(rows, device=self.device) for rows in (before, actions))
        self._batch = min(values["batch_size"], len(before))
        widths = [before.shape[1], *values["hidden"]]
        layers: list[Any] = []
        for inputs, outputs in pairwise(widths):
            layers += [torch.nn.Linear(inputs, outputs), torch.nn.ReLU()]
        self.network = torch.nn.Sequential(*layers, torch.nn.Linear(widths[-1], actions.shape[1]), torch.nn.Tanh())
        self.network.to(self.device)
        self.optimizer = torch.optim.Adam(self.network.parameters(), lr=values["learning_rate"])
        self.num_timesteps = 0
        self.loss = float("nan")

    def parts(self) -> Iterator[tuple[str, Any]]:
        """Yield name and object of everything that is learned."""
        yield "network", self.network
        yield "optimizer", self.optimizer

    def learn(self, steps: int) -> None:
        """Take gradient steps on batches drawn from torch's generator."""
        torch = self._torch
        for _ in range(steps):
            rows = torch.randint(len(self._seen), (self._batch,)).to(self.device)
            loss = torch.nn.functional.mse_loss(self.network(self._seen[rows]), self._done[rows])
            self.optimizer.zero_grad()
            loss.backward()
            self.optimizer.step()
        self.num_timesteps += steps
        self.loss = float(loss.detach())
