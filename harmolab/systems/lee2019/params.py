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
    """Settings of Lee et al. 2019: sizes, schedules and weights; the defaults are as released.

    The system codes units of four beats of movement, and composes a dance of them. Its codes (latents) are z_init of
    the first pose of a unit, z_move of its movement, and z_dance of a dance.

    Parameters
    ----------
    hidden : int
        Units of the recurrent layers of movement and dance.
    latent : int
        Numbers in z_move, and in z_dance.
    pose_latent, pose_hidden : int
        Numbers in z_init, and units of the layers between a pose and it.
    style : int
        Numbers in the style of the music, which are the units of its recurrent layer.
    noise : int
        Numbers in the noise beside it.
    style_layers, regressor_layers : tuples of int
        Units of the layers from style to z_dance, and back.
    critic_layers : tuple of int
        Units of the critics' layers; the last is also that of their audio branch.
    sequence : int
        Units in a training sequence: 2, as our units of 8 beats have it; released: 3.
    style_epochs, unit_epochs, composition_epochs : int
        Epochs of the three phases: music classifier, coder of units, composition of units.
    batch_size : int
        Units of four beats, over all processes together.
    shards : int
        As in `TrainParams`.
    style_rate, rate : float
        Learning rates of Adam: of the music classifier, and of all else.
    decoder_share : float
        Share of `rate` at which the unit decoder goes on learning in the composition.
    clip : float
        Largest norm of a gradient.
    kl_weight : float
        Weight of the divergences at the end of its ramp, and in the composition.
    ramp_midpoint, ramp_width : float
        Of the logistic ramp of `kl_weight` in the phase of units, as shares of its epochs. Released in iterations,
        15000 and 2000, which small data never reaches; the same proportion here.
    pose_frames : int
        Frames of a unit that are coded as single poses.
    pose_weight : float
        Of the poses in the composition.
    style_weight : float
        Of the style that is regressed from z_dance. Released as a third update, which changes weights that the second's
        graph still needs; here a part of the generator's loss.
    beats : "kinematic" or "music"
        Where recorded movement is cut. "kinematic": at the speed valley nearest to each music beat, if it lies within a
        quarter of a period, else at the music beat. "music": at the music's beats.
    shift_x, shift_y : float, metres
        Largest constant offset of a unit, to the side and upwards.
    noise_units : int
        Units of a dance that share noise.
    still : float, standard deviations
        A sequence is drawn again if the mean step of a number from frame to frame is smaller.
    redraws : int
        Times that a sequence is drawn again at most.
    fade : float, seconds
        Time over which the difference at the border of two units is faded
        (`harmolab.systems.training.motion_code.continued`).
    seed : int
        Of weights, batches and draws.

    Raises
    ------
    ValueError
        For a value out of range or of another kind; the message names the field.
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
