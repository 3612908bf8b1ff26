"""Settings of Ren et al. 2020: sizes, losses and schedule as released, and our readings where we depart from them."""

from dataclasses import dataclass

from harmolab.systems.training.features import check_settings

BLOCKS = 10  # of the ST-GCN, whose maps the perceptual loss compares


@dataclass(frozen=True)
class RenParams:
    """Sizes of the networks, weights of the losses, and the schedule.

    Parameters
    ----------
    hidden : int
        Units of the linear layer that hears the music features of a frame (in place of convolutions over raw audio),
        and of every layer of the bidirectional GRU after it; channels of the encoded music.
    layers : int, of the bidirectional GRU
    noise : int, random numbers a frame; units of the GRU that they pass through
    noise_std : float, standard deviation of those numbers
    body : int, units of the residual blocks
    blocks : int, residual blocks
    dropout : float, share of the last features that is left out in training
    discriminator : int
        Channels of the first of three masked convolutions in both discriminators; the last has four times as many.
    attention : int, units of the self-attention over time in the global discriminator
    window_frames, window_step_frames : int
        Length of the local discriminator's windows and frames between their starts: at 15 per second 0.53 and 0.33 s
        (released: 0.5 and 0.3 s).
    graph : int, channels of the first four blocks of the ST-GCN; the next three have twice, the last three four times
    graph_frames : int, frames that the ST-GCN's clips are brought to
    graph_epochs : int
        Of the ST-GCN (256 units each), before everything else.
    pose_weight, perceptual_weight, feature_weight, local_weight, global_weight : float
        Weights in the generator's loss: L1 of the poses, pose perceptual loss, feature matching in the global
        discriminator's motion branch, and the two adversarial terms.
    block_weights : tuple of float, of the ten blocks' maps inside the pose perceptual loss
    discriminator_weight : float, of the cross-entropy in either discriminator's loss
    penalty_weight : float, of the gradient penalty in the global discriminator's loss
    generator_rate, local_rate, global_rate : float, learning rates of Adam
    epochs : int, all with these rates, and the last one is kept
    batch_size : int, over all processes together
    shards : int, parts that each batch is computed in (`harmolab.systems.training.loop`)
    seed : int
    """

    hidden: int = 256
    layers: int = 2
    noise: int = 10
    noise_std: float = 0.33
    body: int = 1024
    blocks: int = 3
    dropout: float = 0.5
    discriminator: int = 64
    attention: int = 20
    window_frames: int = 8
    window_step_frames: int = 5
    graph: int = 64
    graph_frames: int = 32
    graph_epochs: int = 40
    pose_weight: float = 200.0
    perceptual_weight: float = 1.0
    feature_weight: float = 1.0
    local_weight: float = 1.0
    global_weight: float = 1.0
    block_weights: tuple[float, ...] = (20.0, 5.0, *(1.0,) * (BLOCKS - 2))
    discriminator_weight: float = 0.5
    penalty_weight: float = 1.0
    generator_rate: float = 3e-4
    local_rate: float = 3e-4
    global_rate: float = 5e-4
    epochs: int = 400
    batch_size: int = 16
    shards: int = 1
    seed: int = 1

    def __post_init__(self) -> None:
        weights = [name for name in vars(self) if name.endswith("_weight")]
        check_settings(self, not_negative=[*weights, "block_weights", "dropout", "epochs", "seed"])
        if self.dropout >= 1:
            raise ValueError(f"dropout must leave something, got {self.dropout}")
        if len(self.block_weights) != BLOCKS:
            raise ValueError(f"block_weights must be {BLOCKS} numbers, zero or more, got {self.block_weights}")

    @classmethod
    def paper(cls) -> "RenParams":
        """Sizes and schedule as released."""
        return cls()

    @classmethod
    def small(cls) -> "RenParams":
        """A generator of 1.1 million parameters, smaller by as much as our small HarmoGAN is; the same schedule."""
        return cls(hidden=96, body=352, discriminator=32, graph=16)
