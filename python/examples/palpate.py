"""A policy learns to palpate: a finger whose only sense is the torque of its joint looks for a nodule in soft tissue and stays on it.

The environment is Gymnasium's. The policy, a small network, is trained by evolution strategies (Salimans et al. 2017, arXiv:1703.03864) over
batches of episodes, which takes two minutes of one processor core.

    haptize bake datasets/nodule.toml -o nodule.haptize && pip install gymnasium matplotlib && python palpate.py nodule.haptize palpation.png
"""

import sys
import time

import gymnasium
import haptize
import numpy as np

# Range of the finger's yaw and pitch [rad], and how far they move in a step. The fingertip is 120 mm from the axis of yaw.
YAW, PITCH, YAW_STEP, PITCH_STEP, TIP = 0.15, 0.06, 0.02, 0.01, 0.12
# Where datasets/nodule.toml has its nodule, and how far the tissue is displaced to either side, at random [rad].
NODULE, DISPLACED = 0.1, 0.04
# Of the sensor [N m], and the torque that observations are measured by.
NOISE, TORQUE = 0.002, 0.3
STEPS, LAST = 40, 10


class Palpation(gymnasium.Env):
    """The finger over the tissue of `field`, which is displaced and mirrored at random.

    Actions are the rates of yaw and pitch, -1 to 1. Observations are yaw, pitch, the felt torque of the pitch, the greatest torque felt so far,
    the yaw where that was, and the time, each about -1 to 1. The reward is minus the distance from the nodule in the last steps. With a
    `shape` it is a batch of as many episodes: actions, observations and rewards get these leading axes.
    """

    observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (6,), np.float32)
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)

    def __init__(self, field: haptize.Field, shape: tuple[int, ...] = ()):
        self.field, self.shape = field, shape

    def reset(self, *, seed: int | None = None, options: dict | None = None) -> tuple[np.ndarray, dict]:
        super().reset(seed=seed)
        self.side = self.np_random.choice([-1.0, 1.0], self.shape)
        self.displaced = self.np_random.uniform(-DISPLACED, DISPLACED, self.shape)
        self.yaw, self.pitch = self.np_random.uniform(-YAW, YAW, self.shape), np.zeros(self.shape)
        self.time, self.greatest, self.where = 0, np.zeros(self.shape), np.zeros(self.shape)
        return self._observe(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, np.ndarray | float, bool, bool, dict]:
        rates = np.clip(action, -1.0, 1.0)
        self.yaw = np.clip(self.yaw + YAW_STEP * rates[..., 0], -YAW, YAW)
        self.pitch = np.clip(self.pitch + PITCH_STEP * rates[..., 1], 0.0, PITCH)
        self.time += 1
        distance = np.abs(self.yaw - self.displaced - self.side * NODULE)
        reward = -distance / YAW if self.time > STEPS - LAST else np.zeros(self.shape)
        information = {"distance": TIP * distance}
        return self._observe(), reward if self.shape else float(reward), False, self.time == STEPS, information

    def _observe(self) -> np.ndarray:
        q = np.stack([self.side * (self.yaw - self.displaced), self.pitch, np.zeros(self.shape)], -1)
        felt = -self.field.torque(q)[..., 1] + self.np_random.normal(0.0, NOISE, self.shape)
        is_greatest = felt > self.greatest
        self.where, self.greatest = np.where(is_greatest, self.yaw, self.where), np.where(is_greatest, felt, self.greatest)
        numbers = [self.yaw / YAW, self.pitch / PITCH, felt / TORQUE, self.greatest / TORQUE, self.where / YAW]
        return np.stack([*numbers, np.full(self.shape, self.time / STEPS)], -1).astype(np.float32)


class Policy:
    """A network with one hidden layer; a whole population of them where `parameters` have a leading axis."""

    INPUTS, HIDDEN, OUTPUTS = 6, 16, 2
    COUNT = (INPUTS + 1) * HIDDEN + (HIDDEN + 1) * OUTPUTS

    def __init__(self, parameters: np.ndarray):
        first, second = np.split(parameters, [(self.INPUTS + 1) * self.HIDDEN], -1)
        self.first = first.reshape(*first.shape[:-1], self.INPUTS + 1, self.HIDDEN)
        self.second = second.reshape(*second.shape[:-1], self.HIDDEN + 1, self.OUTPUTS)

    def __call__(self, observations: np.ndarray) -> np.ndarray:
        hidden = np.tanh(observations @ self.first[..., :-1, :] + self.first[..., -1:, :])
        return np.tanh(hidden @ self.second[..., :-1, :] + self.second[..., -1:, :])


def play(world: Palpation, policy: Policy, seed: int) -> tuple[np.ndarray, np.ndarray, list[np.ndarray]]:
    """Returns of all episodes, final distances from the nodule [m], and the yaws on the way."""
    observations, _ = world.reset(seed=seed)
    returns, yaws, is_over = 0.0, [world.yaw], False
    while not is_over:
        observations, rewards, _, is_over, information = world.step(policy(observations))
        returns, yaws = returns + rewards, [*yaws, world.yaw]
    return returns, information["distance"], yaws


def train(field: haptize.Field, generations: int = 1000, pairs: int = 64, episodes: int = 16, seed: int = 0) -> tuple[np.ndarray, list[float]]:
    """Returns the parameters, and the median distance from the nodule after each generation [m]."""
    random = np.random.default_rng(seed)
    mean, momentum, spread, rate = 0.1 * random.standard_normal(Policy.COUNT), 0.0, 0.1, 0.1
    world, curve = Palpation(field, (2 * pairs, episodes)), []
    for generation in range(generations):
        directions = random.standard_normal((pairs, Policy.COUNT))
        directions = np.concatenate([directions, -directions])
        returns, distances, _ = play(world, Policy(mean + spread * directions), seed + generation)
        # By rank, from -1/2 to 1/2: how much better one policy is does not count.
        ranks = returns.mean(1).argsort().argsort() / (2 * pairs - 1) - 0.5
        momentum = 0.9 * momentum + ranks @ directions / (pairs * spread)
        mean = mean + rate * spread * momentum
        curve.append(float(np.median(distances)))
    return mean, curve


def draw(curve: list[float], yaws: list[np.ndarray], world: Palpation, file: str) -> None:
    """The curve of the training, and some episodes after it, whose nodule is a dot."""
    from matplotlib import pyplot

    figure, (left, right) = pyplot.subplots(1, 2, figsize=(9, 3.4), layout="constrained")
    left.semilogy(1e3 * np.array(curve))
    left.set(xlabel="generation", ylabel="median distance from the nodule [mm]")
    for episode in range(6):
        (line,) = right.plot(1e3 * TIP * np.array(yaws)[:, episode])
        nodule = world.displaced[episode] + world.side[episode] * NODULE
        right.plot(STEPS + 1, 1e3 * TIP * nodule, "o", color=line.get_color(), clip_on=False)
    right.set(xlabel="step", ylabel="fingertip [mm], and the nodule")
    figure.savefig(file, dpi=150)


def main() -> None:
    field = haptize.Field.open(sys.argv[1])
    begin = time.process_time()
    parameters, curve = train(field)
    world = Palpation(field, (1000,))
    _, distances, yaws = play(world, Policy(parameters), seed=10_000)
    found = f"{1e3 * np.median(distances):.1f} mm from the nodule in the median, within its radius of 7 mm in {(distances < 7e-3).mean():.0%}"
    print(f"trained in {time.process_time() - begin:.0f} s of processor time; then {found} of 1000 episodes")
    draw(curve, yaws, world, sys.argv[2])


if __name__ == "__main__":
    main()
