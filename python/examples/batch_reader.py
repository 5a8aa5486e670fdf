"""A batch of arms for robot learning, in the manner of Gymnasium's vector environments, without Gymnasium: each step looks up the contact
torque of all arms at once.

    python python/examples/batch_reader.py sphere.haptize
"""

import sys
import time

import haptize
import numpy as np


class Arms:
    """`count` arms with damped joints that feel one baked object. Actions are joint torques [N m], observations angles, rates and torques."""

    def __init__(self, path: str, count: int, inertia: float = 2e-3, damping: float = 0.02, step: float = 1e-3):
        self.field = haptize.Field.open(path)
        lines = self.field.dataset.lines
        self.least, self.greatest = np.array([(line[0], line[-1]) for line in lines]).T
        self.inertia, self.damping, self.dt = inertia, damping, step
        self.q = np.empty((count, self.field.joints))
        self.rate, self.torque = np.zeros_like(self.q), np.zeros_like(self.q)

    def reset(self, seed: int | None = None) -> np.ndarray:
        """Begin at random configurations, at rest; returns observations."""
        self.q[:] = np.random.default_rng(seed).uniform(self.least, self.greatest, self.q.shape)
        self.rate[:] = 0.0
        return self._observe()

    def step(self, action: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """One step of all arms; returns observations and rewards, here minus the contact torque's square [N^2 m^2]."""
        self.rate += self.dt / self.inertia * (action + self.torque - self.damping * self.rate)
        self.q += self.dt * self.rate
        # The grid's ends are stops.
        out = (self.q < self.least) | (self.q > self.greatest)
        np.clip(self.q, self.least, self.greatest, out=self.q)
        self.rate[out] = 0.0
        return self._observe(), -np.square(self.torque).sum(axis=1)

    def _observe(self) -> np.ndarray:
        self.field.torque(self.q, out=self.torque)
        return np.concatenate([self.q, self.rate, self.torque], axis=1)


def main() -> None:
    arms = Arms(sys.argv[1], count=100_000)
    arms.reset(seed=0)
    begin = time.perf_counter()
    for _ in range(10):
        arms.field.torque(arms.q, out=arms.torque)
    rate = 10 * len(arms.q) / (time.perf_counter() - begin)
    begin = time.perf_counter()
    for _ in range(10):
        arms.step(np.zeros_like(arms.q))
    steps = 10 * len(arms.q) / (time.perf_counter() - begin)
    print(f"{rate / 1e6:.2f} million torques a second, {steps / 1e6:.2f} million steps a second with all else in NumPy")


if __name__ == "__main__":
    main()
