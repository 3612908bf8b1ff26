"""Settings of how large a generator is and how it is trained (paper Sec. 4 and 5.2)."""

from dataclasses import dataclass, fields

from harmolab.systems.training.features import check_settings


@dataclass(frozen=True)
class ModelParams:
    """Sizes of HarmoGAN's networks, the generator and its discriminators: take ``small()`` or ``paper()``.

    Parameters
    ----------
    hidden : int
        Units of every recurrent layer.
    layers : int
        Recurrent layers of the audio encoder, and of the pose decoder.
    pose_features : int
        Channels of the initial poses' features that are concatenated with the encoded audio, and of the heads.
    discriminator : int
        Channels of the first layer of the discriminators.
    bounded : bool
        Whether the generator corrects the initial poses V_f within bounds, as it should where they are a movement; else
        freely, as the paper's.
    """

    hidden: int
    layers: int
    pose_features: int
    discriminator: int
    bounded: bool = False

    def __post_init__(self) -> None:
        check_settings(self)

    @classmethod
    def paper(cls) -> "ModelParams":
        """Seven to nine million generator parameters: as many as the paper's Sec. 5.5.2 implies."""
        return cls(hidden=512, layers=2, pose_features=256, discriminator=64)

    @classmethod
    def small(cls) -> "ModelParams":
        """About one million generator parameters: trains on a laptop."""
        return cls(hidden=192, layers=1, pose_features=192, discriminator=32)


@dataclass(frozen=True)
class TrainParams:
    """Settings of HarmoGAN's training: schedules, and weights of its hybrid loss (Eq. 32, Sec. 5.2).

    The defaults are the paper's; ``recommended()`` is what we advise. For an ablation change a field, as in
    ``dataclasses.replace(TrainParams.paper(), harmony_weight=0.0)``. The losses are L_kl, L_mse and L_feat (Eq. 24-26:
    pose divergence, poses, features of poses), L_harmo (Eq. 27, harmony) and L_gan (Eq. 31).

    Parameters
    ----------
    pretrain_epochs, adversarial_epochs : int
        Epochs of the pretraining, and with discriminators after it.
    patience : int or None
        Pretraining ends earlier if the error on the validation units has not fallen for so many epochs, and goes back
        to the best one. None: all epochs are trained, and the last one is kept.
    batch_size : int
        Units of a batch, over all processes together.
    shards : int
        Parts in which each batch is computed, one after the other or by several processes; at least as many as there
        are processes. Equal shards give equal results to the last bit. Others round otherwise, and the difference grows
        from epoch to epoch.
    pretrain_rate, adversarial_rate : float
        Initial learning rates of Adam.
    pretrain_drops, pretrain_drop_epochs : tuple of float, and int
        Factors of the learning rate, one after every so many epochs; the last one stays.
    adversarial_drops, adversarial_drop_epochs : tuple of float, and int
        Factors that take turns, one after every so many epochs.
    generator_decay, discriminator_decay : float
        Weight decay.
    pretrain_kl_weight : float
        Weight of L_kl in the pretraining: L_pretrain = this * L_kl + L_mse.
    kl_weight, mse_weight, feature_weight, harmony_weight, gan_weight : float
        The weights lambda of the five losses in Eq. 32.
    cross_domain_weight : float
        Weight of the cross-domain discriminator inside L_gan (Eq. 31). It learns from recorded pairs of music and
        movement: where the recorded dancers do not rest on the beat, it teaches the generator not to, against the
        harmony loss. 0 leaves the judgement of movement to the spatial-temporal discriminator.
    smoothness_weight, foot_weight, energy_weight, moved_weight : float
        Weights of losses that the paper does not have: more jerk than the sketch, feet that slide more, more or less
        movement, and the squared way from the sketch; 0 in paper mode (`harmolab.systems.harmogan.losses`).
    sketches : int
        Sketches of each song: dances of a choreographer that the generator learns to correct
        (`harmolab.systems.harmogan.sketches`). With 0 the initial poses V_f are those of Eq. 23.
    shifted : float from 0 to 1
        Share of the sketches that lie beside their music by up to half a beat.
    critic_share : float
        Learning rate of the discriminators over that of the generator.
    clip : float or None
        Largest norm of a gradient.
    count_weight : float
        Weight of the term inside the harmony loss that keeps the number of visual beats near that of music beats.
    tau_start, tau_end : float
        Softness of the harmony loss (`harmolab.soft_harmony`) in the first and the last adversarial epoch; geometric in
        between.
    epsilon : float
        Of the Charbonnier losses (Eq. 25-26).
    pose_epochs : int
        Epochs (of 256 units) of the pose network behind the feature loss, which is trained first.
    seed : int
        Of weights, batches and draws.

    Raises
    ------
    ValueError
        For a value out of range or of another kind; the message names the field.
    """

    pretrain_epochs: int = 225
    adversarial_epochs: int = 45
    patience: int | None = 30
    batch_size: int = 10
    shards: int = 1
    pretrain_rate: float = 1e-3
    pretrain_drops: tuple[float, ...] = (0.5, 0.2, 0.2, 0.5)
    pretrain_drop_epochs: int = 50
    adversarial_rate: float = 1e-4
    adversarial_drops: tuple[float, ...] = (0.5, 0.2)
    adversarial_drop_epochs: int = 5
    generator_decay: float = 1e-4
    discriminator_decay: float = 1e-3
    pretrain_kl_weight: float = 0.1
    kl_weight: float = 1e-4
    mse_weight: float = 1e-3
    feature_weight: float = 1e-3
    harmony_weight: float = 1.0
    gan_weight: float = 1e-3
    cross_domain_weight: float = 1.0
    smoothness_weight: float = 0.0
    foot_weight: float = 0.0
    energy_weight: float = 0.0
    moved_weight: float = 0.0
    sketches: int = 0
    shifted: float = 0.7
    critic_share: float = 1.0
    clip: float | None = None
    count_weight: float = 1.0
    tau_start: float = 0.5
    tau_end: float = 0.05
    epsilon: float = 1e-3
    pose_epochs: int = 40
    seed: int = 1

    def __post_init__(self) -> None:
        zeros = [field.name for field in fields(self) if field.name.endswith(("_weight", "_decay", "_drops", "seed"))]
        check_settings(self, not_negative=[*zeros, "pretrain_epochs", "adversarial_epochs", "sketches", "shifted"])
        for name in ("pretrain_drops", "adversarial_drops"):
            if 0 in getattr(self, name):
                raise ValueError(f"{name} must be positive factors, got {getattr(self, name)}")
        if self.shifted > 1:
            raise ValueError(f"shifted must be a share, 0 to 1, got {self.shifted}")

    @classmethod
    def paper(cls) -> "TrainParams":
        """The paper's settings, Section 5.2 number by number; `patience` is our reading of where pretraining ends."""
        return cls()

    @classmethod
    def recommended(cls) -> "TrainParams":
        """The settings that we advise: sketches are corrected towards harmony, near to them and as natural as they are.

        There is no pretraining.
        """
        return cls(
            pretrain_epochs=0,
            adversarial_epochs=9,
            batch_size=24,
            adversarial_rate=1e-3,
            adversarial_drops=(1.0,),
            kl_weight=0.0,
            mse_weight=0.0,
            feature_weight=0.0,
            harmony_weight=1.0,
            gan_weight=0.1,
            smoothness_weight=1.0,
            foot_weight=1.0,
            energy_weight=0.5,
            moved_weight=0.3,
            sketches=4,
            critic_share=0.2,
            clip=1.0,
            tau_end=0.1,
        )
