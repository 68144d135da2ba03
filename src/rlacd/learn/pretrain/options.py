"""The options of pretraining: one dataclass, whose fields also define the command line and its help."""

from __future__ import annotations

from dataclasses import dataclass

from rlacd.fields import check_fields, option


@dataclass(frozen=True)
class PretrainOptions:
    """All options that affect the weights; ``(paper)`` marks values stated by Point-M2AE and I2P-MAE.

    Raises
    ------
    OptionError
        A value is of the wrong type or out of its range.
    """

    size: str = option(
        "published", "Sizes of the encoder; small and tiny are for processors.", one_of=("published", "small", "tiny")
    )
    points: int = option(2048, "Points of a cloud (paper).", least=32, most=8192)
    hidden: float = option(0.8, "Share of the coarsest groups that is hidden (paper).", least=0.05, most=0.95)
    rotate: bool = option(True, "Turn each cloud about a random axis by 0, 45, 90 or 180 degrees.")
    stretch: float = option(1.5, "Stretch it along each axis by up to this factor (paper).", least=1, most=4)
    steps: int = option(20_000, "Gradient steps.", least=1)
    batch: int = option(64, "Clouds a step.", least=2)
    learning_rate: float = option(1e-3, "Of AdamW, at its greatest: it rises, then falls as a cosine.", least=0)
    rise: float = option(0.05, "Share of the steps in which it rises.", least=0, most=1)
    weight_decay: float = option(0.05, "Of AdamW (paper).", least=0)
    max_faces: int = option(200_000, "Leave out meshes with more triangles than this.", least=4)
    validation: int = option(64, "Meshes held out: the loss on them is told beside the other.", least=0)
    seed: int = option(0, "The same seed, meshes and options give the same weights on CPU.", least=0, most=2**63 - 1)
    threads: int = option(1, "Threads of the process.", least=1, most=1024)
    device: str = option("auto", "cpu, cuda, or auto: a GPU when there is one.", one_of=("auto", "cpu", "cuda"))
    log_every: int = option(50, "Steps between points of the curves.", least=1)
    validate_every: int = option(500, "Steps between validations.", least=1)
    checkpoint_seconds: float = option(300.0, "Seconds between checkpoints.", least=0)

    def __post_init__(self) -> None:
        check_fields(self)
