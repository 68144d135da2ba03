"""The options of a training run: one dataclass, whose fields also define the command line and its help."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from rlacd.errors import OptionError
from rlacd.fields import check_fields, option, refuse_unknown


@dataclass(frozen=True)
class TrainOptions:
    """All options that affect the outcome of a training run; defaults are the paper's where it states a value.

    Each field's help is in its metadata and serves the command line too.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    # The decision process
    threshold: float = option(0.04, "Concavity at which a component is finished (paper: 4 %).", least=0.001, most=1)
    volume_reward: float = option(1000.0, "Weight of the reward for hull volume saved, lambda 1 (paper).", least=0)
    finish_reward: float = option(1000.0, "Weight of the reward for finishing, lambda 2 (paper).", least=0)
    cut_cost: float = option(0.0, "Reward every cut costs (the paper: none).", least=0)
    finish_counts: str = option(
        "solid",
        "What has to be finished for that reward: the whole solid (paper, eq. 3), or the component's own two sides.",
        one_of=("solid", "component"),
    )
    max_cuts: int = option(64, "Cuts after which an episode is broken off.", least=1)
    max_parts: int = option(64, "Components after which an episode is broken off.", least=2)
    rotate: bool = option(True, "Turn each solid about a random axis by 0, 45, 90 or 180 degrees (paper).")
    max_faces: int = option(2000, "Leave out meshes with more triangles than this.", least=4)

    # What the network sees
    encoder: str = option(
        "profile",
        "What describes a component: counts between the planes, or the paper's pretrained I2P-MAE.",
        one_of=("profile", "profile-without-hull", "i2p-mae"),
    )
    encoder_weights: str = option("", "The file of i2p-mae's weights: the published checkpoint.")
    points: int = option(
        2048, "Points on the surface of a component, and as many on its hull (paper).", least=16, most=65536
    )
    scale_input: bool = option(False, "Tell the network the component's size and creases, too (not paper).")

    lookahead: int = option(
        0,
        "The network values components, not planes (not paper): this many planes of least hull sum are cut, and "
        "the one whose reward and sides are worth most is taken. 0: it values the planes.",
        least=0,
        most=150,
    )

    # Soft Q-learning
    iterations: int = option(1_000_000, "Cuts made, each followed by learning (paper: 1e6).", least=1)
    warmup: int = option(10_000, "First cuts, made at random without learning (paper: 1e4).", least=0)
    batch: int = option(256, "Transitions a gradient step.", least=1)
    learn_every: int = option(1, "Cuts between gradient steps.", least=1)
    learning_rate: float = option(1e-4, "Of Adam.", least=0)
    temperature: float = option(
        5.0, "Of the Boltzmann policy and the soft value, in rewards; 0 is plain Q-learning.", least=0
    )
    discount: str = option(
        "hull",
        "What the values of the sides are weighted by: their share of the hull volume (paper, eq. 9), or a constant.",
        one_of=("hull", "static"),
    )
    static_discount: float = option(0.99, "That constant, for each side.", least=0, most=1)
    returns: str = option(
        "one-step",
        "What the network learns from: a cut's reward and the values of its sides (paper, eq. 8), or the rewards of "
        "the rest of the episode.",
        one_of=("one-step", "monte-carlo"),
    )
    target_every: int = option(1000, "Gradient steps between copies to the target network.", least=1)
    epsilon: float = option(0.2, "Share of random cuts at first (paper).", least=0, most=1)
    epsilon_decay: float = option(0.99, "Factor on it every 1000 cuts (paper).", least=0, most=1)
    replay: int = option(100_000, "Transitions kept (paper).", least=1)

    # The run
    seed: int = option(0, "The same seed, meshes and options give the same weights on CPU.", least=0, most=2**63 - 1)
    environments: int = option(
        4,
        "Episodes played side by side; each begins once the one this many before it has been learned from.",
        least=1,
        most=4096,
    )
    threads: int = option(1, "Threads of the training process.", least=1, most=1024)
    device: str = option("auto", "cpu, cuda, or auto: a GPU when there is one.", one_of=("auto", "cpu", "cuda"))
    log_every: int = option(500, "Cuts between points of the curves.", least=1)
    validate_every: int = option(10_000, "Cuts between validations.", least=1)
    validation: int = option(16, "Meshes held out for validation.", least=0)
    checkpoint_seconds: float = option(300.0, "Seconds between checkpoints.", least=0)

    def __post_init__(self) -> None:
        check_fields(self)
        if self.discount == "hull" and not math.isfinite(self.volume_reward + self.finish_reward):
            raise OptionError("volume_reward and finish_reward have to be finite.")
        if self.volume_reward == self.finish_reward == self.cut_cost == 0:
            raise OptionError("volume_reward, finish_reward and cut_cost are all 0; there is nothing to learn from.")

    @property
    def unit(self) -> float:
        """Scale of the values: the network predicts them in this unit, so that its outputs are of order 1."""
        return max(self.volume_reward, self.finish_reward, 10 * self.cut_cost, 1e-9)

    @classmethod
    def preset(cls, name: str, **changes: Any) -> TrainOptions:
        """Get the preset `name` from `PRESETS` with the given changes.

        Raises
        ------
        OptionError
            There is no such preset or option, or a value is out of range.
        """
        if name not in PRESETS:
            raise OptionError(f"preset is {name!r}; it has to be one of {', '.join(PRESETS)}.")
        refuse_unknown(cls, changes, "train")
        return cls(**{**PRESETS[name], **changes})


_TWO_CORES: Mapping[str, Any] = {
    "batch": 64,
    "learn_every": 2,
    "learning_rate": 3e-4,
    "iterations": 300_000,
    "warmup": 5_000,
    "max_faces": 700,
    "validate_every": 5_000,
}

PRESETS: Mapping[str, Mapping[str, Any]] = MappingProxyType(
    {
        "paper": {"encoder": "i2p-mae"},
        "two-cores": _TWO_CORES,
        "counting": {
            **_TWO_CORES,
            "scale_input": True,
            "volume_reward": 0.0,
            "finish_reward": 0.0,
            "cut_cost": 1.0,
            "discount": "static",
            "static_discount": 1.0,
            "returns": "monte-carlo",
            "lookahead": 4,
            "iterations": 4_000,
            "warmup": 500,
            "epsilon": 0.1,
            "points": 512,
            "max_faces": 500,
            "validate_every": 1_000,
        },
        "quick": {
            "batch": 32,
            "learning_rate": 1e-3,
            "iterations": 2_000,
            "warmup": 200,
            "max_faces": 300,
            "points": 512,
            "target_every": 200,
            "environments": 2,
            "log_every": 100,
            "validate_every": 1_000,
            "validation": 4,
            "checkpoint_seconds": 60.0,
        },
    }
)
"""Changes to the defaults: the paper's run; the same scaled to two cores; a component's number of cuts, learned from
whole episodes and used in lookahead (research/learning.md); and a run of a few minutes to try the paper's."""
