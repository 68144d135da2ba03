"""The options of a training run: one dataclass, whose fields also define the command line and its help."""

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

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    # The decision process (3.1)
    threshold: float = option(
        0.04, least=0.001, most=1, help="Concavity at which a component is finished (paper, 4.1: 4%)."
    )
    volume_reward: float = option(1000.0, least=0, help="Weight of the reward for hull volume saved, lambda 1 (4.1).")
    finish_reward: float = option(1000.0, least=0, help="Weight of the reward for finishing, lambda 2 (4.1).")
    max_parts: int = option(512, least=2, help="Components at which an episode ends.")
    rotate: bool = option(True, help="Rotate each solid about x, y or z by 0, 45, 90 or 180 degrees (4.3).")
    max_faces: int = option(2000, least=4, help="Skip meshes with more triangles than this.")

    # Q-learning (3.3, 3.5, 4.1)
    encoder: str = option(
        "sweep",
        one_of=("sweep", "points"),
        help="""What the network sees: sweep, of each plane what the sweep gives; or points, of a component the
        paper's encoder of points (3.3), reduced and with random weights that are not learned, for the values of
        all planes at once.""",
    )
    target: str = option(
        "one-step",
        one_of=("one-step", "return"),
        help="""What a plane is worth: one-step, its reward plus the values of the two sides (eq. 8); or return,
        the discounted rewards of the whole episode below it, in units of the component's excess volume, learned
        by a network whose average plays.""",
    )
    env_steps: int = option(1_000_000, least=1, help="Cuts made, each followed by learning (4.1).")
    learning_starts: int = option(10_000, least=0, help="Random cuts at the start, without learning (4.1).")
    epsilon: float = option(0.2, least=0, most=1, help="Share of random cuts after those (4.1).")
    epsilon_decay: float = option(0.99, least=0, most=1, help="Factor applied to epsilon every 1000 cuts (4.1).")
    buffer_size: int = option(100_000, least=1, help="Transitions kept for learning (4.1).")
    batch_size: int = option(256, least=1, help="Transitions for each gradient step.")
    train_frequency: int = option(1, least=1, help="Cuts between gradient steps.")
    learning_rate: float = option(1e-4, least=0, help="Learning rate of Adam.")
    target_frequency: int = option(1000, least=1, help="one-step: gradient steps between copies to the target network.")

    # The run
    seed: int = option(
        0, least=0, most=2**63 - 1, help="The same seed, meshes and options give the same weights on CPU."
    )
    environments: int = option(
        4,
        least=1,
        most=4096,
        help="Episodes played at the same time: episode n begins once episode n - E has been learned from.",
    )
    threads: int = option(1, least=1, most=1024, help="Threads of the training process.")
    device: str = option(
        "auto",
        one_of=("auto", "cpu", "cuda"),
        help="""cpu, cuda, or auto: a GPU, if there is one and the network values all planes at once; a small
        network that values them one by one learns as fast on the CPU.""",
    )
    log_every: int = option(500, least=1, help="Cuts between points of the curves.")
    validate_every: int = option(10_000, least=1, help="Cuts between validations.")
    validation: int = option(
        16, least=0, help="Meshes held out for validation, at most half; 0 validates on the first 16 training meshes."
    )
    held_out: str = option(
        "", help="A folder in that of the meshes, such as those of one maker, to validate with and not to learn from."
    )
    checkpoint_seconds: float = option(300.0, least=0, help="Seconds between checkpoints.")

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


_RETURNS: Mapping[str, Any] = {
    "target": "return",
    "finish_reward": 0.0,
    "env_steps": 100_000,
    "learning_starts": 1_000,
    "epsilon": 0.1,
    "batch_size": 64,
    "train_frequency": 2,
    "learning_rate": 1e-3,
    "max_faces": 700,
    "buffer_size": 10_000,
    "max_parts": 128,
    "environments": 1,
}

_ONE_MESH: Mapping[str, Any] = {
    **_RETURNS,
    "env_steps": 5_000,
    "learning_starts": 200,
    "train_frequency": 1,
    "rotate": False,
    "max_faces": 5000,
    "validation": 0,
    "validate_every": 250,
}

_POINTS: Mapping[str, Any] = {**_RETURNS, "encoder": "points", "buffer_size": 100_000, "learning_rate": 3e-4}

TRAIN_PRESETS: Mapping[str, Mapping[str, Any]] = {
    **{"paper": {}, "returns": _RETURNS, "one-mesh": _ONE_MESH, "points": _POINTS}
}
"""Changes to the defaults, which are the paper's run: its loss without r2 (4.5.3), as far as it can be learned on two
cores; the same for a few meshes that are learned by heart in a minute; and by the paper's network, reduced."""
