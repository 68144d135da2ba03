"""State encoders, which describe a component to the Q network, by name."""

from rlacd.learn.encoders.encoder import Encoder, describe
from rlacd.learn.encoders.i2p_mae import I2PMAEEncoder
from rlacd.learn.encoders.named import I2P_MAE, AnyEncoder, make_encoder
from rlacd.learn.encoders.profile import ProfileEncoder, ProfileWithoutHull

__all__ = [
    "I2P_MAE",
    "AnyEncoder",
    "Encoder",
    "I2PMAEEncoder",
    "ProfileEncoder",
    "ProfileWithoutHull",
    "describe",
    "make_encoder",
]
