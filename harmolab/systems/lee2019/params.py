"""Settings of the system of Lee et al. 2019: sizes, schedules, weights, and how we read what was never released.

Released values are those of the public code (NVlabs/Dancing2Music at 7ff1d95; facts and sizes only).
docs/readings_rivals.md lists where we depart from it.
"""

from dataclasses import dataclass, fields
from typing import Literal

from harmolab.systems.training.features import check_settings

Beats = Literal["kinematic", "music"]


@dataclass(frozen=True)
class LeeParams:
    """Sizes, schedules and weights; the defaults are as released. A latent is the code of a movement or of a dance.

    Parameters
    ----------
    hidden : int
        Units of the recurrent layers of movement and dance.
    latent : int
        Numbers of z_move and of z_dance.
    pose_latent, pose_hidden : int
        Numbers of z_init, and units of the layers between a pose and it.
    style, noise : int
        Numbers of the style of the music, the units of its recurrent layer; and of the noise beside it.
    style_layers, regressor_layers : ints
        Units of the layers from style to z_dance, and back.
    critic_layers : ints
        Units of the critics' layers; the last size is that of their audio branch too.
    sequence : int
        Units of a training sequence. Our 8-beat units give 2; released: 3.
    style_epochs, unit_epochs, composition_epochs : int
        Of the music classifier, of the coder of units, of the composition of units.
    batch_size : int, units of four beats, over all processes together
    shards : int, as in `harmolab.systems.harmogan.params.TrainParams`
    style_rate, rate : float, of Adam: of the music classifier, of everything else
    decoder_share : float
        Share of `rate` at which composing goes on teaching the unit decoder.
    clip : float, largest norm of a gradient
    kl_weight : float
        Weight of the divergences, at the end of its ramp and while composing.
    ramp_midpoint, ramp_width : float
        Of the logistic ramp of the units' `kl_weight`, as shares of the phase's epochs. Released in iterations, 15000
        and 2000, which small data never reaches; the same proportion here.
    pose_frames : int, frames of a unit that are coded as single poses
    pose_weight : float, of the poses while composing
    style_weight : float
        Of the style regressed from z_dance. Released as a third update, which changes weights that the second's graph
        still needs; here a part of the generator's loss.
    beats : "kinematic" or "music"
        Beats at which recorded movement is cut: the speed valley nearest to each music beat, if within a quarter of a
        period, else the music beat; or the music's beats alone.
    shift_x, shift_y : float, metres
        Largest constant offset of a unit, to the side and upwards.
    noise_units : int, units of a dance that share noise
    still : float, standard deviations
        Mean step of a number from frame to frame under which a sequence is drawn again.
    redraws : int, times that a sequence is drawn again at most
    fade : float, seconds, of the difference at the border of two units (`systems.training.motion_code.continued`)
    seed : int
    """

    hidden: int = 1024
    latent: int = 512
    pose_latent: int = 10
    pose_hidden: int = 64
    style: int = 30
    noise: int = 30
    style_layers: tuple[int, ...] = (64, 128)
    regressor_layers: tuple[int, ...] = (512, 256, 128)
    critic_layers: tuple[int, ...] = (1024, 512, 256, 30)
    sequence: int = 2
    style_epochs: int = 100
    unit_epochs: int = 1000
    composition_epochs: int = 1500
    batch_size: int = 256
    shards: int = 1
    style_rate: float = 1e-3
    rate: float = 2e-4
    decoder_share: float = 0.1
    clip: float = 0.5
    kl_weight: float = 0.01
    ramp_midpoint: float = 0.3
    ramp_width: float = 0.04
    pose_frames: int = 4
    pose_weight: float = 10.0
    style_weight: float = 1.0
    beats: Beats = "kinematic"
    shift_x: float = 0.4
    shift_y: float = 0.16
    noise_units: int = 3
    still: float = 0.058
    redraws: int = 20
    fade: float = 0.25
    seed: int = 1

    def __post_init__(self) -> None:
        layers = [field.name for field in fields(self) if field.name.endswith("_layers")]
        may_be_zero = [field.name for field in fields(self) if field.name.endswith(("_epochs", "_weight"))]
        check_settings(self, not_negative=[*may_be_zero, "shift_x", "shift_y", "still", "redraws", "seed"])
        for name in layers:
            if not getattr(self, name) or min(getattr(self, name)) < 1:
                raise ValueError(f"{name} must be the units of one or more layers, got {getattr(self, name)}")

    @classmethod
    def paper(cls) -> "LeeParams":
        """As released, but for sequences of two units: 13.85 M parameters to generate its 28 numbers a pose."""
        return cls()

    @classmethod
    def small(cls) -> "LeeParams":
        """In the proportion to HarmoGAN's small preset that the released sizes have to its paper preset."""
        return cls(
            hidden=352, latent=176, regressor_layers=(176, 88, 44), critic_layers=(352, 176, 88, 30), unit_epochs=270,
            composition_epochs=270, batch_size=64,
        )  # fmt: skip
