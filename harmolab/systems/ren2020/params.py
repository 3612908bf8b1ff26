"""Settings of Ren et al. 2020: sizes, losses and schedule as released, and our readings where we depart from them."""

from dataclasses import dataclass

from harmolab.systems.training.features import check_settings

BLOCKS = 10  # of the ST-GCN, whose maps the perceptual loss compares


@dataclass(frozen=True)
class RenParams:
    """Settings of Ren et al. 2020: sizes of networks, weights of losses, schedule; the defaults are as released.

    The ST-GCN is a graph network over the joints of movement, whose maps make the pose perceptual loss.

    Parameters
    ----------
    hidden : int
        Units of the linear layer that reads the music features of a frame (in place of convolutions over raw audio),
        and of every layer of the bidirectional GRU after it; channels of the encoded music.
    layers : int
        Of the bidirectional GRU.
    noise : int
        Random numbers a frame, and units of the GRU that they pass through.
    noise_std : float
        Standard deviation of these numbers.
    body : int
        Units of the residual blocks.
    blocks : int
        Number of residual blocks.
    dropout : float
        Share of the last features that is left out in training.
    discriminator : int
        Channels of the first of three masked convolutions in both discriminators; the last has four times as many.
    attention : int
        Units of the self-attention over time in the global discriminator.
    window_frames, window_step_frames : int
        Length of the windows of the local discriminator, and frames from the start of one to that of the next: at 15
        frames per second .53 and .33 s (released: .5 and .3 s).
    graph : int
        Channels of the first four blocks of the ST-GCN; the next three have twice, the last three four times as many.
    graph_frames : int
        Frames to which the clips of the ST-GCN are brought.
    graph_epochs : int
        Epochs (of 256 units) of the ST-GCN, which is trained first.
    pose_weight, perceptual_weight, feature_weight, local_weight, global_weight : float
        Weights in the generator's loss: L1 of the poses, pose perceptual loss, feature matching in the motion branch of
        the global discriminator, and the adversarial terms of both discriminators.
    block_weights : tuple of float
        Of the maps of the ten blocks inside the pose perceptual loss.
    discriminator_weight : float
        Of the cross-entropy in the loss of either discriminator.
    penalty_weight : float
        Of the gradient penalty in the loss of the global discriminator.
    generator_rate, local_rate, global_rate : float
        Learning rates of Adam.
    epochs : int
        All have these rates, and the last one is kept.
    batch_size : int
        Over all processes together.
    shards : int
        As in `TrainParams`.
    seed : int
        Of weights, batches and draws.

    Raises
    ------
    ValueError
        For a value out of range or of another kind; the message names the field.
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
