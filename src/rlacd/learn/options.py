"""The options of a training run: one dataclass, whose fields also define the command line and its help.

Commands of the published results (`docs/training.md` explains them)::

    rlacd train MESHES --run RUN --preset paper --encoder-weights i2p_mae.pth           # Table 1
    rlacd train MESHES --run RUN --preset paper ... --volume-reward 0                   # 4.5.3, without r1
    rlacd train MESHES --run RUN --preset paper ... --finish-reward 0                   # 4.5.3, without r2
    rlacd train MESHES --run RUN --preset paper ... --static-discount 0.99              # Fig. 7, diverges
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rlacd.errors import OptionError
from rlacd.options.fields import check_fields, option, stated


@stated()
@dataclass(frozen=True)
class TrainOptions:
    """All options that affect the outcome of a training run; defaults are the paper's where it states a value.

    Attributes
    ----------
    threshold
        Concavity at which a component is finished (paper, 4.1: 4 %).
    volume_reward
        Weight of the reward for hull volume saved, lambda 1 (4.1).
    finish_reward
        Weight of the reward for finishing, lambda 2 (4.1).
    max_parts
        Components at which an episode ends.
    rotate
        Rotate each solid about x, y or z by 0, 45, 90 or 180 degrees (4.3).
    max_faces
        Skip meshes with more triangles than this.
    encoder
        What the network sees: sweep, the volumes on both sides of each plane, one plane at a time; or i2p-mae, the
        paper's pre-trained features of the component, for all planes at once.
    encoder_weights
        File of the published weights of i2p-mae.
    points
        i2p-mae: points on a component's surface and on its hull (4.1).
    objective
        What a plane is worth: rewards, its reward plus the values of the two sides (eq. 8); or fewest-cuts, minus the
        logarithm of the fewest cuts that any episode has needed from there.
    env_steps
        Cuts made, each followed by learning (4.1).
    learning_starts
        Random cuts at the start, without learning (4.1).
    epsilon
        Share of random cuts after those (4.1).
    epsilon_decay
        Factor applied to epsilon every 1000 cuts (4.1).
    buffer_size
        Transitions kept for learning (4.1).
    batch_size
        Transitions for each gradient step.
    train_frequency
        Cuts between gradient steps.
    learning_rate
        Learning rate of Adam.
    target_frequency
        Gradient steps between copies to the target network.
    n_step
        Cuts down the tree whose rewards a target adds up before it asks for values; 0: all, which asks for none.
    value_unit
        What the network's outputs are multiplied by: weight, the greater of the two rewards' weights; or excess, what
        a component can still earn by r1, the excess volume of its hull.
    clip
        Limit values and targets to what is possible: between 0 and what the excess volume and the end of the solid can
        earn.
    networks
        With 2, values are the lesser of two networks' (clipped double Q-learning).
    tau
        Share of the network that its average takes up each gradient step; the average is then the target network, and
        plays. With 0 the target network is a copy.
    huber
        Error, in units of the values, beyond which the loss is linear; 0 leaves it a square.
    temperature
        Temperature of the soft value, in units of reward; 0 takes the greatest value (eq. 7).
    static_discount
        Constant weight of the values of the two sides; 0 weights them by hull volume (eq. 9).
    seed
        The same seed, meshes and options give the same weights on CPU.
    environments
        Episodes played at the same time: episode n begins once episode n - E has been learned from.
    threads
        Threads of the training process.
    device
        cpu, cuda, or auto: a GPU for i2p-mae, if there is one; sweep learns as fast on the CPU, to the same weights.
    log_every
        Cuts between points of the curves.
    validate_every
        Cuts between validations.
    validation
        Meshes held out for validation; 0 validates on the first 16 training meshes.
    checkpoint_seconds
        Seconds between checkpoints.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    # The decision process (3.1)
    threshold: float = option(0.04, least=0.001, most=1)
    volume_reward: float = option(1000.0, least=0)
    finish_reward: float = option(1000.0, least=0)
    max_parts: int = option(512, least=2)
    rotate: bool = option(True)
    max_faces: int = option(2000, least=4)

    # What the network sees (3.3)
    encoder: str = option("sweep", one_of=("sweep", "i2p-mae"))
    encoder_weights: str = option("")
    points: int = option(2048, least=16, most=65536)

    # Q-learning (3.5, 4.1)
    objective: str = option("rewards", one_of=("rewards", "fewest-cuts"))
    env_steps: int = option(1_000_000, least=1)
    learning_starts: int = option(10_000, least=0)
    epsilon: float = option(0.2, least=0, most=1)
    epsilon_decay: float = option(0.99, least=0, most=1)
    buffer_size: int = option(100_000, least=1)
    batch_size: int = option(256, least=1)
    train_frequency: int = option(1, least=1)
    learning_rate: float = option(1e-4, least=0)
    target_frequency: int = option(1000, least=1)
    n_step: int = option(1, least=0)
    value_unit: str = option("weight", one_of=("weight", "excess"))
    clip: bool = option(False)
    networks: int = option(1, least=1, most=2)
    tau: float = option(0.0, least=0, most=1)
    huber: float = option(0.0, least=0)
    temperature: float = option(0.0, least=0, most=0.1)
    static_discount: float = option(0.0, least=0, most=1)

    # The run
    seed: int = option(0, least=0, most=2**63 - 1)
    environments: int = option(4, least=1, most=4096)
    threads: int = option(1, least=1, most=1024)
    device: str = option("auto", one_of=("auto", "cpu", "cuda"))
    log_every: int = option(500, least=1)
    validate_every: int = option(10_000, least=1)
    validation: int = option(16, least=0)
    checkpoint_seconds: float = option(300.0, least=0)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.volume_reward == self.finish_reward == 0:
            raise OptionError("volume_reward and finish_reward are both 0; there is nothing to learn from.")

    @classmethod
    def preset(cls, name: str, **changes: Any) -> TrainOptions:
        """Get the preset `name` from `TRAIN_PRESETS` with the given changes.

        Raises
        ------
        OptionError
            There is no such preset, or a value is out of range.
        """
        if name not in TRAIN_PRESETS:
            raise OptionError(f"preset is {name!r}; it has to be one of {', '.join(TRAIN_PRESETS)}.")
        return cls(**{**TRAIN_PRESETS[name], **changes})


_TWO_CORES: Mapping[str, Any] = {
    "objective": "fewest-cuts",
    "env_steps": 100_000,
    "learning_starts": 1_000,
    "epsilon": 0.1,
    "batch_size": 64,
    "train_frequency": 2,
    "learning_rate": 1e-3,
    "max_faces": 700,
}

_RETURNS: Mapping[str, Any] = {
    **_TWO_CORES,
    "objective": "rewards",
    "finish_reward": 0.0,
    "n_step": 0,
    "value_unit": "excess",
    "clip": True,
    "tau": 0.01,
    "buffer_size": 10_000,
    "max_parts": 128,
    "environments": 1,
}

_ONE_MESH: Mapping[str, Any] = {
    **_TWO_CORES,
    "env_steps": 5_000,
    "learning_starts": 200,
    "train_frequency": 1,
    "rotate": False,
    "max_faces": 5000,
    "environments": 1,
    "validation": 0,
    "validate_every": 250,
}

TRAIN_PRESETS = {
    "paper": {"encoder": "i2p-mae"},
    "returns": _RETURNS,
    "two-cores": _TWO_CORES,
    "one-mesh": _ONE_MESH,
}
"""Changes to the defaults: the paper's run; its loss without r2 (4.5.3), by returns of the whole tree, and the fewest
cuts seen, both on cheap features for two cores; the latter for a few meshes that are learned by heart in a minute."""
